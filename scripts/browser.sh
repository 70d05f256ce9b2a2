# What the tests in headless Chromium share. Source it after scripts/common.sh. Logs are in the folder $work, which
# is removed at the end.

work=$(mktemp -d)
browser=
server=
trap 'for started in $browser $server; do kill "$started" 2>/dev/null || true; done
    wait 2>/dev/null || true
    rm -rf "$work"' EXIT
# Options for WebGPU on the software adapter.
software=(--enable-unsafe-webgpu --enable-unsafe-swiftshader --use-webgpu-adapter=swiftshader
    --use-vulkan=swiftshader --enable-features=Vulkan --use-angle=vulkan)

# Opens an address with options of Chromium, until the page says that it has stopped: visit NAME ADDRESS SECONDS
# OPTION... The lines of its console are in the file of the name.
visit() {
    local name=$1 address=$2 seconds=$3
    touch "$work/$name-log"
    shift 3
    chromium --headless --no-sandbox --user-data-dir="$work/$name-profile" --enable-logging=stderr "$@" \
        --disable-quic --no-first-run --disable-background-networking --disable-component-update --disable-sync \
        "$address" 2>"$work/$name-log" &
    browser=$!
    for ((second = 0; second < seconds; second++)); do
        if grep -q 'CONSOLE.*"stopped: ' "$work/$name-log"; then
            break
        fi
        sleep 1
    done
    kill "$browser" 2>/dev/null || true
    wait "$browser" 2>/dev/null || true
    browser=
    grep -o 'CONSOLE.*' "$work/$name-log" | sed -e 's/^[^"]*"//' -e 's/", source: .*//' >"$work/$name" || true
}

# Fails unless a line of the console contains a text: expect NAME TEXT.
expect() {
    if ! grep -qF -- "$2" "$work/$1"; then
        echo "\"$2\" is missing in what the page said:" >&2
        cat "$work/$1" >&2
        exit 1
    fi
}
