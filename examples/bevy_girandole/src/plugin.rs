//! The plugin: which systems run where.

use bevy::core_pipeline::core_3d::main_opaque_pass_3d;
use bevy::core_pipeline::schedule::{Core3d, Core3dSystems};
use bevy::pbr::MeshPipelineSystems;
use bevy::pbr::deferred::deferred_lighting;
use bevy::prelude::*;
use bevy::render::render_resource::SpecializedRenderPipelines;
use bevy::render::renderer::{RenderDevice, RenderGraph, RenderGraphSystems};
use bevy::render::{ExtractSchedule, GpuResourceAppExt, Render, RenderApp, RenderStartup, RenderSystems};
use bevy::shader::Shader;

use crate::names::{self, GirandoleNames};
use crate::pass::{PassPipelines, PassShaders};
use crate::posing::PoseShader;
use crate::settings::{GirandoleSettings, GirandoleStats, RayTraced};
use crate::shadows::{self, Casters, GirandoleShadows, ShadowRays};
use crate::textures::DefaultWrap;
use crate::world::GirandoleLights;
use crate::{extract, gather, gpu, history, pass, posing, shader};

/// Adds Girandole to an application, after Bevy's own plugins.
#[derive(Clone, Copy, Debug)]
pub struct GirandolePlugin {
    /// Whether entities with a mesh cast shadows from the plugin's lights. It takes memory for trees over all
    /// triangles, and a shadow ray for each sample. Ray queries trace the rays on devices that have them.
    pub shadows: bool,
    /// Whether the pass imports the same modules as applications do. Otherwise it is one text, in which
    /// candidates are weighted by Bevy's BRDF and pixels share cuts. Importing is noisier and without
    /// shadows, and is meant for tests of the modules.
    pub importing: bool,
    /// Whether another renderer draws the scene by ray tracing, and only asks for lights: see
    /// [`GirandoleNames`](crate::GirandoleNames). Then the lights of a mesh are its triangles, which no texture cuts;
    /// emissive colours are nits, whatever the exposure; and Bevy keeps directional lights.
    pub ray_traced: bool,
}

impl Default for GirandolePlugin {
    fn default() -> Self {
        Self { shadows: true, importing: false, ray_traced: false }
    }
}

/// The steps in the render world, to order systems by.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GirandoleSystems {
    /// In [`Render`]: the light world is updated and uploaded.
    Upload,
    /// In [`RenderGraph`]: lights are written on the GPU, by the plugin and by passes of the application.
    WriteLights,
    /// In [`RenderGraph`]: the build of the top level is recorded. Passes that sample come later.
    BuildTop,
    /// In [`Core3d`]: the light is added to the picture of a camera.
    Draw,
}

/// Keeps the modules alive, so that they can be imported.
#[derive(Resource)]
struct Modules {
    _handles: [Handle<Shader>; 4],
}

impl GirandolePlugin {
    fn has_shadows(&self) -> bool {
        self.shadows && !self.importing && !self.ray_traced
    }
}

impl Plugin for GirandolePlugin {
    fn build(&self, app: &mut App) {
        app.init_resource::<GirandoleSettings>().init_resource::<GirandoleStats>();
        if app.get_sub_app(RenderApp).is_none() {
            // Nothing is drawn, so nothing would take the edits.
            return;
        }
        app.insert_resource(DefaultWrap::of(app)).insert_resource(RayTraced(self.ray_traced));
        gather::add_systems(app, self.ray_traced);
        if self.has_shadows() {
            gather::add_shadow_systems(app);
        }
        let stats = app.world().resource::<GirandoleStats>().clone();
        let settings = app.world().resource::<GirandoleSettings>().clone();
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app
            .insert_resource(stats)
            .insert_resource(settings)
            .init_resource::<GirandoleLights>()
            .init_gpu_resource::<SpecializedRenderPipelines<PassPipelines>>()
            .add_systems(
                RenderStartup,
                (gpu::start, history::forget, posing::start, pass::start.after(MeshPipelineSystems)),
            )
            .add_systems(ExtractSchedule, (extract::edits, extract::cameras))
            .add_systems(
                Render,
                (
                    gpu::prepare.in_set(GirandoleSystems::Upload).in_set(RenderSystems::PrepareResources),
                    posing::prepare.in_set(RenderSystems::PrepareResources).after(gpu::prepare),
                    history::prepare.in_set(RenderSystems::PrepareResources),
                    pass::specialize.in_set(RenderSystems::Prepare).after(gpu::prepare),
                ),
            )
            .configure_sets(
                RenderGraph,
                (GirandoleSystems::WriteLights, GirandoleSystems::BuildTop).chain().in_set(RenderGraphSystems::Begin),
            )
            .add_systems(
                RenderGraph,
                (
                    posing::record.in_set(GirandoleSystems::WriteLights),
                    gpu::build_top.in_set(GirandoleSystems::BuildTop),
                    gpu::fold_visibility.after(RenderGraphSystems::Render).before(RenderGraphSystems::Submit),
                ),
            )
            .add_systems(
                Core3d,
                pass::draw
                    .in_set(GirandoleSystems::Draw)
                    .in_set(Core3dSystems::MainPass)
                    .after(deferred_lighting)
                    .before(main_opaque_pass_3d),
            );
        if self.ray_traced {
            render_app
                .init_resource::<GirandoleNames>()
                .add_systems(ExtractSchedule, names::extract)
                .add_systems(Render, names::prepare.in_set(GirandoleSystems::Upload).after(gpu::prepare));
        }
        if self.has_shadows() {
            render_app
                .add_systems(RenderStartup, shadows::start)
                .add_systems(ExtractSchedule, shadows::extract)
                .add_systems(Render, shadows::prepare.in_set(RenderSystems::PrepareResources).before(gpu::prepare));
        }
    }

    /// Makes what depends on the device, which Bevy has opened by now.
    fn finish(&self, app: &mut App) {
        if app.get_sub_app(RenderApp).is_none() {
            return;
        }
        let rays = app.world().get_resource::<RenderDevice>().map_or_else(ShadowRays::default, ShadowRays::of);
        let shadows = self.has_shadows().then_some(rays);
        let mut shaders = app.world_mut().resource_mut::<Assets<Shader>>();
        let pass_shaders = match self.importing {
            true => PassShaders {
                alone: [shader::importing(), shader::joined(false, None, true)].map(|text| shaders.add(text)),
                sharing: None,
                shadows,
            },
            false => {
                let [alone, sharing] = [false, true].map(|shares_cuts| {
                    [false, true].map(|is_heat_map| shaders.add(shader::joined(shares_cuts, shadows, is_heat_map)))
                });
                PassShaders { alone, sharing: Some((shaders.add(shader::marking()), sharing)), shadows }
            }
        };
        let pose_shader = PoseShader(shaders.add(shader::posing()));
        let modules = Modules { _handles: shader::modules(rays).map(|module| shaders.add(module)) };
        app.insert_resource(modules);
        if shadows.is_some() {
            app.insert_resource(Casters::new(rays));
        }
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app.insert_resource(pass_shaders).insert_resource(pose_shader);
        if shadows.is_some() {
            render_app.insert_resource(GirandoleShadows::new(rays));
        }
    }
}
