# Takes a sourced ROS installation or workspace out of the environment. POSIX sh.
[ -z "${AMENT_PREFIX_PATH:-}" ] || unset LD_LIBRARY_PATH # theirs, for the most part
unset AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH PYTHONPATH
