#!/usr/bin/env bash
# Makes the folder of the browser page, by default examples/girandole-web/target/page. Open its index.html, or
# copy it to any static host.
set -euo pipefail
folder=$(realpath -m "${1:-$(dirname "$0")/target/page}")
cd "$(dirname "$0")"

rustup target add wasm32-unknown-unknown 2>/dev/null || true
cargo build --quiet --locked --release --target wasm32-unknown-unknown --target-dir target
# It has the version of wasm-bindgen that Cargo.lock has. Cargo builds it for this machine.
cargo run --quiet --locked --manifest-path pack/Cargo.toml --target-dir target -- \
    target/wasm32-unknown-unknown/release/girandole_web.wasm page "$folder"
