#!/usr/bin/env bash
# Everything that must hold: format, lints, docs, tests, and benches and examples that still run.
# Installs the software Vulkan driver where there is none, since GPU tests fail without an adapter.
set -euo pipefail
cd "$(dirname "$0")/.."

has_vulkan_driver() {
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null ||
        [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]
}

has_vulkan_loader() {
    ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1'
}

case "$(uname -s)" in
Linux)
    if ! has_vulkan_driver || ! has_vulkan_loader; then
        if command -v apt-get >/dev/null 2>&1; then
            sudo=
            [ "$(id -u)" -eq 0 ] || sudo=sudo
            $sudo apt-get update -qq
            $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends \
                mesa-vulkan-drivers libvulkan1
        else
            echo 'No Vulkan driver found. Install the loader and one driver: Mesa lavapipe works without a GPU' >&2
            echo '(Fedora: mesa-vulkan-drivers vulkan-loader; Arch: vulkan-swrast vulkan-icd-loader).' >&2
            exit 1
        fi
    fi
    ;;
esac

# Mesa complains where this is unset, on every device that a test opens.
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$(mktemp -d)}"

step() {
    printf '\n== %s\n' "$*"
    "$@"
}

step cargo fmt --all --check
step cargo clippy --locked --all-targets -- -D warnings
step cargo clippy --locked --no-default-features --lib -- -D warnings
step cargo clippy --locked --no-default-features --features gpu-plan --lib -- -D warnings
RUSTDOCFLAGS='-D warnings' step cargo doc --locked --no-deps --features gltf,bake
step cargo test --locked
step cargo test --locked --benches
