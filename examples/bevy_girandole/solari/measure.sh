#!/usr/bin/env bash
# The table of docs/solari.md: errors of pictures with Solari's sampler and with this one, at equal samples. `test.sh`
# builds what it runs. Pictures and references are written to target/solari of the folder above.
set -euo pipefail
cd "$(dirname "$0")/../../.."
source scripts/common.sh
source scripts/newer.sh
enter_newer "$0" "$@"
program="${CARGO_TARGET_DIR:-$PWD/examples/bevy_girandole/target}/debug/compare"
out="$PWD/examples/bevy_girandole/target/solari"
frames="${FRAMES:-512}"
mkdir -p "$out"

compare() {
    RUST_LOG=error in_newer "$program" --size 160x90 "$@"
}

# One line: measure NAME REFERENCE OPTION...
measure() {
    local name=$1 reference=$2 start=$EPOCHREALTIME
    compare --frames 16 --reference "$reference" --out "$out/$name.png" "${@:3}" |
        awk -v name="$name" '/MAPE/ { print name ": " $0 }'
    echo "$start $EPOCHREALTIME" | awk '{ printf "  %.1f s\n", $2 - $1 }'
}

for scene in spheres interior; do
    for renderer in path-tracer real-time; do
        options=(--scene "$scene")
        [ "$renderer" = real-time ] || options+=(--path-tracer)
        reference="$out/$scene-$renderer.raw"
        compare "${options[@]}" --frames "$frames" --raw "$reference" --out "${reference%.raw}.png"
        measure "$scene-$renderer-solari" "$reference" "${options[@]}" --uniform
        measure "$scene-$renderer-girandole" "$reference" "${options[@]}"
        [ "$renderer" = real-time ] || continue
        measure "$scene-reservoirs-solari" "$reference" "${options[@]}" --restir --uniform
        measure "$scene-reservoirs-girandole" "$reference" "${options[@]}" --restir
    done
done
