# How every terminal of the course begins: source docs/course/setup.bash
case $(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd) in
  *[[:space:]]*) echo "catkin cannot build in a path with a space; move the workspace to one without" >&2; return 1 ;;
esac
# It knows the workspace, and what is built in ~/my_workspace.
COURSE=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
source "$COURSE/../../ros/devel/setup.bash"
if [ -f ~/my_workspace/devel/setup.bash ]; then source ~/my_workspace/devel/setup.bash; fi

# Arguments of flights that take seconds: simulated time, one process, no window. To watch a flight
# in RViz and in real time, make it empty: QUICK=
QUICK="rviz:=false sim_time:=true real_time_factor:=5 composed:=true simulator_dt:=0.01"
