# What ./run course N opens: a terminal of lesson $LESSON. The first one launches the vehicle of the
# lesson in the background, unless a master runs already, and ends it when it is closed.
[ -f ~/.bashrc ] && source ~/.bashrc
source "$(dirname "${BASH_SOURCE[0]}")/setup.bash"
page=$(printf '%s/%02d_*.md' "$COURSE" "$LESSON")
page=$(compgen -G "$page")
[ -z "${DISPLAY:-}" ] || QUICK=

[ ! -d "$COURSE/skeletons/$LESSON" ] || exercise "$LESSON" >~/exercise.log || tail -5 ~/exercise.log

# The first command of the page that is awaited and launches something.
launch=$(awk '/^<!-- run: until \//{awaited=1} awaited && /^roslaunch/{print; exit} /^```$/{awaited=0}' "$page")
[ -z "${DISPLAY:-}" ] || launch=$(sed -E 's/ (rviz:=false|sim_time:=true|real_time_factor:=[0-9]+)//g' <<<"$launch")
launch=${launch//'$QUICK'/$QUICK}
if [ -z "$launch" ]; then
  echo "This lesson has no flight to launch."
elif rostopic list >/dev/null 2>&1; then
  echo "A master is already running. This terminal uses it."
elif ! eval "${launch/roslaunch/roslaunch --nodes}" >/dev/null 2>&1; then
  echo "Not launched yet, because you make it in the lesson: $launch"
else
  set -m  # a process group of its own: Ctrl-C in this terminal does not end the flight
  eval "$launch" >~/course.log 2>&1 &
  launched=$!
  trap 'kill -INT -- -$launched 2>/dev/null; wait $launched 2>/dev/null' EXIT
  for _ in {1..60}; do
    rostopic list >/dev/null 2>&1 && break
    sleep 0.5
  done
  echo "Launched: $launch"
  echo "Its output is in ~/course.log. To stop it, type fg and press Ctrl-C, or type exit."
  [ -z "${DISPLAY:-}" ] || echo "RViz starts near the vehicle: zoom out with the mouse wheel, turn the view with the left button."
fi
echo "The lesson: docs/course/${page##*/}"
[ ! -d "$COURSE/skeletons/$LESSON" ] ||
  for package in "$COURSE/skeletons/$LESSON"/*; do
    echo "The exercise: ~/my_workspace/src/${package##*/}; its tests: python3 -m pytest -q ~/my_workspace/src/${package##*/}/test"
  done
PS1="lesson $LESSON \w$ "
