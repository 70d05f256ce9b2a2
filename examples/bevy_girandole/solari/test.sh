#!/usr/bin/env bash
# Tests the light sampler of bevy_solari: lints, unit tests, and the brightness of pictures with Solari's sampler and with
# this one, which agree within three standard errors. Pictures need ray queries, which the software Vulkan of Debian's
# next release has: scripts/newer.sh. Installs what is missing.
set -euo pipefail
cd "$(dirname "$0")/../../.."
source scripts/common.sh
source scripts/newer.sh
need_vulkan
package="$PWD/examples/bevy_girandole/solari"
export RUST_LOG="${RUST_LOG:-error}" WGPU_VALIDATION="${WGPU_VALIDATION:-0}"
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/examples/bevy_girandole/target}"
toolchain=1.97.1

if [ -z "${in_namespace:-}" ]; then
    cargo "+$toolchain" clippy --version >/dev/null 2>&1 ||
        rustup toolchain install "$toolchain" --profile minimal --component clippy --no-self-update
    need patch patch
    step "$package/patch.sh"
    cd "$package"
    step cargo fmt --check
    step cargo "+$toolchain" clippy --locked --all-targets -- -D warnings
    step cargo "+$toolchain" test --locked
    step cargo "+$toolchain" build --locked
    cd - >/dev/null
fi
enter_newer "$0" "$@"

# The brightness of a picture, and its standard error: brightness OPTION...
brightness() {
    in_newer "$CARGO_TARGET_DIR/debug/compare" --size 64x36 "$@" | sed -n 's/^brightness \(.*\), standard error /\1 /p'
}

agree() {
    local ours theirs
    ours=$(brightness "$@") theirs=$(brightness --uniform "$@")
    echo "$ours $theirs" | awk '{
        print "with Girandole " $1 " (" $2 "), with Solari " $3 " (" $4 ")"
        exit !(NF == 4 && $1 > 0 && ($1 - $3) ^ 2 < 9 * ($2 ^ 2 + $4 ^ 2))
    }'
}

for scene in spheres interior; do
    step agree --scene "$scene" --path-tracer --frames 320
    step agree --scene "$scene" --frames 320
done
