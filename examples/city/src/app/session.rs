//! The loop over frames: move the light world, update its trees, upload what changed, render.
//!
//! A [`Session`] returns frames. It neither prints nor writes files, so that tests can run it.

use super::denoiser::denoise;
use super::stage_times::{Laps, StageTimes};
use girandole::{CutTable, Effects, FrameBudget, FrameReport, LightWorld, Revision};
use std::time::Duration;
use testbed::render::backend::{Backend, ChosenBackend};
use testbed::render::cpu::{self, Integrator};
use testbed::render::geometry::{Geometry, GeometryChange};
use testbed::render::gpu::{GpuRenderer, GpuUpdate};
use testbed::render::image::{Image, ShadowRays};
use testbed::render::metering::meter;
use testbed::render::sequence::frame_seed;
use testbed::render::settings::{LightChoice, Settings, cut_options, pixel_size};
use testbed::scene::{Camera, Scene, SceneError, Stage};

/// How time passes from frame to frame.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Frames per second of the scene's time.
    pub fps: f64,
    /// The scene's time in the first frame, in seconds.
    pub start: f64,
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
    /// Effects that the light world needs.
    pub effects: Effects,
    /// Shadow rays of the picture.
    pub shadow_rays: ShadowRays,
    /// Time of each stage. The session leaves those after rendering at zero.
    pub times: StageTimes,
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
}

enum Renderer {
    Cpu,
    Gpu(Box<GpuRenderer>),
}

/// What happened before a frame was rendered.
pub struct Advance {
    /// Number of the frame.
    number: u32,
    report: FrameReport,
    update: GpuUpdate,
    times: StageTimes,
}

/// Renders the frames of a stage one after the other.
pub struct Session {
    stage: Stage,
    geometry: Geometry,
    renderer: Renderer,
    cuts: CutTable,
    settings: Settings,
    pace: Pace,
    /// Number of the next frame.
    next: u32,
    /// The scene's time in the next frame, in frames from the start.
    clock: u32,
    /// The revision of the light world in the last frame.
    seen: Revision,
    is_frozen: bool,
}

impl Session {
    /// Builds the hierarchies of the geometry and, on a GPU, uploads them.
    pub fn new(mut stage: Stage, settings: Settings, pace: Pace, chosen: ChosenBackend) -> Result<Self, SceneError> {
        // Lights are chosen by what surfaces reflect toward the viewer, not by illuminance alone.
        stage.world.set_glossy_sampling(true);
        let geometry = Geometry::new(&stage.scene)?;
        let renderer = match chosen.backend {
            Backend::Cpu if stage.scene.festival.is_some() => {
                return Err(SceneError("the lights of --fire are moved by a GPU, which --backend cpu lacks".into()));
            }
            Backend::Cpu => Renderer::Cpu,
            Backend::Gpu(gpu) => {
                let effects = stage.world.effects();
                let renderer = GpuRenderer::new(gpu, &stage.scene, &geometry, effects, &settings)?;
                Renderer::Gpu(Box::new(renderer))
            }
        };
        Ok(Self {
            stage,
            geometry,
            renderer,
            cuts: CutTable::new(cut_options(&settings)),
            settings,
            pace,
            next: 0,
            clock: 0,
            seen: Revision::default(),
            is_frozen: false,
        })
    }

    /// The scene as of the last frame.
    pub fn scene(&self) -> &Scene {
        &self.stage.scene
    }

    /// The light world as of the last frame.
    pub fn world(&self) -> &LightWorld {
        &self.stage.world
    }

    /// What rays hit, as of the last frame.
    pub fn geometry(&self) -> &Geometry {
        &self.geometry
    }

    /// Whether nothing will move in the next frame.
    pub fn is_still(&self) -> bool {
        self.is_frozen || self.stage.animation.is_still()
    }

    /// How the next frames are rendered. The CPU renders sums over all lights, even if the backend is a GPU, which is
    /// kept up to date.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Changes how the next frames are rendered. Fails if a GPU has no memory for the new size.
    pub fn set_settings(&mut self, settings: Settings) -> Result<(), SceneError> {
        if let Renderer::Gpu(renderer) = &mut self.renderer {
            renderer.set_settings(&settings)?;
        }
        self.settings = settings;
        Ok(())
    }

    /// Changes the camera of the next frames.
    pub fn set_camera(&mut self, camera: Camera) {
        self.stage.scene.camera = camera;
    }

    /// The exposure that was measured or given; `None` before the first frame of a scene that is measured.
    pub fn exposure(&self) -> Option<f32> {
        let scene = &self.stage.scene;
        (!scene.is_metered).then_some(scene.exposure)
    }

    /// Sets the exposure, which is then not measured.
    pub fn set_exposure(&mut self, exposure: f32) {
        self.stage.scene.exposure = exposure;
        self.stage.scene.is_metered = false;
    }

    /// Changes the frame rate and the budget of the next frames.
    pub fn set_pace(&mut self, pace: Pace) {
        self.pace = pace;
    }

    /// Stops the scene's time, or lets it go on.
    pub fn set_frozen(&mut self, is_frozen: bool) {
        self.is_frozen = is_frozen;
    }

    /// Destroys the device of a GPU, as a driver that crashed would. The next frame fails.
    pub fn lose_device(&self) {
        if let Renderer::Gpu(renderer) = &self.renderer {
            renderer.lose_device();
        }
    }

    /// A picture of the last frame with less noise.
    pub fn denoise(&self, image: &Image) -> Image {
        denoise(image, &self.stage.scene, &self.geometry)
    }

    /// Renders the next frame. `progress` receives the finished share, from 0 to 1.
    pub fn frame(&mut self, progress: &(dyn Fn(f64) + Sync)) -> Result<Frame, SceneError> {
        let Advance { number, report, update, mut times } = self.advance()?;
        let (image, shadow_rays) = self.render(frame_seed(self.settings.seed, number), &mut times, progress)?;
        let world = &self.stage.world;
        let stats = FrameStats {
            frame: number,
            instances: world.instances().len(),
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
            effects: world.effects(),
            shadow_rays,
            times,
        };
        Ok(Frame { image, stats, geometry_bytes: update.geometry_bytes })
    }

    /// Moves the stage to the next frame and brings everything up to date, without rendering.
    pub fn advance(&mut self) -> Result<Advance, SceneError> {
        let mut laps = Laps::start();
        let mut times = StageTimes::default();
        let Self { stage: Stage { scene, world, animation }, geometry, renderer, settings, pace, .. } = self;
        let number = self.next;
        self.next += 1;
        // A still animation is advanced once, and the geometry is compared with the scene once.
        let moves = number == 0 || !(self.is_frozen || animation.is_still());
        if moves {
            animation.advance(pace.start + f64::from(self.clock) / pace.fps, scene, world)?;
            self.clock += 1;
        }
        times.animation = laps.lap();
        if let Renderer::Gpu(renderer) = renderer {
            renderer.follow(world);
        }
        world.set_viewpoint(scene.camera.eye.as_dvec3())?;
        let report = world.update(pace.budget);
        let is_changed = !world.changes_since(self.seen).is_empty();
        self.seen = world.revision();
        times.light_update = laps.lap();
        let change = if moves { geometry.update(scene)? } else { GeometryChange::default() };
        meter(scene, geometry, world, (settings.width, settings.height));
        times.geometry = laps.lap();
        let update = match renderer {
            Renderer::Cpu => GpuUpdate::default(),
            // What pixels keep refers to the lights of the frame before.
            Renderer::Gpu(_) if number > 0 && change.is_empty() && !is_changed && settings.reused() == 0 => {
                GpuUpdate::default()
            }
            Renderer::Gpu(renderer) => renderer.update(scene, geometry, &change, world)?,
        };
        times.upload = laps.lap();
        Ok(Advance { number, report, update, times })
    }

    /// Renders the present state of the stage. Adds the times of rendering, and of the top-level build on the CPU.
    fn render(
        &mut self,
        seed: u32,
        times: &mut StageTimes,
        progress: &(dyn Fn(f64) + Sync),
    ) -> Result<(Image, ShadowRays), SceneError> {
        let mut laps = Laps::start();
        let Self { stage: Stage { scene, world, .. }, geometry, renderer, cuts, settings, .. } = self;
        let rendered = match renderer {
            Renderer::Gpu(renderer) if settings.light_choice != LightChoice::Exhaustive => {
                renderer.render(scene, geometry, settings, seed, progress)?
            }
            _ => {
                let mut sampler = world.sampler().with_splits(settings.splits);
                times.top_build = laps.lap();
                if settings.light_choice == LightChoice::Roots {
                    sampler = sampler.from_roots();
                }
                let candidates = (settings.light_choice != LightChoice::Exhaustive).then_some(settings.candidates);
                if settings.light_choice == LightChoice::SharedCuts {
                    cuts.set_view(scene.camera.eye.as_dvec3(), pixel_size(scene, settings));
                    let lights = sampler.with_cuts(cuts);
                    cpu::mark(&Integrator { scene, geometry, sampler: lights, candidates }, settings, seed);
                    cuts.build(world.sampler());
                    sampler = sampler.with_cuts(cuts);
                }
                cpu::render(&Integrator { scene, geometry, sampler, candidates }, settings, seed, progress)
            }
        };
        times.rendering = laps.lap();
        Ok(rendered)
    }
}
