#!/usr/bin/env bash
# Builds the npm package and checks it. Needs node with npm, and no GPU. Installs Chromium on Debian if there is none.
#
# - The package has the files that it should have, and its types fit a program in TypeScript.
# - In headless Chromium, on its software adapter: samples agree with the sum over all lights of a three.js scene,
#   probabilities sum to 1, and a still frame sends nothing.
# - The example page draws frames.
set -euo pipefail
cd "$(dirname "$0")"
source ../../scripts/common.sh
need chromium chromium
need npm nodejs npm
source ../../scripts/browser.sh
cargo fmt --check
(cd pack && cargo fmt --check)
./build.sh target/package
# The flags of the build, so that dependencies are built once.
cargo clippy --quiet --locked --release --target wasm32-unknown-unknown --target-dir target -- -D warnings

(cd target/package && npm pack --dry-run --json) >"$work/packed"
files=$(node -p 'JSON.parse(require("fs").readFileSync(process.argv[1])).flatMap(({ files }) => files.map(({ path }) => path)).sort().join(" ")' "$work/packed")
wanted='LICENSE-APACHE LICENSE-MIT README.md geometry.js girandole.d.ts girandole.js girandole_bg.wasm gpu-lights.d.ts'
wanted+=' gpu-lights.js index.d.ts index.js matrices.js package.json player.d.ts player.js sources.js three.d.ts three.js'
if [ "$files" != "$wanted" ]; then
    printf 'examples/girandole-npm/test.sh: the package has other files:\n%s\ninstead of\n%s\n' "$files" "$wanted" >&2
    exit 1
fi

./page.sh target/site
cp -r test target/site
npm install --silent --no-save --no-package-lock --prefix target/npm three@0.187.0 ./target/npm/girandole-0.1.0.tgz \
    @types/three@0.187.0 typescript@7.0.2
# Modules are found from the folder of a program.
rm -rf target/npm/types
cp -r test/types target/npm/types
target/npm/node_modules/.bin/tsc --project target/npm/types

node test/serve.mjs target/site >"$work/port" &
server=$!
until [ -s "$work/port" ]; do
    sleep 0.1
done
site="http://127.0.0.1:$(cat "$work/port")"

visit checks "$site/test/" 300 "${software[@]}"
cat "$work/checks"
expect checks 'stopped: all checks passed'

visit page "$site/page/?frames=2&size=48x27" 120 "${software[@]}"
cat "$work/page"
expect page 'stopped: drawn'
if grep -q 'WebGPU refused' "$work/page"; then
    exit 1
fi
# The mean is that of the picture in docs/npm.md, to within a fifth.
brightness=$(grep -o '"brightness":[0-9.]*' "$work/page" | cut -d: -f2)
if ! awk -v mean="$brightness" 'BEGIN { exit !(mean > 1.0 && mean < 1.5) }'; then
    echo "examples/girandole-npm/test.sh: the page's picture has a mean of $brightness nits, not 1.2" >&2
    exit 1
fi
