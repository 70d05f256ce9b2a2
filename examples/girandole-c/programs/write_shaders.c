/* Writes all shaders of the library into a folder, as a build step of an engine may:
 *
 *   write_shaders FOLDER
 *
 *   KERNEL.spv, KERNEL.hlsl, KERNEL.metal, KERNEL.wgsl   every kernel
 *   girandole.hlsli, girandole.metal, girandole.wgsl     the functions for an engine's own shaders, for all
 *                                                        effects, at group 1
 *   bindings.txt                                         the tables of bindings
 */
#include <stdio.h>
#include <string.h>

#include "girandole.h"

static const struct {
    const char *name, *ending, *include_ending;
    GirandoleLanguage language;
} LANGUAGES[] = {
    {"WGSL", "wgsl", "wgsl", GIRANDOLE_LANGUAGE_WGSL},
    {"SPIR-V", "spv", NULL, GIRANDOLE_LANGUAGE_SPIRV},
    {"HLSL", "hlsl", "hlsli", GIRANDOLE_LANGUAGE_HLSL},
    {"MSL", "metal", "metal", GIRANDOLE_LANGUAGE_MSL},
};
#define LANGUAGE_COUNT (sizeof LANGUAGES / sizeof LANGUAGES[0])

static int failed(GirandoleStatus status)
{
    if (status != GIRANDOLE_OK) {
        fprintf(stderr, "error %d: %s\n", (int)status, girandole_last_error_message());
    }
    return status != GIRANDOLE_OK;
}

static int write_shader(const char *folder, const char *name, const char *ending, const char *language,
                        const GirandoleShader *shader, FILE *table)
{
    static const char *const KINDS[] = {"uniform", "read", "read-write", "other"};
    GirandoleShaderView view;
    char path[1024];
    FILE *file;
    size_t i, written;

    if (failed(girandole_shader_view(shader, &view))) {
        return 1;
    }
    snprintf(path, sizeof path, "%s/%s.%s", folder, name, ending);
    file = fopen(path, "wb");
    if (file == NULL) {
        perror(path);
        return 1;
    }
    written = fwrite(view.code, 1, view.size, file);
    if (fclose(file) != 0 || written != view.size) {
        perror(path);
        return 1;
    }
    fprintf(table, "%s, %s", name, language);
    for (i = 0; i < view.entry_point_count; i++) {
        const GirandoleEntryPoint *entry = &view.entry_points[i];
        fprintf(table, ", entry point %s of %u x %u x %u", entry->name_in_code, (unsigned)entry->workgroup_size[0],
                (unsigned)entry->workgroup_size[1], (unsigned)entry->workgroup_size[2]);
    }
    fprintf(table, "\n");
    for (i = 0; i < view.binding_count; i++) {
        const GirandoleShaderBinding *row = &view.bindings[i];
        const char letter[2] = {row->register_letter, 0};
        fprintf(table, "  group %u binding %u: %-10s space %u, %s%u, at least %u bytes: %s\n", (unsigned)row->group,
                (unsigned)row->binding, KINDS[row->kind], (unsigned)row->space, letter, (unsigned)row->index,
                (unsigned)row->size, row->name);
    }
    if (view.sizes_index != GIRANDOLE_NO_INDEX) {
        fprintf(table, "  sizes of buffers: index %u\n", (unsigned)view.sizes_index);
    }
    return 0;
}

int main(int argument_count, char **arguments)
{
    char path[1024];
    FILE *table;
    uint32_t kernel_index;
    size_t i;
    int result = 0;

    if (argument_count != 2) {
        fprintf(stderr, "usage: write_shaders FOLDER\n");
        return 1;
    }
    snprintf(path, sizeof path, "%s/bindings.txt", arguments[1]);
    table = fopen(path, "w");
    if (table == NULL) {
        perror(path);
        return 1;
    }
    for (i = 0; i < LANGUAGE_COUNT && !result; i++) {
        GirandoleTarget target;
        GirandoleShader *shader;
        memset(&target, 0, sizeof target);
        target.language = LANGUAGES[i].language;
        for (kernel_index = 0; kernel_index < girandole_kernel_count() && !result; kernel_index++) {
            GirandoleKernel kernel;
            if (failed(girandole_kernel(kernel_index, &kernel)) ||
                failed(girandole_kernel_shader(kernel_index, &target, &shader))) {
                result = 1;
                break;
            }
            result = write_shader(arguments[1], kernel.name, LANGUAGES[i].ending, LANGUAGES[i].name, shader, table);
            girandole_shader_destroy(shader);
        }
        if (!result && LANGUAGES[i].include_ending != NULL) {
            if (failed(girandole_shader_include(GIRANDOLE_ALL_EFFECTS, 1, 0, &target, &shader))) {
                result = 1;
                break;
            }
            result = write_shader(arguments[1], "girandole", LANGUAGES[i].include_ending, LANGUAGES[i].name, shader,
                                  table);
            girandole_shader_destroy(shader);
        }
    }
    return fclose(table) != 0 || result;
}
