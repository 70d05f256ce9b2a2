#!/usr/bin/env bash
# Builds the page and checks it in headless Chromium, on its software adapter. Needs no GPU.
# Installs Chromium on Debian if there is none.
#
# - The picture agrees with the sum over all lights, cells have cuts, and trees were rebuilt.
# - A browser that lacks WebGPU, has no adapter, or takes the device away gets a sentence.
set -euo pipefail
cd "$(dirname "$0")"
source ../../scripts/common.sh
need chromium chromium
source ../../scripts/browser.sh
cargo fmt --check
(cd pack && cargo fmt --check)
./build.sh target/page
# The flags of the build, so that dependencies are built once.
cargo clippy --quiet --locked --release --target wasm32-unknown-unknown --target-dir target -- -D warnings

for hour in night dusk; do
    visit "$hour" "file://$PWD/target/page/index.html?test&$hour" 330 "${software[@]}"
    cat "$work/$hour"
    expect "$hour" 'test: verdict: agree'
    for what in 'cells with cuts' rebuilds variants; do
        if ! grep -q "^test: $what: [1-9]" "$work/$hour"; then
            echo "examples/girandole-web/test.sh: there are no $what" >&2
            exit 1
        fi
    done
    expect "$hour" 'stopped: The browser took the GPU away from this page'
done

# Without the options there is no adapter.
visit blocked "file://$PWD/target/page/index.html" 30
cat "$work/blocked"
expect blocked 'stopped: This browser has WebGPU, but it offers no adapter'

# Browsers hide WebGPU from pages that are not secure, such as this one in a data address. It needs
# neither styles nor the wasm to say so.
inline() {
    grep -v -e '<script' -e 'rel="stylesheet"' target/page/index.html
    for script in controls test page; do
        echo '<script>'
        cat "target/page/$script.js"
        echo '</script>'
    done
}
visit without "data:text/html;base64,$(inline | base64 -w 0)" 30 "${software[@]}"
cat "$work/without"
expect without 'stopped: WebGPU needs a secure page'
