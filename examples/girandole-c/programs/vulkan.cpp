// An engine on Vulkan: plays the plans of the library on its own device, over frames in which lamps move, and
// samples lights in its own shaders.
//
//   vulkan FOLDER [MEASURE.SPV]
//   vulkan --hazard
//
// Writes lights.ppm, a picture of the ground under the lamps, and measure.spv, the shader that was run, into
// FOLDER. Compares the mean of many samples at 16 shading points with the sum over all lights, by the engine's
// shader in WGSL and, if it is given, by the same shader in HLSL that DXC has compiled to SPIR-V. A single lamp
// is compared with the closed form. A kernel writes the lights of a tree on the GPU, which are sampled there, read
// back and rebuilt. --hazard records two writes without a barrier, to show that validation is on.
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <numeric>

#include "girandole.hpp"
#include "shaders.hpp"
#include "vulkan_player.hpp"

using namespace girandole;

namespace {

// Standard errors that a mean may be off by. A normal variable is outside with a probability of 5.7e-7. The
// program compares at most 192 means of 8,192 samples and 12 sums, so a wrong alarm has a probability of 1.2e-4. The random
// numbers are fixed: it either always comes or never.
const double SIGMAS = 5.0;
// Rounding: shaders divide with an error of 2.5 units in the last place and take square roots with more, and a
// sum of 64 terms in single precision is off by up to 64 units in the last place.
const double ROUNDING = 1e-4;

void require(bool holds, const std::string &what) {
    if (!holds) throw std::runtime_error(what);
}

// Lamps on 24 rings, which turn at their own speeds.
struct Scene {
    Owned<GirandoleWorld> world = make_world();
    std::vector<uint64_t> instances;

    Scene() {
        // Lanterns of eight bulbs and a spot each, in six colours.
        const GirandoleVec3 colors[] = {{9, 4, 1}, {1, 4, 9}, {8, 1, 4}, {2, 8, 3}, {6, 6, 5}, {7, 5, 1}};
        std::vector<uint64_t> trees;
        for (const auto color : colors) {
            std::vector<GirandoleLight> lights;
            for (int i = 0; i < 8; i++) {
                const float angle = 0.785398f * static_cast<float>(i), bright = 0.006f * static_cast<float>(i + 4);
                lights.push_back(girandole_point_light(
                    vec3(0.2f * std::cos(angle), 0.0f, 0.2f * std::sin(angle)),
                    vec3(bright * color.x, bright * color.y, bright * color.z)));
                lights.back().range = 6.0f;
            }
            lights.push_back(girandole_spot_light(vec3(0, 0, 0), vec3(0, -1, 0), 0.2f, 0.5f, color));
            uint64_t tree = 0;
            check(girandole_world_add_tree(world.get(), lights.data(), lights.size(), &tree));
            trees.push_back(tree);
        }
        for (size_t i = 0; i < 480; i++) {
            const auto at = place(i, 0.0);
            uint64_t key = 0;
            check(girandole_world_add_instance(world.get(), trees[i % trees.size()], &at, nullptr, &key));
            instances.push_back(key);
        }
    }

    // Where lantern i is at a time in seconds.
    static GirandolePlacement place(size_t i, double time) {
        const size_t ring = i % 24;
        const double radius = 1.0 + 0.9 * static_cast<double>(ring);
        const double angle = 6.2831853 * static_cast<double>(i / 24) / 20.0 + static_cast<double>(ring) +
                             (ring % 2 ? 1.0 : -1.0) * time * 3.0 / radius;
        return girandole_placement_at(radius * std::cos(angle), 0.7 + 0.12 * static_cast<double>(ring % 7),
                                      radius * std::sin(angle));
    }

    void move(double time) {
        std::vector<GirandolePlacement> places;
        for (size_t i = 0; i < instances.size(); i++) places.push_back(place(i, time));
        check(girandole_world_move_instances(world.get(), instances.data(), places.data(), places.size()));
    }
};

// The engine's own text after the library's, as SPIR-V.
Owned<GirandoleShader> engine_shader(uint32_t effects, const char *entry, uint32_t parts = 0) {
    GirandoleTarget target = {};
    target.language = GIRANDOLE_LANGUAGE_WGSL;
    const auto include = make<GirandoleShader>(
        [&](GirandoleShader **it) { return girandole_shader_include(effects, 1, parts, &target, it); });
    GirandoleShaderView view;
    check(girandole_shader_view(include.get(), &view));
    std::string text = std::string(static_cast<const char *>(view.code), view.size) + ENGINE_WGSL + CORNER_WGSL;
    if (parts & GIRANDOLE_SHADER_LEARNS) {
        const std::string mark = "// RECORD";
        text.replace(text.find(mark), mark.size(), "light_record_visibility(ground, s, is_visible);");
    }
    target.language = GIRANDOLE_LANGUAGE_SPIRV;
    target.entry_point = entry;
    return make<GirandoleShader>([&](GirandoleShader **it) { return girandole_translate(text.c_str(), &target, it); });
}

// Runs a shader of the engine once, and returns what it wrote.
std::vector<float> run(vulkan::Device &device, Player &player, const void *code, size_t size, const char *entry,
                       size_t floats, const uint32_t groups[3]) {
    auto pipeline = device.make_pipeline(code, size, entry,
                                         {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER}, Player::binding_types()});
    const auto out = device.make_buffer(4 * floats, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true);
    device.begin();
    device.dispatch(pipeline, {{{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, out.buffer}}, player.bindings()}, groups);
    device.submit_and_wait();
    std::vector<float> result(floats);
    device.read(out, result.data(), 4 * floats);
    device.free_buffer(out);
    device.free_pipeline(pipeline);
    return result;
}

// A shading point: the sum over all lights, and how far a mean of samples may be off.
struct Measured {
    double exact, allowed;
};

// Compares the means of samples with sums over all lights: each on its own, and all together, which finds a bias
// that is too small for one point.
std::vector<Measured> compare(vulkan::Device &device, Player &player, const GirandoleWorld *world, const void *code,
                              size_t size, const char *what, const char *entry = "measure") {
    const bool in_corner = std::string(entry) == "measure_corner";
    const uint32_t groups[] = {INVOCATIONS / 64, POINTS, 1};
    const auto sums = run(device, player, code, size, entry, 4 * POINTS * INVOCATIONS, groups);
    std::vector<Measured> measured;
    double worst = 0.0, sum_z = 0.0;
    for (uint32_t point = 0; point < POINTS; point++) {
        double sum = 0.0, sum_sq = 0.0;
        for (uint32_t i = 0; i < INVOCATIONS; i++) {
            sum += sums[4 * (point * INVOCATIONS + i)];
            sum_sq += sums[4 * (point * INVOCATIONS + i) + 1];
        }
        const double count = double(INVOCATIONS) * SAMPLES, mean = sum / count;
        const double error = std::sqrt(std::fmax(sum_sq / count - mean * mean, 0.0) / count);
        const auto ground = girandole_surface_point(vec3(measured_x(point), 0, measured_z(point)), vec3(0, 1, 0));
        const auto is_seen = [](const GirandoleSample &s) { return std::fmin(s.direction.x, s.direction.z) > 0.0f; };
        const double exact = in_corner ? exhaustive_lux(world, ground, is_seen) : exhaustive_lux(world, ground);
        require(exact > 0.0 && error > 0.0, "no light, or samples without variance");
        const double off = std::fabs(mean - exact), allowed = SIGMAS * error + ROUNDING * exact;
        require(off <= allowed, std::string(what) + ", point " + std::to_string(point) + ": " + std::to_string(mean) +
                                    " lux instead of " + std::to_string(exact));
        worst = std::fmax(worst, off / allowed);
        sum_z += (mean - exact) / error;
        measured.push_back({exact, allowed});
    }
    // The points have independent random numbers, so this is a standard normal variable.
    const double joint = sum_z / std::sqrt(double(POINTS));
    require(std::fabs(joint) <= SIGMAS, std::string(what) + ": all points together are off by " +
                                            std::to_string(joint) + " standard errors");
    std::printf("%s: %u means within %.2f of what is allowed; together %.2f standard errors off\n", what, POINTS,
                worst, joint);
    return measured;
}

// A lamp of 800 candela at 6 m: I h / (h^2 + x^2)^(3/2).
void single_lamp(vulkan::Device &device) {
    auto world = make_world();
    const auto lamp = girandole_point_light(vec3(0, 6, 0), grey(800));
    const auto at = girandole_placement_at(0, 0, 0);
    uint64_t tree = 0, instance = 0;
    check(girandole_world_add_tree(world.get(), &lamp, 1, &tree));
    check(girandole_world_add_instance(world.get(), tree, &at, nullptr, &instance));
    check(girandole_world_update(world.get(), 300.0, nullptr));
    Player player(device);
    player.frame(world.get());
    const auto shader = engine_shader(player.effects(), "measure");
    GirandoleShaderView view;
    check(girandole_shader_view(shader.get(), &view));
    const uint32_t groups[] = {INVOCATIONS / 64, POINTS, 1};
    const auto sums = run(device, player, view.code, view.size, "measure", 4 * POINTS * INVOCATIONS, groups);
    for (uint32_t point = 0; point < POINTS; point++) {
        const double x = measured_x(point), z = measured_z(point);
        const double exact = 800.0 * 6.0 / std::pow(36.0 + x * x + z * z, 1.5);
        const double lux = sums[4 * point * INVOCATIONS] / SAMPLES;
        require(std::fabs(lux / exact - 1.0) <= ROUNDING, "single lamp: " + std::to_string(lux) + " lux instead of " +
                                                              std::to_string(exact));
    }
    std::printf("single lamp: %u points as the closed form says\n", POINTS);
}

// A picture of the ground, with the lanterns as dots.
void picture(vulkan::Device &device, Player &player, GirandoleWorld *world, double time, const std::string &path) {
    const auto shader = engine_shader(player.effects(), "shade");
    GirandoleShaderView view;
    check(girandole_shader_view(shader.get(), &view));
    const uint32_t groups[] = {WIDTH / 8, HEIGHT / 8, 1};
    const auto draw = [&] { return run(device, player, view.code, view.size, "shade", 4 * WIDTH * HEIGHT, groups); };
    player.set_cut_view({0, 7, -17}, 0.65f / 144);
    player.frame(world);
    // Marks the cells in view, which have cuts in the next frame.
    draw();
    player.frame(world);
    auto pixels = draw();
    for (size_t i = 0; i < 480; i++) {
        const auto at = Scene::place(i, time).translation;
        // The inverse of the view in shade.
        const double y = at.y - 7.0, z = at.z + 17.0, ahead = z * 0.90045 - y * 0.43497;
        const double up = y * 0.90045 + z * 0.43497;
        const int px = static_cast<int>(256.0 + 144.0 / 0.65 * at.x / ahead);
        const int py = static_cast<int>(144.0 - 144.0 / 0.65 * up / ahead);
        if (ahead < 0.1 || px < 0 || py < 0 || px + 1 >= int(WIDTH) || py + 1 >= int(HEIGHT)) continue;
        for (int dot = 0; dot < 4; dot++) {
            float *pixel = &pixels[4 * ((py + dot / 2) * WIDTH + px + dot % 2)];
            for (int c = 0; c < 3; c++) pixel[c] += 3.0f;
        }
    }
    std::ofstream file(path, std::ios::binary);
    file << "P6\n" << WIDTH << " " << HEIGHT << "\n255\n";
    double sum = 0.0;
    for (size_t i = 0; i < size_t(WIDTH) * HEIGHT; i++) {
        for (size_t c = 0; c < 3; c++) {
            const float x = pixels[4 * i + c];
            require(std::isfinite(x) && x >= 0.0f, "a pixel is not a number of at least 0");
            sum += x;
            const float shown = 1.0f - std::exp(-0.6f * x);
            file.put(static_cast<char>(static_cast<int>(255.0f * std::pow(shown, 1.0f / 2.2f) + 0.5f)));
        }
    }
    file.close();
    require(!file.fail(), path + " cannot be written");
    require(sum > 0.0, "the picture is black");
}

void write(const std::string &path, const void *bytes, size_t size) {
    std::ofstream file(path, std::ios::binary);
    file.write(static_cast<const char *>(bytes), static_cast<std::streamsize>(size));
    file.close();
    require(!file.fail(), path + " cannot be written");
}

// The engine's text for the effects of the player, which is written to FOLDER/measure.spv.
std::vector<Measured> compare_wgsl(vulkan::Device &device, Player &player, const GirandoleWorld *world,
                                   const char *what, const std::string &folder) {
    const auto shader = engine_shader(player.effects(), "measure");
    GirandoleShaderView view;
    check(girandole_shader_view(shader.get(), &view));
    require(view.binding_count == 8 && view.entry_point_count == 1, "the table of bindings");
    write(folder + "/measure.spv", view.code, view.size);
    return compare(device, player, world, view.code, view.size, what);
}

// Lights that a kernel writes: sampled as they were written, read back, rebuilt on the CPU, and sampled again.
void kernel_lights(vulkan::Device &device, const std::string &folder) {
    auto world = make_world();
    // All at one place, until the kernel has run. The last one is a sphere, which the kernel gets wrong.
    std::vector<GirandoleLight> lights(KERNEL_LIGHTS, girandole_point_light(vec3(0, 2, 0), grey(1)));
    lights.back() = girandole_sphere_light(vec3(0, 2, 0), 0.1f, grey(1));
    const auto at = girandole_placement_at(0, 0, 0);
    const GirandolePolicy policy = {GIRANDOLE_POLICY_ALWAYS_REBUILD, 0, 0};
    uint64_t tree = 0, instance = 0;
    check(girandole_world_add_tree(world.get(), lights.data(), lights.size(), &tree));
    check(girandole_world_add_instance(world.get(), tree, &at, &policy, &instance));
    check(girandole_world_set_light_source(world.get(), tree, GIRANDOLE_SOURCE_GPU_MESH));
    uint32_t number = GIRANDOLE_NO_INDEX;
    check(girandole_world_light_source(world.get(), tree, nullptr, &number));
    require(number == 0, "the number of the first source");

    const auto sources =
        make<GirandoleShader>([](GirandoleShader **it) { return girandole_shader_sources(0, it); });
    GirandoleShaderView view;
    check(girandole_shader_view(sources.get(), &view));
    const std::string text = std::string(static_cast<const char *>(view.code), view.size) + KERNEL_WGSL;
    GirandoleTarget target = {};
    target.language = GIRANDOLE_LANGUAGE_SPIRV;
    const auto kernel = make<GirandoleShader>(
        [&](GirandoleShader **it) { return girandole_translate(text.c_str(), &target, it); });
    check(girandole_shader_view(kernel.get(), &view));
    auto pipeline = device.make_pipeline(view.code, view.size, "put_lights",
                                         {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER}});
    Player player(device);
    const uint32_t groups[] = {KERNEL_LIGHTS / 64, 1, 1};
    const auto frame = [&] {
        check(girandole_world_update(world.get(), 0.0, nullptr));
        player.frame(world.get(), [&] { device.dispatch(pipeline, {player.source_bindings()}, groups); });
    };
    frame();
    const auto wanted = player.apply(player.measures().get(), world.get());
    require(wanted.size() == 1 && wanted[0] == tree, "the policy of the instance wants a rebuild");
    require(player.apply(player.source_parts(2048).get(), world.get()).empty(), "parts name no trees");
    uint64_t refused = 0;
    check(girandole_world_refused_writes(world.get(), tree, &refused));
    require(refused == 1, "the sphere that was written as a point is refused");
    require(player.apply(player.source_lights(tree).get(), world.get()).empty(), "lights name no trees");
    check(girandole_world_update(world.get(), 0.0, nullptr));

    // The world has what the kernel has written.
    for (uint32_t point = 0; point < POINTS; point++) {
        const double x = measured_x(point), z = measured_z(point);
        double exact = 0.0;
        for (uint32_t i = 0; i + 1 < KERNEL_LIGHTS; i++) {
            const double dx = 0.75 * (i % 16) - 6.0 - x, dz = 0.75 * (i / 16) - 6.0 - z, y = 0.5 + 0.125 * (i % 8);
            exact += (1.0 + i % 5) * y / std::pow(dx * dx + y * y + dz * dz, 1.5);
        }
        const auto ground = girandole_surface_point(vec3(measured_x(point), 0, measured_z(point)), vec3(0, 1, 0));
        require(std::fabs(exhaustive_lux(world.get(), ground) / exact - 1.0) <= ROUNDING, "lights that were read back");
    }
    compare_wgsl(device, player, world.get(), "kernel, refitted", folder);
    GirandoleUpdateReport report;
    check(girandole_world_update(world.get(), INFINITY, &report));
    require(report.rebuilt_trees == 1, "the tree is rebuilt from the lights that were read back");
    frame();
    compare_wgsl(device, player, world.get(), "kernel, rebuilt", folder);
    device.free_pipeline(pipeline);
}

// Edits that the measured points see. A lantern gets a factor, one is sheared, one gets a mask, which change the
// layout of records; a tree with an instance comes, and lights come to a tree.
void edit(const Scene &scene, double time) {
    // The lantern next to point 5 shines 20 times brighter.
    const auto dist = [&](size_t i) {
        const auto at = Scene::place(i, time).translation;
        return std::hypot(at.x - measured_x(5), at.y, at.z - measured_z(5));
    };
    size_t nearest = 0;
    for (size_t i = 1; i < scene.instances.size(); i++) {
        if (dist(i) < dist(nearest)) nearest = i;
    }
    const size_t count = scene.instances.size(), other = (nearest + 1) % count, hidden = (nearest + 2) % count;
    GirandoleWorld *world = scene.world.get();
    check(girandole_world_set_factor(world, scene.instances[nearest], vec3(20, 20, 20)));
    auto sheared = Scene::place(other, time);
    sheared.axes[0] = vec3(3, 0.5f, 0);
    check(girandole_world_move_instance(world, scene.instances[other], &sheared));
    check(girandole_world_set_mask(world, scene.instances[hidden], 0));
    const auto bright = girandole_point_light(vec3(0, 0.5f, 0), grey(3));
    const auto extra = girandole_placement_at(-5, 0, -5);
    uint64_t tree = 0, instance = 0;
    uint32_t index = 0;
    check(girandole_world_add_tree(world, &bright, 1, &tree));
    check(girandole_world_add_instance(world, tree, &extra, nullptr, &instance));
    check(girandole_world_add_lights(world, tree, &bright, 1, &index));
}

// Walls hide three quarters of the lanterns from each point. Cells learn that from shadow rays, which lowers the noise.
double noise_in_corner(vulkan::Device &device, GirandoleWorld *world, bool learns, int frames) {
    const GirandoleCutOptions cuts = {0.25f, 4096, 8, learns ? 4096u : 0u, 1.0f};
    Player player(device, &cuts);
    player.frame(world);
    const auto shader = engine_shader(player.effects(), "measure_corner", learns ? GIRANDOLE_SHADER_LEARNS : 0);
    GirandoleShaderView view;
    check(girandole_shader_view(shader.get(), &view));
    double noise = 0.0;
    for (int frame = 0; frame < frames; frame++) {
        const char *what = learns ? "corner, learnt" : "corner";
        const auto all = compare(device, player, world, view.code, view.size, what, "measure_corner");
        player.frame(world);
        const auto add = [](double sum, const Measured &measured) { return sum + measured.allowed; };
        noise = std::accumulate(all.begin(), all.end(), 0.0, add);
    }
    check(girandole_planner_forget_visibility(player.planner()));
    player.frame(world);
    return noise;
}

// Fills one range twice without a barrier, which synchronization validation has to report. Shows that it is on.
void hazard() {
    vulkan::Device device;
    const auto buffer = device.make_buffer(64, VK_BUFFER_USAGE_TRANSFER_DST_BIT, false);
    device.begin();
    device.clear(buffer, 0, 64);
    device.clear(buffer, 0, 64);
    device.submit_and_wait();
    device.free_buffer(buffer);
}

void all(const std::string &folder, const char *measure_spv) {
    vulkan::Device device;
    std::printf("%s\n", device.name().c_str());
    single_lamp(device);
    kernel_lights(device, folder);

    Scene scene;
    Player player(device);
    const int frames = 6;
    const double time = 0.1 * (frames - 1);
    for (int frame = 0; frame < frames; frame++) {
        scene.move(0.1 * frame);
        check(girandole_world_update(scene.world.get(), 300.0, nullptr));
        const size_t commands = player.frame(scene.world.get());
        std::printf("frame %d: %zu commands\n", frame, commands);
        require(commands > 0, "a frame with moves plays no commands");
    }
    // Nothing has changed.
    check(girandole_world_update(scene.world.get(), 0.0, nullptr));
    require(player.frame(scene.world.get()) == 5, "a frame without changes only builds cuts");

    const auto before = compare_wgsl(device, player, scene.world.get(), "WGSL, no cuts yet", folder);
    player.frame(scene.world.get());
    const auto with_cuts = compare_wgsl(device, player, scene.world.get(), "WGSL, cuts", folder);
    const auto add = [](double sum, const Measured &measured) { return sum + measured.allowed; };
    require(std::accumulate(with_cuts.begin(), with_cuts.end(), 0.0, add) <
                0.5 * std::accumulate(before.begin(), before.end(), 0.0, add),
            "cuts do not lower the noise");
    picture(device, player, scene.world.get(), time, folder + "/lights.ppm");
    const double plain = noise_in_corner(device, scene.world.get(), false, 2);
    const double learnt = noise_in_corner(device, scene.world.get(), true, 4);
    std::printf("corner: learnt visibility leaves %.2f of the noise\n", learnt / plain);
    require(learnt < 0.8 * plain, "learnt visibility does not lower the noise");

    edit(scene, time);
    check(girandole_world_update(scene.world.get(), 300.0, nullptr));
    require(player.frame(scene.world.get()) > 0, "a frame with edits plays no commands");
    const auto after = compare_wgsl(device, player, scene.world.get(), "WGSL, edited", folder);
    double largest = 0.0;
    for (size_t i = 0; i < POINTS; i++) {
        const double allowed = std::fmax(before[i].allowed, after[i].allowed);
        largest = std::fmax(largest, std::fabs(after[i].exact - before[i].exact) / allowed);
    }
    require(largest > 2.0, "the edits are too small to be seen");
    if (measure_spv) {
        std::ifstream file(measure_spv, std::ios::binary);
        const std::vector<char> bytes{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
        require(!bytes.empty() && bytes.size() % 4 == 0, std::string(measure_spv) + " is no SPIR-V");
        std::vector<uint32_t> words(bytes.size() / 4);
        std::memcpy(words.data(), bytes.data(), bytes.size());
        compare(device, player, scene.world.get(), words.data(), bytes.size(), "HLSL");
    }
}

}  // namespace

int main(int count, char **arguments) {
    if (count < 2) {
        std::fprintf(stderr, "usage: vulkan FOLDER [MEASURE.SPV]\n       vulkan --hazard\n");
        return 1;
    }
    try {
        if (std::string(arguments[1]) == "--hazard") {
            hazard();
            return 0;
        }
        all(arguments[1], count > 2 ? arguments[2] : nullptr);
    } catch (const std::exception &error) {
        std::fprintf(stderr, "%s\n", error.what());
        return 1;
    }
    return 0;
}
