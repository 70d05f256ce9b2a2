#!/usr/bin/env bash
# Builds and tests what takes the library into engines: the C interface, the browser page and the Bevy
# plugin. Each is a package of its own in examples/, with a script that also runs alone and installs
# what it needs on Debian. Needs rustup and no GPU. The last line of each part says how long it took.
set -euo pipefail
cd "$(dirname "$0")/.."

# The tests of the C interface come last: they install validation layers, which slow others down.
for engine in girandole-web bevy_girandole girandole-c; do
    SECONDS=0
    bash "examples/$engine/test.sh"
    printf '\n== examples/%s passed in %d s\n' "$engine" "$SECONDS"
done
