#!/usr/bin/env bash
# Runs the GPU tests and a frame of the city on the software Vulkan of Debian's next release, in a chroot (newer.sh).
# Drivers differ: the newer one has found faults that the older one hides. It is skipped on other systems than
# Debian 12, and without root. `--all` adds the GPU tests in tests/all.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh
source scripts/newer.sh
enter_newer "$0" "$@"

# The path of a test program: test_program PACKAGE-FOLDER TARGET
test_program() {
    cargo test --no-run --locked --workspace --quiet --message-format=json |
        grep -F "\"manifest_path\":\"$1/Cargo.toml\"" | grep -F "\"name\":\"$2\"" | grep -F '"test":true}' |
        sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' | head -1
}

build_workspace
library=$(test_program "$PWD" girandole)
all=$(test_program "$PWD" all)
city=target/debug/city
for program in "$library" "$all" "$city"; do
    [ -x "$program" ] || { echo "a program was not built" >&2 && exit 1; }
done
step in_newer "$library" gpu::
[ "${1:-}" != --all ] || step in_newer "$all" gpu
rm -rf target/newer-driver-frame
step in_newer "$PWD/$city" --backend gpu --frames 1 --size 64x36 --spp 1 --out "$PWD/target/newer-driver-frame"
[ -s target/newer-driver-frame/frame_0000.png ]
