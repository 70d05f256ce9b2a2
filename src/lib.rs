//! Chooses *which light to sample*, for every shading point and every frame, out of millions that move.
//!
//! One light tree per object (the bottom level) is refitted or rebuilt under a policy of each instance; one tree over
//! the instances (the top level) is made anew every frame, on the GPU; a WGSL function walks both and returns a light
//! with its exact probability; a scheduler spends a small time budget on the rebuilds that buy most.
//!
//! ```
//! use girandole::glam::{DVec3, Vec3};
//! use girandole::{FrameBudget, Light, Placement, Policy, ShadingPoint, LightWorld};
//! use std::time::Duration;
//!
//! let mut world = LightWorld::new();
//! let lamp = world.add_tree(vec![Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(800.0))])?;
//! let post = world.add_instance(lamp, Placement::at(DVec3::new(10.0, 0.0, 0.0)), Policy::Budgeted)?;
//! world.move_instance(post, Placement::at(DVec3::new(12.0, 0.0, 0.0)))?;
//! world.set_lights(lamp, &[(0, Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(400.0)))])?;
//! let report = world.update(FrameBudget::new(Duration::from_micros(300)));
//! assert_eq!(report.refit_trees, 1);
//!
//! let ground = ShadingPoint::surface(Vec3::new(11.0, 0.0, 1.0), Vec3::Y);
//! let sample = world.sampler().sample(&ground, [0.1, 0.2, 0.3, 0.4]).expect("the lamp is in sight");
//! assert_eq!(sample.pmf, world.sampler().pmf(&ground, sample.light));
//! # Ok::<(), girandole::WorldError>(())
//! ```
//!
//! On the GPU, with the engine's own device, queue and encoder (see the `gpu` module):
//!
//! ```
//! # #[cfg(feature = "gpu")] mod engine {
//! use girandole::{LightWorld, gpu::{GpuError, GpuLights}, wgpu};
//!
//! fn frame(lights: &mut GpuLights, world: &mut LightWorld, encoder: &mut wgpu::CommandEncoder) -> Result<(), GpuError> {
//!     let delta = world.take_delta();
//!     lights.upload(world, &delta)?;
//!     lights.build_top(encoder);
//!     // Then the engine's own passes, whose shader was joined to `lights.shader(1, Effects::all())` and which bind
//!     // `lights.bind_group()` at group 1, call `light_sample(shading_point, u)`; `docs/integration.md` goes through it.
//!     Ok(())
//! }
//! # }
//! ```
//!
//! # Conventions
//!
//! Metres, seconds, lumens, candela, nits, lux; linear Rec. 709 colours. Right-handed. Random numbers `u` in [0, 1).
//! Trees live in a space of their own, instances carry them to the world with an f64 translation, and sampling happens
//! relative to [`LightWorld::origin`] in f32. A *pmf* is the chance of choosing a light; a *pdf* is a density per steradian.
//! The sum of all pmf and the chance of "no light" is 1. Bad input gets a typed error and changes nothing.
//!
//! Data moves one way, and the modules read in that order: effects, lights, cones and boxes, clusters, trees, policies,
//! scheduler, world, top level, sampling, GPU. `docs/architecture.md` draws it; `docs/math.md` derives the formulas
//! and names the papers behind keys such as CK18 and SS.

// In the order data passes through them; `tests/all/dependencies.rs` checks that imports point up this list only.
mod simd;
mod keys;
pub mod effects;
pub mod error;
mod counts;
mod dice;
mod shading_point;
mod transform;
pub mod bounds;
pub mod cone;
pub mod cluster;
pub mod light;
pub mod tree;
pub mod policy;
pub mod scheduler;
mod emit;
mod importance;
mod placement;
mod cut;
mod walk;
mod distribution;
mod noise;
mod curve;
mod top;
mod world;
mod sample;
mod resample;
mod pdf;
#[cfg(feature = "gpu")]
pub mod gpu;
#[cfg(feature = "gltf")]
pub mod gltf;

pub use counts::{CandidateCount, MAX_CANDIDATES, MAX_SPLITS, SplitCount};
pub use effects::{EffectCounts, Effects};
pub use emit::Incident;
pub use error::{BudgetError, CountError, LightError, PlacementError, WorldError};
pub use glam;
pub use keys::{DirectionalKey, InstanceKey, TreeKey};
pub use light::{DirectionalLight, Light, Shape};
pub use placement::{MAX_DISTANCE, MAX_SCALE, Placement};
pub use policy::Policy;
pub use resample::Reservoir;
pub use sample::{LightId, LightPick, LightSample, LightSampler};
pub use scheduler::FrameBudget;
pub use shading_point::ShadingPoint;
pub use tree::{Attribute, Attributes, LightTree};
#[cfg(feature = "gpu")]
pub use wgpu;
pub use world::{BackgroundReport, FrameDelta, FrameReport, JobReport, LightWorld};

/// The README's programs, compiled and run as documentation tests.
#[cfg(all(doctest, feature = "gpu"))]
#[doc = include_str!("../README.md")]
struct Readme;

/// The programs of the guide for engines, likewise; a test of `gpu/shader.rs` checks its shaders.
#[cfg(all(doctest, feature = "gpu"))]
#[doc = include_str!("../docs/integration.md")]
struct Integration;
