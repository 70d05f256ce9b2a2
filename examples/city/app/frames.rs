//! The loop: move the world, let its light trees follow, tell the GPU what changed, render.
//!
//! [`Session`] renders frames and hands them out; it neither prints nor writes, so that tests run the very same path.

use super::denoise::denoise;
use super::render::backend::{Backend, Chosen};
use super::render::cpu::{self, UsageCounters};
use super::render::geometry::{Geometry, GeometryChange};
use super::render::gpu::{GpuRenderer, GpuUpdate};
use super::render::image::Image;
use super::render::settings::{Settings, ShadowRays};
use super::render::shading::frame_seed;
use super::scene::{Scene, SceneError, Stage};
use girandole::Effects;
use std::time::{Duration, Instant};

/// A frame's line in `frames.csv`.
#[derive(Clone, Debug)]
pub struct Record {
    /// Counted from 0.
    pub frame: u32,
    /// In the light world.
    pub instances: usize,
    /// Summed over instances.
    pub lights: usize,
    /// Light instances that moved.
    pub moved_instances: usize,
    /// Light trees that were refitted.
    pub refit_trees: usize,
    /// Light trees that were rebuilt.
    pub rebuilt_trees: usize,
    /// Parts of light trees that were rebuilt.
    pub rebuilt_parts: usize,
    /// Light trees that were built in the background and took their place.
    pub background_trees: usize,
    /// Light trees that want a rebuild and must wait.
    pub waiting_trees: usize,
    /// The most frames that one of them waits, or waited that was rebuilt.
    pub longest_wait: u64,
    /// What rebuilds were allowed to take.
    pub budget: Duration,
    /// Time that rebuilds were thought to take.
    pub predicted: Duration,
    /// Time that they took.
    pub spent: Duration,
    /// Time that choosing among them took.
    pub deciding: Duration,
    /// Time by which both together exceeded the budget.
    pub overrun: Duration,
    /// Light data that went to the GPU; 0 on the CPU backend.
    pub upload_bytes: u64,
    /// Of the light world's top level; None where it cannot be timed.
    pub top_build: Option<Duration>,
    /// What the light world calls for.
    pub effects: Effects,
    /// Shadow rays of the picture.
    pub shadow_rays: ShadowRays,
    /// Everything but writing files.
    pub frame_time: Duration,
}

/// A rendered frame.
pub struct Frame {
    /// The picture.
    pub image: Image,
    /// What it cost.
    pub record: Record,
    /// Objects and upper nodes of the geometry that went to the GPU.
    #[cfg_attr(not(test), allow(dead_code, reason = "tests count what a still frame costs"))]
    pub geometry_bytes: u64,
    /// UsageCounters of earlier frames that the light world was told of before it chose what to rebuild.
    #[cfg_attr(not(test), allow(dead_code, reason = "tests count what is counted"))]
    pub noted_picks: u64,
}

enum Renderer {
    /// With the picks of the last frame.
    Cpu(UsageCounters),
    Gpu(Box<GpuRenderer>),
}

/// A stage, a backend, and the number of the next frame.
pub struct Session {
    stage: Stage,
    geometry: Geometry,
    renderer: Renderer,
    settings: Settings,
    next: u32,
}

impl Session {
    /// Builds the geometry's hierarchies and, on a GPU, uploads them.
    pub fn new(stage: Stage, settings: Settings, chosen: Chosen) -> Result<Self, SceneError> {
        let geometry = Geometry::new(&stage.scene)?;
        let renderer = match chosen.backend {
            Backend::Cpu => Renderer::Cpu(UsageCounters::default()),
            Backend::Gpu(gpu) => {
                let effects = stage.world.effects();
                // Where nothing moves nothing is rebuilt, and nobody wants to know what is seen.
                let wants_picks = !stage.animation.is_still();
                let renderer = GpuRenderer::new(gpu, &stage.scene, &geometry, effects, wants_picks, &settings)?;
                Renderer::Gpu(Box::new(renderer))
            }
        };
        Ok(Self { stage, geometry, renderer, settings, next: 0 })
    }

    /// What is drawn.
    pub fn scene(&self) -> &Scene {
        &self.stage.scene
    }

    /// A frame of this session's view for the eye, with less noise.
    pub fn denoise(&self, image: &Image) -> Image {
        denoise(image, &self.stage.scene, &self.geometry)
    }

    /// Renders the next frame; `progress` hears its finished share now and then.
    pub fn frame(&mut self, progress: &(dyn Fn(f64) + Sync)) -> Result<Frame, SceneError> {
        let start = Instant::now();
        let Self { stage: Stage { scene, world, animation }, geometry, settings, .. } = self;
        let number = self.next;
        // What moves nothing is not asked, and nothing is looked through for what moved.
        let moves = number == 0 || !animation.is_still();
        if moves {
            animation.advance(f64::from(number) / settings.fps, scene, world)?;
        }
        // What earlier frames showed, and where this one is taken from.
        let mut noted_picks = 0;
        match &mut self.renderer {
            Renderer::Cpu(picks) => {
                noted_picks = picks.values().map(|count| u64::from(*count)).sum();
                world.record_usage(std::mem::take(picks));
            }
            Renderer::Gpu(renderer) => {
                if let Some(picks) = renderer.take_usage() {
                    noted_picks = picks.total();
                    world.record_usage(picks.iter());
                }
            }
        }
        world.set_viewpoint(scene.camera.eye.as_dvec3())?;
        let report = world.update(settings.budget);
        let change = if moves { geometry.update(scene)? } else { GeometryChange::default() };
        let delta = world.take_delta();
        let seed = frame_seed(settings.seed, number);
        let (image, shadow_rays, update) = match &mut self.renderer {
            Renderer::Cpu(last_picks) => {
                let before = Instant::now();
                let sampler = world.sampler();
                let top_build = before.elapsed();
                let (image, rays, picks) = cpu::render(scene, geometry, &sampler, settings, seed, progress);
                *last_picks = picks;
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
        let record = Record {
            frame: number,
            instances: world.instance_count(),
            lights: world.light_count(),
            moved_instances: report.moved_instances,
            refit_trees: report.refit_trees,
            rebuilt_trees: report.rebuilt_trees,
            rebuilt_parts: report.rebuilt_parts,
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
        Ok(Frame { image, record, geometry_bytes: update.geometry_bytes, noted_picks })
    }
}
