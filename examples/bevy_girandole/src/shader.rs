//! The WGSL of the plugin: Girandole's text, Bevy's lighting by one light, and the pass.
//!
//! The pass is one text. Materials and passes of an application import the same functions as modules.

use bevy::shader::Shader;
use girandole::plan::{self, ShaderParts};

use crate::gpu::effects;
use crate::shadows::ShadowRays;

/// The bind group of [`GirandoleGpu::bind_group`](crate::GirandoleGpu::bind_group) in the modules.
pub const LIGHTS_GROUP: u32 = 3;

/// The bind group of [`GirandoleGpu::source_group`](crate::GirandoleGpu::source_group) in the module
/// `girandole::sources`.
pub const SOURCES_GROUP: u32 = 1;

#[cfg(not(feature = "wesl"))]
use crate::naga_oil::{GIRANDOLE_IMPORTS, LIGHT_IMPORTS, PASS_IMPORTS, SHADING_IMPORTS, module};
#[cfg(feature = "wesl")]
use crate::wesl::{GIRANDOLE_IMPORTS, LIGHT_IMPORTS, PASS_IMPORTS, SHADING_IMPORTS, module};

/// Every sample arrives.
const UNSHADOWED: &str = include_str!("unshadowed.wgsl");

/// What traces shadow rays.
fn shadow(rays: ShadowRays) -> &'static str {
    match rays {
        ShadowRays::Software => concat!(include_str!("shadow_walk.wgsl"), include_str!("shadow.wgsl")),
        ShadowRays::RayQuery => concat!(include_str!("shadow_query.wgsl"), include_str!("shadow.wgsl")),
    }
}

/// The extensions of WGSL that a text needs.
fn extensions(rays: Option<ShadowRays>) -> &'static str {
    match rays {
        Some(ShadowRays::RayQuery) => "enable wgpu_ray_query;\n",
        Some(ShadowRays::Software) | None => "",
    }
}

/// The pass in one text. With `shadows`, a ray looks whether the kept one is seen, and what it finds is learnt. With `is_heat_map`, it
/// shows how they are chosen.
pub fn joined(shadows: Option<ShadowRays>, is_heat_map: bool) -> Shader {
    let parts = ShaderParts::default().with_previous();
    let parts = if shadows.is_some() { parts.with_learning() } else { parts };
    let parts = if is_heat_map { parts.with_heat_map() } else { parts };
    let library = plan::wgsl_with(LIGHTS_GROUP, effects(), &parts);
    let parts = [
        library.as_str(),
        include_str!("surface.wgsl"),
        include_str!("shade.wgsl"),
        shadows.map_or("", shadow),
        if shadows.is_some() { include_str!("seen.wgsl") } else { UNSHADOWED },
        include_str!("pixel.wgsl"),
        include_str!("pass.wgsl"),
        if is_heat_map { include_str!("heat.wgsl") } else { include_str!("light.wgsl") },
    ];
    let path = if is_heat_map { "girandole::heat_pass" } else { "girandole::pass" };
    module(path, extensions(shadows), &[SHADING_IMPORTS, PASS_IMPORTS], &parts.concat())
}

/// The same pass, which imports the modules. It has no shadows.
pub fn importing() -> Shader {
    let imports = [SHADING_IMPORTS, PASS_IMPORTS, LIGHT_IMPORTS, GIRANDOLE_IMPORTS];
    module(
        "girandole::pass",
        "",
        &imports,
        &[UNSHADOWED, include_str!("pixel.wgsl"), include_str!("pass.wgsl"), include_str!("light.wgsl")].concat(),
    )
}

/// The pass that poses meshes.
pub fn posing() -> Shader {
    module("girandole::poses", "", &[], &(plan::wgsl_of_sources(SOURCES_GROUP) + include_str!("pose.wgsl")))
}

/// The modules for applications: `girandole`, with the functions that the documentation of
/// [`LightShader`](girandole::gpu::LightShader) lists; `girandole::shading`, Bevy's lighting by one
/// light; `girandole::shadows`, which traces shadow rays; and `girandole::sources`, with those of
/// [`plan::wgsl_of_sources`].
pub fn modules(rays: ShadowRays) -> [Shader; 4] {
    let shading = [include_str!("surface.wgsl"), include_str!("shade.wgsl"), include_str!("module.wgsl")].concat();
    [
        module(
            "girandole",
            "",
            &[],
            &plan::wgsl_with(LIGHTS_GROUP, effects(), &ShaderParts::default().with_previous()),
        ),
        module("girandole::shading", "", &[SHADING_IMPORTS, LIGHT_IMPORTS], &shading),
        module("girandole::shadows", extensions(Some(rays)), &[], shadow(rays)),
        module("girandole::sources", "", &[], &plan::wgsl_of_sources(SOURCES_GROUP)),
    ]
}
