#!/usr/bin/env bash
# Checks that the library compiles where its tests do not run: other targets, the oldest supported
# Rust, the oldest supported wgpu and glam, and with fewer features.
#
# Needs rustup, and downloads toolchains and targets: CI runs it, and a user's test run does not.
# `--all` also checks a processor of 32 bits and the oldest Rust with today's wgpu.
# `scripts/portability.sh --update-lock` writes scripts/oldest.lock anew.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh

readonly MINIMUM_RUST=1.88.0 # as rust-version in Cargo.toml
readonly OLDEST_WGPU=29.0.0
readonly OLDEST_GLAM=0.30.0
readonly LOCK=scripts/oldest.lock

# Artifacts of their own: other flags and toolchains must not evict those of the tests.
export CARGO_TARGET_DIR="$PWD/target/portability"
export RUSTFLAGS='-D warnings'

# Copies the library and its loaders to a folder in which another lock file takes the place of Cargo.lock. Only what
# users link: the dev-dependencies need newer crates.
copy_library() {
    rm -rf "$1"
    mkdir -p "$1"
    cp -R src shaders README.md docs Cargo.lock "$1"
    mkdir "$1/assets"
    cp -R assets/src assets/README.md "$1/assets"
    local package
    for package in . assets; do
        awk '/^\[/ { keep = !/^\[(workspace|profile|dev-dependencies|\[(example|bench|test)\])/ } keep' "$package/Cargo.toml" >"$1/$package/Cargo.toml"
    done
    # They are no members of the workspace around them.
    printf '%s\n' '[workspace]' 'members = ["assets"]' '[workspace.package]' 'edition = "2024"' 'license = "MIT OR Apache-2.0"' >>"$1/Cargo.toml"
}

readonly COPY="$CARGO_TARGET_DIR/oldest"

if [ "${1:-}" = --update-lock ]; then
    copy_library "$COPY"
    (
        cd "$COPY"
        cargo update --quiet --package wgpu --precise "$OLDEST_WGPU"
        cargo update --quiet --package glam --precise "$OLDEST_GLAM"
    )
    cp "$COPY/Cargo.lock" "$LOCK"
    exit
fi

check() {
    step cargo check --locked -p girandole -p girandole-assets --lib "$@"
}

rustup toolchain install --profile minimal --no-self-update "$MINIMUM_RUST"
rustup target add wasm32-unknown-unknown aarch64-unknown-linux-gnu

check --target wasm32-unknown-unknown --no-default-features --features girandole/gpu,girandole/bake,girandole-assets/gltf,girandole-assets/hdr
check --target aarch64-unknown-linux-gnu --features girandole/bake

copy_library "$COPY"
cp "$LOCK" "$COPY/Cargo.lock"
# Lints differ between versions, so warnings of an older compiler are no failures.
(cd "$COPY" && RUSTFLAGS= step cargo "+$MINIMUM_RUST" check --locked -p girandole -p girandole-assets --lib --features girandole/bake)

if [ "${1:-}" = --all ]; then
    rustup target add i686-unknown-linux-gnu
    check --target i686-unknown-linux-gnu --features girandole/bake
    # The oldest Rust with the newest wgpu that it compiles.
    RUSTFLAGS= step cargo "+$MINIMUM_RUST" check --locked -p girandole -p girandole-assets --lib --features girandole/bake
fi

# Fewer features. The folder of the tests has their dependencies already.
unset CARGO_TARGET_DIR RUSTFLAGS
step cargo clippy --locked --no-default-features --lib -- -D warnings
step cargo clippy --locked --no-default-features --features gpu-plan --lib -- -D warnings
