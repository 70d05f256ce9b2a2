#!/usr/bin/env bash
# Compiles every kernel with Tint, the WGSL compiler of Chromium, on its software adapter. Needs no GPU.
# Installs Chromium on Debian if there is none.
set -euo pipefail
cd "$(dirname "$0")/.."

if ! command -v chromium >/dev/null; then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends chromium >/dev/null
fi

mkdir -p target
cargo run --locked -p shader_stats -- --page target/kernels.html

profile=$(mktemp -d)
log=$profile/log
trap 'kill "$browser" 2>/dev/null || true; wait "$browser" 2>/dev/null || true; rm -rf "$profile"' EXIT
chromium --headless --no-sandbox --user-data-dir="$profile" --enable-logging=stderr \
    --enable-unsafe-webgpu --enable-unsafe-swiftshader --use-webgpu-adapter=swiftshader \
    --use-vulkan=swiftshader --enable-features=Vulkan --use-angle=vulkan \
    --disable-quic --no-first-run --disable-background-networking --disable-component-update --disable-sync \
    "file://$PWD/target/kernels.html" 2>"$log" &
browser=$!

# The page says what it refuses, and ends with "N compiled, M refused".
for ((second = 0; second < 300; second++)); do
    if grep -q 'CONSOLE.*\(compiled, [0-9]* refused\|failed: \|no WebGPU\)' "$log"; then
        grep -o 'CONSOLE.*' "$log" | cut -d'"' -f2
        grep -q 'CONSOLE.*"[1-9][0-9]* compiled, 0 refused"' "$log"
        exit
    fi
    sleep 1
done
echo 'the browser has not finished within 300 s:' >&2
tail -n 20 "$log" >&2
exit 1
