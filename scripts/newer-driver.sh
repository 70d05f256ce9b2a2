#!/usr/bin/env bash
# Runs the GPU tests and a frame of the city on the software Vulkan of Debian's next release, in a chroot of
# that release (700 MB, made on first use). Drivers differ: the newer one has found faults that the older one
# hides. It is skipped on other systems than Debian 12, and without root. `--all` adds the GPU tests in tests/all.
set -euo pipefail
cd "$(dirname "$0")/.."
source scripts/common.sh

root="${GIRANDOLE_CHROOT:-$PWD/target/newer-driver}"
if [ "$(id -u)" -ne 0 ] || ! grep -qs bookworm /etc/os-release; then
    echo "skipped: this is not Debian 12, or not run as root"
    exit
fi

# Mounts are seen by this process alone, and end with it.
[ -n "${in_namespace:-}" ] || exec unshare --mount env in_namespace=yes bash "$0" "$@"

make_chroot() {
    need debootstrap debootstrap
    rm -rf "$root"
    local site
    site=$(apt-get indextargets --format '$(SITE)' 'Codename: bookworm' | head -1)
    debootstrap --variant=minbase trixie "$root" "$site" >/dev/null
    printf 'deb %s %s main\n' "$site" trixie "$site" trixie-backports >"$root/etc/apt/sources.list"
    cp /etc/resolv.conf "$root/etc/"
    cp /etc/apt/apt.conf.d/* "$root/etc/apt/apt.conf.d/" 2>/dev/null || true
    chroot "$root" apt-get update -qq
    DEBIAN_FRONTEND=noninteractive chroot "$root" apt-get install -y -qq --no-install-recommends \
        -t trixie-backports mesa-vulkan-drivers libvulkan1 >/dev/null
    touch "$root/ready"
}
[ -e "$root/ready" ] || step make_chroot

# Tests of the library read its files, where they were when the tests were built.
mkdir -p "$root$PWD"
for place in /dev /proc "$PWD"; do
    mount --bind "$place" "$root$place"
done

in_chroot() {
    chroot "$root" env -C "$PWD" XDG_RUNTIME_DIR=/run LD_LIBRARY_PATH= "$@"
}

# The path of a test program: test_program PACKAGE-FOLDER TARGET
test_program() {
    cargo test --no-run --locked --workspace --quiet --message-format=json |
        grep -F "\"manifest_path\":\"$1/Cargo.toml\"" | grep -F "\"name\":\"$2\"" | grep -F '"test":true}' |
        sed -n 's/.*"executable":"\([^"]*\)".*/\1/p' | head -1
}

build_workspace
library=$(test_program "$PWD" girandole)
all=$(test_program "$PWD" all)
city=target/debug/city
for program in "$library" "$all" "$city"; do
    [ -x "$program" ] || { echo "a program was not built" >&2 && exit 1; }
done
step in_chroot "$library" gpu::
[ "${1:-}" != --all ] || step in_chroot "$all" gpu
rm -rf target/newer-driver-frame
step in_chroot "$PWD/$city" --backend gpu --frames 1 --size 64x36 --spp 1 --out "$PWD/target/newer-driver-frame"
[ -s target/newer-driver-frame/frame_0000.png ]
