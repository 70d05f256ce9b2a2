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
use girandole::gpu::GpuOptions;
use girandole::{CutOptions, VisibilityOptions};

use crate::gpu::LightOptions;
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
    /// The cells whose points choose lights from one cut: 67 MB of GPU memory by default, which suits a picture of
    /// 1920 × 1080 pixels. See `docs/cuts.md`.
    pub cuts: CutOptions,
    /// The cells that learn from shadow rays which lights reach them: 31 MB of GPU memory by default. Where
    /// walls hide most lights, noise falls to half; where nearly all is seen, a sample takes a little longer. Without
    /// shadows nothing is learnt. See `docs/cuts.md`.
    pub learning: Option<VisibilityOptions>,
    /// Whether the pass imports the same modules as applications do. Otherwise it is one text, in which
    /// candidates are weighted by Bevy's BRDF. Importing is noisier and without shadows, and is meant for tests of the
    /// modules.
    pub importing: bool,
    /// Whether another renderer draws the scene by ray tracing, and only asks for lights: see
    /// [`GirandoleNames`](crate::GirandoleNames). Then the lights of a mesh are its triangles, which no texture cuts;
    /// emissive colours are nits, whatever the exposure; and Bevy keeps directional lights.
    pub ray_traced: bool,
}

impl Default for GirandolePlugin {
    fn default() -> Self {
        Self {
            shadows: true,
            // Cells at the edges of surfaces have few pixels.
            cuts: CutOptions::default().with_min_marks(2),
            learning: Some(VisibilityOptions::default()),
            importing: false,
            ray_traced: false,
        }
    }
}

/// The steps in the render world, to order systems by.
#[derive(SystemSet, Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum GirandoleSystems {
    /// In [`Render`]: the light world is updated and uploaded.
    Upload,
    /// In [`RenderGraph`]: lights are written on the GPU, by the plugin and by passes of the application.
    WriteLights,
    /// In [`RenderGraph`]: the builds of the top level and of cuts are recorded. Passes that sample come later.
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
                    (pass::specialize, gpu::follow_camera).in_set(RenderSystems::Prepare).after(gpu::prepare),
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
        let light = if self.importing { shader::importing() } else { shader::joined(shadows, false) };
        let texts = [light, shader::joined(shadows, true)].map(|text| shaders.add(text));
        let pass_shaders = PassShaders { texts, shadows };
        let mut options = GpuOptions::default().with_cuts(self.cuts).with_previous();
        options.learning = self.learning.filter(|_| shadows.is_some());
        let pose_shader = PoseShader(shaders.add(shader::posing()));
        let modules = Modules { _handles: shader::modules(rays).map(|module| shaders.add(module)) };
        app.insert_resource(modules);
        if shadows.is_some() {
            app.insert_resource(Casters::new(rays));
        }
        let Some(render_app) = app.get_sub_app_mut(RenderApp) else { return };
        render_app.insert_resource(pass_shaders).insert_resource(pose_shader).insert_resource(LightOptions(options));
        if shadows.is_some() {
            render_app.insert_resource(GirandoleShadows::new(rays));
        }
    }
}
