//! The procedural night city: streets, houses, lamps, traffic, signs, strings of bulbs and a drone
//! swarm.
//!
//! Read in this order:
//!
//! 1. this file: the sizes of the city, and how it is put together;
//! 2. `roads`, `ground` and `blocks`: the street grid, and what stands still in it;
//! 3. `signals`, `traffic` and `cars`: traffic lights and the cars that obey them;
//! 4. `strings`: strings of bulbs, each a light tree that deforms;
//! 5. `swarm` and `flicker`: a drone swarm, which is one deforming light tree, and neon signs that
//!    flicker.

use girandole::glam::{Affine3A, Vec2, vec2, vec3};
use girandole::{LightWorld, Profile};

use super::assembly::Assembly;
use super::designs::{buildings, furniture, land, signs, vehicles};
use super::palette::Palette;
use super::rng::Rng;
use super::{Animation, Camera, Scene, SceneError, Stage, assembly, palette, part, rng};

pub mod roads;
pub mod ground;
pub mod blocks;

pub mod signals;
pub mod traffic;
pub mod cars;

pub mod strings;
pub mod swarm;
pub mod flicker;

use blocks::Kit;
use cars::Cars;
use flicker::FlickeringSigns;
use ground::LandUse;
use roads::{PITCH, Roads};
use signals::TrafficLights;
use strings::Strings;
use swarm::Swarm;

/// Size of a city.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "native", derive(clap::ValueEnum))]
pub enum Size {
    /// 25 blocks, about 1,000 instances and 20,000 lights.
    #[cfg_attr(feature = "native", value(name = "S", alias = "s"))]
    S,
    /// 256 blocks, about 10,000 instances and 300,000 lights.
    #[cfg_attr(feature = "native", value(name = "M", alias = "m"))]
    M,
    /// 2,500 blocks, about 100,000 instances and 3,000,000 lights.
    #[cfg_attr(feature = "native", value(name = "L", alias = "l"))]
    L,
}

/// What the city is built from.
#[derive(Clone, Copy, Debug)]
pub struct CityOptions {
    /// Size.
    pub size: Size,
    /// Number of cars; `None` for a number that suits the size.
    pub cars: Option<usize>,
    /// Different seeds build different cities.
    pub seed: u64,
    /// Street lamps shine as it says, if there is one.
    pub lamp_profile: Option<Profile>,
}

/// What a size stands for.
struct Plan {
    /// Along each side.
    blocks: usize,
    cars: usize,
    /// Streets with strings of bulbs.
    string_streets: usize,
    drones: usize,
    /// Share of towers among the buildings: everywhere, and in addition in the centre.
    towers: [f32; 2],
}

impl Size {
    /// The number of cars of a city of this size.
    pub fn default_cars(self) -> usize {
        self.plan().cars
    }

    fn plan(self) -> Plan {
        match self {
            Size::S => Plan { blocks: 5, cars: 230, string_streets: 1, drones: 560, towers: [0.0, 0.04] },
            Size::M => Plan { blocks: 16, cars: 2_800, string_streets: 8, drones: 3_000, towers: [0.08, 0.3] },
            Size::L => Plan { blocks: 50, cars: 28_000, string_streets: 30, drones: 10_000, towers: [0.08, 0.3] },
        }
    }
}

/// Builds the city in a new light world. Its cars have driven for a while already.
pub fn stage(options: &CityOptions) -> Result<Stage, SceneError> {
    stage_in(options, LightWorld::new())
}

/// Builds the city as [`stage`] does, in the given light world.
pub fn stage_in(options: &CityOptions, world: LightWorld) -> Result<Stage, SceneError> {
    let plan = options.size.plan();
    let mut assembly = Assembly::with_world(world);
    let mut palette = Palette { lamp_profile: options.lamp_profile, ..Palette::default() };
    let mut kit = Kit::new(&mut assembly, &mut palette, options.seed)?;
    place_blocks(&mut assembly, &mut kit, &plan, options.seed)?;
    // Dark land up to the horizon.
    let reach = plan.blocks as f32 * PITCH + 2_000.0;
    for part in land::land([[-reach; 2], [reach; 2]], -0.05, [0.03; 3], &mut palette) {
        let mesh = assembly.mesh(part.mesh);
        assembly.object(mesh, Affine3A::IDENTITY);
    }
    // The street x = 0 is the avenue that the camera looks along, over the crossing at z = 104.
    let middle = plan.blocks / 2;
    let roads = Roads { side: plan.blocks as u32 - 1, corner: Vec2::splat(1.0 - middle as f32) * PITCH };
    let traffic_lights = TrafficLights::new(&mut assembly, &mut palette, &roads)?;
    let cars = Cars::new(&mut assembly, &mut palette, roads, options.cars.unwrap_or(plan.cars), options.seed)?;
    let strings = Strings::new(&mut assembly, &mut palette, &roads, plan.blocks, plan.string_streets, options.seed)?;
    let glows = swarm::glows(&mut palette);
    let swarm = Swarm::new(&mut assembly, &glows, vec3(2.0, 78.0, -60.0), 30.0, plan.drones)?;
    let signs = FlickeringSigns::new(kit.signs);
    assembly.add_night()?;
    let Assembly { mut scene, world } = assembly;
    scene.materials = palette.materials;
    scene.camera = Camera {
        eye: vec3(-3.4, 4.4, 126.0),
        target: vec3(0.8, 11.4, 30.0),
        vertical_fov: 0.93,
        up: vec3(0.0, 1.0, 0.0),
    };
    scene.lamp_clearance = 0.1;
    scene.exposure = 0.5;
    Ok(Stage { scene, world, animation: Box::new(City { traffic_lights, cars, strings, swarm, signs }) })
}

fn place_blocks(assembly: &mut Assembly, kit: &mut Kit, plan: &Plan, seed: u64) -> Result<(), SceneError> {
    let middle = plan.blocks / 2;
    for (row, column) in (0..plan.blocks).flat_map(|row| (0..plan.blocks).map(move |column| (row, column))) {
        let mut rng = Rng::new(seed, 0x10_0000 + (row * plan.blocks + column) as u64);
        let place = |index: usize| (index as f32 - middle as f32 + 0.5) * PITCH;
        let center = vec2(place(column), place(row));
        let land_use = match (column, row) {
            (x, z) if (x, z + 1) == (middle, middle) => LandUse::Market,
            (x, z) if (x + 1, z + 2) == (middle, middle) => LandUse::Park,
            _ if plan.blocks > 5 && rng.chance(0.03) => LandUse::Park,
            _ => LandUse::Houses,
        };
        let distance = center.length() / (plan.blocks as f32 * PITCH * 0.35);
        // The avenue in front of the camera has no towers, so that the sky is visible.
        let is_low = column + 1 >= middle && column <= middle && row + 3 >= middle && row <= middle + 1;
        let tower_share = if is_low { 0.0 } else { plan.towers[0] + plan.towers[1] * (-distance * distance).exp() };
        kit.block(assembly, center, land_use, tower_share, &mut rng)?;
    }
    Ok(())
}

/// Everything that moves.
struct City {
    traffic_lights: TrafficLights,
    cars: Cars,
    strings: Strings,
    swarm: Swarm,
    signs: FlickeringSigns,
}

impl Animation for City {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.traffic_lights.show(time, scene, world)?;
        self.cars.drive(time, scene, world)?;
        self.strings.swing(time, scene, world)?;
        self.swarm.fly(time, scene, world)?;
        self.signs.flicker(time, scene, world)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use girandole::tree::ChildRef;
    use girandole::{FrameBudget, Light, LightWorld};

    use super::*;

    fn city(size: Size) -> Stage {
        stage(&CityOptions { size, cars: None, seed: 1, lamp_profile: None }).unwrap()
    }

    #[test]
    fn cities_have_about_the_stated_numbers_of_instances_and_lights() {
        for (size, instances, lights) in
            [(Size::S, 1_000.0, 20_000.0), (Size::M, 10_000.0, 300_000.0), (Size::L, 100_000.0, 3_000_000.0)]
        {
            let world = city(size).world;
            let share = [world.instances().len() as f64 / instances, world.light_count() as f64 / lights];
            assert!(share.iter().all(|share| (0.85..1.15).contains(share)), "{size:?}: {share:?}");
        }
    }

    #[test]
    fn the_same_seed_builds_the_same_city() {
        let (mut first, mut second) = (city(Size::S), city(Size::S));
        let other = stage(&CityOptions { size: Size::S, cars: None, seed: 2, lamp_profile: None }).unwrap();
        assert_ne!(first.world.light_count(), other.world.light_count());
        for frame in 0..3 {
            for stage in [&mut first, &mut second] {
                stage.animation.advance(f64::from(frame) * 0.7, &mut stage.scene, &mut stage.world).unwrap();
            }
            let transforms = |stage: &Stage| -> Vec<Affine3A> {
                stage.scene.objects.iter().map(|object| object.transform).collect()
            };
            assert_eq!(transforms(&first), transforms(&second));
        }
        let lights = |stage: &Stage| -> Vec<Light> {
            stage.world.trees().flat_map(|tree| stage.world.tree(tree).unwrap().lights().to_vec()).collect()
        };
        assert_eq!(lights(&first), lights(&second));
    }

    #[test]
    fn a_frame_moves_and_refits_only_what_changed() {
        let mut stage = city(Size::S);
        stage.world.update(FrameBudget::UNLIMITED);
        stage.animation.advance(0.0, &mut stage.scene, &mut stage.world).unwrap();
        let before: Vec<Affine3A> = stage.scene.objects.iter().map(|object| object.transform).collect();
        stage.animation.advance(0.04, &mut stage.scene, &mut stage.world).unwrap();
        let report = stage.world.update(FrameBudget::UNLIMITED);
        assert!((60..=230).contains(&report.moved_instances), "{report:?}");
        // 6 strings across the avenue, 10 over the market, and the swarm.
        assert!((17..60).contains(&report.refit_trees), "{report:?}");
        let moved = stage.scene.objects.iter().zip(&before).filter(|(object, before)| object.transform != **before);
        assert!(moved.count() < 2_000);
    }

    /// The children of each node of the top level. Those of runs, which do not last and come after all other nodes, one
    /// for four leaves, are in place of the runs.
    fn children(world: &LightWorld) -> HashMap<u32, Vec<u32>> {
        let nodes = world.top_nodes();
        let (mut all, mut stack) = (HashMap::new(), vec![0]);
        while let Some(node) = stack.pop() {
            let below = (0..8).filter_map(|slot| nodes[node as usize].child(slot));
            stack.extend(below.filter_map(|child| if let ChildRef::Node(node) = child { Some(node) } else { None }));
            all.insert(node, nodes[node as usize].children.to_vec());
        }
        let leaves = all.values().flatten().filter(|child| matches!(ChildRef::of(**child), Some(ChildRef::Leaf(_))));
        let first_run = nodes.len() as u32 - leaves.count() as u32 / 4;
        let (runs, mut lasting): (HashMap<_, _>, HashMap<_, _>) =
            all.into_iter().partition(|(node, _)| *node >= first_run);
        for children in lasting.values_mut() {
            while children.iter().any(|child| runs.contains_key(child)) {
                let open = |child: &u32| runs.get(child).cloned().unwrap_or_else(|| vec![*child]);
                *children = children.iter().flat_map(open).collect();
            }
        }
        lasting
    }

    #[test]
    fn a_tenth_of_a_second_of_traffic_changes_one_node_of_the_top_level_in_twenty_at_most() {
        for (size, least) in [(Size::S, 200), (Size::M, 2_000)] {
            let Stage { mut scene, mut world, mut animation } = city(size);
            let mut time = 0.0;
            let mut drive = |world: &mut LightWorld, frames: u32| {
                for _ in 0..frames {
                    time += 1.0 / 60.0;
                    animation.advance(time, &mut scene, world).unwrap();
                    world.update(FrameBudget::NONE);
                }
                children(world)
            };
            let before = drive(&mut world, 120);
            let after = drive(&mut world, 6);
            let changed = after.iter().filter(|(node, children)| before.get(node) != Some(children)).count();
            assert!(after.len() > least && changed > 0, "{changed} of {}", after.len());
            assert!(20 * changed < after.len(), "{size:?}: {changed} of {}", after.len());
        }
    }

    #[test]
    fn a_city_without_cars_is_built_and_too_many_cars_are_refused() {
        let with = |cars| stage(&CityOptions { size: Size::S, cars: Some(cars), seed: 1, lamp_profile: None });
        assert!(with(0).is_ok());
        for count in [1_000_000, 1_100_000, usize::MAX] {
            assert!(with(count).is_err_and(|error| error.0.contains("cars")), "{count}");
        }
    }

    #[test]
    fn lights_emit_the_flux_of_the_emissive_faces() {
        let stage = city(Size::S);
        let area = |t: &super::super::Triangle| {
            0.5 * (t.vertices[1] - t.vertices[0]).cross(t.vertices[2] - t.vertices[0]).length()
        };
        // Emission times area, which is proportional to the flux, summed over emissive faces and
        // over area lights.
        let mut faces = 0.0;
        for object in &stage.scene.objects {
            for triangle in &stage.scene.meshes[object.mesh as usize].triangles {
                let emission = stage.scene.materials[triangle.material as usize].emission * object.emission_scale;
                faces += f64::from(area(triangle) * emission.element_sum());
            }
        }
        let mut lights = 0.0;
        for instance in stage.world.instances() {
            let tree = stage.world.tree(stage.world.instance(instance).unwrap().tree).unwrap();
            for light in tree.lights() {
                let area = match light.shape {
                    girandole::Shape::Rectangle { half_u, half_v, .. } => 4.0 * half_u.cross(half_v).length(),
                    girandole::Shape::Sphere { radius, .. } => 4.0 * std::f32::consts::PI * radius * radius,
                    _ => 0.0,
                };
                lights += f64::from(area * light.emission.element_sum());
            }
        }
        // Balls are polyhedra inscribed in their spheres, and the lenses of headlights have spots
        // instead of area lights.
        assert!((0.85..1.05).contains(&(faces / lights)), "{}", faces / lights);
    }
}
