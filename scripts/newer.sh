# A chroot of Debian's next release with its software Vulkan, which has ray queries (700 MB, made on first use). Source
# it after scripts/common.sh, in the root of the repository.

newer_root="${GIRANDOLE_CHROOT:-$PWD/target/newer-driver}"

# Starts the script again where mounts are seen by it alone, and end with it. On other systems than Debian 12, and
# without root, the script ends: enter_newer SCRIPT ARGUMENT...
enter_newer() {
    if [ "$(id -u)" -ne 0 ] || ! grep -qs bookworm /etc/os-release; then
        echo "skipped: this is not Debian 12, or not run as root"
        exit
    fi
    [ -n "${in_namespace:-}" ] || exec unshare --mount env in_namespace=yes bash "$@"
    [ -e "$newer_root/ready" ] || step make_newer
    # Tests of the library read its files, where they were when the tests were built.
    mkdir -p "$newer_root$PWD"
    for place in /dev /proc "$PWD"; do
        mount --bind "$place" "$newer_root$place"
    done
}

make_newer() {
    need debootstrap debootstrap
    rm -rf "$newer_root"
    local site
    site=$(apt-get indextargets --format '$(SITE)' 'Codename: bookworm' | head -1)
    debootstrap --variant=minbase trixie "$newer_root" "$site" >/dev/null
    printf 'deb %s %s main\n' "$site" trixie "$site" trixie-backports >"$newer_root/etc/apt/sources.list"
    cp /etc/resolv.conf "$newer_root/etc/"
    cp /etc/apt/apt.conf.d/* "$newer_root/etc/apt/apt.conf.d/" 2>/dev/null || true
    chroot "$newer_root" apt-get update -qq
    DEBIAN_FRONTEND=noninteractive chroot "$newer_root" apt-get install -y -qq --no-install-recommends \
        -t trixie-backports mesa-vulkan-drivers libvulkan1 >/dev/null
    touch "$newer_root/ready"
}

# Runs a program in the chroot.
in_newer() {
    chroot "$newer_root" env -C "$PWD" XDG_RUNTIME_DIR=/run LD_LIBRARY_PATH= "$@"
}
