/* What a call costs: the least time of five runs, for docs/c.md. Link it with a release build. */
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "girandole.h"

#define RUNS 5
#define CALLS 1000000
#define SAMPLES 200000
#define BATCH 1000

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static void check(GirandoleStatus status)
{
    if (status != GIRANDOLE_OK) {
        fprintf(stderr, "error %d: %s\n", (int)status, girandole_last_error_message());
        exit(1);
    }
}

int main(void)
{
    static GirandoleShadingPoint points[BATCH];
    static float u[4 * BATCH];
    static GirandoleSample samples[BATCH];
    const GirandoleVec3 up = {0.0f, 1.0f, 0.0f}, candela = {100.0f, 100.0f, 100.0f}, at = {0.0f, 3.0f, 0.0f};
    const GirandoleLight bulb = girandole_point_light(at, candela);
    GirandoleWorld *world;
    GirandoleDVec3 origin;
    uint64_t tree, instance = 0;
    double best[5] = {1e9, 1e9, 1e9, 1e9, 1e9}, start;
    int i, run;

    check(girandole_world_create(&world));
    check(girandole_world_add_tree(world, &bulb, 1, &tree));
    for (i = 0; i < 10000; i++) {
        const GirandolePlacement place = girandole_placement_at(i % 100, 0.0, i / 100);
        check(girandole_world_add_instance(world, tree, &place, NULL, &instance));
    }
    check(girandole_world_update(world, 0.0, NULL));
    for (i = 0; i < BATCH; i++) {
        const GirandoleVec3 ground = {(float)(rand() % 10000) * 0.01f, 0.0f, (float)(rand() % 10000) * 0.01f};
        int k;
        points[i] = girandole_surface_point(ground, up);
        for (k = 0; k < 4; k++) u[4 * i + k] = (float)(rand() % 16384) / 16384.0f;
    }
#define MEASURE(index, count, call)                                                                          \
    start = now();                                                                                           \
    for (i = 0; i < (count); i++) check(call);                                                               \
    start = (now() - start) / (count);                                                                        \
    if (start < best[index]) best[index] = start
    for (run = 0; run < RUNS; run++) {
        MEASURE(0, CALLS, girandole_world_origin(world, &origin));
        MEASURE(1, CALLS, girandole_world_set_user_data(world, instance, (uint32_t)i));
        MEASURE(2, CALLS / 10, girandole_world_set_user_data(world, 0, 0) == 203 ? 0 : 1);
        MEASURE(3, SAMPLES, girandole_world_sample(world, &points[i % BATCH], &u[4 * (i % BATCH)], 1, samples));
        MEASURE(4, SAMPLES / BATCH, girandole_world_sample(world, points, u, BATCH, samples));
    }
    printf("a call that reads: %.1f ns\n", 1e9 * best[0]);
    printf("a call that changes: %.1f ns\n", 1e9 * best[1]);
    printf("a call that is refused: %.1f ns\n", 1e9 * best[2]);
    printf("a sample in a call of its own: %.1f ns\n", 1e9 * best[3]);
    printf("a sample in a call for 1,000: %.1f ns\n", 1e9 * best[4] / BATCH);
    girandole_world_destroy(world);
    return 0;
}
