//! lib

pub mod bounds;
pub mod cluster;
pub mod cone;
mod emit;
pub mod error;
#[cfg(feature = "gpu")]
pub mod gpu;
mod importance;
pub mod light;
mod placement;
mod policy;
mod sample;
mod scheduler;
mod top;
pub mod tree;
mod walk;
mod world;

pub use emit::Incident;
pub use error::{LightError, PlacementError, WorldError};
pub use glam;
pub use importance::Receiver;
pub use light::{DirectionalLight, Light, Shape};
pub use placement::{MAX_DISTANCE, Placement};
pub use policy::{ATTRIBUTE_FLOOR, History, Policy, wants_rebuild};
pub use sample::{LightId, LightPick, LightSample, Sampler};
pub use scheduler::{Clock, FrameBudget, SystemClock};
pub use tree::{Attribute, Attributes, LightTree};
#[cfg(feature = "gpu")]
pub use wgpu;
pub use world::{DirectionalKey, FrameDelta, FrameReport, InstanceKey, TreeKey, World};
