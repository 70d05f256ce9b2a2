#!/usr/bin/env bash
# Everything that must hold of the plugin: format, lints, the tests with Bevy 0.19 and with Bevy 0.20, and
# the swarm, small and without a window. Installs what is missing: software Vulkan, and through rustup
# the toolchain that Bevy 0.20 needs. Bevy is built twice, which takes most of the time.
set -euo pipefail
cd "$(dirname "$0")"

# What Bevy 0.20 needs.
toolchain=1.97.1

has_vulkan_driver() {
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null ||
        [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]
}

if [ "$(uname -s)" = Linux ] && ! has_vulkan_driver; then
    sudo=
    [ "$(id -u)" -eq 0 ] || sudo=sudo
    $sudo apt-get update -qq
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
        mesa-vulkan-drivers libvulkan1
fi
cargo "+$toolchain" --version >/dev/null 2>&1 || rustup toolchain install "$toolchain" --profile minimal

# Mesa complains where this is unset, on every device that a test opens.
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$(mktemp -d)}"
export RUST_LOG="${RUST_LOG:-error}"
# A layer of Khronos that is older than wgpu refuses SPIR-V for its number of the source language.
export WGPU_VALIDATION="${WGPU_VALIDATION:-0}"
# Both packages in one folder, so that they share what they have in common.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}"

step() {
    printf '\n== %s\n' "$*"
    "$@"
}

step cargo fmt --check
step cargo clippy --locked --all-targets -- -D warnings
step cargo test --locked
picture=$(mktemp --suffix .png)
step cargo run --locked --bin swarm -- --headless --lamps 2000 --size 96x54 --frames 4 --settle 2 --out "$picture"
# A black picture takes about 200 bytes.
[ "$(stat -c %s "$picture")" -gt 2000 ]
rm "$picture"

cd bevy-0.20
step cargo "+$toolchain" test --locked
