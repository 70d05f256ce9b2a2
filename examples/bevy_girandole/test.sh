#!/usr/bin/env bash
# Tests the plugin with Bevy 0.19 and the swarm, small and without a window. `--all` also lints it, and lints
# and tests the same sources with Bevy 0.20. Installs what is missing: software Vulkan, and through rustup the
# toolchain that Bevy 0.20 needs. Builds of Bevy take most of the time.
set -euo pipefail
cd "$(dirname "$0")"
source ../../scripts/common.sh
need_vulkan

export RUST_LOG="${RUST_LOG:-error}"
# A layer of Khronos that is older than wgpu refuses SPIR-V for its number of the source language.
export WGPU_VALIDATION="${WGPU_VALIDATION:-0}"
# Both packages in one folder, so that they share what they have in common.
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}"

step cargo fmt --check
step cargo test --locked
picture=$(mktemp --suffix .png)
step cargo run --locked --bin swarm -- --headless --lamps 2000 --size 96x54 --frames 4 --settle 2 --out "$picture"
# A black picture takes about 200 bytes.
[ "$(stat -c %s "$picture")" -gt 2000 ]
rm "$picture"
[ "${1:-}" = --all ] || exit 0
step cargo clippy --locked --all-targets -- -D warnings

# What Bevy 0.20 needs.
toolchain=1.97.1
cargo "+$toolchain" clippy --version >/dev/null 2>&1 ||
    rustup toolchain install "$toolchain" --profile minimal --component clippy --no-self-update
cd bevy-0.20
step cargo "+$toolchain" clippy --locked --all-targets -- -D warnings
step cargo "+$toolchain" test --locked
