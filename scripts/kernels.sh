#!/usr/bin/env bash
# What compilers make of every kernel, without a GPU: registers, scratch memory and instructions on AMD's
# are within limits; Khronos' validator accepts the SPIR-V; and Tint, the WGSL compiler of Chromium,
# accepts the text, on its software adapter. Installs what is missing on Debian.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh
need_vulkan
need spirv-val spirv-tools
need chromium chromium

# The limits hold for one version of Mesa.
mkdir -p target
build_workspace
stats="target/debug/measure kernels"
step $stats --out target/kernels.csv --chip navi21 --check
rm -rf target/spirv
step $stats --spirv target/spirv
for kernel in target/spirv/*.spv; do
    spirv-val --target-env vulkan1.3 "$kernel"
done
step $stats --page target/kernels.html

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
for ((second = 0; second < 450; second++)); do
    if grep -q 'CONSOLE.*\(compiled, [0-9]* refused\|failed: \|no WebGPU\)' "$log"; then
        grep -o 'CONSOLE.*' "$log" | cut -d'"' -f2
        grep -q 'CONSOLE.*"[1-9][0-9]* compiled, 0 refused"' "$log"
        exit
    fi
    sleep 1
done
echo 'the browser has not finished within 450 s:' >&2
tail -n 20 "$log" >&2
exit 1
