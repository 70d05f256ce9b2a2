/* What the interface refuses, and that a refusal changes nothing.
 *
 * Run it with AddressSanitizer and UndefinedBehaviorSanitizer, as test.sh does: a call that follows a bad
 * pointer, or that leaks, fails there.
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "girandole.h"

static int failures = 0;

static void expect_at(int line, const char *what, GirandoleStatus given, GirandoleStatus expected)
{
    if (given != expected) {
        fprintf(stderr, "line %d: %s returns %d instead of %d: %s\n", line, what, (int)given, (int)expected,
                girandole_last_error_message());
        failures++;
    }
    if (given != GIRANDOLE_OK && girandole_last_error_message()[0] == 0) {
        fprintf(stderr, "line %d: %s has no message\n", line, what);
        failures++;
    }
}
#define EXPECT(expected, call) expect_at(__LINE__, #call, call, expected)
#define REQUIRE(holds) ((holds) ? (void)0 : (void)(fprintf(stderr, "line %d: %s\n", __LINE__, #holds), failures++))

/* What a refused call must not change: the sizes of the world, and what arrives at a point. */
typedef struct State {
    GirandoleCounts counts;
    GirandoleSample sample;
} State;

static State state_of(const GirandoleWorld *world)
{
    static const float u[4] = {0.3f, 0.6f, 0.2f, 0.9f};
    GirandoleVec3 at = {0.5f, 0.0f, 0.5f}, up = {0.0f, 1.0f, 0.0f};
    GirandoleShadingPoint ground = girandole_surface_point(at, up);
    State state;
    memset(&state, 0, sizeof state);
    EXPECT(GIRANDOLE_OK, girandole_world_counts(world, &state.counts));
    EXPECT(GIRANDOLE_OK, girandole_world_sample(world, &ground, u, 1, &state.sample));
    return state;
}

static int is_same(State a, State b)
{
    return a.counts.trees == b.counts.trees && a.counts.instances == b.counts.instances &&
           a.counts.lights == b.counts.lights && a.counts.effects == b.counts.effects &&
           a.counts.directionals == b.counts.directionals && a.sample.light.key == b.sample.light.key &&
           a.sample.light.light == b.sample.light.light && a.sample.weight == b.sample.weight &&
           a.sample.pmf == b.sample.pmf && a.sample.radiance.x == b.sample.radiance.x &&
           a.sample.radiance.y == b.sample.radiance.y && a.sample.radiance.z == b.sample.radiance.z;
}

static GirandoleLight bulb(float candela)
{
    GirandoleVec3 at = {0.0f, 3.0f, 0.0f}, emission;
    emission.x = emission.y = emission.z = candela;
    return girandole_point_light(at, emission);
}

static void edits(GirandoleWorld *world, uint64_t tree, uint64_t instance)
{
    const GirandoleLight good = bulb(5.0f);
    GirandoleLight bad[6], ignored = good;
    GirandolePlacement place = girandole_placement_at(1.0, 0.0, 0.0), nowhere = girandole_placement_at(NAN, 0, 0);
    GirandolePlacement flat = place;
    GirandolePolicy policy = {99, 0.0f, 0.0f}, ratio = {GIRANDOLE_POLICY_RATIO, 0.5f, 0.0f};
    GirandoleDVec3 far = {1e300, 0.0, 0.0}, nan3 = {0.0, NAN, 0.0};
    GirandoleVec3 negative = {-1.0f, 0.0f, 0.0f}, none = {0.0f, 0.0f, 0.0f};
    GirandoleVec3 up = {0.0f, 1.0f, 0.0f}, side = {1.0f, 0.0f, 0.0f};
    GirandoleDirectionalLight moon;
    const GirandoleLightKind unknown = 77;
    uint64_t key = 7, stale_tree, stale, moved[2];
    uint32_t index[2] = {0, 0}, beyond = 1000, slot = 7;
    size_t count = 7, other = 7;
    GirandolePlacement places[2];
    GirandoleTreeLight removed;
    const State before = state_of(world);
    int i;

    for (i = 0; i < 6; i++) bad[i] = good;
    bad[0].emission.y = NAN;
    bad[1].kind = unknown;
    bad[2] = girandole_triangle_light(none, up, side, none), bad[2].two_sided = 2;
    bad[3].range = -1.0f;
    bad[4] = girandole_spot_light(none, none, 0.1f, 0.2f, none);
    bad[5].emission.x = -1.0f;
    EXPECT(100, girandole_world_add_tree(world, &bad[0], 1, &key));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_add_tree(world, &bad[1], 1, &key));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_add_tree(world, &bad[2], 1, &key));
    EXPECT(100, girandole_world_add_tree(world, &bad[3], 1, &key));
    EXPECT(100, girandole_world_add_tree(world, &bad[4], 1, &key));
    EXPECT(100, girandole_world_add_tree(world, &bad[5], 1, &key));
    /* A good light before a bad one. */
    bad[4] = good;
    EXPECT(100, girandole_world_add_tree(world, &bad[4], 2, &key));
    EXPECT(100, girandole_world_add_lights(world, tree, &bad[4], 2, index));
    EXPECT(100, girandole_world_replace_lights(world, tree, &bad[4], 2));
    index[0] = 0, index[1] = 1;
    EXPECT(100, girandole_world_set_lights(world, tree, index, &bad[4], 2));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_LIGHT, girandole_world_set_lights(world, tree, &beyond, &good, 1));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_LIGHT, girandole_world_remove_lights(world, tree, &beyond, 1));
    index[1] = 0;
    EXPECT(GIRANDOLE_ERROR_REMOVED_LIGHT, girandole_world_remove_lights(world, tree, index, 2));

    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_add_tree(NULL, &good, 1, &key));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_add_tree(world, NULL, 1, &key));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_add_tree(world, &good, 1, NULL));
    EXPECT(GIRANDOLE_ERROR_BAD_LENGTH, girandole_world_add_tree(world, &good, SIZE_MAX, &key));
    EXPECT(GIRANDOLE_ERROR_BAD_LENGTH, girandole_world_add_tree(world, &good, SIZE_MAX / sizeof good, &key));
    EXPECT(GIRANDOLE_ERROR_MISALIGNED,
           girandole_world_add_tree(world, (const GirandoleLight *)((const char *)bad + 1), 1, &key));
    REQUIRE(key == 7);

    EXPECT(GIRANDOLE_ERROR_TREE_IN_USE, girandole_world_remove_tree(world, tree));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_remove_tree(world, 0));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_remove_tree(world, UINT64_MAX));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_remove_tree(world, tree & 0xffffffffu));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_INSTANCE, girandole_world_remove_instance(world, 0));
    EXPECT(100, girandole_world_add_instance(world, tree, &nowhere, NULL, &key));
    EXPECT(100, girandole_world_move_instance(world, instance, &nowhere));
    flat.axes[1] = none;
    EXPECT(GIRANDOLE_OK, girandole_world_move_instance(world, instance, &flat));
    EXPECT(GIRANDOLE_OK, girandole_world_move_instance(world, instance, &place));
    moved[0] = instance, moved[1] = 0, places[0] = place, places[1] = place;
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_INSTANCE, girandole_world_move_instances(world, moved, places, 2));
    moved[1] = instance, places[1] = nowhere;
    EXPECT(100, girandole_world_move_instances(world, moved, places, 2));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_move_instances(world, moved, NULL, 2));
    EXPECT(GIRANDOLE_OK, girandole_world_move_instances(world, NULL, NULL, 0));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_set_policy(world, instance, &policy));
    EXPECT(100, girandole_world_set_policy(world, instance, &ratio));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_add_instance(world, tree, &place, &policy, &key));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_set_enabled(world, instance, 2));
    EXPECT(100, girandole_world_set_factor(world, instance, negative));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_INSTANCE, girandole_world_instance_slot(world, 1, &slot));
    REQUIRE(slot == 7);

    /* Results that are not wanted, and one place for two. */
    EXPECT(GIRANDOLE_OK, girandole_world_tree_lights(world, tree, NULL, NULL));
    EXPECT(GIRANDOLE_OK, girandole_world_tree_lights(world, tree, &count, &count));
    REQUIRE(count == 2);
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_instance_slot(world, instance, NULL));
    count = 7;

    /* Keys of what was removed. A point light ignores two_sided. */
    ignored.two_sided = 99;
    EXPECT(GIRANDOLE_OK, girandole_world_add_tree(world, &ignored, 1, &stale_tree));
    EXPECT(GIRANDOLE_OK, girandole_world_remove_tree(world, stale_tree));
    EXPECT(GIRANDOLE_OK, girandole_world_add_tree(world, &good, 1, &stale_tree));
    EXPECT(GIRANDOLE_OK, girandole_world_add_instance(world, stale_tree, &place, NULL, &stale));
    EXPECT(GIRANDOLE_OK, girandole_world_remove_instance(world, stale));
    EXPECT(GIRANDOLE_OK, girandole_world_remove_tree(world, stale_tree));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_INSTANCE, girandole_world_remove_instance(world, stale));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_INSTANCE, girandole_world_move_instance(world, stale, &place));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_remove_tree(world, stale_tree));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_add_instance(world, stale_tree, &place, NULL, &key));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_add_lights(world, stale_tree, &good, 1, index));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_tree_lights(world, stale_tree, &count, &other));
    REQUIRE(count == 7 && other == 7);

    EXPECT(100, girandole_world_update(world, NAN, NULL));
    EXPECT(100, girandole_world_update(world, -1.0, NULL));
    EXPECT(100, girandole_world_set_origin_near(world, nan3));
    EXPECT(100, girandole_world_set_origin_near(world, far));
    EXPECT(100, girandole_world_set_viewpoint(world, nan3));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_set_sampling(world, 8));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_set_background_builds(world, 2));
    moon.direction = none, moon.illuminance = none;
    EXPECT(100, girandole_world_add_directional(world, &moon, &key));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_DIRECTIONAL, girandole_world_remove_directional(world, 1));
    EXPECT(1100, girandole_world_add_baked(world, (const uint8_t *)"not a tree, but long enough", 27, &key));
    EXPECT(1100, girandole_world_add_baked(world, NULL, 0, &key));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_removed_lights(world, &removed, 1, NULL));
    REQUIRE(key == 7);
    /* Edits of lights take effect at the next update. */
    EXPECT(GIRANDOLE_OK, girandole_world_update(world, 0.0, NULL));
    REQUIRE(is_same(before, state_of(world)));
}

static void sampling(const GirandoleWorld *world)
{
    GirandoleVec3 at = {0.5f, 0.0f, 0.5f}, up = {0.0f, 1.0f, 0.0f}, nan3 = {NAN, NAN, NAN};
    GirandoleShadingPoint ground = girandole_surface_point(at, up), bad = ground;
    GirandoleLightId id = {0, 9, 0}, ids[1];
    const float u[5] = {0.5f, 0.5f, 0.5f, 0.5f, 0.5f}, wild[4] = {NAN, -1.0f, INFINITY, 2.0f};
    GirandoleSample sample;
    float pmf = 7.0f;
    uint32_t generation = 7;
    size_t count = 0;

    memset(&sample, 0x55, sizeof sample);
    EXPECT(GIRANDOLE_OK, girandole_world_resample(world, 0, &ground, u, 1, &sample));
    REQUIRE(sample.light.kind == GIRANDOLE_ID_NONE);
    memset(&sample, 0x55, sizeof sample);
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_sample(NULL, &ground, u, 1, &sample));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_sample(world, NULL, u, 1, &sample));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_sample(world, &ground, NULL, 1, &sample));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_sample(world, &ground, u, 1, NULL));
    EXPECT(GIRANDOLE_ERROR_BAD_LENGTH, girandole_world_sample(world, &ground, u, SIZE_MAX / 8, &sample));
    bad.is_glossy = 9;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_sample(world, &bad, u, 1, &sample));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_pmf(world, &ground, &id, 1, &pmf));
    REQUIRE(pmf == 7.0f && sample.is_delta == 0x55555555u);
    /* No sample, no pointers. */
    EXPECT(GIRANDOLE_OK, girandole_world_sample(world, NULL, NULL, 0, NULL));
    /* Stale names and numbers that are not finite are ordinary: nothing arrives. */
    id.kind = GIRANDOLE_ID_INSTANCE, id.key = 12345;
    EXPECT(GIRANDOLE_OK, girandole_world_generations(world, &id, 1, &generation));
    REQUIRE(generation == 0);
    EXPECT(GIRANDOLE_OK, girandole_world_pmf(world, &ground, &id, 1, &pmf));
    REQUIRE(pmf == 0.0f);
    EXPECT(GIRANDOLE_OK, girandole_world_sample_lights(world, &ground, &id, u, 1, &sample));
    REQUIRE(sample.light.kind == GIRANDOLE_ID_NONE && sample.weight == 0.0f);
    bad = girandole_surface_point(nan3, nan3);
    EXPECT(GIRANDOLE_OK, girandole_world_sample(world, &bad, wild, 1, &sample));
    EXPECT(GIRANDOLE_OK, girandole_world_sample(world, &ground, wild, 1, &sample));
    REQUIRE(sample.light.kind != GIRANDOLE_ID_NONE && isfinite(sample.weight));
    EXPECT(GIRANDOLE_ERROR_NO_SPACE, girandole_world_lights(world, ids, 1, &count));
    REQUIRE(count > 1);
}

static void plans(GirandoleWorld *world)
{
    GirandoleWorld *other_world = NULL;
    GirandolePlanner *planner = NULL, *small = NULL, *reserved = NULL;
    GirandoleCursor *cursor = NULL;
    GirandoleReader *reader = NULL;
    GirandoleChanges changes;
    GirandolePlan *first = NULL, *second = NULL, *plan = NULL;
    GirandolePlanView view;
    GirandoleCutOptions cuts = {0.001f, 100, 8, 0, 0.0f};
    const GirandoleDVec3 nowhere = {NAN, 0.0, 0.0};
    const GirandoleNewBuffer *buffers = NULL;
    uint32_t ids[GIRANDOLE_SHADER_BUFFERS];
    size_t count = 0;

    EXPECT(GIRANDOLE_OK, girandole_world_create(&other_world));
    EXPECT(100, girandole_planner_create(NULL, &cuts, &planner));
    cuts.edge = 0.25f, cuts.cells = 65537;
    EXPECT(100, girandole_planner_create(NULL, &cuts, &planner));
    cuts.cells = 65536, cuts.learning_cells = 5, cuts.learning_edge = 1.0f;
    EXPECT(100, girandole_planner_create(NULL, &cuts, &planner));
    cuts.learning_cells = 4, cuts.learning_edge = 0.0f;
    EXPECT(100, girandole_planner_create(NULL, &cuts, &planner));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_forget_visibility(NULL));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_create(NULL, NULL, NULL));
    REQUIRE(planner == NULL);
    EXPECT(GIRANDOLE_OK, girandole_planner_create(NULL, NULL, &planner));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_set_cut_view(NULL, nowhere, 0.001f));
    EXPECT(GIRANDOLE_OK, girandole_planner_set_cut_view(planner, nowhere, 0.001f));
    EXPECT(GIRANDOLE_OK, girandole_cursor_create(&cursor));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_reader_create(NULL));
    EXPECT(GIRANDOLE_OK, girandole_reader_create(&reader));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_reader_read(NULL, world, &changes));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_reader_read(reader, NULL, &changes));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_reader_read(reader, world, NULL));
    /* What a refused call should have stored is still to come. */
    EXPECT(GIRANDOLE_OK, girandole_reader_read(reader, world, &changes));
    REQUIRE(changes.added_count > 0 && changes.moved_count == 0 && changes.is_empty == 0);
    EXPECT(GIRANDOLE_OK, girandole_reader_read(reader, world, &changes));
    REQUIRE(changes.added_count == 0 && changes.is_empty == 1);
    EXPECT(GIRANDOLE_ERROR_OTHER_WORLD, girandole_reader_read(reader, other_world, &changes));
    EXPECT(GIRANDOLE_OK, girandole_planner_bindings(planner, ids));
    REQUIRE(ids[0] == UINT32_MAX && ids[6] == UINT32_MAX);
    EXPECT(GIRANDOLE_ERROR_NOT_RESERVED, girandole_planner_plan(planner, &plan));
    EXPECT(GIRANDOLE_ERROR_NOT_RESERVED, girandole_planner_cancel(planner));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_planner_reserve(planner, world, 2, &buffers, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_reserve(planner, NULL, 0, &buffers, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_reserve(planner, world, 0, NULL, &count));
    REQUIRE(plan == NULL && count == 0);

    /* A reservation that is cancelled has changed nothing; the next one needs the same buffers. */
    EXPECT(GIRANDOLE_OK, girandole_planner_reserve(planner, world, 0, &buffers, &count));
    REQUIRE(count >= 8);
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_set_cut_view(planner, nowhere, 0.001f));
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_bindings(planner, ids));
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_lose(planner));
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_reserve(planner, world, 0, &buffers, &count));
    EXPECT(GIRANDOLE_OK, girandole_world_update(world, 0.0, NULL)); /* the world is not part of the reservation */
    EXPECT(GIRANDOLE_OK, girandole_planner_cancel(planner));
    EXPECT(GIRANDOLE_ERROR_OTHER_WORLD,
           girandole_planner_reserve(planner, other_world, 0, &buffers, &count));
    EXPECT(GIRANDOLE_OK, girandole_planner_reserve(planner, world, 1, &buffers, &count));
    REQUIRE(count >= 8);
    EXPECT(GIRANDOLE_OK, girandole_planner_plan(planner, &first));
    EXPECT(GIRANDOLE_ERROR_NOT_RESERVED, girandole_planner_plan(planner, &second));

    /* Plans that are played twice or out of order. */
    EXPECT(GIRANDOLE_OK, girandole_planner_lose(planner));
    EXPECT(GIRANDOLE_OK, girandole_planner_reserve(planner, world, 0, &buffers, &count));
    EXPECT(GIRANDOLE_OK, girandole_planner_plan(planner, &second));
    EXPECT(GIRANDOLE_ERROR_OUT_OF_ORDER, girandole_cursor_advance(cursor, second));
    EXPECT(GIRANDOLE_OK, girandole_cursor_advance(cursor, first));
    EXPECT(GIRANDOLE_ERROR_OUT_OF_ORDER, girandole_cursor_advance(cursor, first));
    EXPECT(GIRANDOLE_OK, girandole_cursor_skip_to(cursor, second));
    EXPECT(GIRANDOLE_OK, girandole_cursor_advance(cursor, second));
    EXPECT(GIRANDOLE_OK, girandole_plan_view(second, &view));
    REQUIRE(view.number == 2 && view.upload_count > 0 && view.top_count > 0);
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_plan_view(NULL, &view));

    /* A planner that ends with its reservation frees the world. */
    EXPECT(GIRANDOLE_OK, girandole_planner_create(NULL, NULL, &reserved));
    EXPECT(GIRANDOLE_OK, girandole_planner_reserve(reserved, world, 0, &buffers, &count));
    girandole_planner_destroy(reserved);
    EXPECT(GIRANDOLE_OK, girandole_world_update(world, 0.0, NULL));

    {   /* A world that does not fit. */
        const GirandoleLimits limits = {131072, GIRANDOLE_NO_LIMIT, GIRANDOLE_NO_LIMIT};
        const GirandoleLight light = bulb(1.0f);
        const GirandolePlacement place = girandole_placement_at(0.0, 0.0, 0.0);
        uint64_t tree, instance;
        int i;
        EXPECT(GIRANDOLE_OK, girandole_world_add_tree(other_world, &light, 1, &tree));
        for (i = 0; i < 5000; i++) {
            EXPECT(GIRANDOLE_OK, girandole_world_add_instance(other_world, tree, &place, NULL, &instance));
        }
        EXPECT(GIRANDOLE_OK, girandole_planner_create(&limits, NULL, &small));
        EXPECT(GIRANDOLE_ERROR_FULL, girandole_planner_reserve(small, other_world, 0, &buffers, &count));
        EXPECT(GIRANDOLE_OK, girandole_world_update(other_world, 0.0, NULL));
    }
    girandole_plan_destroy(first);
    girandole_plan_destroy(second);
    girandole_reader_destroy(reader);
    girandole_cursor_destroy(cursor);
    girandole_planner_destroy(planner);
    girandole_planner_destroy(small);
    girandole_world_destroy(other_world);
}

/* Trees whose lights a kernel writes. */
static void sources(GirandoleWorld *world)
{
    static const uint8_t bytes[4096] = {0};
    static uint8_t noise[4096];
    const GirandoleLight bulbs[2] = {bulb(1.0f), bulb(2.0f)};
    const GirandolePlacement place = girandole_placement_at(0.0, 0.0, 0.0);
    GirandoleWorld *other = NULL;
    GirandolePlanner *planner = NULL;
    GirandolePlan *plan = NULL;
    GirandoleReadback *measures = NULL, *parts = NULL, *lights = NULL, *none = NULL;
    GirandoleReadbackView view;
    GirandolePlanView of_plan;
    GirandoleShader *text = NULL;
    const GirandoleNewBuffer *buffers = NULL;
    uint64_t tree = 0, instance = 0, refused = 7, trees[2];
    uint32_t source = 7, number = 7, ids[GIRANDOLE_SOURCE_BUFFERS], sources = 7;
    size_t count = 0, i, dispatches = 0;

    memset(noise, 0xff, sizeof noise); /* NaN */
    EXPECT(GIRANDOLE_OK, girandole_world_add_tree(world, bulbs, 2, &tree));
    EXPECT(GIRANDOLE_OK, girandole_world_add_instance(world, tree, &place, NULL, &instance));
    EXPECT(GIRANDOLE_OK, girandole_planner_create(NULL, NULL, &planner));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_set_light_source(NULL, tree, GIRANDOLE_SOURCE_GPU_MESH));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_set_light_source(world, 1, GIRANDOLE_SOURCE_GPU_MESH));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_world_set_light_source(world, tree, 3));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_light_source(world, 1, &source, &number));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_TREE, girandole_world_refused_writes(world, 1, &refused));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_refused_writes(world, tree, NULL));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_shader_sources(255, &text));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_shader_sources(0, NULL));
    REQUIRE(source == 7 && number == 7 && refused == 7 && text == NULL);
    EXPECT(GIRANDOLE_OK, girandole_world_light_source(world, tree, &source, &number));
    REQUIRE(source == GIRANDOLE_SOURCE_CPU && number == GIRANDOLE_NO_INDEX);
    EXPECT(GIRANDOLE_OK, girandole_planner_source_bindings(planner, ids));
    EXPECT(GIRANDOLE_OK, girandole_planner_source_count(planner, &sources));
    EXPECT(GIRANDOLE_OK, girandole_planner_measures(planner, 0, 9, &none));
    REQUIRE(ids[0] == UINT32_MAX && ids[1] == UINT32_MAX && sources == 0 && none == NULL);

    EXPECT(GIRANDOLE_OK, girandole_world_set_light_source(world, tree, GIRANDOLE_SOURCE_GPU_MESH));
    EXPECT(GIRANDOLE_OK, girandole_world_light_source(world, tree, &source, &number));
    REQUIRE(source == GIRANDOLE_SOURCE_GPU_MESH && number == 0);
    EXPECT(GIRANDOLE_OK, girandole_world_light_source(world, tree, NULL, NULL));
    EXPECT(GIRANDOLE_OK, girandole_world_update(world, 0.0, NULL));
    EXPECT(GIRANDOLE_OK, girandole_planner_reserve(planner, world, 0, &buffers, &count));
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_measures(planner, 0, 9, &none));
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_source_parts(planner, 9, &none));
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_source_lights(planner, tree, &none));
    EXPECT(GIRANDOLE_ERROR_RESERVED, girandole_planner_source_bindings(planner, ids));
    EXPECT(GIRANDOLE_OK, girandole_planner_plan(planner, &plan));
    EXPECT(GIRANDOLE_OK, girandole_plan_view(plan, &of_plan));
    for (i = 0; i < of_plan.top_count; i++) {
        GirandoleKernel kernel;
        if (of_plan.top[i].kind != GIRANDOLE_COMMAND_DISPATCH) continue;
        EXPECT(GIRANDOLE_OK, girandole_kernel(of_plan.top[i].kernel, &kernel));
        dispatches += strncmp(kernel.name, "refit", 5) == 0;
    }
    REQUIRE(dispatches == 2); /* one level of pieces, and the records of all trees */
    EXPECT(GIRANDOLE_OK, girandole_planner_source_bindings(planner, ids));
    EXPECT(GIRANDOLE_OK, girandole_planner_source_count(planner, &sources));
    REQUIRE(ids[0] != UINT32_MAX && ids[1] != UINT32_MAX && sources == 1);

    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_measures(NULL, 0, 9, &none));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_measures(planner, 0, 9, NULL));
    EXPECT(GIRANDOLE_OK, girandole_planner_measures(planner, 1, 9, &none));
    EXPECT(GIRANDOLE_OK, girandole_planner_measures(planner, UINT32_MAX, UINT32_MAX, &none));
    EXPECT(GIRANDOLE_OK, girandole_planner_source_lights(planner, 1, &none));
    REQUIRE(none == NULL);
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_source_parts(NULL, 9, &none));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_planner_source_parts(planner, 9, NULL));
    EXPECT(GIRANDOLE_OK, girandole_planner_source_parts(planner, 0, &parts));
    EXPECT(GIRANDOLE_OK, girandole_planner_measures(planner, 0, UINT32_MAX, &measures));
    EXPECT(GIRANDOLE_OK, girandole_planner_source_lights(planner, tree, &lights));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_readback_view(NULL, &view));
    EXPECT(GIRANDOLE_OK, girandole_readback_view(measures, &view));
    REQUIRE(view.size == 32 && view.most_trees == 1);
    count = 7;
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_readback_apply(NULL, world, bytes, 32, trees, 2, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_readback_apply(measures, NULL, bytes, 32, trees, 2, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_readback_apply(measures, world, NULL, 32, trees, 2, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_readback_apply(measures, world, bytes, 32, NULL, 2, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_readback_apply(measures, world, bytes, 32, trees, 2, NULL));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_readback_apply(measures, world, bytes, 64, trees, 2, &count));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_readback_apply(measures, world, NULL, 0, trees, 2, &count));
    REQUIRE(count == 7);
    EXPECT(GIRANDOLE_ERROR_NO_SPACE, girandole_readback_apply(measures, world, bytes, 32, NULL, 0, &count));
    REQUIRE(count == 1);
    EXPECT(GIRANDOLE_OK, girandole_world_create(&other));
    EXPECT(GIRANDOLE_ERROR_OTHER_WORLD, girandole_readback_apply(measures, other, bytes, 32, trees, 2, &count));
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(measures, world, bytes, 32, trees, 2, &count));
    REQUIRE(count == 0);
    EXPECT(GIRANDOLE_OK, girandole_world_refused_writes(world, tree, &refused));
    REQUIRE(refused == 0);

    /* Bytes that no GPU has written. */
    EXPECT(GIRANDOLE_OK, girandole_readback_view(parts, &view));
    REQUIRE(view.size % 80 == 0 && view.size <= sizeof bytes && view.most_trees == 0);
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(parts, world, noise, (size_t)view.size, NULL, 0, &count));
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(parts, world, bytes, (size_t)view.size, NULL, 0, &count));
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(measures, world, noise, 32, trees, 2, &count));
    EXPECT(GIRANDOLE_OK, girandole_readback_view(lights, &view));
    REQUIRE(view.size <= sizeof bytes && view.most_trees == 0);
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(lights, world, noise, (size_t)view.size, NULL, 0, &count));
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(lights, world, bytes, (size_t)view.size, NULL, 0, &count));
    REQUIRE(count == 0);
    EXPECT(GIRANDOLE_OK, girandole_world_update(world, INFINITY, NULL));

    /* Readbacks may outlive the planner and the tree. */
    girandole_planner_destroy(planner);
    EXPECT(GIRANDOLE_OK, girandole_world_remove_instance(world, instance));
    EXPECT(GIRANDOLE_OK, girandole_world_remove_tree(world, tree));
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(measures, world, noise, 32, trees, 2, &count));
    EXPECT(GIRANDOLE_OK, girandole_readback_apply(lights, world, noise, (size_t)view.size, NULL, 0, &count));
    REQUIRE(count == 0);
    girandole_readback_destroy(measures);
    girandole_readback_destroy(parts);
    girandole_readback_destroy(lights);
    girandole_plan_destroy(plan);
    girandole_world_destroy(other);
}

static void regions(GirandoleWorld *world)
{
    const GirandoleLight good = bulb(5.0f), bad = bulb(-1.0f);
    GirandoleRegion *region = NULL;
    GirandoleRegionInstance instance;
    uint32_t tree = 7;
    uint64_t key = 7;
    size_t count = 7;
    const State before = state_of(world);

    EXPECT(GIRANDOLE_ERROR_NULL, girandole_region_create(NULL));
    EXPECT(GIRANDOLE_OK, girandole_region_create(&region));
    EXPECT(100, girandole_region_add_tree(region, &bad, 1, &tree));
    EXPECT(1100, girandole_region_add_baked(region, NULL, 0, &tree));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_region_add_tree(NULL, &good, 1, &tree));
    instance = girandole_region_instance(0, girandole_placement_at(0.0, 0.0, 0.0));
    EXPECT(212, girandole_region_add_instance(region, &instance));
    REQUIRE(tree == 7);
    EXPECT(GIRANDOLE_OK, girandole_region_add_tree(region, &good, 1, &tree));
    instance.is_enabled = 2;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_region_add_instance(region, &instance));
    instance.is_enabled = 1, instance.policy.kind = 99;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_region_add_instance(region, &instance));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_add_region(world, NULL, &key));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_add_region(world, region, NULL));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_REGION, girandole_world_remove_region(world, 3));
    EXPECT(GIRANDOLE_ERROR_NO_SUCH_REGION, girandole_world_region_trees(world, 3, &key, 1, &count));
    REQUIRE(key == 7 && count == 7);
    /* Edits of lights take effect at the next update. */
    EXPECT(GIRANDOLE_OK, girandole_world_update(world, 0.0, NULL));
    REQUIRE(is_same(before, state_of(world)));
    /* With its content: no leak. */
    girandole_region_destroy(region);
    girandole_region_destroy(NULL);
}

static void textures(void)
{
    GirandoleVec3 none = {0.0f, 0.0f, 0.0f}, right = {1.0f, 0.0f, 0.0f}, up = {0.0f, 1.0f, 0.0f};
    GirandoleVec3 nits = {9.0f, 9.0f, 9.0f}, texels[4];
    uint8_t bytes[16] = {0};
    GirandoleTexture image, bad;
    GirandoleTexturedSurface sign, list[2], parts[2], part;
    GirandoleLight light;
    size_t count = 7;
    int i;

    memset(&image, 0, sizeof image);
    memset(&sign, 0, sizeof sign);
    for (i = 0; i < 4; i++) texels[i] = i < 2 ? nits : none;
    image.linear = texels, image.width = image.height = 2;
    sign.white = girandole_parallelogram_light(none, right, up, nits);
    sign.tex_coords[0].y = sign.tex_coords[1].x = sign.tex_coords[1].y = 1.0f;
    part = sign, part.white.range = 77.0f;
    light = bulb(77.0f);
    list[0] = list[1] = sign;

    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_split(NULL, &sign, 1, 0.1f, &part, 1, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_split(&image, NULL, 1, 0.1f, &part, 1, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_split(&image, &sign, 1, 0.1f, NULL, 1, &count));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_split(&image, &sign, 1, 0.1f, &part, 1, NULL));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_lights(NULL, &sign, 1, &light));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_lights(&image, NULL, 1, &light));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_lights(&image, &sign, 1, NULL));
    EXPECT(GIRANDOLE_ERROR_BAD_LENGTH, girandole_texture_lights(&image, &sign, SIZE_MAX / 8, &light));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_texture_split(&image, &sign, 1, NAN, &part, 1, &count));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_texture_split(&image, &sign, 1, -0.1f, &part, 1, &count));
    /* Images. */
    bad = image, bad.linear = NULL;
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_texture_lights(&bad, &sign, 1, &light));
    bad = image, bad.srgb = bytes;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_texture_lights(&bad, &sign, 1, &light));
    bad = image, bad.linear = (const GirandoleVec3 *)(const void *)((const char *)texels + 1);
    EXPECT(GIRANDOLE_ERROR_MISALIGNED, girandole_texture_lights(&bad, &sign, 1, &light));
    bad = image, bad.width = bad.height = UINT32_MAX;
    EXPECT(GIRANDOLE_ERROR_BAD_LENGTH, girandole_texture_lights(&bad, &sign, 1, &light));
    bad = image, bad.wrap[1] = 3;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_texture_lights(&bad, &sign, 1, &light));
    bad = image, bad.width = 0;
    EXPECT(700, girandole_texture_lights(&bad, &sign, 1, &light));
    bad.linear = NULL, bad.srgb = bytes;
    EXPECT(700, girandole_texture_lights(&bad, &sign, 1, &light));
    texels[3].z = -1.0f;
    EXPECT(700, girandole_texture_lights(&image, &sign, 1, &light));
    texels[3].z = 0.0f;
    /* Surfaces; a good one comes before the bad one. */
    list[1].white = bulb(1.0f);
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_texture_split(&image, list, 2, 0.1f, &part, 1, &count));
    REQUIRE(strstr(girandole_last_error_message(), "surface 1") != NULL);
    list[1] = sign, list[1].white.two_sided = 2;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_texture_lights(&image, list, 2, &light));
    list[1] = sign, list[1].white.emission.y = NAN;
    EXPECT(100, girandole_texture_lights(&image, list, 2, &light));
    list[1] = sign, list[1].white.range = 0.0f;
    EXPECT(100, girandole_texture_lights(&image, list, 2, &light));
    list[1] = sign, list[1].tex_coords[2].x = INFINITY;
    EXPECT(700, girandole_texture_lights(&image, list, 2, &light));
    REQUIRE(count == 7 && part.white.range == 77.0f && light.emission.x == 77.0f);
    /* Too many surfaces for the array. */
    list[1] = sign;
    EXPECT(GIRANDOLE_ERROR_NO_SPACE, girandole_texture_split(&image, list, 2, 0.1f, &part, 1, &count));
    REQUIRE(count == 2 && part.white.range == 77.0f);
    /* No surface, no pointers. */
    EXPECT(GIRANDOLE_OK, girandole_texture_split(&image, NULL, 0, 0.1f, NULL, 0, &count));
    EXPECT(GIRANDOLE_OK, girandole_texture_lights(&image, NULL, 0, NULL));
    REQUIRE(count == 0);
    /* Coordinates far beyond the image are ordinary. */
    for (i = 0; i < 3; i++) {
        bad = image, bad.wrap[0] = bad.wrap[1] = (GirandoleWrap)i;
        list[0] = sign, list[0].tex_coords[0].x = 3e38f, list[0].tex_coords[1].y = -3e38f;
        EXPECT(GIRANDOLE_OK, girandole_texture_split(&bad, list, 2, 0.0f, parts, 2, &count));
        EXPECT(GIRANDOLE_OK, girandole_texture_lights(&bad, parts, 1, &light));
        REQUIRE(light.emission.x >= 0.0f && light.emission.x <= 81.0f);
    }
}

static void shaders(void)
{
    GirandoleTarget target, bad;
    GirandoleShader *shader = NULL;
    GirandoleKernel kernel;
    GirandoleBindTarget far = {0, 0, 256, 0};
    const char *text = "@compute @workgroup_size(1) fn main() {}";
    const char *sampled = "@group(0) @binding(0) var t: texture_2d<f32>; @group(0) @binding(1) var s: sampler;"
                          "@fragment fn f() -> @location(0) vec4<f32> { return textureSample(t, s, vec2(0.5)); }";
    const char *external = "@group(0) @binding(0) var t: texture_external;"
                           "@fragment fn f() -> @location(0) vec4<f32> { return textureLoad(t, vec2(0, 0)); }";
    const char *immediate = "var<immediate> i: vec4<f32>;"
                            "@fragment fn f() -> @location(0) vec4<f32> { return i; }";

    memset(&target, 0, sizeof target);
    target.language = GIRANDOLE_LANGUAGE_SPIRV;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_kernel(girandole_kernel_count(), &kernel));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_kernel_shader(UINT32_MAX, &target, &shader));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_translate(NULL, &target, &shader));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_translate(text, NULL, &shader));
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_translate(text, &target, NULL));
    EXPECT(GIRANDOLE_ERROR_WGSL, girandole_translate("fn main( {", &target, &shader));
    EXPECT(GIRANDOLE_ERROR_WGSL, girandole_translate("fn f() -> u32 { return 1.5f; }", &target, &shader));
    EXPECT(GIRANDOLE_ERROR_BAD_TEXT, girandole_translate("// \xff\xfe", &target, &shader));
    EXPECT(GIRANDOLE_ERROR_TRANSLATION, girandole_translate("fn f() {}", &target, &shader));
    bad = target, bad.language = 4;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_translate(text, &bad, &shader));
    bad = target, bad.major_version = 9;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_translate(text, &bad, &shader));
    bad = target, bad.flags = 2;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_translate(text, &bad, &shader));
    bad = target, bad.entry_point = "other";
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_translate(text, &bad, &shader));
    bad = target, bad.binding_count = 1;
    EXPECT(GIRANDOLE_ERROR_NULL, girandole_translate(text, &bad, &shader));
    bad = target, bad.language = GIRANDOLE_LANGUAGE_HLSL, bad.bindings = &far, bad.binding_count = 1;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_kernel_shader(0, &bad, &shader));
    EXPECT(GIRANDOLE_ERROR_TRANSLATION, girandole_shader_include(GIRANDOLE_ALL_EFFECTS, 1, 0, &target, &shader));
    bad = target, bad.language = GIRANDOLE_LANGUAGE_HLSL;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_shader_include(1u << 16, 1, 0, &bad, &shader));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_shader_include(0, 1000, 0, &bad, &shader));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_shader_include(0, 1, 7, &bad, &shader));
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_shader_include(0, 255, 0, &bad, &shader));
    bad.minor_version = 99, bad.major_version = 1, bad.language = GIRANDOLE_LANGUAGE_MSL;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_translate(text, &bad, &shader));
    bad = target, bad.language = GIRANDOLE_LANGUAGE_WGSL, bad.bindings = &far, bad.binding_count = 1;
    EXPECT(GIRANDOLE_ERROR_BAD_VALUE, girandole_translate(text, &bad, &shader));
    /* Valid texts that naga cannot write. */
    EXPECT(GIRANDOLE_ERROR_TRANSLATION, girandole_translate(external, &target, &shader));
    bad = target, bad.language = GIRANDOLE_LANGUAGE_HLSL;
    EXPECT(GIRANDOLE_ERROR_TRANSLATION, girandole_translate(sampled, &bad, &shader));
    REQUIRE(strstr(girandole_last_error_message(), "sampler") != NULL);
    EXPECT(GIRANDOLE_ERROR_TRANSLATION, girandole_translate(immediate, &bad, &shader));
    REQUIRE(shader == NULL);
    EXPECT(GIRANDOLE_OK, girandole_translate(sampled, &target, &shader));
    girandole_shader_destroy(shader);
    EXPECT(GIRANDOLE_OK, girandole_translate(text, &target, &shader));
    girandole_shader_destroy(shader);
}

int main(void)
{
    GirandoleWorld *world = NULL;
    const GirandoleLight bulbs[2] = {bulb(10.0f), bulb(20.0f)};
    const GirandolePlacement place = girandole_placement_at(0.0, 0.0, 0.0);
    uint64_t tree = 0, instance = 0;

    EXPECT(GIRANDOLE_ERROR_NULL, girandole_world_create(NULL));
    EXPECT(GIRANDOLE_OK, girandole_world_create(&world));
    EXPECT(GIRANDOLE_OK, girandole_world_add_tree(world, bulbs, 2, &tree));
    EXPECT(GIRANDOLE_OK, girandole_world_add_instance(world, tree, &place, NULL, &instance));
    EXPECT(GIRANDOLE_OK, girandole_world_update(world, 300.0, NULL));
    edits(world, tree, instance);
    sampling(world);
    regions(world);
    plans(world);
    sources(world);
    textures();
    shaders();
    girandole_world_destroy(world);
    /* NULL may be destroyed. */
    girandole_world_destroy(NULL);
    girandole_planner_destroy(NULL);
    girandole_plan_destroy(NULL);
    girandole_reader_destroy(NULL);
    girandole_cursor_destroy(NULL);
    girandole_shader_destroy(NULL);
    girandole_blob_destroy(NULL);
    girandole_readback_destroy(NULL);
    printf("%d refusals differ from what is expected\n", failures);
    return failures != 0;
}
