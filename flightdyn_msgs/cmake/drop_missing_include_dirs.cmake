# The ROS wheels on PyPI export targets that name include folders of the machine they were built
# on, and CMake refuses to generate with a folder that is not there. Drop those; with an ordinary
# ROS installation there is nothing to drop.
get_property(_targets DIRECTORY PROPERTY IMPORTED_TARGETS)
foreach(_target IN LISTS _targets)
  get_target_property(_dirs ${_target} INTERFACE_INCLUDE_DIRECTORIES)
  if(NOT _dirs)
    continue()
  endif()
  set(_kept)
  foreach(_dir IN LISTS _dirs)
    if(NOT IS_ABSOLUTE "${_dir}" OR EXISTS "${_dir}")
      list(APPEND _kept "${_dir}")
    endif()
  endforeach()
  set_target_properties(${_target} PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${_kept}")
endforeach()
