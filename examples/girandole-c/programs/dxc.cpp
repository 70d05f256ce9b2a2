// Compiles HLSL by DXC, for the tests:
//
//   dxc LIBRARY SHADER OUT ARGUMENTS...
//
// LIBRARY is libdxcompiler.so, SHADER the HLSL file, whose folder is searched for includes. ARGUMENTS are those
// of the compiler, for example -T cs_6_0 -E main -spirv. Ends with 1, after the messages of DXC, if it refuses
// the shader.
#include <dlfcn.h>

#include <cstdio>
#include <cwchar>
#include <string>
#include <vector>

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunknown-pragmas"
#endif
#include "dxcapi.h"

namespace {

std::wstring wide(const std::string &text) { return std::wstring(text.begin(), text.end()); }

int fail(const char *what) {
    std::fprintf(stderr, "%s\n", what);
    return 1;
}

}  // namespace

int main(int count, char **arguments) {
    if (count < 4) return fail("usage: dxc LIBRARY SHADER OUT ARGUMENTS...");
    void *library = dlopen(arguments[1], RTLD_NOW);
    if (!library) return fail(dlerror());
    const auto create = reinterpret_cast<DxcCreateInstanceProc>(dlsym(library, "DxcCreateInstance"));
    if (!create) return fail("the library has no DxcCreateInstance");
    CComPtr<IDxcUtils> utils;
    CComPtr<IDxcCompiler3> compiler;
    CComPtr<IDxcIncludeHandler> includes;
    if (create(CLSID_DxcUtils, __uuidof(IDxcUtils), reinterpret_cast<void **>(&utils)) != S_OK ||
        create(CLSID_DxcCompiler, __uuidof(IDxcCompiler3), reinterpret_cast<void **>(&compiler)) != S_OK ||
        utils->CreateDefaultIncludeHandler(&includes) != S_OK) {
        return fail("DXC does not start");
    }
    const std::wstring path = wide(arguments[2]);
    CComPtr<IDxcBlobEncoding> source;
    if (utils->LoadFile(path.c_str(), nullptr, &source) != S_OK) return fail("the shader cannot be read");
    const DxcBuffer text = {source->GetBufferPointer(), source->GetBufferSize(), DXC_CP_UTF8};
    std::vector<std::wstring> kept = {path};
    for (int i = 4; i < count; i++) kept.push_back(wide(arguments[i]));
    std::vector<LPCWSTR> given;
    for (const auto &argument : kept) given.push_back(argument.c_str());
    CComPtr<IDxcResult> result;
    const auto done = compiler->Compile(&text, given.data(), static_cast<UINT32>(given.size()), includes,
                                        __uuidof(IDxcResult), reinterpret_cast<void **>(&result));
    if (done != S_OK) return fail("DXC does not run");
    CComPtr<IDxcBlobUtf8> messages;
    if (result->GetOutput(DXC_OUT_ERRORS, __uuidof(IDxcBlobUtf8), reinterpret_cast<void **>(&messages), nullptr) ==
            S_OK &&
        messages && messages->GetStringLength() > 0) {
        std::fprintf(stderr, "%s", messages->GetStringPointer());
    }
    HRESULT status = S_OK;
    if (result->GetStatus(&status) != S_OK || status != S_OK) return fail("DXC refuses the shader");
    CComPtr<IDxcBlob> code;
    if (result->GetOutput(DXC_OUT_OBJECT, __uuidof(IDxcBlob), reinterpret_cast<void **>(&code), nullptr) != S_OK ||
        !code) {
        return fail("DXC returns no code");
    }
    std::FILE *out = std::fopen(arguments[3], "wb");
    if (!out || std::fwrite(code->GetBufferPointer(), 1, code->GetBufferSize(), out) != code->GetBufferSize() ||
        std::fclose(out) != 0) {
        return fail("the code cannot be written");
    }
    return 0;
}
