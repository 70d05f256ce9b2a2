//! The WGSL texts of refits on the GPU.

use super::super::kernel::{Binding, Kernel};
use super::super::text::wgsl_of_kernel;
use super::super::top::NODE_LANES;
use super::pieces::{ENTRIES, ROUND, STORED};
use super::records::RefitPass;
use crate::cluster;
use crate::cluster::cone;
use crate::light;
use crate::tree::{WIDTH, cost};

/// Invocations in a workgroup that writes the records of parts.
pub(super) const PART_LANES: u32 = 64;

/// Added to the angle of a spot for the rounding of its cosine, which is stored: as much as the cosine may
/// be off.
const COSINE_ERROR: f32 = 3.0e-7;

/// Stands for infinity in the boxes of dark children. No box extends farther.
const FAR: f32 = 1.0e30;

const UNIFORM: Binding = Binding::Uniform { bytes: size_of::<RefitPass>() as u32 };

/// Nodes, sources, clusters and measures; lights, pieces and lists.
const REFIT_BINDINGS: &[Binding] = &[
    UNIFORM,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::Read,
    Binding::Read,
    Binding::Read,
];

/// Records of trees, sources, clusters, nodes, lights, lists and measures. Nodes are only read.
const PART_BINDINGS: &[Binding] = &[
    UNIFORM,
    Binding::ReadWrite,
    Binding::ReadWrite,
    Binding::Read,
    Binding::ReadWrite,
    Binding::Read,
    Binding::Read,
    Binding::ReadWrite,
];

pub(in crate::plan) const REFIT: Kernel = Kernel::new("refit", "refit", REFIT_BINDINGS, |_| text(REFIT_SOURCES));
pub(in crate::plan) const PARTS: Kernel = Kernel::new("refit_parts", "refit", PART_BINDINGS, |_| text(PART_SOURCES));

const SHARED: &[&str] = &[
    shader!("types"),
    shader!("instance"),
    shader!("node"),
    shader!("cluster"),
    shader!("node_store"),
    shader!("source_types"),
    shader!("refit_types"),
    shader!("refit_light"),
];
const REFIT_SOURCES: &[&str] = &[shader!("pack_merge"), shader!("refit")];
const PART_SOURCES: &[&str] = &[shader!("refit_parts")];

/// What shaders of the engine and refits share.
const SOURCE_PI: (&str, f32) = ("LIGHT_SOURCE_PI", std::f32::consts::PI);

/// Returns the text for a kernel of the engine that writes the lights of trees with a
/// [source](crate::TreeSource). It has these functions:
///
/// ```wgsl
/// // How many lights a source has; 0 while the GPU does not hold its tree.
/// fn light_source_count(source: u32) -> u32
/// fn light_put_point(source: u32, light: u32, position: vec3<f32>, intensity: vec3<f32>)
/// fn light_put_spot(source: u32, light: u32, position: vec3<f32>, direction: vec3<f32>, intensity: vec3<f32>)
/// fn light_put_rectangle(source: u32, light: u32, center: vec3<f32>, half_u: vec3<f32>, half_v: vec3<f32>, radiance: vec3<f32>)
/// fn light_put_triangle(source: u32, light: u32, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, radiance: vec3<f32>)
/// fn light_put_sphere(source: u32, light: u32, center: vec3<f32>, radius: f32, radiance: vec3<f32>)
/// // Keeps the place of a light, and makes it emit nothing.
/// fn light_put_dark(source: u32, light: u32)
/// // The light is another one from now on: its `light_generation` changes.
/// fn light_put_new(source: u32, light: u32)
/// ```
///
/// `source` is the number from [`LightWorld::light_source`](crate::LightWorld::light_source), and `light` the index of a
/// light in its tree. Positions are in the space of the tree. A light keeps the kind, the range, the sides and the
/// opening angles that it has on the CPU. A write is refused for a light of another kind and for values that
/// [`Light::validate`](crate::Light::validate) would refuse, such as NaN: the light is then dark, and the refusal is
/// counted. A write to a light that is not there does nothing. Each light is written by one invocation of a dispatch.
///
/// The text binds two storage buffers, at 0 and 1, which it writes:
/// [`LightPlanner::source_bindings`](super::super::LightPlanner::source_bindings).
#[must_use]
pub fn wgsl_of_sources(group: u32) -> String {
    let whole = [
        ("LIGHT_MAX_COORDINATE_BITS", light::MAX_COORDINATE.to_bits()),
        ("LIGHT_MAX_EMISSION_BITS", light::MAX_EMISSION.to_bits()),
    ];
    let real = [SOURCE_PI, ("LIGHT_UNIT_TOLERANCE", light::UNIT_TOLERANCE)];
    let functions = shader!("source").replace("LIGHT_GROUP", &group.to_string());
    wgsl_of_kernel(&whole, &real, &[shader!("source_types"), &functions])
}

fn text(own: &[&str]) -> String {
    let whole = [
        ("TOP_NODE_LANES", NODE_LANES),
        ("REFIT_ENTRIES", ENTRIES),
        ("REFIT_STORED", STORED),
        ("REFIT_PART_LANES", PART_LANES),
    ];
    let (sin_rim, cos_rim) = light::SPOT_RIM.sin_cos();
    let real = [
        SOURCE_PI,
        ("CAP_PADDING", cone::CAP_PADDING),
        ("MIN_AXIS", cluster::MIN_AXIS),
        ("TRANSFORM_PADDING", cluster::bounds::TRANSFORM_PADDING),
        ("REFIT_MIN_SINE", light::MIN_SINE),
        ("REFIT_MIN_CROSS", light::MIN_CROSS),
        ("REFIT_LAMBERTIAN", light::LAMBERTIAN),
        ("REFIT_COS_RIGHT_ANGLE", (0.5 * std::f32::consts::PI).cos()),
        ("REFIT_COSINE_ERROR", COSINE_ERROR),
        ("REFIT_DIAGONAL_WEIGHT", cost::DIAGONAL_WEIGHT),
        ("REFIT_ALL_SIDES", cost::ALL_SIDES),
        ("REFIT_FALL_TO_FLAT", cost::FALL_TO_FLAT),
        ("REFIT_FALL_TO_BEAM", cost::FALL_TO_BEAM),
        ("REFIT_FAR", FAR),
        ("REFIT_SIN_RIM", sin_rim),
        ("REFIT_COS_RIM", cos_rim),
    ];
    wgsl_of_kernel(&whole, &real, &[SHARED, own].concat())
}

const _: () = assert!(ROUND * WIDTH == NODE_LANES as usize);
