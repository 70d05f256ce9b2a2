//! Girandole chooses *which light to sample* for a shading point, among millions of lights that
//! move, and returns the light with its exact probability. Engines link to it and call it on the
//! CPU, or in their own WGSL shaders on their own wgpu device.
//!
//! One light tree per object (the *bottom level*) holds the lights of the object in the object's
//! space. *Instances* place trees in the world. One tree over all instances (the *top level*) is
//! built on the GPU whenever something changed. A sample walks both levels. Trees whose lights
//! change are refitted. A scheduler rebuilds trees that have become noisy, within a time budget
//! for each frame. Rebuilds that remove the most noise per millisecond go first.
//!
//! # On the CPU
//!
//! ```
//! use girandole::glam::{DVec3, Vec3};
//! use girandole::{FrameBudget, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};
//! use std::time::Duration;
//!
//! let bulb = |candela| Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(candela));
//! let mut world = LightWorld::new();
//!
//! // One tree for each kind of object, any number of instances of it.
//! let lamp = world.add_tree(LightTree::new(vec![bulb(800.0)])?);
//! let post = world.add_instance(lamp, Placement::at(DVec3::new(10.0, 0.0, 0.0)), Policy::Budgeted)?;
//!
//! // Every frame: move instances, change lights, then update.
//! world.move_instance(post, Placement::at(DVec3::new(12.0, 0.0, 0.0)))?;
//! world.set_lights(lamp, &[(0, bulb(400.0))])?;
//! let report = world.update(FrameBudget::new(Duration::from_micros(300)));
//! assert_eq!((report.moved_instances, report.refit_trees), (1, 1));
//!
//! // Sample one light for a point on the ground. `u` are four random numbers in [0, 1).
//! let ground = ShadingPoint::surface(Vec3::new(11.0, 0.0, 1.0), Vec3::Y);
//! let sampler = world.sampler();
//! let sample = sampler.sample(&ground, [0.1, 0.2, 0.3, 0.4]).expect("the lamp is above the ground");
//! assert_eq!(sample.pmf, sampler.pmf(&ground, sample.light));
//!
//! // The estimate of the illuminance, before shadows, in lux.
//! let cosine = ground.normal.dot(sample.incident.direction);
//! let lux = sample.incident.radiance * cosine / (sample.pmf * sample.incident.pdf);
//! assert!((lux.y - 10.25).abs() < 0.01);
//! # Ok::<(), girandole::WorldError>(())
//! ```
//!
//! # On the GPU
//!
//! The engine joins the text of a `gpu::LightShader` to its own shader, and calls `light_mark` and
//! `light_sample` there. Everything is recorded into the engine's own command encoder; nothing waits for the GPU.
//!
//! ```
//! # #[cfg(feature = "gpu")] mod engine {
//! use girandole::gpu::{GpuError, GpuLights};
//! use girandole::{Effects, FrameBudget, LightWorld, wgpu};
//!
//! const ENGINE: &str = "
//!     @group(0) @binding(0) var<storage, read_write> lux: array<f32>;
//!     @compute @workgroup_size(64)
//!     fn main(@builtin(global_invocation_id) id: vec3<u32>) {
//!         let ground = light_surface_point(vec3(f32(id.x), 0.0, 0.0), vec3(0.0, 1.0, 0.0));
//!         light_mark(ground);
//!         let s = light_sample(ground, vec4(0.1, 0.2, 0.3, 0.4));
//!         lux[id.x] = select(0.0, s.radiance.y * s.direction.y / (s.pmf * s.pdf), s.pmf > 0.0);
//!     }";
//!
//! /// Once: the source of the engine's shader.
//! ///
//! /// Its pipeline layout has `lights.bind_group_layout()` at group 1.
//! fn start(device: &wgpu::Device, queue: &wgpu::Queue) -> Result<(GpuLights, String), GpuError> {
//!     let lights = GpuLights::new(device, queue)?;
//!     let source = lights.shader(1, Effects::all()).join(ENGINE);
//!     Ok((lights, source))
//! }
//!
//! /// Every frame, after the edits of the world.
//! fn frame(
//!     lights: &mut GpuLights,
//!     world: &mut LightWorld,
//!     encoder: &mut wgpu::CommandEncoder,
//! ) -> Result<(), GpuError> {
//!     // Refits edited trees, sends what changed and nothing else, and builds the top level and the cuts of cells.
//!     lights.sync(world, FrameBudget::NONE, encoder)?;
//!     // Then the engine's own passes, with `lights.bind_group()` at group 1.
//!     Ok(())
//! }
//! # }
//! ```
//!
//! `docs/integration.md` explains every step; the package `engine_shader` is a complete program.
//!
//! # Conventions
//!
//! - **Units** are metres, seconds, radians, lumens, candela, nits and lux. Colours are linear Rec.
//!   709. Axes are right-handed.
//! - **Spaces.** A tree has a space of its own. A [`Placement`] maps it to the world, with an f64
//!   translation. Sampling happens in f32, relative to [`LightWorld::origin`], which can follow the
//!   camera ([`LightWorld::set_origin_near`]).
//! - **Probabilities.** A *pmf* is the probability of a light; a *pdf* is a density per steradian.
//!   At every shading point the pmf of all lights and the probability of "no light" sum to 1. Every
//!   light that can contribute has a pmf above 0.
//! - **Random numbers** `u` are in [0, 1). The same numbers give the same light.
//! - **Errors.** Bad input returns a typed error with a [stable code](error) and changes nothing.
//!   No scene makes the library panic, and it never prints.
//! - **Threads.** Edits need the world mutably; any number of threads may share a [`LightSampler`].
//!   Results do not depend on the number of threads.
//!
//! # Modules
//!
//! What most programs need is exported from the root. The modules hold the rest
//! (`docs/architecture.md` shows how data passes through them):
//!
//! | module | contents |
//! |---|---|
//! | [`light`] | lights: shapes, units, limits |
//! | [`cluster`] | the summary of a group of lights, for tools: box, cone of directions, flux and moments |
//! | [`tree`] | bottom-level trees: build, refit, attributes, soundness check |
//! | [`policy`] | when a tree requests a rebuild |
//! | [`scheduler`] | the frame budget; clocks for tests and replays |
//! | [`effects`] | the features that a scene has, for which shaders and layouts are specialized |
//! | [`error`] | all errors and their codes |
//! | `plan` | what a GPU has to do for a frame, as data; the WGSL functions |
//! | `gpu` | plays plans on wgpu: upload, top level and sampling |
//!
//! `docs/math.md` derives the formulas and names the papers behind keys such as CK18 and SS.
//!
//! # Features
//!
//! | feature | default | what it adds |
//! |---|---|---|
//! | `gpu` | yes | the module `gpu`, with wgpu, and the feature `gpu-plan` |
//! | `gpu-plan` | with `gpu` | the module `plan`, for engines that have no wgpu device |
//! | `parallel` | yes | builds and refits on rayon's threads, and builds in the background |
//! | `bake` | no | `LightTree::bake` and `from_baked`: trees as bytes; `LightWorld::write_dump` and `from_dump` |
//! | `tracing` | no | spans of the crate tracing around updates, refits, rebuilds, plans and uploads |

// Modules are in the order in which data passes through them. A module imports only from modules
// above it; `tests/all/dependencies.rs` checks that.
mod span;
mod rare;
mod keys;
pub mod effects;
pub mod error;
#[cfg(feature = "bake")]
mod file;
mod math;
pub mod cluster;
mod profile;
pub mod light;
mod sky;
pub mod tree;
pub mod policy;
pub mod scheduler;
mod shading;
mod instance;
mod visibility;
mod top;
mod world;
mod sampling;
#[cfg(feature = "gpu-plan")]
pub mod plan;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(test)]
mod documented;
#[cfg(test)]
mod f64_reference;

pub use effects::{EffectCounts, Effects};
#[cfg(feature = "bake")]
pub use error::LoadError;
pub use error::{ProfileError, SkyError, ValueError, WorldError};

pub use glam;
pub use instance::appearance::{Appearance, MAX_FACTOR};
pub use instance::placement::{MAX_DISTANCE, MAX_SCALE, Placement};
pub use instance::portal::Portal;
pub use instance::sector::ORIGIN_GRID;
pub use keys::{DirectionalKey, InstanceKey, LightId, RegionKey, TreeKey};
pub use light::{DirectionalLight, Light, Shape};
pub use policy::Policy;
pub use profile::Profile;
pub use sampling::along::SegmentPoint;
pub use sampling::cut::MAX_SPLITS;
pub use sampling::cuts::options::CutOptions;
pub use sampling::cuts::table::{CutReport, CutTable};
pub use sampling::emit::Incident;
pub use sampling::reservoir::Reservoir;
pub use sampling::sample::{LightPick, LightSample, LightSampler};
pub use sampling::snapshot::LightSnapshot;
pub use scheduler::FrameBudget;
pub use shading::gloss::Gloss;
pub use shading::shading_point::ShadingPoint;
pub use sky::Sky;
pub use tree::{Attribute, Attributes, LightTree};
pub use visibility::{VisibilityOptions, VisibilityTable};
#[cfg(feature = "gpu")]
pub use wgpu;
#[cfg(feature = "bake")]
pub use world::LeftOut;
pub use world::{
    BackgroundReport, Changes, FrameReport, Instance, JobReport, LightWorld, RebuildState, Region, RegionInstance,
    RegionTree, RegionView, Revision, TreeSource, WorldMemory,
};

/// The README's programs, compiled and run as documentation tests.
#[cfg(all(doctest, feature = "gpu"))]
#[doc = include_str!("../README.md")]
struct Readme;

/// The programs of the guide for engines and of its pages, compiled and run as documentation tests. A
/// test in `tests/all/references.rs` finds the pages that are missing here, and one in
/// `gpu/shader.rs` checks their shaders.
#[cfg(all(doctest, feature = "gpu"))]
mod pages {
    #[doc = include_str!("../docs/integration.md")]
    struct Integration;
    #[doc = include_str!("../docs/edits.md")]
    struct Edits;
    #[doc = include_str!("../docs/rebuilds.md")]
    struct Rebuilds;
    #[doc = include_str!("../docs/shaders.md")]
    struct Shaders;
    #[doc = include_str!("../docs/reuse.md")]
    struct Reuse;
    #[doc = include_str!("../docs/cuts.md")]
    #[cfg(feature = "parallel")]
    struct Cuts;
    #[doc = include_str!("../docs/sky.md")]
    struct SkyPage;
    #[doc = include_str!("../docs/gpu-lights.md")]
    struct KernelLights;
    #[doc = include_str!("../docs/streaming.md")]
    #[cfg(feature = "bake")]
    struct Streaming;
    #[doc = include_str!("../docs/dumps.md")]
    #[cfg(feature = "bake")]
    struct Dumps;
    #[doc = include_str!("../docs/large-worlds.md")]
    struct LargeWorlds;
    #[doc = include_str!("../docs/memory.md")]
    struct Memory;
    #[doc = include_str!("../docs/plans.md")]
    struct Plans;
    #[doc = include_str!("../docs/browser.md")]
    struct Browser;
}
