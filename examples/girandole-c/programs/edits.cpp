// Edits of a world from C++: every kind of light, skies, windows and signs, moves, factors, masks, lights that
// come and go, baked trees, regions, a moving origin, and sampling on several threads.
//
// Each step is compared with a closed form or with the sum over all lights. The program ends with 1 at the
// first difference.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <stdexcept>
#include <thread>

#include "girandole.hpp"

using namespace girandole;

namespace {

const double PI = 3.14159265358979323846;
// Rounding of single precision over a few dozen operations, also 1,024 m from the origin.
const double ROUNDING = 1e-4;
// Standard errors that a mean may be off by. A normal variable is outside with a probability of 5.7e-7; the
// program compares 6 means, with fixed random numbers, so a wrong alarm after a change of these numbers has a
// probability of 4e-6.
const double SIGMAS = 5.0;

void require(bool holds, const std::string &what) {
    if (!holds) throw std::runtime_error(what);
}

void require_near(double given, double expected, const std::string &what) {
    require(std::fabs(given - expected) <= ROUNDING * std::fabs(expected),
            what + ": " + std::to_string(given) + " instead of " + std::to_string(expected));
}

// PCG with a fixed seed.
struct Random {
    uint32_t state = 1;
    float next() {
        state = state * 747796405u + 2891336453u;
        uint32_t word = ((state >> ((state >> 28) + 4)) ^ state) * 277803737u;
        return static_cast<float>(((word >> 22) ^ word) >> 8) / 16777216.0f;
    }
};

uint64_t add_tree(GirandoleWorld *world, const std::vector<GirandoleLight> &lights) {
    uint64_t key = 0;
    check(girandole_world_add_tree(world, lights.data(), lights.size(), &key));
    return key;
}

uint64_t add_instance(GirandoleWorld *world, uint64_t tree, double x, double y, double z) {
    const GirandolePlacement at = girandole_placement_at(x, y, z);
    uint64_t key = 0;
    check(girandole_world_add_instance(world, tree, &at, nullptr, &key));
    return key;
}

void update(GirandoleWorld *world) { check(girandole_world_update(world, 300.0, nullptr)); }

// The mean of many samples against the sum over all lights, and each pmf against girandole_world_pmf.
void require_unbiased(const GirandoleWorld *world, const GirandoleShadingPoint &point, const std::string &what) {
    const size_t count = 20000;
    const std::vector<GirandoleShadingPoint> points(count, point);
    std::vector<float> u(4 * count);
    Random random;
    for (auto &x : u) x = random.next();
    std::vector<GirandoleSample> samples(count);
    check(girandole_world_sample(world, points.data(), u.data(), count, samples.data()));
    double sum = 0.0, sum_sq = 0.0;
    std::vector<GirandoleLightId> ids;
    for (const auto &s : samples) {
        const auto n = point.normal, d = s.direction;
        const double lux = s.radiance.y * (n.x * d.x + n.y * d.y + n.z * d.z) * s.weight;
        sum += lux;
        sum_sq += lux * lux;
        ids.push_back(s.light);
    }
    std::vector<float> pmf(count);
    check(girandole_world_pmf(world, points.data(), ids.data(), count, pmf.data()));
    for (size_t i = 0; i < count; i++) {
        if (samples[i].pmf > 0.0f) require_near(pmf[i], samples[i].pmf, what + ", pmf");
    }
    const double mean = sum / count, exact = exhaustive_lux(world, point);
    const double error = std::sqrt((sum_sq / count - mean * mean) / count);
    require(std::fabs(mean - exact) <= SIGMAS * error + ROUNDING * exact,
            what + ": mean " + std::to_string(mean) + ", sum " + std::to_string(exact));
    std::printf("%s: %.4f lux from samples, %.4f lux as the sum\n", what.c_str(), mean, exact);
}

void closed_forms() {
    auto world = make_world();
    const auto up = girandole_surface_point(vec3(0, 0, 0), vec3(0, 1, 0));
    const auto sphere = add_tree(world.get(), {girandole_sphere_light(vec3(0, 5, 0), 0.5f, grey(100))});
    const auto instance = add_instance(world.get(), sphere, 0, 0, 0);
    update(world.get());
    // A sphere of radius r and radiance L, straight above: pi L (r / d)^2. All its samples are equal in weight
    // and differ in the cosine, so the mean over a grid of numbers is taken.
    double lux = 0.0;
    const int steps = 64;
    for (int i = 0; i < steps * steps; i++) {
        const float u[] = {0.5f, 0.5f, (i % steps + 0.5f) / steps, (i / steps + 0.5f) / steps};
        GirandoleSample s;
        check(girandole_world_sample(world.get(), &up, u, 1, &s));
        require(s.is_delta == 0 && s.light.key == instance && s.light.light == 0, "the sphere was not chosen");
        lux += s.radiance.y * s.direction.y * s.weight / (steps * steps);
    }
    require_near(lux, PI * 100 * 0.01, "sphere");

    // The factor of an instance multiplies, and a disabled instance is dark.
    const auto emission = [&] {
        GirandoleSample s;
        const float u[] = {0.5f, 0.5f, 0.5f, 0.5f};
        check(girandole_world_sample(world.get(), &up, u, 1, &s));
        return s.light.kind == GIRANDOLE_ID_NONE ? 0.0f : s.radiance.y;
    };
    check(girandole_world_set_factor(world.get(), instance, vec3(1, 0.25f, 0)));
    require_near(emission(), 25.0, "factor");
    check(girandole_world_set_enabled(world.get(), instance, 0));
    require(emission() == 0.0f, "a disabled instance shines");
    check(girandole_world_set_enabled(world.get(), instance, 1));
    check(girandole_world_set_mask(world.get(), instance, 2));
    require_near(emission(), 25.0, "mask");
    auto masked = up;
    masked.mask = 1;
    GirandoleSample s;
    const float u[] = {0.5f, 0.5f, 0.5f, 0.5f};
    check(girandole_world_sample(world.get(), &masked, u, 1, &s));
    require(s.light.kind == GIRANDOLE_ID_NONE && s.weight == 0.0f, "a mask hides nothing");
    check(girandole_world_set_user_data(world.get(), instance, 77));
    check(girandole_world_sample(world.get(), &up, u, 1, &s));
    require(s.user_data == 77, "user data");

    // The density of a direction to a hit is that of the sample.
    const auto hit = vec3(s.direction.x * s.dist, s.direction.y * s.dist, s.direction.z * s.dist);
    float pdf = 0.0f;
    check(girandole_world_pdf(world.get(), &up, &s.light, &hit, 1, &pdf));
    require_near(pdf, s.pmf * s.pdf, "pdf");

    // A directional light of 10 lux, 60 degrees from the zenith.
    check(girandole_world_remove_instance(world.get(), instance));
    check(girandole_world_remove_tree(world.get(), sphere));
    const GirandoleDirectionalLight moon = {vec3(std::sqrt(0.75f), -0.5f, 0), grey(10)};
    uint64_t key = 0;
    check(girandole_world_add_directional(world.get(), &moon, &key));
    require_near(exhaustive_lux(world.get(), up), 5.0, "directional light");
    check(girandole_world_remove_directional(world.get(), key));
    require(exhaustive_lux(world.get(), up) == 0.0, "a removed directional light shines");
}

void sky_and_profiles() {
    auto world = make_world();
    const auto up = girandole_surface_point(vec3(0, 0, 0), vec3(0, 1, 0));
    const auto mean = [&] {
        double lux = 0.0;
        const int count = 20000;
        Random random;
        for (int i = 0; i < count; i++) {
            const float u[] = {random.next(), random.next(), random.next(), random.next()};
            GirandoleSample s;
            check(girandole_world_sample(world.get(), &up, u, 1, &s));
            lux += s.radiance.y * s.direction.y * s.weight / count;
        }
        return lux;
    };
    // An even sky of 50 nits: pi times its radiance.
    std::vector<GirandoleVec3> pixels(64 * 32, grey(50));
    uint64_t sky = 0;
    check(girandole_world_set_sky(world.get(), 64, 32, pixels.data(), &sky));
    update(world.get());
    require(std::fabs(mean() / (PI * 50) - 1.0) < 0.02, "an even sky");
    // Black but for the uppermost row, which has a solid angle of 2 pi (1 - cos(pi / 32)).
    std::vector<GirandoleVec3> black(64 * 31, grey(0));
    check(girandole_world_set_sky_part(world.get(), 0, 1, 64, 31, black.data()));
    require(std::fabs(mean() / (PI * 50 * std::pow(std::sin(PI / 32), 2)) - 1.0) < 0.02, "a part of the sky");
    require(girandole_world_set_sky_part(world.get(), 60, 0, 5, 1, black.data()) == 1302, "a part beyond the map");
    require(girandole_world_set_sky(world.get(), 0, 32, pixels.data(), &sky) == 1300, "a sky without columns");
    // A file of one pixel: 32 nits, since its exponent 134 stands for 2^6.
    const std::string map = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\x80\x80\x80\x86";
    const auto map_bytes = reinterpret_cast<const uint8_t *>(map.data());
    uint64_t same = 0;
    check(girandole_world_set_sky_hdr(world.get(), map_bytes, map.size(), &same));
    require(same == sky, "another map has another key");
    require(std::fabs(mean() / (PI * 32) - 1.0) < 0.02, "a sky of a file");
    require(girandole_world_set_sky_hdr(world.get(), map_bytes, 20, &same) == 700, "a map that ends early");
    check(girandole_world_remove_instance(world.get(), sky));

    // A lamp 4 m above, turned to shine down: 300 candela straight below, half of it at the edge of its beam.
    const std::string file = "TILT=NONE\n1 -1 3 2 1 1 2 0 0 0 1 1 0\n0 45\n0\n100 50\n";
    uint64_t profile = 0, again = 0;
    const auto bytes = reinterpret_cast<const uint8_t *>(file.data());
    check(girandole_profile_from_ies(bytes, file.size(), &profile));
    check(girandole_profile_from_ies(bytes, file.size(), &again));
    require(profile == again && profile != 0, "equal profiles");
    const float half = std::sqrt(0.5f);
    const GirandoleVec4 down = {-half, 0, 0, half};
    const auto lamp = girandole_profile_light(vec3(0, 4, 0), down, profile, vec3(1, 2, 1));
    const auto tree = add_tree(world.get(), {lamp});
    add_instance(world.get(), tree, 0, 0, 0);
    update(world.get());
    require_near(exhaustive_lux(world.get(), up), 2 * 300 / 16.0, "straight below a lamp with a profile");
    const auto beside = girandole_surface_point(vec3(0, 0, 5), vec3(0, 1, 0));
    require(exhaustive_lux(world.get(), beside) == 0.0, "beyond the beam of a profile");
    require(girandole_profile_from_ies(bytes, 30, &profile) == 700 && profile == again, "a file that ends early");
    require(girandole_world_set_light_source(world.get(), tree, GIRANDOLE_SOURCE_GPU_MESH) ==
                GIRANDOLE_ERROR_PROFILE_ON_GPU, "a kernel writes a light with a profile");
    auto unknown = lamp;
    unknown.shape.profile.profile ^= 1;
    uint64_t refused = 0;
    require(girandole_world_add_tree(world.get(), &unknown, 1, &refused) == GIRANDOLE_ERROR_BAD_VALUE, "no profile");
    std::printf("sky and profiles: as their closed forms\n");
}

void windows() {
    auto world = make_world();
    std::vector<GirandoleVec3> pixels(64 * 32, grey(50));
    uint64_t sky = 0;
    check(girandole_world_set_sky(world.get(), 64, 32, pixels.data(), &sky));
    update(world.get());
    // A room of 2.2 x 2.2 x 2.2 m around (1, 0, 0). Its wall at x = 2 has a window of 1.2 x 1.6 m.
    GirandolePortal window = {{2, 0, 0}, vec3(0, 0.6f, 0), vec3(0, 0, 0.8f), girandole_placement_at(1, 0, 0)};
    window.room.axes[0] = vec3(1.1f, 0, 0);
    window.room.axes[1] = vec3(0, 1.1f, 0);
    window.room.axes[2] = vec3(0, 0, 1.1f);
    // On the opposite wall, facing the window.
    const auto wall = girandole_surface_point(vec3(0, 0, 0), vec3(1, 0, 0));
    const int count = 20000;
    // The mean of what comes in through the window, its standard error, and the share of samples that do so.
    struct Seen { double lux, error, share; };
    const auto seen = [&] {
        double sum = 0.0, sum_sq = 0.0, through = 0.0;
        Random random;
        for (int i = 0; i < count; i++) {
            const float u[] = {random.next(), random.next(), random.next(), random.next()};
            GirandoleSample s;
            check(girandole_world_sample(world.get(), &wall, u, 1, &s));
            const auto d = s.direction;
            if (s.weight == 0.0f || std::fabs(d.y) > 0.3f * d.x || std::fabs(d.z) > 0.4f * d.x) continue;
            const double lux = s.radiance.y * d.x * s.weight;
            sum += lux;
            sum_sq += lux * lux;
            through += 1.0;
        }
        const double mean = sum / count;
        return Seen{mean, std::sqrt((sum_sq / count - mean * mean) / count), through / count};
    };
    // Four times the form factor of a rectangle parallel to the wall, whose corner is opposite to the point.
    const double a = 0.3, b = 0.4, root_a = std::sqrt(1 + a * a), root_b = std::sqrt(1 + b * b);
    const double exact = 50 * 2 * (a / root_a * std::atan(b / root_a) + b / root_b * std::atan(a / root_b));
    const auto effects = [&] {
        GirandoleCounts counts;
        check(girandole_world_counts(world.get(), &counts));
        return counts.effects & GIRANDOLE_EFFECT_PORTALS;
    };
    const Seen before = seen();
    require(effects() == 0, "portals before there are any");
    check(girandole_world_set_portals(world.get(), &window, 1));
    require(effects() != 0, "no effect of portals");
    const Seen with = seen();
    for (const auto &of : {before, with}) {
        require(std::fabs(of.lux - exact) <= SIGMAS * of.error,
                "a window: mean " + std::to_string(of.lux) + ", closed form " + std::to_string(exact));
    }
    require(with.share > 2 * before.share && with.error < 0.7 * before.error, "a portal lowers no noise");

    // What is refused leaves the portal.
    const std::vector<GirandolePortal> many(33, window);
    require(girandole_world_set_portals(world.get(), many.data(), many.size()) == 1304, "33 portals");
    auto bad = window;
    bad.center.y = NAN;
    require(girandole_world_set_portals(world.get(), &bad, 1) == 1305, "a portal without a place");
    bad = window;
    bad.room.axes[2] = bad.room.axes[1];
    require(girandole_world_set_portals(world.get(), &bad, 1) == 1305, "a room without a volume");
    require(girandole_world_set_portals(world.get(), nullptr, 1) == GIRANDOLE_ERROR_NULL, "no portal");
    require(seen().lux == with.lux, "a refused portal changes the light");
    check(girandole_world_set_portals(world.get(), nullptr, 0));
    require(seen().lux == before.lux, "portals that were removed");
    // Effects end a while after their cause, so that shaders are not made again and again.
    for (int i = 0; i < 200 && effects() != 0; i++) update(world.get());
    require(effects() == 0, "an effect of portals that were removed");
    std::printf("window: %.2f lux from samples, %.2f lux in closed form; %.0f %% of samples pass, %.0f %% without it\n",
                with.lux, exact, 100 * with.share, 100 * before.share);
}

void signs() {
    // Of 32 rows, the eight from row 8 on are white: a quarter of the image.
    const auto bar = [](uint32_t first) {
        std::vector<GirandoleVec3> texels(64 * 32, grey(0));
        std::fill_n(texels.begin() + 64 * first, 64 * 8, grey(1));
        return texels;
    };
    const auto texels = bar(8);
    GirandoleTexture image = {};
    image.linear = texels.data();
    image.width = 64, image.height = 32;
    // 4 m wide, 2 m high; white has 900 nits.
    const GirandoleTexturedSurface sign = {
        girandole_parallelogram_light(vec3(0, 0, 0), vec3(2, 0, 0), vec3(0, 1, 0), grey(900)),
        {{0, 1}, {1, 1}, {0, 0}},
    };
    std::vector<GirandoleTexturedSurface> parts(100, sign);
    size_t count = 0;
    check(girandole_texture_split(&image, &sign, 1, 0.1f, parts.data(), parts.size(), &count));
    // The lower quarters are dark, and each of the upper ones is cut into two lit parts and two dark ones.
    require(count == 10, "parts: " + std::to_string(count));
    std::vector<GirandoleLight> lights(count);
    check(girandole_texture_lights(&image, parts.data(), count, lights.data()));
    const auto candela = [&] {
        double sum = 0.0;
        for (const auto &light : lights) {
            const auto u = light.shape.parallelogram.half_u, v = light.shape.parallelogram.half_v;
            sum += 4.0 * u.x * v.y * light.emission.y;
        }
        return sum;
    };
    require_near(candela(), 8 * 900 / 4.0, "the intensity of all parts");
    size_t lit = 0;
    for (size_t i = 0; i < count; i++) {
        const auto *at = parts[i].tex_coords;
        const bool is_bar = at[0].y <= 0.5f && at[2].y >= 0.25f;
        require_near(lights[i].emission.y, is_bar ? 900 : 0, "a part");
        lit += is_bar;
    }
    require(lit == 4, "lit parts: " + std::to_string(lit));

    // The same image in bytes, and the whole sign as one light.
    std::vector<uint8_t> bytes(4 * 64 * 32, 0);
    std::fill_n(bytes.begin() + 4 * 64 * 8, 4 * 64 * 8, uint8_t{255});
    GirandoleTexture encoded = {};
    encoded.srgb = bytes.data();
    encoded.width = 64, encoded.height = 32;
    GirandoleLight whole;
    check(girandole_texture_lights(&encoded, &sign, 1, &whole));
    require_near(whole.emission.y, 900 / 4.0, "the average of a sign");

    // In a world, 1 km away: the intensity over the square of the distance. The next frame moves the bar down.
    auto world = make_world();
    const auto tree = add_tree(world.get(), lights);
    add_instance(world.get(), tree, 0, 0, 0);
    update(world.get());
    const auto far = girandole_surface_point(vec3(0, 0, 1000), vec3(0, 0, -1));
    require_near(exhaustive_lux(world.get(), far), 1800e-6, "a sign");
    const auto next = bar(16);
    image.linear = next.data();
    check(girandole_texture_lights(&image, parts.data(), count, lights.data()));
    require_near(candela(), 1800, "the next frame");
    std::vector<uint32_t> indices;
    for (uint32_t i = 0; i < count; i++) indices.push_back(i);
    check(girandole_world_set_lights(world.get(), tree, indices.data(), lights.data(), count));
    update(world.get());
    require_near(exhaustive_lux(world.get(), far), 1800e-6, "a sign in its next frame");
    GirandoleCounts counts;
    check(girandole_world_counts(world.get(), &counts));
    require(counts.lights == 10, "lights of a sign");
    std::printf("signs: as their closed forms\n");
}

void every_kind() {
    auto world = make_world();
    auto lamp = girandole_point_light(vec3(0, 3, 0), grey(100));
    lamp.range = 30.0f;
    auto panel = girandole_parallelogram_light(vec3(2, 3, 0), vec3(0.1f, 0, 0), vec3(0, 0, 0.1f), grey(1000));
    panel.two_sided = 1;
    const auto tree = add_tree(world.get(), {
        lamp,
        girandole_spot_light(vec3(1, 3, 1), vec3(0, -1, 0), 0.3f, 0.9f, grey(500)),
        panel,
        girandole_triangle_light(vec3(3, 3, 0), vec3(3.2f, 3, 0), vec3(3, 3, 0.2f), grey(1000)),
        girandole_sphere_light(vec3(-2, 3, 0), 0.05f, grey(3000)),
    });
    std::vector<uint64_t> instances;
    for (int i = 0; i < 50; i++) instances.push_back(add_instance(world.get(), tree, 3 * (i % 10), 0, 3 * (i / 10)));
    update(world.get());
    GirandoleCounts counts;
    check(girandole_world_counts(world.get(), &counts));
    require(counts.trees == 1 && counts.instances == 50 && counts.lights == 250, "counts");
    const auto ground = girandole_surface_point(vec3(7, 0, 5), vec3(0, 1, 0));
    require(all_lights(world.get()).size() == 250, "lights");

    // The probabilities of all lights sum up to 1 minus the probability of a sample without a light.
    const auto ids = all_lights(world.get());
    const std::vector<GirandoleShadingPoint> points(ids.size(), ground);
    std::vector<float> pmf(ids.size());
    check(girandole_world_pmf(world.get(), points.data(), ids.data(), ids.size(), pmf.data()));
    double sum = 0.0;
    for (const float p : pmf) sum += p;
    require(sum <= 1.0 + ROUNDING, "the probabilities sum up to " + std::to_string(sum));

    // All samples on many threads at once are those of one thread.
    const size_t count = 1000;
    const std::vector<GirandoleShadingPoint> many(count, ground);
    std::vector<float> u(5 * count);
    Random random;
    for (auto &x : u) x = random.next();
    // A sample has no light also where the chosen light sends nothing, so the share of those with one may be smaller.
    std::vector<GirandoleSample> lit(count);
    check(girandole_world_sample(world.get(), many.data(), u.data(), count, lit.data()));
    size_t with_light = 0;
    for (const auto &sample : lit) with_light += sample.light.kind != GIRANDOLE_ID_NONE;
    const double share = double(with_light) / count;
    require(share > 0.5 && share <= sum + SIGMAS * std::sqrt(share * (1.0 - share) / count) + ROUNDING,
            "a share of " + std::to_string(share) + " has a light, and the probabilities sum up to " + std::to_string(sum));
    std::printf("probabilities: sum %.4f, share of samples with a light %.4f\n", sum, share);
    std::vector<std::vector<GirandoleSample>> results(4, std::vector<GirandoleSample>(count));
    // The first call after a change builds the top level; all threads try it.
    check(girandole_world_set_user_data(world.get(), instances[0], 1));
    std::vector<std::thread> threads;
    for (auto &result : results) {
        threads.emplace_back([&] {
            check(girandole_world_resample(world.get(), 8, many.data(), u.data(), count, result.data()));
        });
    }
    for (auto &thread : threads) thread.join();
    for (size_t i = 0; i < count; i++) {
        for (const auto &result : results) {
            const auto &a = results[0][i], &b = result[i];
            require(a.light.key == b.light.key && a.light.light == b.light.light && a.weight == b.weight, "threads");
        }
    }
}

void moves_and_edits() {
    auto world = make_world();
    std::vector<GirandoleLight> bulbs;
    for (int i = 0; i < 20; i++) bulbs.push_back(girandole_point_light(vec3(0.3f * i, 4, 0), grey(20.0f + i)));
    const auto tree = add_tree(world.get(), bulbs);
    std::vector<uint64_t> instances;
    for (int i = 0; i < 200; i++) instances.push_back(add_instance(world.get(), tree, i, 0, i % 7));
    update(world.get());
    const auto ground = girandole_surface_point(vec3(20, 0, 3), vec3(0, 1, 0));
    require_unbiased(world.get(), ground, "built");

    // All instances turn by a quarter about the vertical axis and move; then the lights dim.
    std::vector<GirandolePlacement> places;
    for (size_t i = 0; i < instances.size(); i++) {
        auto place = girandole_placement_at(0.5 * i, 0.1 * i, 0.0);
        place.axes[0] = vec3(0, 0, -1);
        place.axes[2] = vec3(1, 0, 0);
        places.push_back(place);
    }
    check(girandole_world_move_instances(world.get(), instances.data(), places.data(), instances.size()));
    update(world.get());
    require_unbiased(world.get(), ground, "moved");
    std::vector<uint32_t> indices;
    for (uint32_t i = 0; i < 10; i++) {
        indices.push_back(i);
        bulbs[i].emission = grey(1);
    }
    const double before = exhaustive_lux(world.get(), ground);
    check(girandole_world_set_lights(world.get(), tree, indices.data(), bulbs.data(), indices.size()));
    update(world.get());
    require(exhaustive_lux(world.get(), ground) < before, "dimmed lights are as bright as before");
    require_unbiased(world.get(), ground, "dimmed");

    // Lights come and go, without a build.
    const GirandoleLight flashes[] = {girandole_point_light(vec3(0, 2, 0), grey(200)),
                                      girandole_point_light(vec3(1, 2, 0), grey(300))};
    uint32_t added[2];
    check(girandole_world_add_lights(world.get(), tree, flashes, 2, added));
    update(world.get());
    require_unbiased(world.get(), ground, "two lights added");
    check(girandole_world_remove_lights(world.get(), tree, added, 1));
    update(world.get());
    GirandoleTreeLight removed;
    size_t count = 0;
    check(girandole_world_removed_lights(world.get(), &removed, 1, &count));
    require(count == 1 && removed.tree == tree && removed.light == added[0], "the removed light is not listed");
    require_unbiased(world.get(), ground, "one light removed");
    size_t existing = 0, all = 0;
    check(girandole_world_tree_lights(world.get(), tree, &existing, &all));
    require(existing == 21 && all == 22, "numbers of lights");

    // A baked tree gives the same bytes again, and the same samples.
    const auto baked = make<GirandoleBlob>(
        [&](GirandoleBlob **it) { return girandole_world_bake_tree(world.get(), tree, it); });
    const uint8_t *bytes = nullptr;
    size_t size = 0;
    check(girandole_blob_bytes(baked.get(), &bytes, &size));
    auto other = make_world();
    uint64_t loaded = 0;
    check(girandole_world_add_baked(other.get(), bytes, size, &loaded));
    for (const auto &place : places) {
        uint64_t key = 0;
        check(girandole_world_add_instance(other.get(), loaded, &place, nullptr, &key));
    }
    update(other.get());
    require_near(exhaustive_lux(other.get(), ground), exhaustive_lux(world.get(), ground), "baked");
    const auto again = make<GirandoleBlob>(
        [&](GirandoleBlob **it) { return girandole_world_bake_tree(other.get(), loaded, it); });
    const uint8_t *same = nullptr;
    size_t same_size = 0;
    check(girandole_blob_bytes(again.get(), &same, &same_size));
    require(same_size == size && std::memcmp(same, bytes, size) == 0, "a baked tree changes when it is loaded");
}

void far_away() {
    auto world = make_world();
    const auto tree = add_tree(world.get(), {girandole_point_light(vec3(0, 2, 0), grey(8))});
    const auto instance = add_instance(world.get(), tree, 1.0e6 + 1.0, 0, 0);
    const auto reader = make<GirandoleReader>(girandole_reader_create);
    GirandoleChanges changes;
    check(girandole_reader_read(reader.get(), world.get(), &changes));
    require(changes.added_count == 1 && changes.origin_shift.x == 0.0, "the first call names all instances");
    check(girandole_world_set_origin_near(world.get(), GirandoleDVec3{1.0e6, 0, 0}));
    update(world.get());
    check(girandole_reader_read(reader.get(), world.get(), &changes));
    GirandoleDVec3 origin;
    check(girandole_world_origin(world.get(), &origin));
    require(changes.added_count == 0 && changes.origin_shift.x == origin.x && std::fmod(origin.x, 1024.0) == 0.0, "the origin is not on the grid");
    const auto below = girandole_surface_point(vec3(static_cast<float>(1.0e6 + 1.0 - origin.x), 0, 0), vec3(0, 1, 0));
    require_near(exhaustive_lux(world.get(), below), 2.0, "a lamp far away");
    uint32_t slot = 0, generation = 0;
    check(girandole_world_instance_slot(world.get(), instance, &slot));
    const GirandoleLightId lamp = {instance, GIRANDOLE_ID_INSTANCE, 0};
    check(girandole_world_generations(world.get(), &lamp, 1, &generation));
    uint64_t same = 0;
    check(girandole_world_instance_at(world.get(), slot, &same));
    require(same == instance && generation >= 1, "slots");
}

// A loader thread fills regions, which the thread of the world adds and removes.
void regions() {
    auto world = make_world();
    auto region = make<GirandoleRegion>(girandole_region_create);
    std::thread loader([&] {
        std::vector<GirandoleLight> lights;
        for (int i = 0; i < 30; i++) lights.push_back(girandole_point_light(vec3(0.2f * i, 3, 0), grey(10)));
        uint32_t built = 0, other = 0;
        check(girandole_region_add_tree(region.get(), lights.data(), lights.size(), &built));
        check(girandole_region_add_tree(region.get(), lights.data(), 20, &other));
        for (int i = 0; i < 12; i++) {
            auto instance = girandole_region_instance(i % 2 ? built : other, girandole_placement_at(3 * i, 0, i));
            instance.user_data = 100 + i;
            instance.factor = grey(i == 0 ? 2 : 1);
            check(girandole_region_add_instance(region.get(), &instance));
        }
    });
    loader.join();
    uint64_t key = 0;
    check(girandole_world_add_region(world.get(), region.get(), &key));
    GirandoleUpdateReport report;
    check(girandole_world_update(world.get(), INFINITY, &report));
    require(report.rebuilt_trees == 0, "the trees of the region are built");
    const auto ground = girandole_surface_point(vec3(10, 0, 5), vec3(0, 1, 0));
    require_unbiased(world.get(), ground, "region");
    uint64_t trees[2], instances[12];
    size_t count = 0;
    check(girandole_world_region_trees(world.get(), key, trees, 2, &count));
    require(count == 2, "trees of the region");
    check(girandole_world_region_instances(world.get(), key, instances, 12, &count));
    require(count == 12, "instances of the region");
    // The first one goes dark.
    const double before = exhaustive_lux(world.get(), ground);
    check(girandole_world_set_factor(world.get(), instances[0], grey(0)));
    require(exhaustive_lux(world.get(), ground) < before, "an instance of the region keeps its light");

    // A refused region keeps its content: here it names a tree that is gone.
    uint32_t index = 0;
    check(girandole_region_add_world_tree(region.get(), 1, &index));
    const auto instance = girandole_region_instance(index, girandole_placement_at(0, 0, 0));
    check(girandole_region_add_instance(region.get(), &instance));
    uint64_t other = 0;
    for (int i = 0; i < 2; i++) {
        require(girandole_world_add_region(world.get(), region.get(), &other) == GIRANDOLE_ERROR_NO_SUCH_TREE,
                "a region with a stale tree is added");
    }
    const auto beyond = girandole_region_instance(index + 1, girandole_placement_at(0, 0, 0));
    require(girandole_region_add_instance(region.get(), &beyond) == 212, "an instance without a tree is added");

    const auto outside = add_instance(world.get(), trees[0], 0, 0, 0);
    require(girandole_world_remove_region(world.get(), key) == GIRANDOLE_ERROR_REGION_IN_USE,
            "a region in use is removed");
    check(girandole_world_remove_instance(world.get(), outside));
    check(girandole_world_remove_region(world.get(), key));
    require(girandole_world_remove_region(world.get(), key) == GIRANDOLE_ERROR_NO_SUCH_REGION,
            "a region is removed twice");
    GirandoleCounts counts;
    check(girandole_world_counts(world.get(), &counts));
    require(counts.trees == 0 && counts.instances == 0 && counts.lights == 0, "a removed region leaves something");
}

}  // namespace

int main() {
    try {
        closed_forms();
        sky_and_profiles();
        windows();
        signs();
        every_kind();
        moves_and_edits();
        far_away();
        regions();
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    std::printf("all edits are as expected\n");
    return 0;
}
