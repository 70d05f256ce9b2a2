// Which light a point should sample, in the names of bevy_solari: the index of a light in `light_sources` shifted by 16
// bits, with the triangle of a mesh in the lower bits.

import girandole::{
    LightShadingPoint, LIGHT_DIRECTIONAL, light_cuts, light_glossy_point, light_nodes, light_pmf, light_resample, light_top,
};

const GIRANDOLE_NO_LIGHT: u32 = 0xffffffffu;

// The names of lights. Twin of `Names` in names.rs.
struct GirandoleNames {
    slots: u32,
    directionals: u32,
    lights: u32,
    instances: u32,
    // The light of each slot and of each directional light; the slot of each light, where directional lights come
    // after all slots; the light of each instance that rays may hit.
    words: array<u32>,
}

@group(4) @binding(0) var<storage, read> girandole_names: GirandoleNames;

struct GirandoleDraw {
    light: u32,
    // 0 if nothing was drawn.
    pmf: f32,
}

// The point for which lights are drawn. Roughness is perceptual.
fn girandole_solari_point(
    position: vec3<f32>, normal: vec3<f32>, wo: vec3<f32>, roughness: f32, specular: vec3<f32>, diffuse: vec3<f32>,
) -> LightShadingPoint {
    let luminance = vec3(0.2126, 0.7152, 0.0722);
    return light_glossy_point(position, normal, wo, roughness, dot(specular, luminance), dot(diffuse, luminance));
}

// Whether there are lights. To be asked at the start of a kernel: it also keeps Mesa 26's llvmpipe, which merges reads of
// several buffers, from a read through no buffer when no invocation is left in a loop.
fn girandole_is_there() -> bool {
    return min(min(arrayLength(&light_top), arrayLength(&light_nodes)), arrayLength(&light_cuts.quads)) > 0u;
}

// A word of the names; GIRANDOLE_NO_LIGHT beyond `count` words from `first` on.
fn girandole_name(first: u32, count: u32, number: u32) -> u32 {
    let word = girandole_names.words[first + min(number, max(count, 1u) - 1u)];
    return select(GIRANDOLE_NO_LIGHT, word, number < count);
}

// A light.
fn girandole_draw(point: LightShadingPoint, u: vec2<f32>) -> GirandoleDraw {
    let slots = girandole_names.slots;
    let directionals = girandole_names.directionals;
    let pick = light_resample(point, vec4(u, 0.5, 0.5), 0.5, 1u);
    let is_directional = pick.instance == LIGHT_DIRECTIONAL;
    let of_slot = girandole_name(0u, slots, pick.instance);
    let light = select(of_slot, girandole_name(slots, directionals, pick.light), is_directional);
    let is_drawn = pick.weight > 0.0 && light != GIRANDOLE_NO_LIGHT;
    return GirandoleDraw((light << 16u) | select(pick.light, 0u, is_directional), select(0.0, 1.0 / pick.weight, is_drawn));
}

// The probability of a light; 0 if it has no name here.
fn girandole_pmf(point: LightShadingPoint, light: u32) -> f32 {
    let slots = girandole_names.slots;
    let first = slots + girandole_names.directionals;
    let place = girandole_name(first, girandole_names.lights, light >> 16u);
    if place == GIRANDOLE_NO_LIGHT {
        return 0.0;
    }
    let is_directional = place >= slots;
    let instance = select(place, LIGHT_DIRECTIONAL, is_directional);
    return light_pmf(point, instance, select(light & 0xffffu, place - slots, is_directional));
}

// The light that a ray has hit; GIRANDOLE_NO_LIGHT if it has no name here.
fn girandole_light_of_hit(instance: u32, triangle: u32) -> u32 {
    let first = girandole_names.slots + girandole_names.directionals + girandole_names.lights;
    let number = girandole_name(first, girandole_names.instances, instance);
    return select((number << 16u) | triangle, GIRANDOLE_NO_LIGHT, number == GIRANDOLE_NO_LIGHT);
}

// The probability of a triangle that a ray has hit.
fn girandole_pmf_of_hit(point: LightShadingPoint, instance: u32, triangle: u32) -> f32 {
    return girandole_pmf(point, girandole_light_of_hit(instance, triangle));
}
