//! Settings of the plugin, and what it reports.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use bevy::camera::Exposure;
use bevy::prelude::*;
use girandole::FrameBudget;

use crate::shadows::ShadowRays;

/// Whether another renderer draws by ray tracing: see [`GirandolePlugin::ray_traced`](crate::GirandolePlugin::ray_traced).
#[derive(Resource, Clone, Copy, Debug)]
pub struct RayTraced(pub bool);

/// Settings that may change in any frame.
#[derive(Resource, Clone, Default)]
pub struct GirandoleSettings {
    /// The time that a frame may spend on rebuilds of light trees.
    pub budget: FrameBudget,
    /// Whether every entity with a light component gets a [`GirandoleLight`](crate::GirandoleLight),
    /// unless it has a [`NoGirandole`](crate::NoGirandole). False at first.
    pub all_lights: bool,
    /// The exposure by which emissive surfaces are weighed against other lights while a light is
    /// chosen. Bevy's emissive colours are in units of the picture, so what they emit depends on the
    /// exposure of the camera. The picture is right for any exposure; noise is lowest for this one.
    pub exposure: Exposure,
}

/// What the plugin did for the last frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct GirandoleReport {
    /// Frames that reached the render world so far. The other fields but `passes` and
    /// `refused` are of the last one.
    pub frames: u64,
    /// Passes over pictures that were recorded so far. None are while shaders are compiled.
    pub passes: u64,
    /// Lights that were added.
    pub added: usize,
    /// Lights that were removed.
    pub removed: usize,
    /// Moves of lights that were sent to the render world.
    pub moved: usize,
    /// Other changes: of brightness, of parameters, of visibility.
    pub changed: usize,
    /// Bytes that were written to the GPU.
    pub bytes: u64,
    /// Records of instances that were written to the GPU.
    pub instances: usize,
    /// Trees that the world has: one for each kind of light, and one for the sky.
    pub trees: usize,
    /// Instances that the world has: all lights except directional ones, and the sky.
    pub lights: usize,
    /// Trees whose lights are written on the GPU, by the plugin for meshes that are posed or by passes of the application.
    pub written: usize,
    /// How shadow rays are traced; `None` without shadows.
    pub shadow_rays: Option<ShadowRays>,
    /// Entities that cast shadows.
    pub casters: usize,
    /// Meshes that cast no shadows yet, since they are being prepared.
    pub waiting_meshes: usize,
    /// Acceleration structures that the device built for ray queries: one for each mesh that is new, and one over all
    /// entities if any of them has changed.
    pub structures: usize,
    /// Time in the main world: the search for changes.
    pub gather: Duration,
    /// Time in the render world: the edits of the light world.
    pub apply: Duration,
    /// Time in the render world: refits and rebuilds.
    pub update: Duration,
    /// Time in the render world: the upload.
    pub upload: Duration,
    /// Time in both worlds: the search for what casts shadows, the trees or the list of entities, and their upload.
    pub shadows: Duration,
    /// Lights and moves that were refused in all frames so far: see the log.
    pub refused: u64,
}

/// The report of the last frame, which both worlds share.
#[derive(Resource, Clone, Debug, Default)]
pub struct GirandoleStats {
    report: Arc<Mutex<GirandoleReport>>,
    passes: Arc<AtomicU64>,
}

impl GirandoleStats {
    /// Returns the report of the last frame that the render world has begun.
    pub fn report(&self) -> GirandoleReport {
        let report = *self.report.lock().unwrap_or_else(PoisonError::into_inner);
        GirandoleReport { passes: self.passes.load(Ordering::Relaxed), ..report }
    }

    pub(crate) fn count_pass(&self) {
        self.passes.fetch_add(1, Ordering::Relaxed);
    }

    pub(crate) fn set(&self, report: GirandoleReport) {
        *self.report.lock().unwrap_or_else(PoisonError::into_inner) = report;
    }
}
