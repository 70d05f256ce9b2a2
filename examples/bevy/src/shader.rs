//! The WGSL of the plugin: Girandole's text, Bevy's lighting by one light, and the pass.
//!
//! The pass is one text, in which candidates are weighed by Bevy's BRDF. Materials and passes of an
//! application import the same functions as modules.

use girandole::plan::{self, TargetHook};

use crate::gpu::effects;

/// The bind group of [`GirandoleGpu::bind_group`](crate::GirandoleGpu::bind_group) in the modules.
pub const LIGHTS_GROUP: u32 = 3;

/// What the texts below import of Bevy, for shading.
///
/// naga_oil replaces imported names wherever they occur, also where they name a field. So functions
/// and variables of Bevy are written with their modules.
const SHADING_IMPORTS: &str = "#import bevy_pbr::{
    lighting, lighting::LightingInput, mesh_view_bindings, pbr_functions, pbr_types::PbrInput,
}
";

/// What the pass imports of Bevy in addition.
const PASS_IMPORTS: &str = "#import bevy_pbr::{
    pbr_deferred_functions::pbr_input_from_deferred_gbuffer, pbr_types::STANDARD_MATERIAL_FLAGS_UNLIT_BIT,
}
";

/// The functions of Girandole that shading uses, for texts that import them.
const LIGHT_IMPORTS: &str = "#import girandole::{
    LightShadingPoint, LightSample, LightPick, LIGHT_DIRECTIONAL, light_glossy_point, light_user_data, light_hash,
    light_resample, light_sample_picked,
}
";

const GIRANDOLE_IMPORTS: &str = "#import girandole::shading::{
    girandole_surface, girandole_shading_point, girandole_reflected, girandole_sample, girandole_numbers,
    girandole_kinds,
}
";

/// The text of the pass. Candidates are kept in proportion to what Bevy's BRDF reflects of them.
pub fn joined() -> String {
    let hook = TargetHook::new("girandole_target", "LightingInput").expect("both are names");
    let library = plan::wgsl_with_target(LIGHTS_GROUP, effects(), &hook);
    let imports = [SHADING_IMPORTS, PASS_IMPORTS].concat();
    [&imports, &library, include_str!("shade.wgsl"), include_str!("joined.wgsl"), include_str!("pass.wgsl")].concat()
}

/// The same pass, which imports the modules. Candidates are kept by Girandole's own estimate of what
/// the surface reflects, since a module cannot call what imports it.
pub fn importing() -> String {
    [SHADING_IMPORTS, PASS_IMPORTS, LIGHT_IMPORTS, GIRANDOLE_IMPORTS, include_str!("pass.wgsl")].concat()
}

/// The module `girandole`: the functions that the documentation of
/// [`LightShader`](girandole::gpu::LightShader) lists.
pub fn lights_module() -> String {
    plan::naga_oil_module(&plan::wgsl(LIGHTS_GROUP, effects()))
}

/// The module `girandole::shading`: Bevy's lighting by one light.
pub fn shading_module() -> String {
    let path = "#define_import_path girandole::shading\n";
    [path, SHADING_IMPORTS, LIGHT_IMPORTS, include_str!("shade.wgsl"), include_str!("module.wgsl")].concat()
}
