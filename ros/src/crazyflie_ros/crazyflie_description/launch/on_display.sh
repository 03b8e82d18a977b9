# Runs a program with a window, RViz, if there is a display for it.
if [ -z "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
  echo "[ERROR] ${1##*/}: there is no display (DISPLAY is not set); rviz:=false launches without it" >&2
  exit 0
fi
exec "$@"
