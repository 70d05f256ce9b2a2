#!/usr/bin/env bash
# Everything that must hold of the library and of the programs around it: format, lints, documents and
# tests. Installs the software Vulkan driver where there is none, since GPU tests fail without an adapter.
#
# CI runs this first, and then what needs more tools: see .ci/run.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh
need_vulkan

step cargo fmt --all --check
step cargo clippy --locked --workspace --all-targets -- -D warnings
RUSTDOCFLAGS='-D warnings' step cargo doc --locked --no-deps -p girandole -p girandole-assets --features girandole/bake,girandole/tracing
step cargo test --locked --workspace
# Compares the tables of the documents with what the programs print. The tests have built these.
step target/debug/measure documents --quick --jobs "$(nproc)"
