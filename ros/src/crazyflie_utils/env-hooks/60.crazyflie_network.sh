# Nodes, and a master, that are started in this shell listen to this computer only, unless ROS_IP
# or ROS_HOSTNAME says how others reach them, or the master runs on another computer.
if [ -z "${ROS_IP:-}${ROS_HOSTNAME:-}" ]; then
  case "${ROS_MASTER_URI:-http://localhost}/" in
    http://localhost[:/]* | http://127.*) export ROS_IP=127.0.0.1 ;;
  esac
fi
