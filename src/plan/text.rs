//! Joins the WGSL files and puts the constants of the Rust sources before them, so that no number
//! is written in two places.

use std::collections::HashSet;
use std::fmt::Write;

use super::cuts::layout as cut_layout;
use super::heat_map::HeatMap;
use super::items::renamed;
use super::{layout, previous};
use crate::cluster;
use crate::effects::Effects;
use crate::instance::sector;
use crate::instance::{part, portal};
use crate::light;
use crate::math::dice;
use crate::math::solid_angle;
use crate::profile;
use crate::sampling::cuts;
use crate::sampling::emit;
use crate::sampling::equiangular;
use crate::sampling::hit;
use crate::sampling::{resample, reservoir, view};
use crate::shading::gloss;
use crate::shading::importance;
use crate::shading::rough;
use crate::shading::segment;
use crate::shading::shading_point;
use crate::sky;
use crate::top::masks;
use crate::tree;
use crate::visibility;

/// Returns the WGSL text that an engine puts before its own text, after its `enable` and
/// `requires` directives.
///
/// `girandole::gpu::LightShader` lists the functions and the units of their results. The bindings
/// are in `@group(group)`, for compute and fragment stages: one uniform buffer at binding 0 and five
/// read-only storage buffers at 1 to 5, and one that shaders write at 6. That is six of the eight that WebGPU
/// grants a stage. [`LightPlanner::bindings`](super::LightPlanner::bindings) names those up to 4, and
/// [`LightPlanner::cells`](super::LightPlanner::cells) the others. All names start with
/// `light_`, `Light` or `LIGHT_`.
///
/// Lights are chosen from the cuts that cells share, and where a cell has none by a walk from the roots: see
/// [`LightPlanner::build_cuts`](super::LightPlanner::build_cuts). All probabilities are exact.
///
/// `effects` selects the code of the text. It must contain the effects of the world and needs no
/// others. The text reads buffers of any layout: parts that it has no code for are skipped, and
/// parts that are not stored have the values of lights without that effect.
#[must_use]
pub fn wgsl(group: u32, effects: Effects) -> String {
    wgsl_with(group, effects, &ShaderParts::default())
}

/// As [`wgsl`], with more parts.
#[must_use]
pub fn wgsl_with(group: u32, effects: Effects, parts: &ShaderParts) -> String {
    with_constants(&functions(group, effects, *parts))
}

/// What a text has besides the functions of [`wgsl`]. The default adds nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct ShaderParts {
    /// Shaders record what shadow rays find, where cells learn. The text has
    ///
    /// ```wgsl
    /// // Records whether a light that light_sample chose for this shading point is visible: whether
    /// // a shadow ray to the chosen point met nothing.
    /// fn light_record_visibility(shading_point: LightShadingPoint, chosen: LightSample, is_visible: bool)
    /// ```
    ///
    /// Call it for all samples, or for a random part of them. Samples with a pmf of 0 and
    /// directional lights may be passed and are not recorded. The cost is one node and one atomic
    /// addition for each level above the light. Builds of cuts read the table, `light_resample`
    /// weighs candidates by it, and `light_visible_share` returns what is learnt.
    pub learns: bool,
    /// The text has a function that shows how lights are chosen, for people who look for the cause of noise:
    ///
    /// ```wgsl
    /// // A colour from 0 to 1 for a shading point. `shown` is a number of `HeatMap`; `seed` makes samples differ.
    /// fn light_heat_map(shading_point: LightShadingPoint, shown: u32, seed: u32) -> vec3<f32>
    /// ```
    ///
    /// The cost is that of 16 samples, and little for [`HeatMap::Cuts`](super::HeatMap::Cuts).
    pub heat_map: bool,
    /// Shaders read the lights of the last frame, for renderers that reuse samples from frame to frame. The text has
    ///
    /// ```wgsl
    /// // As light_reservoir_sample, of the light as it was in the last frame: where it was and how bright. The pmf is 0
    /// // for a light that did not exist.
    /// fn light_reservoir_sample_previous(shading_point: LightShadingPoint, reservoir: LightReservoir) -> LightSample
    /// ```
    ///
    /// and binds one more read-only storage buffer at binding 7:
    /// [`LightPlanner::previous`](super::LightPlanner::previous). The shading point is relative to the origin that the
    /// world had then ([`LightWorld::origin`](crate::LightWorld::origin)). The maps of the sky and of profiles are the
    /// present ones.
    pub previous: bool,
    /// Counts the nodes that an invocation reads.
    pub(crate) counts: bool,
    /// Builds the cuts of cells.
    pub(crate) builds: bool,
}

impl ShaderParts {
    /// The same with `light_heat_map`.
    #[must_use]
    pub fn with_heat_map(self) -> Self {
        Self { heat_map: true, ..self }
    }

    /// The same with learnt visibility.
    #[must_use]
    pub fn with_learning(self) -> Self {
        Self { learns: true, ..self }
    }

    /// The same with the lights of the last frame.
    #[must_use]
    pub fn with_previous(self) -> Self {
        Self { previous: true, ..self }
    }

    /// Whether the lines between `// #if NAME` and `// #endif` are kept; `None` for another name.
    fn keep(self, name: &str) -> Option<bool> {
        match name {
            "COUNTS" => Some(self.counts),
            "LEARNS" => Some(self.learns),
            "BUILDS" => Some(self.builds),
            _ => None,
        }
    }
}

/// The same as [`wgsl`] with the variable `light_nodes_read`, which counts the nodes that an
/// invocation reads.
#[cfg(all(test, feature = "gpu"))]
pub(crate) fn wgsl_counting(group: u32, effects: Effects) -> String {
    wgsl_with(group, effects, &ShaderParts { counts: true, ..ShaderParts::default() })
}

/// The text of a kernel that knows all effects, with constants that only some kernels have.
pub(crate) fn wgsl_of_kernel(whole: &[(&str, u32)], real: &[(&str, f32)], files: &[&str]) -> String {
    let mut text = String::new();
    write_constants(&mut text, "", whole, real);
    text += &files.concat();
    with_constants(&variant(&text, Effects::all(), ShaderParts::default()))
}

/// The text of a kernel that writes cuts, behind the functions that it shares with shaders.
pub(crate) fn wgsl_of_cuts(effects: Effects, parts: ShaderParts, files: &[&str]) -> String {
    let functions =
        functions(0, effects, parts).replace("var<storage, read> light_cuts", "var<storage, read_write> light_cuts");
    with_constants(&(functions + &variant(&files.concat(), effects, parts)))
}

fn with_constants(body: &str) -> String {
    constants_of(body) + body
}

/// Puts a text's bindings in a group.
fn at_group(text: &str, group: u32) -> String {
    text.replace("LIGHT_GROUP", &group.to_string())
}

/// All functions, without the constants.
fn functions(group: u32, effects: Effects, parts: ShaderParts) -> String {
    let optional = |is_used: bool, text: &'static str| if is_used { text } else { "" };
    let weighs = parts.builds || effects.contains(Effects::SEGMENTS);
    let body = [
        shader!("types"),
        shader!("instance"),
        shader!("node"),
        shader!("gloss"),
        shader!("shading_point"),
        shader!("segment"),
        shader!("child"),
        optional(weighs, shader!("importance")),
        shader!("dice"),
        shader!("solid_angle"),
        shader!("emit"),
        shader!("sample"),
        shader!("records"),
        shader!("scaled"),
        shader!("places"),
        shader!("rough"),
        shader!("row_walk"),
        shader!("along"),
        shader!("pdf"),
        shader!("hit"),
        shader!("sky"),
        shader!("profile"),
        shader!("resample"),
        optional(parts.learns, shader!("visibility")),
        shader!("cut_grid"),
        shader!("cells"),
        shader!("mark"),
        shader!("shared"),
        optional(parts.heat_map, shader!("heat")),
    ]
    .concat();
    let mut text = variant(&body, effects, parts);
    if parts.previous {
        // A copy that reads the lights of the last frame.
        let given = ["light_params", "light_instance_quad", "light_record_quad", "light_record_quads"];
        text += &renamed(&text, "light_reservoir_sample", "_then", &given);
        text += &variant(shader!("previous"), effects, parts);
    }
    at_group(&text, group)
}

/// Constants that `LightShader` documents for engines. Every variant has them.
const PROMISED: [&str; 3] = ["LIGHT_DIRECTIONAL", "LIGHT_MAX_CANDIDATES", "LIGHT_STAND_IN"];

/// The constants that a text names outside of comments, and the constants that engines may name.
fn constants_of(text: &str) -> String {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    let words = code.flat_map(|code| code.split(|c: char| !c.is_alphanumeric() && c != '_'));
    let named: HashSet<&str> = words.chain(PROMISED).collect();
    let constants = constants();
    let is_named = |line: &&str| match line.strip_prefix("const ") {
        Some(rest) => named.contains(rest.split([':', ' ']).next().unwrap_or_default()),
        None => true,
    };
    constants.lines().filter(is_named).flat_map(|line| [line, "\n"]).collect()
}

/// The constants of the Rust sources, as WGSL.
fn constants() -> String {
    let mut text = String::from("// Constants of the Rust sources; see src/plan/text.rs.\n");
    let whole = [
        ("WIDTH", tree::WIDTH as u32),
        ("LEAF", tree::LEAF),
        ("EMPTY_SLOT", tree::EMPTY_SLOT),
        ("NO_PARENT", tree::NO_PARENT),
        ("ALL_SURFACES", tree::ALL_SURFACES),
        ("LEAST_NORMAL_CODE", tree::LEAST_NORMAL_CODE),
        ("KIND_MASK", layout::KIND_MASK),
        ("KIND_POINT", layout::KIND_POINT),
        ("KIND_SPOT", layout::KIND_SPOT),
        ("KIND_RECTANGLE", layout::KIND_RECTANGLE),
        ("KIND_SKY", layout::KIND_SKY),
        ("KIND_PROFILE", layout::KIND_PROFILE),
        ("SKY_LEVELS", sky::SKY_LEVELS),
        ("KIND_TRIANGLE", layout::KIND_TRIANGLE),
        ("KIND_SPHERE", layout::KIND_SPHERE),
        ("KIND_DIRECTIONAL", layout::KIND_DIRECTIONAL),
        ("TWO_SIDED", layout::TWO_SIDED),
        ("BIRTH_SHIFT", layout::BIRTH_SHIFT),
        ("PREVIOUS_HEAD", previous::HEAD),
        ("LIVE", layout::LIVE),
        ("NON_RIGID", layout::NON_RIGID),
        ("OPENING", layout::OPENING),
        ("STANDS_IN", layout::STANDS_IN),
        ("STAND_IN", layout::STAND_IN),
        ("PART", part::PART),
        ("SINGLE", part::SINGLE),
        ("PART_BITS", part::PART_BITS),
        ("DIRECTIONAL", layout::DIRECTIONAL),
        ("NO_INSTANCE", view::NO_INSTANCE),
        ("HEAT_CUTS", HeatMap::Cuts.number()),
        ("HEAT_MISSES", HeatMap::Misses.number()),
        ("HEAT_LIGHTS", HeatMap::Lights.number()),
        ("MAX_CANDIDATES", resample::MAX_CANDIDATES),
        ("LATTICE_Y", resample::LATTICE[0]),
        ("LATTICE_Z", resample::LATTICE[1]),
        ("LATTICE_W", resample::LATTICE[2]),
        ("NODE_QUADS", layout::NODE_QUADS),
        ("NODE_CHILDREN", layout::NODE_CHILDREN),
        ("NODE_LOBES", layout::NODE_LOBES),
        ("RECORD_QUADS", layout::RECORD_QUADS),
        ("INSTANCE_QUADS", layout::INSTANCE_QUADS),
        ("INSTANCE_LOCAL", layout::INSTANCE_LOCAL),
        ("INSTANCE_FACTOR", layout::INSTANCE_FACTOR),
        ("INSTANCE_SECTOR", layout::INSTANCE_SECTOR),
        ("NODE_TAIL", layout::NODE_TAIL),
        ("INSTANCE_TREE", layout::INSTANCE_TREE),
        ("INSTANCE_PART", layout::INSTANCE_PART),
        ("MASK_QUADS", layout::MASK_QUADS),
        ("MASK_WHOLE", masks::WHOLE),
        ("SHARED_NODES", cuts::SHARED_NODES as u32),
        ("CONTESTED", cuts::CONTESTED as u32),
        ("SHARED_UNITS", cuts::UNITS),
        ("SHARED_BITS", cuts::CHILD_BITS),
        ("PROBES", cuts::PROBES as u32),
        ("STILL_LEVEL", cuts::LEVELS[0]),
        ("CELL_LEVELS", cuts::LEVELS[0] + cuts::LEVELS[1]),
        ("CELL_POINTS", cuts::POINTS as u32),
        ("COARSER", cuts::COARSER),
        ("COARSE_MARKS", cuts::COARSE_MARKS),
        ("PLACE_BITS", cuts::PLACE_BITS),
        ("SLOPE_BITS", cuts::SLOPE_BITS),
        ("RANDOM_BITS", cuts::RANDOM_BITS),
        ("VOLUME_CLASS", cuts::VOLUME),
        ("GLOSS_SHIFT", cuts::GLOSS_SHIFT),
        ("CUT_HEAD", cut_layout::HEAD),
        ("SLOT_WORDS", cut_layout::SLOT_WORDS),
        ("LOST_MARKS", cut_layout::LOST_MARKS),
        ("ROW_QUADS", cut_layout::ROW_QUADS),
        ("ROW_NODES", cut_layout::ROW_NODES),
        ("ROW_SUMS", cut_layout::ROW_SUMS),
        ("ROW_FROM", cut_layout::ROW_FROM),
        ("ROW_STATE", cut_layout::ROW_STATE),
        ("ROW_FLUX", cut_layout::ROW_FLUX),
        ("TURNS", cuts::keep::TURNS),
        ("YOUNG", cuts::keep::YOUNG),
        ("FLUX_JUMP", cuts::keep::FLUX_JUMP),
        ("SKY_ROOT", cuts::keep::SKY_ROOT.into()),
        ("WAYS", visibility::WAYS as u32),
        ("MIN_IDLE", visibility::MIN_IDLE),
        ("BINS", visibility::BINS as u32),
        // Bits of floats, for tests that a compiler cannot fold by assuming that no float is NaN.
        ("INFINITY_BITS", f32::INFINITY.to_bits()),
        ("TINY_BITS", f32::MIN_POSITIVE.to_bits()),
        ("ONE_MINUS_EPSILON_BITS", dice::ONE_MINUS_EPSILON.to_bits()),
        ("FARTHEST_BITS", light::UNLIMITED_RANGE.to_bits()),
        ("BIN_SHIFT", visibility::BIN_SHIFT),
        ("COORDINATE_BITS", visibility::COORDINATE_BITS),
        ("TAG_SEED", visibility::TAG_SEED),
        ("TABLE_HEAD", visibility::TABLE_HEAD),
        ("UNITS", visibility::UNITS),
        ("MEMORY", visibility::MEMORY),
        ("FIRST", visibility::FIRST),
        ("PRIOR", visibility::PRIOR),
        ("RARE", visibility::RARE),
        ("DOUBT", visibility::DOUBT),
        ("BLOCK_BITS", visibility::BLOCK_BITS),
        ("LEARNT_BIT", visibility::LEARNT_BIT),
        ("USED_BIT", visibility::USED_BIT),
        ("MAX_NEW", visibility::MAX_NEW),
        ("FULL_SHARE", visibility::FULL_SHARE.into()),
        ("MIN_SHARE", visibility::MIN_SHARE.into()),
    ];
    let real = [
        ("VARIANCE_SHARE", importance::VARIANCE_SHARE),
        ("PORTAL_SLACK", portal::PORTAL_SLACK),
        ("FILLED_WIDTH", portal::FILLED_WIDTH),
        ("LEAST_SHARE", portal::LEAST_SHARE),
        ("IN_PLANE", portal::IN_PLANE),
        ("COSINE_WIDTH_SQ", importance::COSINE_WIDTH_SQ),
        ("NEAR_GAIN", importance::NEAR_GAIN),
        ("NEAR_VARIANCE", importance::NEAR_VARIANCE),
        ("MIN_GAP", importance::MIN_GAP),
        ("HORIZON_SHARE", importance::HORIZON_SHARE),
        ("MIN_COSINE", importance::MIN_COSINE),
        ("LAMBERTIAN", light::LAMBERTIAN),
        ("LOBE_SHARE", importance::LOBE_SHARE),
        ("RIM_WIDTH_SQ", importance::RIM_WIDTH_SQ),
        ("RIM_MIN_SQ", importance::RIM_MIN_SQ),
        ("MAX_LOBE_LENGTH", importance::MAX_LOBE_LENGTH),
        ("MIN_IMPORTANCE", importance::MIN_IMPORTANCE),
        ("ROUGH_COSINE", rough::ROUGH_COSINE),
        ("ROUGH_RISE", rough::ROUGH_RISE),
        ("ROUGH_SPILL", rough::ROUGH_SPILL),
        ("UNLIKELY", rough::UNLIKELY),
        ("BELOW", rough::BELOW),
        ("MAX_IMPORTANCE", importance::MAX_IMPORTANCE),
        ("POSITION_MARGIN", importance::POSITION_MARGIN),
        ("RIGID_TOLERANCE", cluster::RIGID_TOLERANCE),
        ("AXIS_ROUNDING", cluster::AXIS_ROUNDING),
        ("MAX_DIST_SQ", importance::MAX_DIST_SQ),
        ("COSINE_MARGIN", importance::COSINE_MARGIN),
        ("ANGLE_MARGIN", importance::ANGLE_MARGIN),
        ("MEAN_ERROR_SQ", importance::MEAN_ERROR_SQ),
        ("POSITION_ERROR", importance::POSITION_ERROR),
        ("MIN_POSITION_ERROR", importance::MIN_POSITION_ERROR),
        ("UNRESOLVED_DOUBT", importance::UNRESOLVED_DOUBT),
        ("STEPS", tree::STEPS),
        ("DIRECTION_STEPS", tree::DIRECTION_STEPS),
        ("CAP_STEPS", tree::CAP_STEPS),
        ("MIN_FLUX", light::MIN_FLUX),
        ("MAX_FLUX", cluster::MAX_FLUX),
        ("UNLIMITED_RANGE", light::UNLIMITED_RANGE),
        ("TINY", f32::MIN_POSITIVE),
        ("MIN_DIST_SQ", emit::MIN_DIST_SQ),
        ("MIN_PDF", emit::MIN_PDF),
        ("MIN_INVERSE_PDF", emit::MIN_INVERSE_PDF),
        ("MAX_DENSITY", 1.0 / emit::MIN_INVERSE_PDF),
        ("CLOSE", emit::CLOSE),
        ("NEAR_SIZE_SQ", solid_angle::NEAR_SIZE_SQ),
        ("MIN_DETERMINANT", solid_angle::MIN_DETERMINANT),
        ("MAX_DETERMINANT", solid_angle::MAX_DETERMINANT),
        ("MIN_VIEW_SQ", gloss::MIN_VIEW_SQ),
        ("MAX_VIEW_SQ", gloss::MAX_VIEW_SQ),
        ("MIN_VIEW_SINE_SQ", gloss::MIN_VIEW_SINE_SQ),
        ("MIN_VIEW_COSINE", gloss::MIN_VIEW_COSINE),
        ("MIN_SPECULAR", gloss::MIN_SPECULAR),
        ("MIN_ALPHA", gloss::MIN_ALPHA),
        ("GLOSS_WIDTH", gloss::GLOSS_WIDTH),
        ("MIN_GLOSS", gloss::MIN_GLOSS),
        ("MAX_FINITE", f32::MAX),
        ("SECTOR_EDGE", sector::EDGE),
        ("MIN_SEGMENT_SQ", shading_point::MIN_SEGMENT_SQ),
        ("MAX_SEGMENT_SQ", shading_point::MAX_SEGMENT_SQ),
        ("ARC_TANGENT_3", segment::ARC_TANGENT[0]),
        ("ARC_TANGENT_5", segment::ARC_TANGENT[1]),
        ("ARC_TANGENT_7", segment::ARC_TANGENT[2]),
        ("ARC_TANGENT_9", segment::ARC_TANGENT[3]),
        ("MIN_LINE_SHARE", equiangular::MIN_LINE_SHARE),
        ("CONE_SLACK", equiangular::CONE_SLACK),
        ("CONE_MARGIN", equiangular::CONE_MARGIN),
        ("RANGE_SLACK", equiangular::RANGE_SLACK),
        ("MIN_DIRECTION", hit::MIN_DIRECTION),
        ("BOX_ROUNDING", hit::BOX_ROUNDING),
        ("MIN_PMF", dice::MIN_PMF),
        ("FOUR_PI", 4.0 * std::f32::consts::PI),
        ("U_STEP", dice::U_STEP),
        ("MIN_WEIGHT", resample::MIN_WEIGHT),
        ("MAX_WEIGHT", resample::MAX_WEIGHT),
        ("MAX_RESERVOIR_WEIGHT", reservoir::MAX_RESERVOIR_WEIGHT),
        ("MAX_TARGET", reservoir::MAX_TARGET),
        ("MIN_SIDE", cuts::MIN_SIDE),
        ("MIN_SHARED_DOUBT", cuts::MIN_SHARED_DOUBT),
        ("DEVIATION", cuts::DEVIATION),
        ("DISAGREEMENT", cuts::DISAGREEMENT),
        ("EVEN", cuts::EVEN),
        ("CENTER", cuts::CENTER),
        ("SLOPE_CLASSES", cuts::SLOPE_CLASSES),
        ("SLOPE_STEPS", cuts::SLOPE_STEPS),
        ("SLOPE_ZERO", cuts::SLOPE_ZERO),
        ("ROUGHNESS_STEPS", cuts::ROUGHNESS_STEPS),
        ("LEAST_RATIO", cuts::REFLECTANCES[0]),
        ("GREATEST_RATIO", cuts::REFLECTANCES[1]),
        ("VIEW_COSINE", cuts::VIEW_COSINE),
        ("KEPT_VIEW_COSINE", cuts::keep::KEPT_VIEW_COSINE),
        ("JUMP_SHARE", cuts::keep::JUMP_SHARE),
        ("MAX_COORDINATE", visibility::MAX_COORDINATE),
        ("MAX_DIST", visibility::MAX_DIST),
        ("ROUNDING", visibility::ROUNDING),
        ("BLOCK_MIDDLE", visibility::BLOCK_MIDDLE),
        ("SKY_DIST", sky::SKY_DIST),
        ("WHOLE_TURN", profile::WHOLE_TURN),
    ];
    write_constants(&mut text, "LIGHT_", &whole, &real);
    text
}

/// Adds constants, whose names get a prefix.
fn write_constants(text: &mut String, prefix: &str, whole: &[(&str, u32)], real: &[(&str, f32)]) {
    for (name, value) in whole {
        let _ = writeln!(text, "const {prefix}{name}: u32 = {value}u;");
    }
    for (name, value) in real {
        // As f64: the shortest digits of the greatest f32 are above it, which Tint refuses.
        let _ = writeln!(text, "const {prefix}{name}: f32 = {:e};", f64::from(*value));
    }
}

/// The lines of a text that a variant needs. `// #if NAME` and `// #endif` enclose lines that only
/// worlds with the effect of that name need, and `// #if A | B` lines that worlds with any of these
/// effects need. `// #if COUNTS` and `// #if LEARNS` enclose the code of [`ShaderParts`]. The directives
/// nest, and the text is valid WGSL with and without the enclosed lines.
///
/// Panics on an unknown name and on an unbalanced directive: the texts are part of this crate.
fn variant(text: &str, effects: Effects, parts: ShaderParts) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut conditions: Vec<bool> = Vec::new();
    for line in text.lines() {
        match line.trim_start().strip_prefix("// #") {
            Some("endif") => assert!(conditions.pop().is_some(), "`#endif` without `#if`"),
            Some(directive) => {
                let names = directive.strip_prefix("if ").unwrap_or_else(|| panic!("an unknown directive: {line}"));
                conditions.push(names.split(" | ").any(|name| {
                    let kept = Effects::from_name(name).map(|effect| effects.contains(effect));
                    kept.or(parts.keep(name)).unwrap_or_else(|| panic!("an unknown effect: {name}"))
                }));
            }
            None if conditions.iter().all(|kept| *kept) => {
                kept += line;
                kept.push('\n');
            }
            None => {}
        }
    }
    assert!(conditions.is_empty(), "`#if` without `#endif`");
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::{cut_kernels, visibility_kernels, with_prefix};

    #[test]
    fn constants_are_written_as_numbers_of_32_bits() {
        let constants = constants();
        let numbers = constants.lines().filter_map(|line| line.split_once(": f32 = "));
        let mut count = 0;
        for (name, value) in numbers {
            let value: f64 = value.trim_end_matches(';').parse().expect(name);
            assert_eq!(f64::from(value as f32), value, "{name}: Tint refuses what is beyond the greatest f32");
            count += 1;
        }
        assert!(count > 20, "{count}");
    }

    #[test]
    fn a_variant_keeps_the_lines_that_its_effects_need() {
        let text =
            "a\n// #if CONES\nb\n    // #if RANGES\nc\n    // #endif\n// #endif\n// #if COUNTS\nd\n// #endif\ne\n";
        let all = |effects, counts| {
            variant(text, effects, ShaderParts { counts, ..ShaderParts::default() }).replace('\n', "")
        };
        assert_eq!(all(Effects::empty(), false), "ae");
        assert_eq!(all(Effects::CONES, false), "abe");
        assert_eq!(all(Effects::RANGES, true), "ade");
        assert_eq!(all(Effects::all(), true), "abcde");
    }

    /// Sets that have any four effects in every combination. Whether lights move changes no text.
    fn text_variants() -> impl Iterator<Item = Effects> {
        let number = |effect: Effects| effect.numbers().next().expect("an effect");
        let sets = testbed::testing::effect_sets::effect_sets(Effects::NAMES.len(), number(Effects::MOVING));
        sets.into_iter().map(|set| set.into_iter().map(Effects::of_number).collect())
    }

    fn module(text: &str) -> naga::Module {
        let module = naga::front::wgsl::parse_str(text).map_err(|e| e.emit_to_string(text)).expect("it parses");
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(text))
            .expect("it is valid");
        module
    }

    #[test]
    fn the_joined_text_is_valid_wgsl() {
        let module = module(&wgsl(3, Effects::all()));
        let mut groups: Vec<_> =
            module.global_variables.iter().filter_map(|(_, v)| v.binding.map(|b| (b.group, b.binding))).collect();
        groups.sort_unstable();
        assert_eq!(groups, [0, 1, 2, 3, 4, 5, 6].map(|binding| (3, binding)));
    }

    /// How often a text has a name outside of comments.
    fn uses(text: &str, name: &str) -> usize {
        let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
        code.flat_map(|code| code.split(|c: char| !c.is_alphanumeric() && c != '_'))
            .filter(|word| *word == name)
            .count()
    }

    #[test]
    fn every_variant_is_valid_and_uses_all_its_functions_and_constants() {
        let functions = [
            "surface_point",
            "glossy_point",
            "volume_point",
            "masked_point",
            "segment",
            "mark",
            "sample",
            "resample",
            "pmf",
            "pdf",
            "hit",
            "place_on",
            "user_data",
            "generation",
            "reservoir_of",
            "reservoir_sample",
            "reservoir_merge",
            "visible_share",
            "candidate_numbers",
            "stands_in",
            "hash",
        ]
        .map(|f| format!("light_{f}"));
        let promised: Vec<&str> = functions.iter().map(String::as_str).chain(PROMISED).collect();
        for effects in text_variants() {
            let text = wgsl(0, effects);
            let module = module(&text);
            let functions = module.functions.iter().filter_map(|(_, f)| f.name.clone());
            let constants = module.constants.iter().filter_map(|(_, c)| c.name.clone());
            let names: Vec<String> = functions.chain(constants).collect();
            // Those of segments are there with their effect only.
            let of_segments = ["light_sample_along", "light_along_pdf"];
            let is_promised = |name: &&String| [&promised[..], &of_segments].concat().contains(&name.as_str());
            for name in names.iter().filter(|name| !is_promised(name)) {
                assert!(uses(&text, name) > 1, "{name} is not used with {effects:?}");
            }
            for name in &promised {
                assert!(names.iter().any(|other| other == name), "{name} is missing with {effects:?}");
            }
            let counting = module_names(&wgsl_counting(0, effects));
            assert_eq!(counting.len(), module_names(&text).len() + 1, "only the counter is added");
        }
        assert_eq!(wgsl(0, Effects::all()), wgsl(0, Effects::all() - Effects::MOVING), "moving lights need no code");
    }

    const PORTAL_NAMES: &str = "light_portal_quad light_is_in_room light_portals_in_sight light_portal_share \
        light_share_between light_portal_side LIGHT_PORTAL_SLACK LIGHT_FILLED_WIDTH LIGHT_LEAST_SHARE LIGHT_IN_PLANE";

    const LEARNING_NAMES: &str = "light_learnt light_row_counts light_cell light_bin \
        light_child_bin light_learnt_share light_child_share light_cell_of_contested light_learnt_where \
        light_place_share light_toward_sample light_row_or_claim light_cell_key light_learnt_row \
        light_row_to_record light_record_visibility LightCellKey LightCellKey.tag LightCellKey.bucket \
        LightCell LightCell.key LightCell.block LightCell.row LightCell.from_center \
        LIGHT_NO_ROW LIGHT_WAYS LIGHT_MIN_IDLE LIGHT_BINS LIGHT_BIN_SHIFT LIGHT_COORDINATE_BITS \
        LIGHT_BLOCK_BITS LIGHT_LEARNT_BIT LIGHT_USED_BIT LIGHT_TABLE_HEAD LIGHT_MAX_DIST LIGHT_ROUNDING \
        LIGHT_BLOCK_MIDDLE";

    #[test]
    fn learning_adds_its_names_with_every_effect_and_without_any() {
        let all = Effects::all() - Effects::MOVING;
        let sets = all.iter().flat_map(|effect| [effect, all - effect]).chain([all, Effects::empty()]);
        for effects in sets {
            let text = wgsl_with(2, effects, &ShaderParts::default().with_learning());
            let (names, plain) = (module_names(&text), module_names(&wgsl(2, effects)));
            let added: HashSet<&str> = names.difference(&plain).map(String::as_str).collect();
            let sky = effects.contains(Effects::SKY).then_some("LIGHT_SKY_DIST");
            assert_eq!(added, LEARNING_NAMES.split_whitespace().chain(sky).collect(), "{effects:?}");
            assert!(plain.is_subset(&names));
            let bindings = module(&text).global_variables.iter().filter(|(_, v)| v.binding.is_some()).count();
            assert_eq!(bindings, 7, "{effects:?}");
        }
        let [fold, ..] = visibility_kernels().map(|kernel| module(&kernel.wgsl()));
        for entry in &fold.entry_points {
            assert_eq!(entry.workgroup_size, [visibility::BINS as u32 / 4, 1, 1], "{}", entry.name);
        }
    }

    const HEAT_NAMES: &str = "light_heat_map light_heat_of_cut light_heat_color light_number_color LIGHT_HEAT_DRAWS \
        LIGHT_HEAT_CUTS LIGHT_HEAT_MISSES LIGHT_HEAT_LIGHTS";

    #[test]
    fn a_heat_map_adds_its_names_to_every_variant_and_nothing_else() {
        for effects in text_variants() {
            let names = |parts: &ShaderParts| module_names(&wgsl_with(2, effects, parts));
            let (plain, with) = (names(&ShaderParts::default()), names(&ShaderParts::default().with_heat_map()));
            let added: HashSet<&str> = with.difference(&plain).map(String::as_str).collect();
            assert_eq!(added, HEAT_NAMES.split_whitespace().collect(), "{effects:?}");
            assert!(plain.is_subset(&with));
        }
    }

    #[test]
    fn the_stages_of_cells_are_valid_with_every_effect_and_without_any() {
        let all = Effects::all() - Effects::MOVING;
        let sets = all.iter().flat_map(|effect| [effect, all - effect]).chain([all, Effects::empty()]);
        for effects in sets {
            for kernel in &cut_kernels(effects)[4..] {
                assert_eq!(module(&kernel.wgsl()).entry_points[0].workgroup_size, [64, 1, 1]);
            }
            // Shaders choose by rough estimates.
            assert!(!module_names(&wgsl(2, effects)).contains("light_importance"));
        }
        let points = cut_kernels(all).map(|kernel| module(&kernel.wgsl()).entry_points.len());
        assert_eq!(points, [3, 3, 1, 3, 1, 1]);
    }

    #[test]
    fn every_name_of_every_variant_takes_a_prefix() {
        for effects in text_variants() {
            let text = wgsl_with(0, effects, &ShaderParts::default().with_previous());
            let prefixed = with_prefix(&text, "gi_").expect("a prefix");
            let engine = "
                struct LightSample { mine: f32 }
                fn light_sample(at: gi_LightShadingPoint) -> f32 {
                    let kept = gi_LightReservoir();
                    return gi_light_reservoir_sample(at, kept).pmf + gi_light_reservoir_sample_previous(at, kept).pmf;
                }";
            let names = module_names(&(prefixed + engine));
            for name in module_names(&text).iter().filter(|name| !name.contains('.')) {
                assert!(names.contains(&format!("gi_{name}")), "{name} with {effects:?}");
            }
        }
        for prefix in ["", "__x", "9a", "a b", "gi-", "größe", "a\n", "f("] {
            let error = with_prefix("", prefix).expect_err("no prefix");
            assert_eq!((error.prefix.as_str(), error.code()), (prefix, 900));
        }
    }

    /// The names of functions, variables, constants and types, and of members as `Type.member`.
    fn module_names(text: &str) -> HashSet<String> {
        let module = module(text);
        let functions = module.functions.iter().filter_map(|(_, f)| f.name.clone());
        let variables = module.global_variables.iter().filter_map(|(_, v)| v.name.clone());
        let constants = module.constants.iter().filter_map(|(_, c)| c.name.clone());
        let mut names: HashSet<String> = functions.chain(variables).chain(constants).collect();
        for (_, ty) in module.types.iter() {
            // Those of the language begin with two underscores.
            let Some(name) = ty.name.as_ref().filter(|name| !name.starts_with("__")) else { continue };
            names.insert(name.clone());
            if let naga::TypeInner::Struct { members, .. } = &ty.inner {
                names.extend(members.iter().filter_map(|m| Some(format!("{name}.{}", m.name.as_ref()?))));
            }
        }
        names
    }

    const SOLID_ANGLE_NAMES: &str = "light_spherical_triangle light_near_surface light_share light_sample_near_surface light_near \
        light_is_lit_side light_from_near_surface LightNearSurface LightNearSurface.corner \
        LightNearSurface.u LightNearSurface.v LightNearSurface.first LightNearSurface.second \
        LightNearSurface.solid_angle LIGHT_NEAR_SIZE_SQ LIGHT_MIN_DETERMINANT LIGHT_MAX_DETERMINANT";

    const SEGMENT_NAMES: &str = "LIGHT_ARC_TANGENT_3 LIGHT_ARC_TANGENT_5 LIGHT_ARC_TANGENT_7 LIGHT_ARC_TANGENT_9 \
        LIGHT_CONE_MARGIN LIGHT_CONE_SLACK LIGHT_MIN_LINE_SHARE LIGHT_RANGE_SLACK \
        LightAlong LightAlong.along LightAlong.pdf \
        LightEnd LightEnd.dist LightEnd.place LightGap LightGap.center_sq LightGap.gap_sq \
        LightLocalShadingPoint.segment light_along LightSegmentView LightSegmentView.foot \
        LightSegmentView.half_length LightSegmentView.line_sq LightShadingPoint.segment LightSource \
        LightSource.axis LightSource.cos LightSource.radius LightSource.toward LightSource.variance \
        LightStretch LightStretch.a LightStretch.angle LightStretch.extent LightStretch.start \
        LightStretch.soft light_along_pdf light_angle light_is_turned_away_along \
        light_cone_place light_emitted_along light_end light_estimate_along \
        light_importance_along light_gap light_halved light_is_segment light_local_segment light_near_sq \
        light_point_along light_sample_along light_segment_view \
        light_source light_source_of light_stretch light_stretch_density light_stretch_of \
        light_stretch_sample light_seen_axis light_seen_box LightImportance LightImportance.doubt \
        LightImportance.lux light_has_unresolved light_is_out_of_range light_position_error_sq light_resolved_sum \
        light_scale_unresolved light_unresolved_scale light_unresolved_sum light_weights LIGHT_ANGLE_MARGIN \
        LIGHT_MAX_DIST_SQ LIGHT_MEAN_ERROR_SQ LIGHT_MIN_GAP LIGHT_MIN_POSITION_ERROR LIGHT_NEAR_GAIN \
        LIGHT_NEAR_VARIANCE LIGHT_POSITION_ERROR LIGHT_VARIANCE_SHARE";

    #[test]
    fn a_variant_without_an_effect_lacks_exactly_the_names_that_the_effect_needs() {
        let all = module_names(&wgsl(0, Effects::all()));
        let effects = [
            (
                Effects::CONES,
                "light_lobe light_from_spot light_unit_axis LightLobe LightLobe.value LightLobe.width_sq \
                 LightChild.facing LightChild.center_sq \
                 LightChild.center_facing LightChild.axis_length LightChild.cos_half_angle LIGHT_KIND_SPOT \
                 LIGHT_LAMBERTIAN LIGHT_LOBE_SHARE LIGHT_RIM_WIDTH_SQ LIGHT_RIM_MIN_SQ LIGHT_MAX_LOBE_LENGTH \
                 LIGHT_CAP_STEPS LIGHT_ANGLE_MARGIN light_cap_cosine LIGHT_AXIS_ROUNDING light_see_axis light_seen_axis light_axis_in_axes light_end light_halved \
                 LightEnd LightEnd.place LightEnd.dist light_is_turned_away_along light_emitted_along LIGHT_LEAST_NORMAL_CODE \
                 LIGHT_ROUGH_SPILL",
            ),
            (
                Effects::RANGES,
                "light_is_out_of_range light_range_window LightChild.range \
                 LightRecord.range LIGHT_RANGE_SLACK",
            ),
            (
                Effects::AREAS,
                "light_from_surface light_from_rectangle light_from_triangle light_from_sphere light_is_density \
                 light_orthonormal light_normal_area light_tree_margin LIGHT_KIND_RECTANGLE LIGHT_KIND_TRIANGLE \
                 LIGHT_KIND_SPHERE LIGHT_TWO_SIDED LIGHT_CLOSE LIGHT_MIN_INVERSE_PDF \
                 light_point_pdf light_surface_pdf light_sphere_pdf light_flat_normal_area \
                 light_ray light_meets light_hit_dist light_flat_hit light_flat_corner light_first_hit LIGHT_MIN_DIRECTION LIGHT_BOX_ROUNDING \
                 LightRay LightRay.position LightRay.margin LightRay.inverse \
                 LightFirstHit LightFirstHit.instance LightFirstHit.light LightFirstHit.dist",
            ),
            (Effects::SOLID_ANGLES, SOLID_ANGLE_NAMES),
            (
                Effects::GLOSSY,
                "light_gloss light_reflected light_reflectance LightGloss LightChild.tangents \
                 LightGloss.tangent LightGloss.alpha LightGloss.bitangent LightGloss.specular LightGloss.view \
                 LightGloss.flat_part LightReflected LightReflected.value LightReflected.doubt \
                 LightShadingPoint.gloss LightLocalShadingPoint.gloss \
                 LIGHT_MIN_VIEW_SQ LIGHT_MAX_VIEW_SQ LIGHT_MIN_VIEW_SINE_SQ LIGHT_MIN_VIEW_COSINE LIGHT_MIN_SPECULAR LIGHT_MIN_ALPHA \
                 LIGHT_GLOSS_WIDTH LIGHT_MIN_GLOSS light_cell_gloss LightShadingPoint.cell_gloss LIGHT_GLOSS_SHIFT \
                 LIGHT_GREATEST_RATIO LIGHT_LEAST_RATIO LIGHT_ROUGHNESS_STEPS LIGHT_VIEW_COSINE",
            ),
            (Effects::SEGMENTS, SEGMENT_NAMES),
            (
                Effects::FACTORS,
                "light_brightness light_factored LightInstance.factor LightLocalShadingPoint.brightness \
                 LIGHT_MAX_FINITE",
            ),
            (
                Effects::MASKS,
                "light_met_children light_seen_share LightInstance.mask LightShadingPoint.mask \
                 LIGHT_MASK_QUADS LIGHT_MASK_WHOLE",
            ),
            (
                Effects::SKY,
                "light_sees_sky light_sky_root light_sky_head light_square_holds light_patch_square light_sky_quad light_sky_quad_lux \
                 light_shared_exponent light_sky_texel light_sky_luminance light_sky_lux light_sky_choose \
                 light_sky_direction light_sky_row light_sky_arriving light_sky_incident light_sky_texel_at \
                 LIGHT_ROOT_OF_SKY light_sky_from light_sky_pdf light_in_order light_patch_of LightSquare LightSquare.level \
                 LightSquare.at LIGHT_SKY_BITS LIGHT_KIND_SKY LIGHT_SKY_LEVELS",
            ),
            (Effects::PORTALS, PORTAL_NAMES),
            (
                Effects::PROFILES,
                "light_profile_number light_profile_cell light_profile_column light_profile_candela light_from_profile \
                 LightProfile LightProfile.first LightProfile.polar LightProfile.around LightRecord.profile \
                 LIGHT_KIND_PROFILE LIGHT_WHOLE_TURN",
            ),
            (
                Effects::DIRECTIONAL,
                "light_illuminance light_directional_lux light_directional_lux_of light_pick_directional LIGHT_KIND_DIRECTIONAL",
            ),
            (
                Effects::NON_RIGID,
                "light_flux_shares light_axes light_axis_in_axes \
                 light_box_in_axes light_scaled_child LightMappedBox LightMappedBox.bounds \
                 LightMappedBox.size_sq light_cap_cosine LIGHT_LEAST_NORMAL_CODE LIGHT_ALL_SURFACES LIGHT_AXIS_ROUNDING LightInstance.to_local \
                 LightPackedChild.area_ratio LightLocalShadingPoint.scaled_instance \
                 LIGHT_NON_RIGID LIGHT_MAX_FLUX LIGHT_INSTANCE_LOCAL",
            ),
        ];
        for (effect, names) in effects {
            let without = module_names(&wgsl(0, Effects::all() - effect));
            assert!(without.is_subset(&all));
            let missing: HashSet<&str> = all.difference(&without).map(String::as_str).collect();
            // Code for solid angles is part of that for areas, and code for portals of that for the sky.
            let nested = match effect {
                Effects::AREAS => SOLID_ANGLE_NAMES,
                Effects::SKY => PORTAL_NAMES,
                _ => "",
            };
            let expected = names.split_whitespace().chain(nested.split_whitespace()).collect();
            assert_eq!(missing, expected, "without {effect:?}");
        }
        let points = module_names(&wgsl(0, Effects::empty()));
        for name in ["LightRecord.b", "LightRecord.c", "LIGHT_KIND_MASK", "LIGHT_UNLIMITED_RANGE"] {
            assert!(all.contains(name) && !points.contains(name), "{name}");
        }
    }
}
