//! The scenes of the benchmark: a city with trees that deform, and who receives their light.

use super::figures::{Kind, Troupe};
use super::motion::Motion;
use super::rays::{Rays, through};
use super::scene::procedural::roads::PITCH;
use super::scene::procedural::{self, CityOptions, Size};
use super::scene::rng::Rng;
use super::scene::{Animation, Camera, Scene, SceneError};
use girandole::glam::{DVec3, Mat3, Quat, Vec2, Vec3, vec2, vec3};
use girandole::scheduler::Clock;
use girandole::{InstanceKey, Light, LightWorld, Placement, Policy, ShadingPoint, Shape, TreeKey};
use rayon::prelude::*;
use std::sync::Arc;

/// How many trees deform, in how large a city.
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
    /// All of them, the smallest first.
    pub const ALL: [Self; 3] = [Self::S10, Self::M100, Self::L1000];

    /// As in tables.
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

/// Of everything that is drawn by lot.
const SEED: u64 = 1;
/// Shading points beside trees stand beside those within so many metres of the view's middle.
const NEAR: f32 = 450.0;
/// And within so many metres of one of their lights.
const REACH: f32 = 35.0;
/// The camera sees this far, in metres.
const SIGHT: f32 = 1_000.0;
/// Rays that are sent for a shading point before it is given up.
const TRIES: usize = 2_000;

/// A city, its trees that deform and their motion.
pub struct Stage {
    /// Scene and motion.
    pub name: String,
    /// How its trees move.
    pub motion: Motion,
    /// All lights, as in the frame of the last [`Stage::advance`].
    pub world: LightWorld,
    /// Half of them beside the trees that deform, half where the camera looks; fixed.
    pub shading_points: Vec<ShadingPoint>,
    /// The camera.
    pub eye: DVec3,
    /// Those that deform.
    pub trees: Vec<TreeKey>,
    /// What each of them is, in the order of `trees`.
    pub kinds: Vec<Kind>,
    troupes: Vec<Troupe>,
    scene: Scene,
    city: Box<dyn Animation>,
}

impl Stage {
    /// Builds city and trees as in frame 0.
    ///
    /// The trees that deform get [`Policy::Budgeted`]; the city's own strings and swarm are only ever refitted.
    pub fn new(
        kind: SceneKind,
        motion: Motion,
        shading_points: usize,
        clock: Arc<dyn Clock>,
    ) -> Result<Self, SceneError> {
        let options = CityOptions { size: kind.size(), cars: None, seed: SEED };
        let city = procedural::stage_in(&options, LightWorld::with_clock(clock))?;
        let (scene, mut world) = (city.scene, city.world);
        let own: Vec<InstanceKey> = world.instances().collect();
        for instance in own {
            if world.policy(instance).is_some_and(|policy| policy != Policy::Static) {
                world.set_policy(instance, Policy::RefitOnly)?;
            }
        }
        let camera = scene.camera;
        let troupes: Vec<Troupe> = (0..kind.trees())
            .into_par_iter()
            .map(|index| Troupe::new(Kind::of(index, motion), motion, SEED << 32 | index as u64))
            .collect();
        let mut sites = Sites::new(kind, middle(&camera));
        let mut rng = Rng::new(SEED, 0x517e);
        let (mut trees, mut beside) = (Vec::new(), Vec::new());
        for troupe in &troupes {
            let tree = world.add_tree(troupe.lights().to_vec())?;
            trees.push(tree);
            // Some trees are shown two or three times.
            let shown = if rng.chance(0.12) { 2 + rng.below(2) } else { 1 };
            for copy in 0..shown {
                let in_view = trees.len() % 3 != 0 && copy == 0;
                let placement = sites.place(troupe.kind, in_view, &mut rng);
                world.add_instance(tree, placement, Policy::Budgeted)?;
                beside.push((tree, placement));
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
        stage.shading_points = stage.find_shading_points(&beside, shading_points)?;
        Ok(stage)
    }

    /// Moves lights and cars to a frame, 60 a second; frames never go back. What it sets depends on the frame alone.
    /// [`LightWorld::update`] is the caller's.
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

    /// Points in front of the first surface that a ray meets: from a light of a tree to any side, or through the picture.
    fn find_shading_points(
        &self,
        beside: &[(TreeKey, Placement)],
        count: usize,
    ) -> Result<Vec<ShadingPoint>, SceneError> {
        let camera = self.scene.camera;
        let middle = middle(&camera);
        let is_near = |(_, placement): &&(TreeKey, Placement)| {
            let at = placement.translation.as_vec3();
            vec2(at.x, at.z).distance(middle) < NEAR
        };
        let near: Vec<&(TreeKey, Placement)> = beside.iter().filter(is_near).collect();
        let (rays, world) = (Rays::new(&self.scene), &self.world);
        let find = |index: usize| {
            let mut rng = Rng::new(SEED, 0x4ece_0000 + index as u64);
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
        found.ok_or_else(|| SceneError("the scene has too few surfaces to stand on".into()))
    }
}

/// The middle of what is in view, seen from above.
fn middle(camera: &Camera) -> Vec2 {
    let forward = (camera.target - camera.eye).normalize_or(Vec3::NEG_Z);
    vec2(camera.eye.x, camera.eye.z) + vec2(forward.x, forward.z) * 80.0
}

fn direction(rng: &mut Rng) -> Vec3 {
    let (height, turn) = (rng.range(-1.0, 1.0), rng.unit() * std::f32::consts::TAU);
    let ring = (1.0 - height * height).sqrt();
    vec3(ring * turn.cos(), height, ring * turn.sin())
}

fn position(light: &Light) -> Vec3 {
    match light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } => position,
        Shape::Rectangle { center, .. } | Shape::Sphere { center, .. } => center,
        Shape::Triangle { vertices, .. } => vertices[0],
    }
}

/// Where trees may stand: courtyards and stretches of streets, each once while there are any left.
struct Sites {
    middle: Vec2,
    /// Half of the city's side, metres.
    half: f32,
    /// In front of the camera, the nearest last.
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

    /// A place for a kind: the avenue's first, for what fits into a street and may stand there; then half of all near
    /// the view's middle, many within walking distance, some anywhere.
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
        let wanted = vec2(any(self.middle.x, rng), any(self.middle.y, rng));
        let is_in_street = matches!(kind, Kind::Strings | Kind::Parade);
        let in_view = if in_view && kind != Kind::FerrisWheel { self.avenue.pop() } else { None };
        let sites = if is_in_street { &mut self.streets } else { &mut self.yards };
        let nearest = (0..sites.len())
            .min_by(|a, b| sites[*a].distance_squared(wanted).total_cmp(&sites[*b].distance_squared(wanted)));
        let site = in_view.or_else(|| nearest.map(|index| sites.swap_remove(index))).unwrap_or(wanted);
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
