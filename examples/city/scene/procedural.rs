//! The procedural night city: streets, houses, lamps, traffic, signs, strings of lights and a drone swarm.

use girandole::glam::{Affine3A, Quat, Vec2, Vec3, vec2, vec3};
use girandole::{Light, LightWorld, Policy, TreeKey};

use super::assembly::{Assembly, Design};
use super::furniture;
use super::ground::{PAVEMENT, Use};
use super::layout::{Kit, Sign};
use super::meshes::Part;
use super::palette::{Glow, NEON, Palette, SOFT, WARM};
use super::rng::Rng;
use super::roads::{PITCH, Roads, Signal, heading_vector, signal, signal_group};
use super::strings::{LightString, StringKit};
use super::swarm::{self, Swarm};
use super::traffic_sim::Traffic;
use super::vehicles::{self, BODIES, Body, PAINTS};
use super::{Animation, Camera, Scene, SceneError, Stage};

/// How large a city is: about 1 k, 10 k or 100 k instances and 20 k, 300 k or 3 M lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Size {
    /// 25 blocks.
    #[value(name = "S", alias = "s")]
    S,
    /// 256 blocks.
    #[value(name = "M", alias = "m")]
    M,
    /// 2,500 blocks.
    #[value(name = "L", alias = "l")]
    L,
}

/// What the city is made from.
#[derive(Clone, Copy, Debug)]
pub struct CityOptions {
    /// How large.
    pub size: Size,
    /// How many cars drive; `None` for as many as suit the size.
    pub cars: Option<usize>,
    /// Another seed, another city.
    pub seed: u64,
}

/// What a size stands for.
struct Plan {
    blocks: usize,
    cars: usize,
    festoons: usize,
    drones: usize,
    /// Share of towers: everywhere, and more in the centre.
    towers: [f32; 2],
}

impl Size {
    fn plan(self) -> Plan {
        match self {
            Size::S => Plan { blocks: 5, cars: 230, festoons: 1, drones: 560, towers: [0.0, 0.04] },
            Size::M => Plan { blocks: 16, cars: 2_800, festoons: 8, drones: 3_000, towers: [0.08, 0.3] },
            Size::L => Plan { blocks: 50, cars: 28_000, festoons: 30, drones: 10_000, towers: [0.08, 0.3] },
        }
    }
}

/// Builds the city and parks nobody: the cars have already driven for a while.
pub fn stage(options: &CityOptions) -> Result<Stage, SceneError> {
    stage_in(options, LightWorld::new())
}

/// [`stage`], in a world that is given.
pub fn stage_in(options: &CityOptions, world: LightWorld) -> Result<Stage, SceneError> {
    let plan = options.size.plan();
    let mut assembly = Assembly::with_world(world);
    let mut palette = Palette::default();
    let mut kit = Kit::new(&mut assembly, &mut palette, options.seed)?;
    blocks(&mut assembly, &mut kit, &plan, options.seed)?;
    earth(&mut assembly, &mut palette, plan.blocks as f32 * PITCH);
    // The street x = 0 is the avenue that the camera looks along, over the crossing at z = 104.
    let middle = plan.blocks / 2;
    let roads = Roads { side: plan.blocks as u32 - 1, corner: Vec2::splat(1.0 - middle as f32) * PITCH };
    let signals = Signals::new(&mut assembly, &mut palette, &roads)?;
    let cars = Cars::new(&mut assembly, &mut palette, roads, options.cars.unwrap_or(plan.cars), options.seed)?;
    let festoons = Festoons::new(&mut assembly, &mut palette, &roads, &plan, options.seed)?;
    let glows = swarm::glows(&mut palette);
    let swarm = Swarm::new(&mut assembly, &glows, vec3(2.0, 78.0, -60.0), 30.0, plan.drones)?;
    let signs = Signs::new(kit.signs);
    assembly.add_night()?;
    let Assembly { mut scene, world } = assembly;
    scene.materials = palette.materials;
    scene.camera = Camera { eye: vec3(-3.4, 4.4, 126.0), target: vec3(0.8, 11.4, 30.0), vertical_fov: 0.93 };
    scene.lamp_clearance = 0.1;
    scene.exposure = 0.5;
    Ok(Stage { scene, world, animation: Box::new(City { signals, cars, festoons, swarm, signs }) })
}

fn blocks(assembly: &mut Assembly, kit: &mut Kit, plan: &Plan, seed: u64) -> Result<(), SceneError> {
    let middle = plan.blocks / 2;
    for (row, column) in (0..plan.blocks).flat_map(|row| (0..plan.blocks).map(move |column| (row, column))) {
        let mut rng = Rng::new(seed, 0x10_0000 + (row * plan.blocks + column) as u64);
        let place = |index: usize| (index as f32 - middle as f32 + 0.5) * PITCH;
        let center = vec2(place(column), place(row));
        let usage = match (column, row) {
            (x, z) if (x, z + 1) == (middle, middle) => Use::Market,
            (x, z) if (x + 1, z + 2) == (middle, middle) => Use::Park,
            _ if plan.blocks > 5 && rng.chance(0.03) => Use::Park,
            _ => Use::Houses,
        };
        let far = center.length() / (plan.blocks as f32 * PITCH * 0.35);
        // The avenue in front of the camera keeps its old houses, and its view of the sky.
        let is_old = column + 1 >= middle && column <= middle && row + 3 >= middle && row <= middle + 1;
        let downtown = if is_old { 0.0 } else { plan.towers[0] + plan.towers[1] * (-far * far).exp() };
        kit.block(assembly, center, usage, downtown, &mut rng)?;
    }
    Ok(())
}

/// Dark land up to the horizon.
fn earth(assembly: &mut Assembly, palette: &mut Palette, reach: f32) {
    let mut part = Part::default();
    let reach = reach + 2_000.0;
    part.floor([-reach; 2], [reach; 2], -0.05, palette.matt(0.03, 0.03, 0.03));
    let mesh = assembly.mesh(part.mesh);
    assembly.object(mesh, Affine3A::IDENTITY);
}

/// All that moves.
struct City {
    signals: Signals,
    cars: Cars,
    festoons: Festoons,
    swarm: Swarm,
    signs: Signs,
}

impl Animation for City {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.signals.show(time, scene, world)?;
        self.cars.drive(time, scene, world)?;
        self.festoons.swing(time, scene, world)?;
        self.swarm.fly(time, scene, world)?;
        self.signs.flicker(time, scene, world)
    }
}

/// Traffic lights: a tree for each of the four groups, shared by all lights of the group.
struct Signals {
    trees: Vec<TreeKey>,
    /// The three lenses of each light of each group.
    lenses: Vec<Vec<[usize; 3]>>,
    lights: [Light; 3],
    shown: [Option<Signal>; 4],
}

impl Signals {
    fn new(assembly: &mut Assembly, palette: &mut Palette, roads: &Roads) -> Result<Self, SceneError> {
        let body = assembly.design(furniture::signal_body(palette))?;
        let lens: Vec<(Part, Glow)> = (0..3).map(|index| furniture::signal_lens(index, palette)).collect();
        let lights = [0, 1, 2].map(|index| lens[index].0.lights[0]);
        let meshes: Vec<u32> = lens.into_iter().map(|(part, _)| assembly.mesh(part.mesh)).collect();
        let mut trees = Vec::new();
        for _ in 0..4 {
            trees.push(assembly.world.add_tree(lights.to_vec())?);
        }
        let mut lenses = vec![Vec::new(); 4];
        for (node, heading) in (0..roads.nodes()).flat_map(|node| (0..4).map(move |heading| (node, heading))) {
            // A light stands beyond the crossing, for those who come from another one.
            if roads.neighbor(node, heading + 2).is_none() {
                continue;
            }
            let group = signal_group(node, roads.side, heading) as usize;
            let at = roads.position(node) + heading_vector(heading) * 10.8 + heading_vector(heading + 3) * 7.7;
            let turn = Quat::from_rotation_y((heading as f32 + 2.0) * std::f32::consts::FRAC_PI_2);
            let place = Affine3A::from_rotation_translation(turn, vec3(at.x, PAVEMENT, at.y));
            assembly.place(body, place, Policy::Static)?;
            lenses[group].push([0, 1, 2].map(|index| assembly.object(meshes[index], place)));
            assembly.world.add_instance(trees[group], place, Policy::RefitOnly)?;
        }
        let mut signals = Self { trees, lenses, lights, shown: [None; 4] };
        signals.show(0.0, &mut assembly.scene, &mut assembly.world)?;
        Ok(signals)
    }

    fn show(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for group in 0..4 {
            let now = signal(group as u32, time);
            if self.shown[group].replace(now) == Some(now) {
                continue;
            }
            let lit = [Signal::Red, Signal::Amber, Signal::Green].map(|lens| f32::from(u8::from(lens == now)));
            let light =
                |index: usize| Light { emission: self.lights[index].emission * lit[index], ..self.lights[index] };
            world.set_lights(self.trees[group], &[(0, light(0)), (1, light(1)), (2, light(2))])?;
            for (object, lit) in self.lenses[group].iter().flat_map(|lenses| lenses.iter().zip(lit)) {
                scene.objects[*object].emission_scale = lit;
            }
        }
        Ok(())
    }
}

/// The cars' bodies and lights, moved by [`Traffic`].
struct Cars {
    traffic: Traffic,
    placed: Vec<super::assembly::Placed>,
}

/// One design a body and paint; all of a body share its tree.
pub fn car_designs(assembly: &mut Assembly, palette: &mut Palette) -> Result<Vec<(Body, Vec<Design>)>, SceneError> {
    let mut kinds = Vec::new();
    for body in BODIES {
        let mut designs: Vec<Design> = Vec::new();
        for &paint in &PAINTS[..body.paints()] {
            let part = vehicles::vehicle(body, paint, palette);
            designs.push(match designs.first() {
                Some(first) => Design { mesh: assembly.mesh(part.mesh), tree: first.tree },
                None => assembly.design(part)?,
            });
        }
        kinds.push((body, designs));
    }
    Ok(kinds)
}

/// Where a car with this pose stands.
pub fn car_transform(position: Vec2, angle: f32) -> Affine3A {
    Affine3A::from_rotation_translation(Quat::from_rotation_y(angle), vec3(position.x, 0.0, position.y))
}

impl Cars {
    fn new(
        assembly: &mut Assembly,
        palette: &mut Palette,
        roads: Roads,
        count: usize,
        seed: u64,
    ) -> Result<Self, SceneError> {
        let kinds = car_designs(assembly, palette)?;
        let mut rng = Rng::new(seed, 0xca45);
        let mut chosen: Vec<(Body, Design)> = Vec::with_capacity(count);
        for _ in 0..count {
            // Sedans, hatches, vans, taxis and few buses.
            let kind = rng.pick(&[0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4]);
            let (body, designs) = &kinds[kind];
            chosen.push((*body, rng.pick(designs)));
        }
        let lengths: Vec<f32> = chosen.iter().map(|(body, _)| body.length()).collect();
        let traffic = Traffic::new(roads, &lengths, seed)?;
        let mut placed = Vec::with_capacity(count);
        for (car, (_, design)) in chosen.into_iter().enumerate() {
            let pose = traffic.pose(car, 0.0);
            placed.push(assembly.place(design, car_transform(pose.position, pose.angle), Policy::RefitOnly)?);
        }
        Ok(Self { traffic, placed })
    }

    fn drive(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.traffic.advance(time);
        for (car, placed) in self.placed.iter().enumerate() {
            let pose = self.traffic.pose(car, time);
            let transform = car_transform(pose.position, pose.angle);
            let object = &mut scene.objects[placed.object];
            // Cars that wait cost nothing.
            if object.transform == transform {
                continue;
            }
            object.transform = transform;
            if let Some(instance) = placed.instance {
                world.move_instance(instance, transform)?;
            }
        }
        Ok(())
    }
}

/// Strings of bulbs over streets and over the market.
struct Festoons {
    warm: StringKit,
    mixed: StringKit,
    over_streets: Vec<LightString>,
    over_market: Vec<LightString>,
}

const BULB_NITS: f32 = 320.0;

impl Festoons {
    fn new(
        assembly: &mut Assembly,
        palette: &mut Palette,
        roads: &Roads,
        plan: &Plan,
        seed: u64,
    ) -> Result<Self, SceneError> {
        let mut rng = Rng::new(seed, 0xfe57);
        let cable = palette.matt(0.02, 0.02, 0.02);
        let steel = palette.metal([0.2, 0.21, 0.22], 0.5);
        let warm = StringKit::new(assembly, &[palette.glow(WARM, BULB_NITS), palette.glow(SOFT, BULB_NITS)], cable);
        let colors = [WARM, NEON[5], NEON[2], NEON[3], vec3(0.2, 0.4, 1.0), NEON[0]];
        let mixed = StringKit::new(assembly, &colors.map(|color| palette.glow(color, BULB_NITS)), cable);
        let mut mast = Part::default();
        mast.column(Vec3::ZERO, 7.6, [0.1, 0.06], 8, steel);
        let mast = assembly.mesh(mast.mesh);
        let pole = |assembly: &mut Assembly, at: Vec3| {
            assembly.object(mast, Affine3A::from_translation(at - Vec3::Y * 7.6));
        };
        // Streets along Z, from a crossing to the next: the first is the avenue in front of the camera.
        let home = plan.blocks as u32 / 2 - 1;
        let mut streets = vec![(home, home)];
        while streets.len() < plan.festoons {
            let street = (rng.below(roads.side as usize) as u32, rng.below(roads.side as usize - 1) as u32);
            if !streets.contains(&street) {
                streets.push(street);
            }
        }
        let mut over_streets = Vec::new();
        for (x, z) in streets {
            let from = roads.position(z * roads.side + x);
            let post = |side: f32, step: usize| {
                let along = 18.0 + step as f32 * 13.6;
                vec3(from.x + side * 7.9, 7.6 + PAVEMENT, from.y + along)
            };
            for step in 0..6 {
                [-1.0, 1.0].into_iter().for_each(|side| pole(assembly, post(side, step)));
                let ends = [post(-1.0, step), post(1.0, step)];
                over_streets.push(LightString::new(assembly, &warm, ends, 22, 1.3, &mut rng)?);
            }
        }
        let mut over_market = Vec::new();
        let market = vec3(PITCH * 0.5, PAVEMENT + 7.6, -PITCH * 0.5);
        pole(assembly, market);
        for spoke in 0..10 {
            let (sin, cos) = (spoke as f32 / 10.0 * std::f32::consts::TAU).sin_cos();
            let end = market + vec3(cos * 33.0, -1.8, sin * 33.0);
            pole(assembly, end);
            over_market.push(LightString::new(assembly, &mixed, [market, end], 34, 2.2, &mut rng)?);
        }
        Ok(Self { warm, mixed, over_streets, over_market })
    }

    fn swing(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for string in &mut self.over_streets {
            string.swing(&self.warm, time, scene, world)?;
        }
        for string in &mut self.over_market {
            string.swing(&self.mixed, time, scene, world)?;
        }
        Ok(())
    }
}

/// Neon that flickers: every third kind has a loose contact.
struct Signs {
    kinds: Vec<Flicker>,
}

struct Flicker {
    tree: TreeKey,
    lights: Vec<Light>,
    objects: Vec<usize>,
    stream: u64,
    level: f32,
}

impl Signs {
    fn new(signs: Vec<Sign>) -> Self {
        let mut kinds = Vec::new();
        for (index, sign) in
            signs.into_iter().enumerate().filter(|(index, sign)| index % 3 == 1 && !sign.objects.is_empty())
        {
            let Some(tree) = sign.design.tree else { continue };
            let (lights, objects) = (sign.lights, sign.objects);
            kinds.push(Flicker { tree, lights, objects, stream: index as u64, level: 1.0 });
        }
        Self { kinds }
    }

    fn flicker(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for sign in &mut self.kinds {
            // Twelve states a second; in bad seconds most of them are dark.
            let bad = Rng::new((time / 1.7) as u64, sign.stream).chance(0.3);
            let roll = Rng::new((time * 12.0) as u64, 0xf11c + sign.stream).unit();
            let level = if !bad || roll > 0.55 { 1.0 } else { 0.06 };
            if level == sign.level {
                continue;
            }
            sign.level = level;
            let dim =
                |(index, light): (usize, &Light)| (index as u32, Light { emission: light.emission * level, ..*light });
            let changes: Vec<(u32, Light)> = sign.lights.iter().enumerate().map(dim).collect();
            world.set_lights(sign.tree, &changes)?;
            sign.objects.iter().for_each(|&object| scene.objects[object].emission_scale = level);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn city(size: Size) -> Stage {
        stage(&CityOptions { size, cars: None, seed: 1 }).unwrap()
    }

    #[test]
    fn sizes_are_what_they_promise() {
        for (size, instances, lights) in
            [(Size::S, 1_000.0, 20_000.0), (Size::M, 10_000.0, 300_000.0), (Size::L, 100_000.0, 3_000_000.0)]
        {
            let world = city(size).world;
            let share = [world.instance_count() as f64 / instances, world.light_count() as f64 / lights];
            assert!(share.iter().all(|share| (0.85..1.15).contains(share)), "{size:?}: {share:?}");
        }
    }

    #[test]
    fn the_same_seed_builds_the_same_city() {
        let (mut first, mut second) = (city(Size::S), city(Size::S));
        let other = stage(&CityOptions { size: Size::S, cars: None, seed: 2 }).unwrap();
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
    fn only_what_moves_is_touched() {
        let mut stage = city(Size::S);
        stage.world.update(girandole::FrameBudget::UNLIMITED);
        stage.animation.advance(0.0, &mut stage.scene, &mut stage.world).unwrap();
        let before: Vec<Affine3A> = stage.scene.objects.iter().map(|object| object.transform).collect();
        stage.animation.advance(0.04, &mut stage.scene, &mut stage.world).unwrap();
        let report = stage.world.update(girandole::FrameBudget::UNLIMITED);
        assert!((60..=230).contains(&report.moved_instances), "{report:?}");
        // 6 strings, 10 spokes and the swarm.
        assert!((17..60).contains(&report.refit_trees), "{report:?}");
        let moved = stage.scene.objects.iter().zip(&before).filter(|(object, before)| object.transform != **before);
        assert!(moved.count() < 2_000);
    }

    #[test]
    fn no_cars_is_a_quiet_city_and_too_many_are_refused() {
        let with = |cars| stage(&CityOptions { size: Size::S, cars: Some(cars), seed: 1 });
        assert!(with(0).is_ok());
        assert!(with(1_000_000).is_err());
    }

    #[test]
    fn every_glowing_face_has_a_light() {
        let stage = city(Size::S);
        let area = |t: &super::super::Triangle| {
            0.5 * (t.vertices[1] - t.vertices[0]).cross(t.vertices[2] - t.vertices[0]).length()
        };
        // Flux of glowing faces against flux of the rectangle lights of the world, instance by instance.
        let mut faces = 0.0;
        for object in &stage.scene.objects {
            for triangle in &stage.scene.meshes[object.mesh as usize].triangles {
                let emission = stage.scene.materials[triangle.material as usize].emission * object.emission_scale;
                faces += f64::from(area(triangle) * emission.element_sum());
            }
        }
        let mut lights = 0.0;
        for instance in stage.world.instances() {
            let tree = stage.world.tree(stage.world.instance_tree(instance).unwrap()).unwrap();
            for light in tree.lights() {
                let area = match light.shape {
                    girandole::Shape::Rectangle { half_u, half_v, .. } => 4.0 * half_u.cross(half_v).length(),
                    girandole::Shape::Sphere { radius, .. } => 4.0 * std::f32::consts::PI * radius * radius,
                    _ => 0.0,
                };
                lights += f64::from(area * light.emission.element_sum());
            }
        }
        // Balls are polyhedra within their spheres, and headlights' lenses only depict the spots in front of them.
        assert!((0.85..1.05).contains(&(faces / lights)), "{}", faces / lights);
    }
}
