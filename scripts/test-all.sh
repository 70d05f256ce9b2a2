#!/usr/bin/env bash
# All checks: those of .ci/run, and those that take too long for each change. Run it before a release.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh

step bash .ci/run
# The window of the city.
step bash scripts/window.sh
# The plugin for Bevy 0.19 and 0.20.
step bash examples/bevy_girandole/test.sh --all
step bash examples/bevy_girandole/ray-queries.sh
step bash examples/bevy_girandole/solari/test.sh
step bash scripts/newer-driver.sh --all
# More targets and versions.
step bash scripts/portability.sh --all
# The library's tests without threads.
step cargo test --locked --no-default-features --lib --test all
# Every bench runs once.
step cargo test --locked --benches
# All rounds of tests of which CI runs a quarter.
GIRANDOLE_THOROUGH=1 step cargo test --locked --test all hard_cases
# Longer tests with fresh seeds: 200,000 damaged glTF files, and many threads beside background builds.
step cargo test --locked --release -p girandole -p girandole-assets --test all -- --ignored
# The fuzz target compiles. It needs a C++ compiler.
need g++ g++
step cargo check --locked --manifest-path fuzz/Cargo.toml
