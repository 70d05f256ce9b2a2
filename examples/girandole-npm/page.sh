#!/usr/bin/env bash
# Makes a folder with the example page, the package and three.js, by default examples/girandole-npm/target/site.
# Copy it to any static host, or serve it by `node test/serve.mjs FOLDER PORT`, and open page/. Needs npm.
# examples/girandole-npm/build.sh comes first.
set -euo pipefail
folder=$(realpath -m "${1:-$(dirname "$0")/target/site}")
cd "$(dirname "$0")"

# npm would keep an older package of the same version.
rm -rf target/npm
mkdir -p target/npm
# The file that a registry would get.
npm pack --silent --pack-destination target/npm ./target/package >/dev/null
npm install --silent --no-save --no-package-lock --prefix target/npm three@0.187.0 ./target/npm/girandole-0.1.0.tgz
rm -rf "$folder"
mkdir -p "$folder/three"
cp -r page target/npm/node_modules/girandole "$folder"
cp target/npm/node_modules/three/build/three.{core,webgpu,tsl}.js "$folder/three"
