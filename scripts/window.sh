#!/usr/bin/env bash
# Opens the city's window on a virtual screen, with software Vulkan: it must show pictures, react to
# keys, survive a new size, an unmapped window and a lost device, and close. Needs no GPU.
# Installs Xvfb and xdotool on Debian if they are missing.
#
# `scripts/window.sh FOLDER` keeps the pictures that the window saves.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh
need_vulkan
need Xvfb xvfb
need xdotool xdotool libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0

build_workspace

work=$(mktemp -d)
out=${1:-$work/out}
window=
screen=
trap 'kill $window $screen 2>/dev/null || true; wait 2>/dev/null || true; rm -rf "$work"' EXIT

# The screen writes its number to file descriptor 3. Without -noreset it would restart, and refuse the city, each time
# that a search for the window ends as its last client.
Xvfb -displayfd 3 -screen 0 1280x800x24 -nolisten tcp -noreset 3>"$work/display" 2>"$work/xvfb.log" &
screen=$!

fail() {
    echo "$1" >&2
    cat "$work/log" >&2
    exit 1
}

# Waits until a command succeeds.
wait_for() {
    for ((tenth = 0; tenth < 1800; tenth++)); do
        if "${@:2}" >/dev/null 2>&1; then return; fi
        if [ -n "$window" ] && ! kill -0 "$window" 2>/dev/null; then fail "the program ended before $1"; fi
        sleep 0.1
    done
    fail "waited for 180 s for $1"
}

touch "$work/log"
wait_for 'the virtual screen' grep -q . "$work/display"
DISPLAY=":$(cat "$work/display")"
export DISPLAY

target/debug/city --window --window-size 800x450 --backend cpu --cars 60 --out "$out" >"$work/log" 2>&1 &
window=$!
wait_for 'the window' xdotool search --name 'Girandole'
id=$(xdotool search --name 'Girandole' | head -n 1)
# There is no window manager, which would do this.
xdotool windowfocus "$id"

saved=0
# Presses a key, then saves pictures until one is on disk.
press() {
    xdotool key "$1"
    sleep 1
    local file
    file=$out/window_$(printf '%04d' "$saved").png
    save() { [ -s "$file" ] || { xdotool key p && sleep 0.5 && [ -s "$file" ]; }; }
    wait_for "a picture after the key $1" save
    saved=$(find "$out" -name 'window_*.png' | wc -l)
    picture=$(find "$out" -name 'window_*.png' | sort | tail -n 1)
}

differs() {
    if cmp -s "$1" "$2"; then fail "$1 and $2 are the same picture"; fi
}

press space
first=$picture
[ "$(stat -c %s "$first")" -gt 4000 ] || fail 'the picture is empty'
shows() {
    [ "$(xdotool getwindowname "$id")" = "Girandole: $1" ]
}
for view in '2 noise' '3 trees' '1 picture'; do
    read -r key name <<<"$view"
    press "$key"
    shows "$name" || fail "the key $key does not show $name"
done
press 3
differs "$first" "$picture"
press 1
xdotool keydown w
sleep 2
xdotool keyup w
press r
differs "$first" "$picture"
xdotool windowsize "$id" 640 700
press 1
xdotool windowunmap "$id"
sleep 1
xdotool windowmap "$id"
sleep 1
xdotool windowfocus "$id"
press 1
xdotool key F10
press 1
xdotool key Escape
for ((tenth = 0; tenth < 300; tenth++)); do
    kill -0 "$window" 2>/dev/null || break
    sleep 0.1
done
wait "$window" || fail 'the program failed'
window=
grep -q ' 1 lost device(s) replaced' "$work/log" || fail 'the lost device was not replaced'
cat "$work/log"
