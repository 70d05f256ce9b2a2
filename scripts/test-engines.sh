#!/usr/bin/env bash
# Builds and tests what takes the library into engines: the C interface, the browser page and the Bevy
# plugin. Each is a package in examples/ with a script that also runs alone and installs what it needs on
# Debian. Needs rustup and no GPU. `--all` tests the plugin with both versions of Bevy.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh

step bash examples/girandole-web/test.sh
step bash examples/bevy_girandole/test.sh "$@"
# Last: it installs validation layers, which slow others down.
step bash examples/girandole-c/test.sh
