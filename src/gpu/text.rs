//! Joins the WGSL files, and gives them the constants that Rust owns: no number is written in two places.

use std::fmt::Write;

use super::layout;
use crate::importance;
use crate::light;
use crate::tree;
use crate::walk;

/// The WGSL that an engine joins into a shader of its own: `light_sample`, `light_pick`, `light_pmf` and what they need.
///
/// Its bindings sit in `@group(group)`, laid out as `GpuLights::bind_group_layout` has them: one uniform and four
/// read-only storage buffers. All names start with `light_`, `Light` or `LIGHT_`. Source: `shaders/sample.wgsl`.
pub fn wgsl(group: u32) -> String {
    let sample = include_str!("../../shaders/sample.wgsl").replace("LIGHT_GROUP", &group.to_string());
    pure() + &sample
}

/// Constants, records and pure functions: everything that binds nothing.
pub(crate) fn pure() -> String {
    let mut text = constants();
    for part in [
        include_str!("../../shaders/types.wgsl"),
        include_str!("../../shaders/node.wgsl"),
        include_str!("../../shaders/importance.wgsl"),
        include_str!("../../shaders/dice.wgsl"),
        include_str!("../../shaders/emit.wgsl"),
    ] {
        text += part;
    }
    text
}

/// Rust's constants as WGSL's.
pub(crate) fn constants() -> String {
    let mut text = String::from("// Constants of the Rust sources; see src/gpu/text.rs.\n");
    for (name, value) in [
        ("WIDTH", tree::WIDTH as u32),
        ("LEAF", tree::LEAF),
        ("EMPTY_SLOT", tree::EMPTY_SLOT),
        ("NO_PARENT", tree::NO_PARENT),
        ("KIND_MASK", layout::KIND_MASK),
        ("KIND_POINT", layout::KIND_POINT),
        ("KIND_SPOT", layout::KIND_SPOT),
        ("KIND_RECTANGLE", layout::KIND_RECTANGLE),
        ("KIND_TRIANGLE", layout::KIND_TRIANGLE),
        ("KIND_SPHERE", layout::KIND_SPHERE),
        ("KIND_DIRECTIONAL", layout::KIND_DIRECTIONAL),
        ("TWO_SIDED", layout::TWO_SIDED),
        ("LIVE", layout::LIVE),
        ("KEEPS_ANGLES", layout::KEEPS_ANGLES),
        ("DIRECTIONAL", layout::DIRECTIONAL),
    ] {
        let _ = writeln!(text, "const LIGHT_{name}: u32 = {value}u;");
    }
    for (name, value) in [
        ("VARIANCE_SHARE", importance::VARIANCE_SHARE),
        ("COSINE_WIDTH", importance::COSINE_WIDTH),
        ("FLOOR", importance::FLOOR),
        ("LAMBERTIAN", light::LAMBERTIAN),
        ("LOBE_SHARE", importance::LOBE_SHARE),
        ("LONGEST_LOBE", importance::LONGEST_LOBE),
        ("LEAST", importance::LEAST),
        ("MOST", importance::MOST),
        ("POSITION_MARGIN", importance::POSITION_MARGIN),
        ("COSINE_MARGIN", importance::COSINE_MARGIN),
        ("LEAST_FLUX", light::MIN_FLUX),
        ("FARTHEST", tree::FARTHEST),
        ("TINY", f32::MIN_POSITIVE),
        // Densities of more than 1e30 per steradian belong to surfaces seen from their edge.
        ("TINY_RATIO", 1.0e-30),
        ("FOUR_PI", 4.0 * std::f32::consts::PI),
        ("BELOW_ONE", walk::BELOW_ONE),
        ("U_STEP", walk::U_STEP),
    ] {
        let _ = writeln!(text, "const LIGHT_{name}: f32 = {value:e};");
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_joined_text_is_valid_wgsl() {
        let text = super::wgsl(3);
        let module = naga::front::wgsl::parse_str(&text).map_err(|e| e.emit_to_string(&text)).expect("it parses");
        naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::default())
            .validate(&module)
            .map_err(|e| e.emit_to_string(&text))
            .expect("it is valid");
        let groups: Vec<_> =
            module.global_variables.iter().filter_map(|(_, v)| v.binding.map(|b| (b.group, b.binding))).collect();
        assert_eq!(groups, [(3, 0), (3, 1), (3, 2), (3, 3), (3, 4)]);
    }
}
