#!/usr/bin/env bash
# Makes the folder of the npm package, by default examples/girandole-npm/target/package.
set -euo pipefail
folder=$(realpath -m "${1:-$(dirname "$0")/target/package}")
cd "$(dirname "$0")"

rustup target add wasm32-unknown-unknown 2>/dev/null || true
cargo build --quiet --locked --release --target wasm32-unknown-unknown --target-dir target
rm -rf "$folder"
# The program that packs has the version of wasm-bindgen that Cargo.lock has.
cargo run --quiet --locked --manifest-path pack/Cargo.toml --target-dir target -- \
    girandole target/wasm32-unknown-unknown/release/girandole_npm.wasm "$folder"
rm "$folder/girandole_bg.wasm.d.ts"
cp js/* README.md ../../LICENSE-* "$folder"
wasm="$folder/girandole_bg.wasm"
echo "$folder: $(stat -c %s "$wasm") bytes of wasm, $(gzip -9 -c "$wasm" | wc -c) compressed by gzip"
