#!/usr/bin/env bash
# Takes a picture of the whole page, by default docs/browser.png, in headless Chromium, on its software
# adapter. It takes minutes. examples/girandole-web/build.sh comes first.
set -euo pipefail
picture=$(realpath -m "${1:-$(dirname "$0")/../../docs/browser.png}")
cd "$(dirname "$0")"

profile=$(mktemp -d)
trap 'rm -rf "$profile"' EXIT
rm -f "$picture"
# The page delays its load event, for which Chromium waits, until it has averaged these frames.
timeout 1200 chromium --headless --no-sandbox --user-data-dir="$profile" --enable-logging=stderr \
    --enable-unsafe-webgpu --enable-unsafe-swiftshader --use-webgpu-adapter=swiftshader \
    --use-vulkan=swiftshader --enable-features=Vulkan --use-angle=vulkan \
    --disable-quic --no-first-run --disable-background-networking --disable-component-update --disable-sync \
    --window-size=960,540 --hide-scrollbars --screenshot="$picture" \
    "file://$PWD/target/page/index.html?picture=${FRAMES:-12}&size=384x216" 2>"$profile/log" || true
grep -o 'CONSOLE.*' "$profile/log" | cut -d'"' -f2- || true
ls -l "$picture"
