//! What the shader texts need for Bevy 0.20, which composes them with WESL.

use bevy::shader::Shader;

pub const SHADING_IMPORTS: &str = "import bevy_pbr::render::{
    pbr_lighting as lighting, pbr_lighting::LightingInput, mesh_view_bindings, pbr_functions, pbr_types::PbrInput,
};
";

pub const PASS_IMPORTS: &str = "import bevy_pbr::{
    deferred::functions::pbr_input_from_deferred_gbuffer, render::pbr_types::STANDARD_MATERIAL_FLAGS_UNLIT_BIT,
};
";

pub const LIGHT_IMPORTS: &str = "import girandole::{
    LightShadingPoint, LightSample, LightReservoir, LIGHT_DIRECTIONAL, light_glossy_point, light_user_data, light_hash,
    light_mark, light_resample, light_reservoir_of, light_reservoir_sample, light_reservoir_sample_previous,
    light_reservoir_merge, light_cuts, light_top, light_nodes,
};
";

pub const GIRANDOLE_IMPORTS: &str = "import girandole::shading::{
    girandole_surface, girandole_shading_point, girandole_reflected, girandole_numbers,
    girandole_kinds, girandole_is_there,
};
";

/// A text as the module of a path. Bevy derives the path of the module from the path of the file. Imports come before
/// extensions in WESL.
pub fn module(path: &str, extensions: &str, imports: &[&str], text: &str) -> Shader {
    let text = format!("{}{extensions}{text}", imports.concat());
    Shader::from_wesl(text, format!("embedded://{}.wesl", path.replace("::", "/")))
}
