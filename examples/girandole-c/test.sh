#!/usr/bin/env bash
# Tests the C interface: builds both libraries, checks the header, compiles and runs the programs in C and C++
# with and without sanitizers, checks all shaders by the tools of Khronos and Microsoft, and plays plans on
# software Vulkan.
#
#   bash examples/girandole-c/test.sh
#
# Installs what it needs with apt. DXC, a download of 64 MB, comes from the PyPI package compushady; without it
# the part for HLSL is skipped, which the last line says. GIRANDOLE_DXC_SDIST names a file to use instead.
set -euo pipefail
cd "$(dirname "$0")"
source ../../scripts/common.sh
target="${CARGO_TARGET_DIR:-../../target}"
out="$target/c"
mkdir -p "$out"
skipped=""

part() { echo "== $*"; }

need_vulkan
need g++ g++
need spirv-val spirv-tools
need /usr/include/vulkan/vulkan.h libvulkan-dev
need /usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json vulkan-validationlayers

part "whether the header is up to date"
build_workspace
cargo test --locked --workspace --test header
# Where tests have the library.
built="$target/debug/deps"

c=(gcc -std=c99 -Wall -Wextra -Wpedantic -Werror -Iinclude)
cpp=(g++ -std=c++17 -Wall -Wextra -Wpedantic -Werror -Iinclude)
libraries=(-lpthread -ldl -lm)
sanitizers=(-g -O1 -fsanitize=address,undefined -fno-sanitize-recover=all)
export ASAN_OPTIONS=detect_leaks=1

part "the header alone, in C99 and C++17"
echo '#include "girandole.h"' > "$out/header.c"
"${c[@]}" -fsyntax-only "$out/header.c"
"${cpp[@]}" -fsyntax-only -x c++ "$out/header.c"

for link in static shared; do
    if [ "$link" = static ]; then
        library=("$built/libgirandole_c.a" "${libraries[@]}")
    else
        library=(-L"$built" -lgirandole_c "-Wl,-rpath,$(realpath "$built")" "${libraries[@]}")
    fi
    for checks in plain sanitized; do
        part "programs, $link, $checks"
        flags=()
        [ "$checks" = plain ] || flags=("${sanitizers[@]}")
        bin="$out/$link-$checks"
        mkdir -p "$bin"
        "${c[@]}" "${flags[@]}" programs/first.c -o "$bin/first" "${library[@]}"
        "${c[@]}" "${flags[@]}" programs/abuse.c -o "$bin/abuse" "${library[@]}"
        "${c[@]}" "${flags[@]}" programs/write_shaders.c -o "$bin/write_shaders" "${library[@]}"
        "${cpp[@]}" "${flags[@]}" programs/edits.cpp -o "$bin/edits" "${library[@]}"
        "$bin/first"
        "$bin/abuse"
        "$bin/edits"
    done
done

part "shaders in all languages, and SPIR-V by spirv-val"
shaders="$out/shaders"
rm -rf "$shaders"
mkdir -p "$shaders"
"$out/static-sanitized/write_shaders" "$shaders"
kernels=("$shaders"/*.spv)
[ "${#kernels[@]}" -ge 7 ]
for kernel in "${kernels[@]}"; do
    spirv-val --target-env vulkan1.1 "$kernel"
done

part "HLSL by DXC"
dxc_folder="$target/dxc"
sdist_sha256=5052caf9e955d8e7a48e22f536e82b44b72e83af46e824a9e99157c7809de691
sdist="${GIRANDOLE_DXC_SDIST:-$dxc_folder/compushady-0.17.5.tar.gz}"
measure_spv=""
if [ "$(uname -m)" != x86_64 ]; then
    skipped="HLSL (this machine is no x86_64)"
elif ! [ -e "$sdist" ] && ! python3 -m pip download -q compushady==0.17.5 --no-binary compushady --no-deps -d "$dxc_folder"; then
    skipped="HLSL (DXC cannot be downloaded)"
elif ! echo "$sdist_sha256  $sdist" | sha256sum --check --status; then
    skipped="HLSL ($sdist has another SHA-256 than $sdist_sha256)"
else
    mkdir -p "$dxc_folder"
    backends=compushady-0.17.5/compushady/backends
    tar xzf "$sdist" -C "$dxc_folder" --strip-components 3 \
        $backends/libdxcompiler_x86_64.so.3.7 $backends/dxcapi.h $backends/WinAdapter.h
    # The headers of DXC have warnings of their own.
    g++ -std=c++17 -w -I"$dxc_folder" programs/dxc.cpp -o "$out/dxc" -ldl
    dxc=("$out/dxc" "$dxc_folder/libdxcompiler_x86_64.so.3.7")
    for kernel in "$shaders"/*.hlsl; do
        name="$(basename "$kernel" .hlsl)"
        "${dxc[@]}" "$kernel" "$out/$name.dxil" -T cs_6_0 -E "$name" -Wno-parentheses-equality 2> "$out/dxc.txt" ||
            { cat "$out/dxc.txt"; exit 1; }
    done
    "${dxc[@]}" programs/measure.hlsl "$out/measure.dxil" -T cs_6_0 -E measure -I "$shaders"
    measure_spv="$out/measure_hlsl.spv"
    "${dxc[@]}" programs/measure.hlsl "$measure_spv" -T cs_6_0 -E measure -I "$shaders" \
        -spirv -fspv-target-env=vulkan1.1
    spirv-val --target-env vulkan1.1 "$measure_spv"
fi

part "plans on Vulkan"
for link in static shared; do
    library=("$built/libgirandole_c.a")
    [ "$link" = static ] ||
        library=(-L"$built" -lgirandole_c "-Wl,-rpath,$(realpath "$built")")
    "${cpp[@]}" -O1 programs/vulkan.cpp programs/vulkan_device.cpp -o "$out/vulkan-$link" "${library[@]}" \
        -lvulkan "${libraries[@]}"
done
# With Khronos' validation, of barriers too. The loader ignores a layer that is missing, so validation first has
# to find a hazard that is there.
validated=(env VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation
    VK_LAYER_ENABLES=VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT)
"${validated[@]}" "$out/vulkan-static" --hazard > "$out/hazard.txt" 2>&1
if ! grep -q SYNC-HAZARD-WRITE-AFTER-WRITE "$out/hazard.txt"; then
    cat "$out/hazard.txt"
    echo "Khronos' validation is not on: it does not report a hazard" >&2
    exit 1
fi
"${validated[@]}" "$out/vulkan-static" "$out" ${measure_spv:+"$measure_spv"} 2>&1 | tee "$out/vulkan.txt"
if grep -E "VUID|Validation Error|SYNC-HAZARD" "$out/vulkan.txt"; then
    echo "Khronos' validation has found errors" >&2
    exit 1
fi
"$out/vulkan-shared" "$out"
spirv-val --target-env vulkan1.1 "$out/measure.spv"

echo "== all passed${skipped:+, SKIPPED: $skipped}"
