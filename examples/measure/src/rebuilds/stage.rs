//! The scenes of this tool: a city with deforming trees, and shading points.

use super::figures::{Kind, Troupe};
use super::motion::Motion;
use super::rays::{Rays, through};
use girandole::glam::{DVec3, Mat3, Quat, Vec2, Vec3, vec2, vec3};
use girandole::scheduler::Clock;
use girandole::{InstanceKey, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint, Shape, TreeKey};
use rayon::prelude::*;
use std::sync::Arc;
use testbed::scene::procedural::roads::PITCH;
use testbed::scene::procedural::{self, CityOptions, Size};
use testbed::scene::rng::Rng;
use testbed::scene::{Animation, Camera, Scene, SceneError};

/// The number of deforming trees, and the size of the city.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum SceneKind {
    /// 10 in city S.
    #[value(name = "S10", alias = "s10")]
    S10,
    /// 100 in city M.
    #[value(name = "M100", alias = "m100")]
    M100,
    /// 1,000 in city L.
    #[value(name = "L1000", alias = "l1000")]
    L1000,
}

impl SceneKind {
    /// All scenes, the smallest first.
    pub const ALL: [Self; 3] = [Self::S10, Self::M100, Self::L1000];

    /// The scene's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::S10 => "S10",
            Self::M100 => "M100",
            Self::L1000 => "L1000",
        }
    }

    fn size(self) -> Size {
        match self {
            Self::S10 => Size::S,
            Self::M100 => Size::M,
            Self::L1000 => Size::L,
        }
    }

    fn trees(self) -> usize {
        match self {
            Self::S10 => 10,
            Self::M100 => 100,
            Self::L1000 => 1_000,
        }
    }

    /// Blocks along each side of the city.
    fn blocks(self) -> usize {
        match self {
            Self::S10 => 5,
            Self::M100 => 16,
            Self::L1000 => 50,
        }
    }
}

/// Half of the shading points are near trees that are at most this far from the middle of the view,
/// in metres.
const NEAR: f32 = 450.0;
/// The greatest distance of these shading points from a light of their tree, in metres.
const REACH: f32 = 35.0;
/// The length of camera rays, in metres.
const SIGHT: f32 = 1_000.0;
/// The number of rays for one shading point, after which the search fails.
const TRIES: usize = 2_000;

/// What a stage is made of. Equal options give equal stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StageOptions {
    pub kind: SceneKind,
    pub motion: Motion,
    /// Seeds the city, the trees, their motion and the shading points.
    pub seed: u64,
    /// The number of shading points.
    pub shading_points: usize,
}

/// A city, its deforming trees and their motion.
pub struct Stage {
    /// The names of scene and motion.
    pub name: String,
    /// The motion of its trees.
    pub motion: Motion,
    /// All lights, as of the last [`Stage::advance`].
    pub world: LightWorld,
    /// Fixed points: those with an even index are near deforming trees, the others in view of the
    /// camera.
    pub shading_points: Vec<ShadingPoint>,
    /// The position of the camera.
    pub eye: DVec3,
    /// The deforming trees.
    pub trees: Vec<TreeKey>,
    /// The kind of each of `trees`.
    pub kinds: Vec<Kind>,
    /// The lights of each of `trees`.
    troupes: Vec<Troupe>,
    scene: Scene,
    city: Box<dyn Animation>,
}

impl Stage {
    /// Builds the city and the trees, as of frame 0.
    ///
    /// The deforming trees get [`Policy::Budgeted`]. The city's own strings and swarm are only
    /// refitted.
    pub fn new(options: &StageOptions, clock: Arc<dyn Clock>) -> Result<Self, SceneError> {
        let StageOptions { kind, motion, seed, shading_points } = *options;
        let city = CityOptions { size: kind.size(), cars: None, seed, lamp_profile: None };
        let city = procedural::stage_in(&city, LightWorld::with_clock(clock))?;
        let (scene, mut world) = (city.scene, city.world);
        let own: Vec<InstanceKey> = world.instances().collect();
        for instance in own {
            if world.instance(instance).map(|i| i.policy).is_some_and(|policy| policy != Policy::Static) {
                world.set_policy(instance, Policy::RefitOnly)?;
            }
        }
        let camera = scene.camera;
        let troupes: Vec<Troupe> = (0..kind.trees())
            .into_par_iter()
            .map(|index| Troupe::new(Kind::of(index, motion), motion, seed << 32 | index as u64))
            .collect();
        let mut sites = Sites::new(kind, middle(&camera));
        let mut rng = Rng::new(seed, 0x517e);
        let (mut trees, mut placed) = (Vec::new(), Vec::new());
        for troupe in &troupes {
            let tree = world.add_tree(LightTree::new(troupe.lights().to_vec())?);
            trees.push(tree);
            // Some trees have two or three instances.
            let shown = if rng.chance(0.12) { 2 + rng.below(2) } else { 1 };
            for copy in 0..shown {
                let in_view = trees.len() % 3 != 0 && copy == 0;
                let placement = sites.place(troupe.kind, in_view, &mut rng);
                world.add_instance(tree, placement, Policy::Budgeted)?;
                placed.push((tree, placement));
            }
        }
        let mut stage = Self {
            name: format!("{} {}", kind.name(), motion.name()),
            motion,
            world,
            shading_points: Vec::new(),
            eye: camera.eye.as_dvec3(),
            trees,
            kinds: troupes.iter().map(|troupe| troupe.kind).collect(),
            troupes,
            scene,
            city: city.animation,
        };
        stage.advance(0)?;
        stage.shading_points = stage.find_shading_points(&placed, shading_points, seed)?;
        Ok(stage)
    }

    /// Moves lights and cars to a frame, which must not be before the last one. There are 60 frames
    /// per second. The result depends only on the frame. The caller calls [`LightWorld::update`].
    pub fn advance(&mut self, frame: u32) -> Result<(), SceneError> {
        let time = f64::from(self.motion.frame_of_traffic(frame)) / 60.0;
        self.city.advance(time, &mut self.scene, &mut self.world)?;
        let has_moved: Vec<bool> = self.troupes.par_iter_mut().map(|troupe| troupe.advance(frame)).collect();
        for ((troupe, tree), _) in self.troupes.iter().zip(&self.trees).zip(has_moved).filter(|(_, moved)| *moved) {
            let changes: Vec<(u32, Light)> = (0..).zip(troupe.lights().iter().copied()).collect();
            self.world.set_lights(*tree, &changes)?;
        }
        Ok(())
    }

    /// Finds the first surfaces that rays meet: rays from a light of a tree in random directions,
    /// and camera rays.
    fn find_shading_points(
        &self,
        placed: &[(TreeKey, Placement)],
        count: usize,
        seed: u64,
    ) -> Result<Vec<ShadingPoint>, SceneError> {
        let camera = self.scene.camera;
        let middle = middle(&camera);
        let is_near = |(_, placement): &&(TreeKey, Placement)| {
            let at = placement.translation.as_vec3();
            vec2(at.x, at.z).distance(middle) < NEAR
        };
        let near: Vec<&(TreeKey, Placement)> = placed.iter().filter(is_near).collect();
        let (rays, world) = (Rays::new(&self.scene), &self.world);
        let find = |index: usize| {
            let mut rng = Rng::new(seed, 0x4ece_0000 + index as u64);
            (0..TRIES).find_map(|_| {
                if index % 2 == 1 || near.is_empty() {
                    return rays.first(camera.eye, through(&camera, [rng.unit(), rng.unit()]), SIGHT);
                }
                let (tree, placement) = near[rng.below(near.len())];
                let lights = world.tree(*tree)?.lights();
                let from =
                    placement.linear * position(lights.get(rng.below(lights.len()))?) + placement.translation.as_vec3();
                rays.first(from, direction(&mut rng), REACH)
            })
        };
        let found: Option<Vec<ShadingPoint>> = (0..count).into_par_iter().map(find).collect();
        found.ok_or_else(|| SceneError("the scene has too few surfaces for shading points".into()))
    }
}

/// The middle of the view, as seen from above.
fn middle(camera: &Camera) -> Vec2 {
    let forward = (camera.target - camera.eye).normalize_or(Vec3::NEG_Z);
    vec2(camera.eye.x, camera.eye.z) + vec2(forward.x, forward.z) * 80.0
}

/// A random direction, uniform over the sphere.
pub fn direction(rng: &mut Rng) -> Vec3 {
    let (height, turn) = (rng.range(-1.0, 1.0), rng.unit() * std::f32::consts::TAU);
    let ring = (1.0 - height * height).sqrt();
    vec3(ring * turn.cos(), height, ring * turn.sin())
}

fn position(light: &Light) -> Vec3 {
    match light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => position,
        Shape::Rectangle { center, .. } | Shape::Sphere { center, .. } => center,
        Shape::Triangle { vertices, .. } => vertices[0],
        _ => unreachable!("this version has no others"),
    }
}

/// The places for trees: courtyards and stretches of streets. Each is used once, as long as there
/// are free ones.
struct Sites {
    middle: Vec2,
    /// Half of the city's side, in metres.
    half: f32,
    /// Places in front of the camera, the nearest last.
    avenue: Vec<Vec2>,
    yards: Vec<Vec2>,
    streets: Vec<Vec2>,
}

impl Sites {
    fn new(kind: SceneKind, middle: Vec2) -> Self {
        let blocks = kind.blocks();
        let at = |index: usize| (index as f32 - (blocks / 2) as f32) * PITCH;
        let all = || (0..blocks).flat_map(|x| (0..blocks).map(move |z| (x, z)));
        let yards = all().map(|(x, z)| vec2(at(x) + 0.5 * PITCH, at(z) + 0.5 * PITCH)).collect();
        let streets = all().filter(|(x, _)| *x > 0).map(|(x, z)| vec2(at(x), at(z) + 0.5 * PITCH)).collect();
        let avenue = (0..8).rev().map(|step| vec2(0.0, 100.0 - 24.0 * step as f32)).collect();
        Self { middle, half: 0.5 * PITCH * blocks as f32, avenue, yards, streets }
    }

    /// Chooses a place for a tree. Trees in view, except ferris wheels, get the avenue in front of
    /// the camera first. Of the others, half are within 120 m of the middle of the view along each
    /// axis, 35 % within 500 m, and the rest anywhere.
    fn place(&mut self, kind: Kind, in_view: bool, rng: &mut Rng) -> Placement {
        let reach = match rng.unit() {
            roll if roll < 0.5 => 120.0,
            roll if roll < 0.85 => 500.0,
            _ => f32::INFINITY,
        };
        let any = |middle: f32, rng: &mut Rng| {
            let reach = reach.min(self.half);
            (if reach < self.half { middle } else { 0.0 }) + rng.range(-reach, reach)
        };
        let target = vec2(any(self.middle.x, rng), any(self.middle.y, rng));
        let is_in_street = matches!(kind, Kind::Strings | Kind::Parade);
        let in_view = if in_view && kind != Kind::FerrisWheel { self.avenue.pop() } else { None };
        let sites = if is_in_street { &mut self.streets } else { &mut self.yards };
        let nearest = (0..sites.len())
            .min_by(|a, b| sites[*a].distance_squared(target).total_cmp(&sites[*b].distance_squared(target)));
        let site = in_view.or_else(|| nearest.map(|index| sites.swap_remove(index))).unwrap_or(target);
        let height = match kind {
            Kind::Strings => rng.range(6.5, 8.5),
            Kind::Swarm => rng.range(14.0, 45.0),
            Kind::FerrisWheel => 21.0,
            Kind::Market | Kind::Parade | Kind::Crowd => 0.2,
        };
        let turn = match kind {
            Kind::Strings | Kind::Parade => 0.0,
            _ => rng.unit() * std::f32::consts::TAU,
        };
        let translation = vec3(site.x, height, site.y).as_dvec3();
        Placement { linear: Mat3::from_quat(Quat::from_rotation_y(turn)), translation }
    }
}
