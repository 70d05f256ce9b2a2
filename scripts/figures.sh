#!/usr/bin/env bash
# Makes every table and plot of README and docs on this machine, from the commit that is checked out: see
# examples/measure/src/documents/mod.rs, which has the options. Needs RADV for figures of shaders, and takes about two
# hours on two cores. The programs lie in target/figures/programs afterwards; another machine can measure with a copy of
# this folder: `GIRANDOLE_COMMIT=ID programs/measure documents --measure --out DIR`, and `--draw --out DIR` here.
# `--build` only builds.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh
need_vulkan

programs=target/figures/programs
mkdir -p "$programs"
# Prints the file of each program that Cargo has built, with its name: benches come after the program.
built() {
    cargo "$@" --locked --message-format=json | sed -n 's/.*"kind":\["\(bin\|bench\)"\].*"name":"\([^"]*\)".*"executable":"\([^"]*\)".*/\1 \2 \3/p'
}
{
    built build --release --package measure
    built bench --no-run --package girandole --features bake
} | while read -r kind name file; do
    [ "$kind" = bench ] && name=bench_$name
    # Without symbols they are a tenth of the size.
    strip -o "$programs/$name" "$file" 2>/dev/null || cp "$file" "$programs/$name"
done
[ "${1-}" = --build ] || exec "$programs/measure" documents "$@"
