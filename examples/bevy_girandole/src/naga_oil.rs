//! What the shader texts need for Bevy 0.19, which composes them with naga_oil.
//!
//! naga_oil replaces imported names wherever they occur, even where they name a field. So Bevy's
//! functions and variables are qualified with their modules.

use bevy::shader::Shader;
use girandole::plan::naga_oil_module;

pub const SHADING_IMPORTS: &str = "#import bevy_pbr::{
    lighting, lighting::LightingInput, mesh_view_bindings, pbr_functions, pbr_types::PbrInput,
}
";

pub const PASS_IMPORTS: &str = "#import bevy_pbr::{
    pbr_deferred_functions::pbr_input_from_deferred_gbuffer, pbr_types::STANDARD_MATERIAL_FLAGS_UNLIT_BIT,
}
";

pub const LIGHT_IMPORTS: &str = "#import girandole::{
    LightShadingPoint, LightSample, LightReservoir, LIGHT_DIRECTIONAL, light_glossy_point, light_user_data, light_hash,
    light_mark, light_resample, light_reservoir_of, light_reservoir_sample, light_reservoir_sample_previous,
    light_reservoir_merge, light_cuts, light_top, light_nodes,
}
";

pub const GIRANDOLE_IMPORTS: &str = "#import girandole::shading::{
    girandole_surface, girandole_shading_point, girandole_reflected, girandole_numbers,
    girandole_kinds, girandole_is_there,
}
";

/// A text as the module of a path. naga_oil finds extensions at the start alone.
pub fn module(path: &str, extensions: &str, imports: &[&str], text: &str) -> Shader {
    let text = match path {
        "girandole" => naga_oil_module(text),
        _ => format!("{extensions}#define_import_path {path}\n{}{text}", imports.concat()),
    };
    Shader::from_wgsl(text, format!("{path}.wgsl"))
}
