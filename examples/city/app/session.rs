//! The loop over frames: move the light world, update its trees, upload what changed, render.
//!
//! A [`Session`] returns frames. It neither prints nor writes files, so that tests can run it.

use super::denoiser::denoise;
use super::render::backend::{Backend, ChosenBackend};
use super::render::cpu::{self, UsageCounters};
use super::render::geometry::{Geometry, GeometryChange};
use super::render::gpu::{GpuRenderer, GpuUpdate};
use super::render::image::{Image, ShadowRays};
use super::render::sequence::frame_seed;
use super::render::settings::Settings;
use super::scene::{Scene, SceneError, Stage};
use girandole::{Effects, FrameBudget};
use std::time::{Duration, Instant};

/// How time passes from frame to frame.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Frames per second of the scene's time.
    pub fps: f64,
    /// What rebuilds of light trees may cost in each frame.
    pub budget: FrameBudget,
}

/// What a frame did and cost: a line of `frames.csv`.
#[derive(Clone, Debug)]
pub struct FrameStats {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// Instances in the light world.
    pub instances: usize,
    /// Lights, summed over all instances.
    pub lights: usize,
    /// Instances that moved.
    pub moved_instances: usize,
    /// Light trees that were refitted.
    pub refit_trees: usize,
    /// Light trees that were rebuilt.
    pub rebuilt_trees: usize,
    /// Light trees that were replaced by one that was built in the background.
    pub background_trees: usize,
    /// Light trees that wait for a rebuild.
    pub waiting_trees: usize,
    /// The longest wait of a tree for its rebuild, in frames.
    pub longest_wait: u64,
    /// Time that rebuilds were allowed to take.
    pub budget: Duration,
    /// Time that the rebuilds were predicted to take.
    pub predicted: Duration,
    /// Time that the rebuilds took.
    pub spent: Duration,
    /// Time that the choice of rebuilds took.
    pub deciding: Duration,
    /// Time by which rebuilds and their choice exceeded the budget.
    pub overrun: Duration,
    /// Bytes of light data that were uploaded; 0 on the CPU backend.
    pub upload_bytes: u64,
    /// Time of the top-level build; `None` if it was not measured.
    pub top_build: Option<Duration>,
    /// Effects that the light world needs.
    pub effects: Effects,
    /// Shadow rays of the picture.
    pub shadow_rays: ShadowRays,
    /// Time of the whole frame, without writing files.
    pub frame_time: Duration,
}

/// A rendered frame.
pub struct Frame {
    /// The picture.
    pub image: Image,
    /// What it did and cost.
    pub stats: FrameStats,
    /// Bytes of objects and of the upper hierarchy that were uploaded; 0 on the CPU backend.
    #[cfg_attr(not(test), allow(dead_code, reason = "only tests read it"))]
    pub geometry_bytes: u64,
    /// Usage of earlier frames, in samples, that the light world received before it chose what to
    /// rebuild.
    #[cfg_attr(not(test), allow(dead_code, reason = "only tests read it"))]
    pub recorded_usage: u64,
}

enum Renderer {
    /// Holds the usage of the last frame.
    Cpu(UsageCounters),
    Gpu(Box<GpuRenderer>),
}

/// Renders the frames of a stage one after the other.
pub struct Session {
    stage: Stage,
    geometry: Geometry,
    renderer: Renderer,
    settings: Settings,
    pace: Pace,
    /// Number of the next frame.
    next: u32,
}

impl Session {
    /// Builds the hierarchies of the geometry and, on a GPU, uploads them.
    pub fn new(mut stage: Stage, settings: Settings, pace: Pace, chosen: ChosenBackend) -> Result<Self, SceneError> {
        // Lights are chosen by what surfaces reflect toward the viewer, not by illuminance alone.
        stage.world.set_glossy_sampling(true);
        let geometry = Geometry::new(&stage.scene)?;
        let renderer = match chosen.backend {
            Backend::Cpu => Renderer::Cpu(UsageCounters::default()),
            Backend::Gpu(gpu) => {
                let effects = stage.world.effects();
                // Usage only serves to choose rebuilds, and where nothing moves there are none.
                let counts_usage = !stage.animation.is_still();
                let renderer = GpuRenderer::new(gpu, &stage.scene, &geometry, effects, counts_usage, &settings)?;
                Renderer::Gpu(Box::new(renderer))
            }
        };
        Ok(Self { stage, geometry, renderer, settings, pace, next: 0 })
    }

    /// The scene as of the last frame.
    pub fn scene(&self) -> &Scene {
        &self.stage.scene
    }

    /// A picture of the last frame with less noise.
    pub fn denoise(&self, image: &Image) -> Image {
        denoise(image, &self.stage.scene, &self.geometry)
    }

    /// Renders the next frame. `progress` receives the finished share, from 0 to 1.
    pub fn frame(&mut self, progress: &(dyn Fn(f64) + Sync)) -> Result<Frame, SceneError> {
        let start = Instant::now();
        let Self { stage: Stage { scene, world, animation }, geometry, settings, pace, .. } = self;
        let number = self.next;
        // A still animation is advanced once, and the geometry is compared with the scene once.
        let moves = number == 0 || !animation.is_still();
        if moves {
            animation.advance(f64::from(number) / pace.fps, scene, world)?;
        }
        // The light world learns which lights earlier frames used, and where the camera is.
        let mut recorded_usage = 0;
        match &mut self.renderer {
            Renderer::Cpu(usage) => {
                recorded_usage = usage.values().map(|count| u64::from(*count)).sum();
                world.record_usage(std::mem::take(usage));
            }
            Renderer::Gpu(renderer) => {
                if let Some(usage) = renderer.take_usage() {
                    recorded_usage = usage.total();
                    world.record_usage(usage.iter());
                }
            }
        }
        world.set_viewpoint(scene.camera.eye.as_dvec3())?;
        let report = world.update(pace.budget);
        let change = if moves { geometry.update(scene)? } else { GeometryChange::default() };
        let delta = world.take_delta();
        let seed = frame_seed(settings.seed, number);
        let (image, shadow_rays, update) = match &mut self.renderer {
            Renderer::Cpu(last_usage) => {
                let before = Instant::now();
                let sampler = world.sampler();
                let top_build = before.elapsed();
                let (image, rays, usage) = cpu::render(scene, geometry, &sampler, settings, seed, progress);
                *last_usage = usage;
                (image, rays, GpuUpdate { top_build: Some(top_build), ..GpuUpdate::default() })
            }
            Renderer::Gpu(renderer) => {
                let is_up_to_date = number > 0 && change.is_empty() && delta.is_empty();
                let update = if is_up_to_date {
                    GpuUpdate::default()
                } else {
                    renderer.update(geometry, &change, world, &delta)?
                };
                let (image, rays) = renderer.render(scene, geometry, settings, seed, progress)?;
                (image, rays, update)
            }
        };
        self.next += 1;
        let stats = FrameStats {
            frame: number,
            instances: world.instance_count(),
            lights: world.light_count(),
            moved_instances: report.moved_instances,
            refit_trees: report.refit_trees,
            rebuilt_trees: report.rebuilt_trees,
            background_trees: report.background.taken,
            waiting_trees: report.waiting_trees,
            longest_wait: report.longest_wait,
            budget: report.budget,
            predicted: report.predicted,
            spent: report.spent,
            deciding: report.deciding,
            overrun: report.overrun,
            upload_bytes: update.light_bytes,
            top_build: update.top_build,
            effects: world.effects(),
            shadow_rays,
            frame_time: start.elapsed(),
        };
        Ok(Frame { image, stats, geometry_bytes: update.geometry_bytes, recorded_usage })
    }
}
