/* The first steps: a lamp above the ground, sampled on the CPU.
 *
 * Prints the illuminance of a point on the ground, estimated from 1,000 samples. A lamp of I candela at a
 * height h gives I h / (h^2 + x^2)^(3/2) lux at the distance x from its foot: 800 candela at 6 m, 2 m aside,
 * give 18.97 lux. With one lamp all samples are equal, so the estimate differs by rounding only.
 */
#include <math.h>
#include <stdio.h>

#include "girandole.h"

#define SAMPLES 1000
/* Rounding of single precision, over a few dozen operations. */
#define TOLERANCE 1e-5

static int failed(GirandoleStatus status)
{
    if (status != GIRANDOLE_OK) {
        fprintf(stderr, "error %d: %s\n", (int)status, girandole_last_error_message());
    }
    return status != GIRANDOLE_OK;
}

int main(void)
{
    GirandoleWorld *world = NULL;
    GirandoleVec3 at = {0.0f, 6.0f, 0.0f}, candela = {800.0f, 800.0f, 800.0f};
    GirandoleLight bulb = girandole_point_light(at, candela);
    GirandolePlacement place = girandole_placement_at(12.0, 0.0, 0.0);
    GirandoleVec3 foot = {10.0f, 0.0f, 0.0f}, up = {0.0f, 1.0f, 0.0f};
    GirandoleShadingPoint ground = girandole_surface_point(foot, up);
    uint64_t lamp, post;
    double lux = 0.0, exact = 800.0 * 6.0 / pow(6.0 * 6.0 + 2.0 * 2.0, 1.5);
    int i, result;

    if (girandole_version() != GIRANDOLE_VERSION) {
        fprintf(stderr, "the header and the library have different versions\n");
        return 1;
    }
    /* One tree for each kind of object, any number of instances of it. */
    if (failed(girandole_world_create(&world)) ||
        failed(girandole_world_add_tree(world, &bulb, 1, &lamp)) ||
        failed(girandole_world_add_instance(world, lamp, &place, NULL, &post)) ||
        failed(girandole_world_update(world, 300.0, NULL))) { /* each frame: 300 microseconds */
        return 1;
    }
    for (i = 0; i < SAMPLES; i++) {
        float u[4] = {(i + 0.5f) / SAMPLES, 0.2f, 0.3f, 0.4f};
        GirandoleSample s;
        if (failed(girandole_world_sample(world, &ground, u, 1, &s))) {
            return 1;
        }
        /* The cosine at the ground is direction.y. Without a light the weight is 0. */
        lux += s.radiance.y * s.direction.y * s.weight / SAMPLES;
    }
    printf("illuminance: %.4f lux from samples, %.4f lux by the formula\n", lux, exact);
    result = fabs(lux / exact - 1.0) < TOLERANCE ? 0 : 1;
    girandole_world_destroy(world);
    return result;
}
