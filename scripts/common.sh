# What the scripts share. Source it after `cd` to the root of the repository, or with a path to it.

# Mesa complains where this is unset, on every device that a test opens.
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$(mktemp -d)}"

# Prints a command, runs it, and prints how long it took.
step() {
    local start=$SECONDS
    printf '\n== %s\n' "$*"
    "$@"
    printf '== took %d s\n' "$((SECONDS - start))"
}

# Builds the programs and the tests of the workspace. All scripts build by this command alone: others choose
# other features of dependencies, and compile nearly everything again.
build_workspace() {
    step cargo test --locked --workspace --no-run
}

# Installs Debian packages.
install_packages() {
    command -v apt-get >/dev/null || { echo "install these packages, or what your system calls them: $*" >&2 && exit 1; }
    local sudo=()
    [ "$(id -u)" -eq 0 ] || sudo=(sudo)
    "${sudo[@]}" apt-get update -qq
    "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

# Installs packages if a command or a file is missing: need COMMAND-OR-FILE PACKAGE...
need() {
    command -v "$1" >/dev/null || [ -e "$1" ] || install_packages "${@:2}"
}

# Installs software Vulkan where no driver is: GPU tests fail without an adapter.
need_vulkan() {
    [ "$(uname -s)" = Linux ] || return 0
    local has_driver=
    if compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null ||
        [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ]; then
        has_driver=yes
    fi
    if [ -z "$has_driver" ] || ! ldconfig -p 2>/dev/null | grep -q 'libvulkan\.so\.1'; then
        # Fedora: mesa-vulkan-drivers vulkan-loader; Arch: vulkan-swrast vulkan-icd-loader.
        install_packages mesa-vulkan-drivers libvulkan1
    fi
}
