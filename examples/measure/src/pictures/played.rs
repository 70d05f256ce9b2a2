//! Plays a scene for some frames under a policy and a budget, and times what happens to the world
//! in each frame: updates of trees, uploads and builds of the top level.

use girandole::gpu::GpuLights;
use girandole::wgpu;
use girandole::{FrameBudget, InstanceKey, LightWorld, Policy};
use std::time::{Duration, Instant};
use testbed::common::gpu::{open_default, wait};
use testbed::scene::{SceneError, Stage};
use testbed::scene_options::SceneOptions;

/// Frames per second of the scene's time.
const FPS: f64 = 24.0;

/// When trees are rebuilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Upkeep {
    /// All trees whose lights change are refitted only.
    RefitOnly,
    /// All trees whose lights change are rebuilt in the same frame.
    AlwaysRebuild,
    /// The library's scheduler, with a budget in microseconds per frame.
    Budgeted(u32),
}

/// The times of one frame in milliseconds, as means over all frames but the first.
#[derive(Clone, Copy, Debug, Default)]
pub struct WorldTimes {
    /// Refits, rebuilds, and the choice of rebuilds.
    pub update: f64,
    /// `None` without a device.
    pub upload: Option<f64>,
    pub top_level: f64,
}

/// A stage as of the last frame, and what its frames took.
pub struct Played {
    pub stage: Stage,
    pub times: WorldTimes,
}

/// Loads a scene for pictures of a size and plays it for at least two frames. Directional lights are removed, since they
/// belong to no tree. What is timed uses one thread.
pub fn play((options, size): (&SceneOptions, (u32, u32)), frames: u32, upkeep: Upkeep) -> Result<Played, SceneError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|error| SceneError(format!("cannot start a thread: {error}")))?;
    let mut stage = options.load(size)?;
    stage.remove_directionals()?;
    let budget = start(&mut stage.world, upkeep)?;
    let mut uploads = Uploads::start();
    let mut times = WorldTimes::default();
    let frames = frames.max(2);
    for frame in 0..frames {
        let Stage { scene, world, animation } = &mut stage;
        animation.advance(f64::from(frame) / FPS, scene, world)?;
        world.set_viewpoint(scene.camera.eye.as_dvec3())?;
        let budget = if frame == 0 { FrameBudget::UNLIMITED } else { budget };
        let (update, top_level) = pool.install(|| {
            let start = Instant::now();
            world.update(budget);
            let updated = Instant::now();
            world.sampler();
            (updated - start, updated.elapsed())
        });
        let upload = uploads.as_mut().map(|uploads| uploads.send(world)).transpose()?;
        // The first frame uploads the whole world.
        if frame > 0 {
            let per_frame = |time: Duration| time.as_secs_f64() * 1.0e3 / f64::from(frames - 1);
            times.update += per_frame(update);
            times.top_level += per_frame(top_level);
            if let Some(time) = upload {
                *times.upload.get_or_insert_default() += per_frame(time);
            }
        }
    }
    Ok(Played { stage, times })
}

/// Applies the policy. Returns the budget of a frame.
fn start(world: &mut LightWorld, upkeep: Upkeep) -> Result<FrameBudget, SceneError> {
    // Builds on other threads would not be part of the time of a frame.
    world.set_background_builds(false);
    let (policy, budget) = match upkeep {
        Upkeep::RefitOnly => (Policy::RefitOnly, FrameBudget::NONE),
        Upkeep::AlwaysRebuild => (Policy::AlwaysRebuild, FrameBudget::UNLIMITED),
        Upkeep::Budgeted(us) => (Policy::Budgeted, FrameBudget::new(Duration::from_micros(u64::from(us)))),
    };
    let moving =
        |key: &InstanceKey| world.instance(*key).map(|i| i.policy).is_some_and(|policy| policy != Policy::Static);
    let instances: Vec<InstanceKey> = world.instances().filter(moving).collect();
    instances.into_iter().try_for_each(|key| world.set_policy(key, policy))?;
    Ok(budget)
}

/// A device that receives what changes.
struct Uploads {
    device: wgpu::Device,
    queue: wgpu::Queue,
    lights: GpuLights,
}

impl Uploads {
    /// `None` where there is no device, or not enough of it.
    fn start() -> Option<Self> {
        let (device, queue) = open_default().ok()?;
        let lights = GpuLights::new(&device, &queue).ok()?;
        Some(Self { device, queue, lights })
    }

    /// Sends what changed since the last call. Returns the time of the library's call.
    fn send(&mut self, world: &mut LightWorld) -> Result<Duration, SceneError> {
        let start = Instant::now();
        self.lights.upload(world).map_err(|error| SceneError(error.to_string()))?;
        let time = start.elapsed();
        self.queue.submit([]);
        wait(&self.device).map_err(SceneError)?;
        Ok(time)
    }
}

impl WorldTimes {
    /// The sum of all stages that were measured.
    pub fn total(&self) -> f64 {
        self.update + self.upload.unwrap_or(0.0) + self.top_level
    }
}
