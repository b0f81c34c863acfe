# Makes a virtual environment with the ROS wheels look like a ROS installation, so that colcon
# chains to it and `. install/setup.bash` alone restores everything. Installed by tools/setup as
# local_setup.sh and setup.sh of the environment, with @PREFIX@ filled in. POSIX sh.

_flightdyn_prepend() {
  eval "_flightdyn_old=\"\${$1:-}\""
  case ":$_flightdyn_old:" in
    *":$2:"*) ;;
    *) eval "export $1=\"\$2\${_flightdyn_old:+:\$_flightdyn_old}\"" ;;
  esac
}

_flightdyn_prepend AMENT_PREFIX_PATH '@PREFIX@'
_flightdyn_prepend CMAKE_PREFIX_PATH '@PREFIX@'
_flightdyn_prepend PATH '@PREFIX@/bin'
for _flightdyn_dir in '@PREFIX@'/lib/python3*/site-packages/ros_*.libs '@PREFIX@/lib'; do
  _flightdyn_prepend LD_LIBRARY_PATH "$_flightdyn_dir"
done
export ROS_DISTRO=kilted ROS_VERSION=2 ROS_PYTHON_VERSION=3
# Else a hook of the wheels runs every Python twice to set LD_LIBRARY_PATH, in random order.
export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
unset _flightdyn_dir _flightdyn_old
unset -f _flightdyn_prepend
