//! What an engine needs to call our functions from a shader of its own.

use crate::effects::Effects;
use crate::plan::ShaderParts;
use crate::plan::text;

/// The WGSL text and the bind group layout that an engine's shader needs to choose lights.
///
/// [`GpuLights::shader`](super::GpuLights::shader) makes one; [`LightShader::join`] puts it before
/// the engine's own text. `docs/integration.md` explains both step by step.
///
/// The functions are for compute and fragment shaders, and so for ray queries in them, which are
/// the only rays that WebGPU has. They are not for vertex shaders, in which the bind group is not
/// visible.
///
/// # Functions
///
/// Positions and directions are in the space of [`LightWorld::origin`](crate::LightWorld::origin).
/// Random numbers `u` are in [0, 1).
///
/// ```wgsl
/// fn light_surface_point(position: vec3<f32>, normal: vec3<f32>) -> LightShadingPoint // metres; unit
/// fn light_glossy_point(position: vec3<f32>, normal: vec3<f32>, view: vec3<f32>,
///     roughness: f32, specular: f32, diffuse: f32) -> LightShadingPoint // see `Gloss`
/// // The same point with another mask: see `Appearance::mask`.
/// fn light_masked_point(shading_point: LightShadingPoint, mask: u32) -> LightShadingPoint
/// fn light_volume_point(position: vec3<f32>) -> LightShadingPoint
/// // A segment of a ray through a medium: metres; unit; metres.
/// fn light_segment(origin: vec3<f32>, direction: vec3<f32>, length: f32) -> LightShadingPoint
/// struct LightSample {
///     direction: vec3<f32>, dist: f32, // unit, from the shading point; metres
///     radiance: vec3<f32>, pdf: f32, pmf: f32, // see below
///     instance: u32, light: u32, is_delta: u32,
/// }
/// // A light that was kept, and the numbers of the point on it: 28 bytes, to be stored from frame to frame. `weight`
/// // takes the place of 1 / pmf, and is 0 if no light is kept. `count` is how many draws it stands for. The engine sets
/// // `reflected`. See `Reservoir`.
/// struct LightReservoir {
///     instance: u32, light: u32, generation: u32, numbers: u32, weight: f32, count: f32, reflected: f32,
/// }
/// // Made by the functions above. Shaders may read these two fields; the others depend on the effects,
/// // and may change with any version. The normal is zero in a volume.
/// struct LightShadingPoint { position: vec3<f32>, normal: vec3<f32>, /* ... */ }
///
/// // Marks the cell of a shading point, which will have a cut from the next build on: see
/// // `GpuLights::build_cuts`. Call it for all points that a camera sees. Two atomic operations.
/// fn light_mark(shading_point: LightShadingPoint)
/// // A light and a point on it.
/// fn light_sample(shading_point: LightShadingPoint, u: vec4<f32>) -> LightSample
/// // One of up to LIGHT_MAX_CANDIDATES candidates, kept in proportion to its unshadowed light.
/// // `choice` is a fifth random number, which chooses among them.
/// fn light_resample(
///     shading_point: LightShadingPoint, u: vec4<f32>, choice: f32, candidates: u32,
/// ) -> LightReservoir
/// // The light of a reservoir at any point, as it is now; its pmf is 1 / weight, and 0 if nothing arrives.
/// fn light_reservoir_sample(shading_point: LightShadingPoint, reservoir: LightReservoir) -> LightSample
/// // With `GpuOptions::previous` only: the same for a light as it was in the last frame.
/// fn light_reservoir_sample_previous(shading_point: LightShadingPoint, reservoir: LightReservoir) -> LightSample
/// // One of two, at the point of `own`, by what the lights of both reflect there and at the point of `other`. `u`
/// // chooses. See `Reservoir::merge`.
/// fn light_reservoir_merge(
///     own: LightReservoir, own_there: f32, other: LightReservoir, other_here: f32, u: f32,
/// ) -> LightReservoir
/// // A light that the engine names, with a weight of 1, and 0 if it is not there.
/// fn light_reservoir_of(instance: u32, light: u32, u: vec2<f32>) -> LightReservoir
/// // The numbers of candidate `i` of up to LIGHT_MAX_CANDIDATES, spread evenly, for an engine that merges candidates
/// // itself.
/// fn light_candidate_numbers(u: vec4<f32>, i: u32, candidates: u32) -> vec4<f32>
/// // The learnt share of rays toward a sample that are not blocked; 1 where nothing is learnt. Targets without
/// // shadow rays are multiplied by it.
/// fn light_visible_share(shading_point: LightShadingPoint, s: LightSample) -> f32
/// // The probability of a light, and the density of a point on it.
/// fn light_pmf(shading_point: LightShadingPoint, instance: u32, light: u32) -> f32
/// fn light_pdf(shading_point: LightShadingPoint, instance: u32, light: u32, point: vec3<f32>) -> f32
/// // The first light that a ray hits before `max_dist` metres: the sample that light_sample would have
/// // returned for this unit vector. Its radiance is 0 if there is none. A ray that hits nothing finds
/// // the sky if `max_dist` is 1e18 or more.
/// fn light_hit(shading_point: LightShadingPoint, direction: vec3<f32>, max_dist: f32) -> LightSample
/// // Where on a triangle or parallelogram the point of a sample or of a hit is, from 0 to 1 along both edges
/// // from the first corner: see `LightSampler::place_on_light`.
/// fn light_place_on(shading_point: LightShadingPoint, s: LightSample) -> vec2<f32>
/// // The 32 bits that the engine has given to an instance: see `Appearance::user_data`.
/// fn light_user_data(instance: u32) -> u32
/// // With Effects::SEGMENTS only: where on its segment the last sample was taken, in metres from the
/// // start.
/// var<private> light_along: f32;
/// // With Effects::SEGMENTS only: the distance along a segment for a given light, and its density.
/// struct LightAlong { along: f32, pdf: f32 }
/// fn light_sample_along(shading_point: LightShadingPoint, instance: u32, light: u32, u: f32) -> LightAlong
/// fn light_along_pdf(shading_point: LightShadingPoint, instance: u32, light: u32, along: f32) -> f32
/// // A number that changes when this comes to name another light: see `LightWorld::generation`.
/// fn light_generation(instance: u32, light: u32) -> u32
/// // Whether the lights of an instance are stand-ins: see `GpuLights::set_tree_memory`.
/// fn light_stands_in(instance: u32) -> bool
/// // Well-mixed bits, for random numbers.
/// fn light_hash(bits: u32) -> u32
/// ```
///
/// [`GpuOptions::learning`](super::GpuOptions::learning) adds a function that records
/// which of the chosen lights are visible. [`LightShader::with_heat_map`] adds
/// `light_heat_map`, which shows how lights are chosen.
///
/// # Measures
///
/// - `pmf` is the probability of the light among all lights, in [0, 1]. In a sample, 0 means that
///   nothing arrives: `radiance` is 0, and all fields are finite, but `pdf` may be 0. The light of a
///   reservoir has `1 / weight` in its place, which may be above 1.
/// - If `is_delta` is 0, `radiance` is in nits and `pdf` is a density per steradian, seen from the
///   shading point.
/// - If `is_delta` is 1 (points, spots and directional lights), `radiance` is the illuminance in
///   lux of a surface that faces the light, and `pdf` is 1.
/// - In both cases `brdf * cosine * radiance / (pmf * pdf)` estimates the radiance that leaves the
///   shading point, if nothing occludes the light within `dist`.
/// - For a segment, `pdf` is multiplied by the density of `light_along` per metre, and the estimate
///   is that of an integral over the segment.
/// - `light_pdf` is per steradian, and includes the pmf. It is 0 for segments.
///
/// # Names of lights
///
/// `instance` is a slot, which stays the same while the instance lives: see
/// [`LightWorld::instance_at`](crate::LightWorld::instance_at) and
/// [`LightWorld::slot`](crate::LightWorld::slot). `light` is the index in the instance's tree, or
/// `LIGHT_STAND_IN` (2³⁰) and more for a stand-in of that tree's lights. A light that is not there has
/// the probability, density and generation 0, and sends nothing. For a directional light, `instance` is `LIGHT_DIRECTIONAL` (`u32::MAX`) and `light` is the index in
/// [`LightWorld::directionals`](crate::LightWorld::directionals) at the last upload.
///
/// # Bindings
///
/// The text binds one uniform buffer, five read-only storage buffers and one that `light_mark` writes, at `group`. Of
/// WebGPU's default limits, that leaves an engine three bind groups, and two storage buffers and eleven
/// uniform buffers in each stage. Most devices grant more. All names in the text start with `light_`, `Light` or `LIGHT_`;
/// [`with_prefix`](super::with_prefix) puts a prefix before them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct LightShader {
    /// The text. It goes before the engine's own text and after its directives: see
    /// [`LightShader::join`].
    pub wgsl: String,
    /// The number of the bind group: the place of [`LightShader::layout`] in pipeline layouts, and
    /// of [`GpuLights::bind_group`](super::GpuLights::bind_group) in passes.
    pub group: u32,
    /// The effects that the text supports. It may be used while
    /// [`GpuLights::effects`](super::GpuLights::effects) contains no others.
    pub effects: Effects,
    /// What the text has besides the functions above.
    pub parts: ShaderParts,
    /// The layout of the bind group, for compute and fragment stages.
    pub layout: wgpu::BindGroupLayout,
}

impl LightShader {
    pub(super) fn new(group: u32, effects: Effects, parts: ShaderParts, layout: wgpu::BindGroupLayout) -> Self {
        Self { wgsl: String::new(), group, effects, parts, layout }.with_effects(effects)
    }

    /// Returns the same shader for other effects. This needs no [`GpuLights`](super::GpuLights), so it
    /// works on the threads of an engine that compiles its pipelines there. Joins texts and compiles
    /// nothing.
    #[must_use]
    pub fn with_effects(&self, effects: Effects) -> Self {
        Self { wgsl: text::wgsl_with(self.group, effects, &self.parts), effects, ..self.clone() }
    }

    /// The same with `light_record_visibility`: see [`ShaderParts::learns`](crate::plan::ShaderParts::learns).
    /// [`GpuLights::shader`](super::GpuLights::shader) has it where cells learn.
    #[must_use]
    pub fn with_learning(self) -> Self {
        let effects = self.effects;
        Self { parts: self.parts.with_learning(), ..self }.with_effects(effects)
    }

    /// The same with `light_heat_map`, which shows how lights are chosen: see
    /// [`ShaderParts::heat_map`](crate::plan::ShaderParts::heat_map).
    #[must_use]
    pub fn with_heat_map(self) -> Self {
        let effects = self.effects;
        Self { parts: self.parts.with_heat_map(), ..self }.with_effects(effects)
    }

    /// Returns the engine's text with this text before it, but after the engine's `enable`,
    /// `requires` and `diagnostic` directives, which WGSL requires to be first.
    ///
    /// Line numbers in errors about the engine's part are shifted by the lines of this text.
    #[must_use]
    pub fn join(&self, engine: &str) -> String {
        let is_directive = |line: &str| {
            let word = line.trim_start().split([' ', '\t', '(']).next();
            matches!(word, Some("enable" | "requires" | "diagnostic"))
        };
        let mut start = 0;
        let mut end = 0;
        for line in engine.split_inclusive('\n') {
            if is_directive(line) {
                end = engine[start..].find(';').map_or(engine.len(), |length| start + length + 1);
            }
            start += line.len();
        }
        format!("{}\n{}{}", &engine[..end], self.wgsl, &engine[end..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::testing::gpu_lights;
    use crate::plan::wgsl_of_sources;

    #[test]
    fn the_directives_of_an_engine_stay_first() {
        let shader = gpu_lights().shader(2, Effects::all());
        let body = "@compute @workgroup_size(1) fn main() { let p = light_pmf(LightShadingPoint(), 0u, 0u); }\n";
        for head in [
            "",
            "// A comment.\n",
            "diagnostic(off, derivative_uniformity);\n",
            "// One.\ndiagnostic(off,\n    derivative_uniformity);\n// Two.\ndiagnostic(off, subgroup_uniformity); // Three.\n",
        ] {
            let text = shader.join(&format!("{head}{body}"));
            naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("directives come first");
            assert!(shader.with_effects(Effects::empty()).join("").contains("@group(2)"));
            assert!(text.contains(body) && text.contains("@group(2)"), "the text is complete");
        }
    }

    /// The functions that the guide leaves to the engine.
    const STUBS: &str = "
        struct EngineSurface { position: vec3<f32>, normal: vec3<f32> }
        fn engine_surface(pixel: vec2<u32>) -> EngineSurface { return EngineSurface(); }
        fn engine_random(seed: u32) -> vec4<f32> { return vec4(0.5); }
        fn engine_brdf(normal: vec3<f32>, direction: vec3<f32>) -> vec3<f32> { return vec3(0.3); }
        fn engine_brdf_pdf(normal: vec3<f32>, direction: vec3<f32>) -> f32 { return 0.3; }
        fn engine_sample_brdf(normal: vec3<f32>, v: vec2<f32>) -> vec3<f32> { return normal; }
        fn engine_is_occluded(from_: vec3<f32>, direction: vec3<f32>, dist: f32) -> bool { return false; }
        fn engine_shade(surface: EngineSurface, s: LightSample) -> vec4<f32> { return vec4(s.radiance, 1.0); }
        fn engine_surface_then(pixel: vec2<u32>) -> EngineSurface { return EngineSurface(); }
        fn engine_has_surface(pixel: vec2<u32>) -> bool { return true; }
        fn engine_is_occluded_then(from_: vec3<f32>, direction: vec3<f32>, dist: f32) -> bool { return false; }
        fn engine_pixel_then(pixel: vec2<u32>) -> vec2<i32> { return vec2<i32>(pixel); }
        fn engine_is_alike(a: EngineSurface, b: EngineSurface) -> bool { return true; }
        fn engine_trace(from_: vec3<f32>, direction: vec3<f32>) -> f32 { return 0.0; }
    ";

    /// Those that a page defines once.
    const DEFINED: &str = "
        fn engine_point(surface: EngineSurface) -> LightShadingPoint { return LightShadingPoint(); }
        fn engine_target(surface: EngineSurface, s: LightSample) -> f32 { return s.pmf; }
    ";

    #[test]
    fn the_shaders_of_the_guide_are_valid_for_all_effects_and_for_none() {
        // All pages of the guide are in one folder.
        let pages = std::fs::read_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/docs")).expect("the folder of the guide");
        let paths =
            pages.map(|page| page.expect("readable").path()).filter(|path| path.extension() == Some("md".as_ref()));
        let texts: Vec<_> = paths.map(|path| std::fs::read_to_string(path).expect("a text")).collect();
        let blocks_of = |text| str::split(text, "```wgsl\n").skip(1).filter_map(|rest| rest.split("```").next());
        let blocks: Vec<_> = texts.iter().flat_map(|text| blocks_of(text)).collect();
        assert_eq!(blocks.len(), 12);
        for effects in [Effects::all(), Effects::empty()] {
            // Only shaders that know segments have the distance along one.
            let knows = |block: &&&str| effects.contains(Effects::SEGMENTS) || !block.contains("light_segment(");
            for block in blocks.iter().filter(knows) {
                let learns = block.contains("light_record_visibility");
                let previous = block.contains("light_reservoir_sample_previous");
                let heat_map = block.contains("light_heat_map");
                let parts = ShaderParts { learns, heat_map, previous, ..ShaderParts::default() };
                let text = match block.contains("light_put_") {
                    true => wgsl_of_sources(1),
                    false => text::wgsl_with(1, effects, &parts) + STUBS,
                };
                let defined = if block.contains("fn engine_point") { "" } else { DEFINED };
                let is_source = block.contains("light_put_");
                let text = text + if is_source { "" } else { defined } + block;
                let module =
                    naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
                naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
                    .validate(&module)
                    .map_err(|e| e.emit_to_string(&text))
                    .expect("it is valid");
            }
        }
    }
}
