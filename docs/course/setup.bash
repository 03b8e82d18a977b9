# How every terminal of the course begins: source docs/course/setup.bash
case $(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd) in
  *[[:space:]]*) echo "catkin cannot build in a path with a space; move the workspace to one without" >&2; return 1 ;;
esac
# It knows the workspace, and what is built in ~/my_workspace.
export COURSE=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
if ! source "$COURSE/../../ros/devel/setup.bash"; then
  echo "The workspace is not built yet: ./run build builds it." >&2
  return 1
fi
if [ -f ~/my_workspace/devel/setup.bash ]; then source ~/my_workspace/devel/setup.bash; fi

# Arguments of flights that take seconds: simulated time, one process, no window. To watch a flight
# in RViz and in real time, make it empty: QUICK=
QUICK="rviz:=false sim_time:=true real_time_factor:=5 composed:=true simulator_dt:=0.01"

# CMake 4 refuses Debian's catkin without it.
export CMAKE_POLICY_VERSION_MINIMUM=3.5

# build: ~/my_workspace, and this terminal knows what is new in it.
build() { catkin_make -C ~/my_workspace -DCMAKE_WARN_DEPRECATED=OFF && source ~/my_workspace/devel/setup.bash; }

# exercise N: the skeletons and tests of lesson N, in ~/my_workspace/src; no file of yours is changed.
exercise() {
  local package
  [ -d "$COURSE/skeletons/$1" ] || { echo "exercise: lesson $1 has no skeleton" >&2; return 1; }
  for package in "$COURSE/skeletons/$1"/*; do
    if [ ! -f "$package/package.xml" ] && [ ! -d ~/my_workspace/src/"${package##*/}" ]; then
      echo "exercise: make the package ${package##*/} first, as lesson $1 says" >&2
      return 1
    fi
  done
  course_files "skeletons/$1" keep && build
}

# solution N: the files in which the solution differs from the skeleton; yours are kept as *.mine.
solution() {
  [ -d "$COURSE/solutions/$1" ] || { echo "solution: lesson $1 has no package" >&2; return 1; }
  course_files "solutions/$1" replace && build
}

course_files() {
  local folder=$COURSE/$1 file mine
  # Some solutions are links to files of the workspace.
  find -L "$folder" -type f -not -path '*/__pycache__/*' | while read -r file; do
    mine=~/my_workspace/src/${file#"$folder/"}
    if [ -e "$mine" ]; then
      [ "$2" = keep ] && continue
      mv "$mine" "$mine.mine"
    fi
    mkdir -p "$(dirname "$mine")" && cp "$file" "$mine" || return 1
  done
}
