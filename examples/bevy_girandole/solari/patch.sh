#!/usr/bin/env bash
# Makes the Solari that takes a light sampler: the released crate with bevy_solari.patch, in target/bevy_solari of the
# folder above. Cargo.toml names that folder.
set -euo pipefail
cd "$(dirname "$0")"
version=0.20.1
to="$PWD/../target/bevy_solari"

# A package that only depends on the crate, so that Cargo fetches it.
fetch=$(mktemp -d)
trap 'rm -rf "$fetch"' EXIT
mkdir "$fetch/src"
touch "$fetch/src/lib.rs"
printf '[package]\nname = "fetch"\nedition = "2024"\n[dependencies]\nbevy_solari = "=%s"\n' "$version" >"$fetch/Cargo.toml"
manifest=$(cargo +1.97.1 metadata --format-version 1 --manifest-path "$fetch/Cargo.toml" |
    grep -o '"manifest_path":"[^"]*bevy_solari-'"$version"'/Cargo.toml"' | head -1 | cut -d '"' -f 4)

rm -rf "$to"
mkdir -p "$(dirname "$to")"
cp -r "$(dirname "$manifest")" "$to"
patch --quiet --strip 1 --directory "$to" <bevy_solari.patch
echo "$to has a light sampler"
