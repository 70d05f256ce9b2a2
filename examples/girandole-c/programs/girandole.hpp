// A thin C++ layer over girandole.h for the programs of this folder: objects that end with their scope, and
// statuses as exceptions. Copy it or write your own; it is no part of the interface.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "girandole.h"

namespace girandole {

struct Error : std::runtime_error {
    explicit Error(GirandoleStatus given)
        : std::runtime_error("girandole error " + std::to_string(given) + ": " + girandole_last_error_message()),
          status(given) {}
    GirandoleStatus status;
};

inline void check(GirandoleStatus status) {
    if (status != GIRANDOLE_OK) throw Error(status);
}

struct Destroy {
    void operator()(GirandoleWorld *it) const { girandole_world_destroy(it); }
    void operator()(GirandoleReader *it) const { girandole_reader_destroy(it); }
    void operator()(GirandolePlanner *it) const { girandole_planner_destroy(it); }
    void operator()(GirandolePlan *it) const { girandole_plan_destroy(it); }
    void operator()(GirandoleCursor *it) const { girandole_cursor_destroy(it); }
    void operator()(GirandoleShader *it) const { girandole_shader_destroy(it); }
    void operator()(GirandoleReadback *it) const { girandole_readback_destroy(it); }
    void operator()(GirandoleRegion *it) const { girandole_region_destroy(it); }
    void operator()(GirandoleBlob *it) const { girandole_blob_destroy(it); }
};

// Objects end in the reverse order of their declarations. Declare a planner after its world, since a world with a
// reservation refuses to end.
template <typename T>
using Owned = std::unique_ptr<T, Destroy>;

// Calls a function whose last argument gets a new object.
template <typename T, typename Make>
Owned<T> make(Make make) {
    T *it = nullptr;
    check(make(&it));
    return Owned<T>(it);
}

inline Owned<GirandoleWorld> make_world() { return make<GirandoleWorld>(girandole_world_create); }

inline GirandoleVec3 vec3(float x, float y, float z) { return GirandoleVec3{x, y, z}; }
inline GirandoleVec3 grey(float x) { return GirandoleVec3{x, x, x}; }

// All lights of a world that can be sampled.
inline std::vector<GirandoleLightId> all_lights(const GirandoleWorld *world) {
    std::vector<GirandoleLightId> ids;
    size_t count = 0;
    GirandoleStatus status;
    while ((status = girandole_world_lights(world, ids.data(), ids.size(), &count)) == GIRANDOLE_ERROR_NO_SPACE) {
        ids.resize(count);
    }
    check(status);
    ids.resize(count);
    return ids;
}

// The illuminance of a shading point by all lights that are visible, in lux (the channel y), for lights without size.
// Without is_visible, all are.
inline double exhaustive_lux(const GirandoleWorld *world, const GirandoleShadingPoint &point,
                             const std::function<bool(const GirandoleSample &)> &is_visible = nullptr) {
    const auto ids = all_lights(world);
    const std::vector<GirandoleShadingPoint> points(ids.size(), point);
    const std::vector<float> u(2 * ids.size(), 0.5f);
    std::vector<GirandoleSample> samples(ids.size());
    check(girandole_world_sample_lights(world, points.data(), ids.data(), u.data(), ids.size(), samples.data()));
    double lux = 0.0;
    for (const auto &s : samples) {
        if (is_visible && !is_visible(s)) continue;
        const auto n = point.normal, d = s.direction;
        lux += s.radiance.y * (n.x * d.x + n.y * d.y + n.z * d.z) * s.weight;
    }
    return lux;
}

}  // namespace girandole
