//! The scenes in which samplers are compared, and how each is rendered: with Sobol' numbers and one light per
//! sample, against a sum over all lights.

use super::errors::errors;
use super::options::Options;
use super::rival_scenes::{Lamps, street, tunnel, yard};
use super::samplers::Prepared;
use super::scene_view::SceneView;
use girandole::LightWorld;
use girandole::glam::Vec3;
use testbed::direct_light::cells::{CellSettings, SharedCells};
use testbed::direct_light::converged;
use testbed::direct_light::draw::Draw;
use testbed::direct_light::renderer::Renderer;
use testbed::direct_light::sobol::sobol;
use testbed::direct_light::stage::prepare;
use testbed::measuring::score::Estimate;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::{SceneError, Stage};

/// Seeds the reference, above the seeds of pictures.
const REFERENCE_SEED: u32 = 1_000_000;
/// The products of rivals should be at least so many times that of the library; on a scene of a file
/// the second.
pub const GOALS: [f64; 2] = [3.0, 2.0];

/// A scene, and how it is rendered.
pub struct Contest {
    pub name: String,
    pub stage: Stage,
    /// Whether materials become diffuse. If not, the library is told how surfaces reflect.
    pub is_matte: bool,
    pub goal: f64,
}

/// How closely a run measures.
pub struct Closeness {
    pub size: (u32, u32),
    pub seeds: u32,
    pub timed_pixels: usize,
    pub yard_lights: usize,
}

impl Closeness {
    /// What the options ask for.
    pub fn new(options: &Options) -> Self {
        let closeness = match options.quick {
            true => Self { size: (32, 18), seeds: 2, timed_pixels: 100, yard_lights: 1_000 },
            false => Self { size: (128, 72), seeds: 8, timed_pixels: 4_000, yard_lights: 10_000 },
        };
        Self {
            size: options.size.unwrap_or(closeness.size),
            seeds: options.pictures.unwrap_or(closeness.seeds),
            ..closeness
        }
    }
}

/// The scenes of a run. A glTF file of the options comes last.
pub fn contests(options: &Options, closeness: &Closeness) -> Result<Vec<Contest>, SceneError> {
    let lights = closeness.yard_lights;
    let city = || procedural::stage(&CityOptions { size: Size::S, cars: None, seed: 1, lamp_profile: None });
    let contest = |name: &str, stage: Stage, is_matte| Contest { name: name.into(), stage, is_matte, goal: GOALS[0] };
    let mut all = vec![
        contest("panels", yard(Lamps::Panels, lights)?, true),
        contest("points", yard(Lamps::Points, lights)?, true),
        contest("tunnel", tunnel()?, true),
        contest("glossy street", street()?, false),
        contest("city S, matte", city()?, true),
        contest("city S, glossy", city()?, false),
    ];
    if options.scene.gltf.is_some() {
        let stage = options.scene.load(closeness.size)?;
        all.push(Contest { name: options.scene.name(), stage, is_matte: options.matte, goal: GOALS[1] });
    }
    Ok(all)
}

/// A scene that stands still, with what its pictures are compared with.
pub struct Arena {
    pub view: SceneView,
    pub world: LightWorld,
    pub prepared: Prepared,
    /// The mean of all lights.
    pub reference: Vec<Vec3>,
}

impl Arena {
    /// Renders the reference.
    pub fn new(stage: Stage, is_matte: bool, size: (u32, u32)) -> Result<Self, SceneError> {
        let Stage { scene, world, .. } = prepare(stage, 0.0)?;
        let view = SceneView::new(&scene, is_matte, size)?;
        let prepared = Prepared::new(&world)?;
        let renderer = Renderer { numbers: sobol, ..view.renderer() };
        let reference = converged::picture(&renderer, &world.sampler(), &prepared.ids, REFERENCE_SEED);
        Ok(Self { view, world, prepared, reference })
    }

    /// With Sobol' numbers.
    pub fn renderer(&self) -> Renderer<'_> {
        Renderer { numbers: sobol, ..self.view.renderer() }
    }

    /// Cells that share cuts.
    pub fn cells(&self, settings: CellSettings) -> Result<SharedCells<'_>, SceneError> {
        let cells = SharedCells::new(&self.world, (&self.view.view, &self.view.scene), settings);
        cells.map_err(|error| SceneError(error.to_string()))
    }

    /// The relMSE of several pictures, and the first of them.
    pub fn error(&self, draw: &mut dyn Draw, samples: f64, pictures: u32) -> (Estimate, Vec<Vec3>) {
        let (errors, picture) = errors(&self.renderer(), draw, samples, pictures, &self.reference);
        (errors.rel_mse, picture)
    }
}
