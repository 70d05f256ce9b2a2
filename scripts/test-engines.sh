#!/usr/bin/env bash
# Builds and tests what takes the library into engines: the C interface and the npm package. Each is a package
# in examples/ with a script that also runs alone and installs what it needs on Debian. Needs rustup and no GPU.
# The plugin for Bevy has such a script too, which scripts/test-all.sh runs: Bevy takes ten minutes to build.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh

step bash examples/girandole-npm/test.sh
# Last: it installs validation layers, which slow others down.
step bash examples/girandole-c/test.sh
