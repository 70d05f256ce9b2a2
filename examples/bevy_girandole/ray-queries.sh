#!/usr/bin/env bash
# Runs the plugin's tests of shadows where the device has ray queries, with Bevy 0.19 and 0.20: on the software Vulkan of
# Debian's next release (scripts/newer.sh). It is skipped on other systems than Debian 12, and without root. test.sh
# installs the toolchain that Bevy 0.20 needs.
set -euo pipefail
cd "$(dirname "$0")/../.."
source scripts/common.sh
source scripts/newer.sh
enter_newer "$0" "$@"
package="$PWD/examples/bevy_girandole"
export RUST_LOG="${RUST_LOG:-error}" WGPU_VALIDATION="${WGPU_VALIDATION:-0}"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$package/target}"
# A device without ray queries fails the tests that compare them with the software.
export GIRANDOLE_RAY_QUERIES=1

# Builds the tests of a package and runs those of shadows: shadow_tests FOLDER CARGO...
shadow_tests() {
    cd "$1"
    step "${@:2}" test --locked --test all --no-run
    local program
    program=$("${@:2}" test --locked --test all --no-run --quiet --message-format=json |
        grep -F '"name":"all"' | sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' | head -1)
    cd - >/dev/null
    # Mesa 26's llvmpipe crashes now and then where two devices of a process trace rays at a time.
    step in_newer "$program" shadow --test-threads 1
}

shadow_tests "$package" cargo
shadow_tests "$package/bevy-0.20" cargo +1.97.1
