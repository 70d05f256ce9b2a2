//! The lights of the last frame.

use std::collections::HashMap;

use girandole::glam::{DVec3, Mat3, Vec3};
use girandole::gpu::{GpuLights, GpuOptions};
use girandole::{
    DirectionalLight, Effects, FrameBudget, InstanceKey, Light, LightId, LightTree, LightWorld, ORIGIN_GRID, Placement,
    Policy, Sky, TreeKey, wgpu,
};

use crate::gpu::{Gpu, answers_after, asker};
use testbed::common::gpu as device;
use testbed::testing::support::{Rng, place_tree};

const TEXT: &str = "
    struct Query { position: vec3<f32>, instance: u32, light: u32, a: u32, b: u32, c: u32 }
    fn answer(q: Query) -> vec4<f32> {
        let at = light_surface_point(q.position, vec3(0.0, 1.0, 0.0));
        let kept = light_reservoir_of(q.instance, q.light, vec2(0.5));
        let now = light_reservoir_sample(at, kept);
        let then = light_reservoir_sample_previous(at, kept);
        return vec4(
            now.pmf * now.radiance.y, then.pmf * then.radiance.y,
            f32(light_generation(q.instance, q.light)), 0.0,
        );
    }
";

#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Query {
    position: [f32; 3],
    instance: u32,
    light: u32,
    padding: [u32; 3],
}

struct Asker {
    gpu: Gpu,
    lights: GpuLights,
    pipeline: wgpu::ComputePipeline,
}

impl Asker {
    fn new() -> Self {
        // Seven storage buffers of the lights, and two of the test.
        let limits = wgpu::Limits { max_storage_buffers_per_shader_stage: 9, ..wgpu::Limits::default() };
        let adapter = device::find_adapter(None).expect("an adapter");
        let gpu = device::open_device(&adapter, wgpu::Features::empty(), limits).expect("nine storage buffers");
        let options = GpuOptions::default().with_previous();
        let lights = GpuLights::with_options(&gpu.0, &gpu.1, options).expect("default limits are enough");
        let pipeline = asker(&gpu, &lights, Effects::all(), TEXT);
        Self { gpu, lights, pipeline }
    }

    fn encoder(&self) -> wgpu::CommandEncoder {
        self.gpu.0.create_command_encoder(&wgpu::CommandEncoderDescriptor::default())
    }

    /// Uploads a frame and asks for the radiance of lights: now, and in the last frame. Then for their generation.
    fn frame(&mut self, world: &mut LightWorld, queries: &[Query]) -> Vec<[f32; 4]> {
        let mut encoder = self.encoder();
        self.lights.sync(world, FrameBudget::NONE, &mut encoder).expect("room enough");
        answers_after(encoder, &self.gpu, &self.pipeline, &self.lights, queries)
    }
}

fn query(position: Vec3, instance: u32, light: u32) -> Query {
    Query { position: position.to_array(), instance, light, padding: [0; 3] }
}

fn light(rng: &mut Rng, round: u32) -> Light {
    let (at, emission) = (rng.position(4.0), Vec3::splat(rng.between(1.0, 9.0)));
    match round {
        // Other layouts of nodes and lights.
        8.. => Light::spot(at, Vec3::NEG_Y, 0.2, 1.4, emission).with_range(300.0),
        _ => Light::point(at, emission),
    }
}

fn tree(world: &mut LightWorld, rng: &mut Rng, round: u32) -> TreeKey {
    let count = 4 + 60 * (round as usize % 3);
    world.add_tree(LightTree::new((0..count).map(|_| light(rng, round)).collect()).expect("valid"))
}

/// A number for each light that ever was. A light keeps it while it is changed, and in copies of its tree.
#[derive(Default)]
struct Names {
    count: u64,
    of_trees: HashMap<TreeKey, Vec<u64>>,
}

impl Names {
    fn name(&mut self, tree: TreeKey, light: usize) {
        let names = self.of_trees.entry(tree).or_default();
        names.resize(names.len().max(light + 1), 0);
        self.count += 1;
        names[light] = self.count;
    }

    /// All lights of a tree are new.
    fn name_all(&mut self, tree: TreeKey, world: &LightWorld) {
        self.of_trees.remove(&tree);
        (0..world.tree(tree).expect("it lives").lights().len()).for_each(|light| self.name(tree, light));
    }

    /// Which light a shader means; `None` if it is not shown.
    fn of(&self, query: &Query, world: &LightWorld) -> Option<(u64, u64)> {
        if query.instance == u32::MAX {
            return world.directionals().nth(query.light as usize).map(|key| (u64::MAX, key.into()));
        }
        let key = world.instance_at(query.instance)?;
        let is_shown = world.instance(key)?.appearance.is_enabled;
        let name = self.of_trees[&world.instance(key)?.tree].get(query.light as usize)?;
        is_shown.then_some((key.into(), *name))
    }
}

#[test]
fn the_last_frames_lights_are_those_that_it_had() {
    let (mut asker, mut world, mut rng) = (Asker::new(), LightWorld::new(), Rng(71));
    let (mut instances, mut names): (Vec<InstanceKey>, _) = (Vec::new(), Names::default());
    let mut suns = Vec::new();
    // The queries of the last frame, which lights they meant then, and their radiance.
    type Asked = Vec<(Query, Option<(u64, u64)>, f32)>;
    let mut before: Asked = Vec::new();
    let (mut compared, mut new) = (0, 0);
    for round in 0..30 {
        // Growth, moves, removals whose slots are used again, edits, and frames without any change.
        if round % 5 != 4 {
            for _ in 0..1 + round % 7 * 9 {
                let tree = tree(&mut world, &mut rng, round);
                names.name_all(tree, &world);
                let at = Placement::at(rng.position(30.0).as_dvec3());
                instances.push(world.add_instance(tree, at, Policy::Budgeted).expect("valid"));
            }
            for (i, key) in instances.iter().enumerate() {
                let tree = world.instance(*key).expect("it lives").tree;
                match rng.bits() % 14 {
                    0 => {
                        let scale = Mat3::IDENTITY * if round > 12 { 2.0 } else { 1.0 };
                        let at = Placement { linear: scale, ..Placement::at(rng.position(30.0).as_dvec3()) };
                        world.move_instance(*key, at).expect("valid");
                    }
                    1 => world.set_emission(tree, 1, Vec3::splat(rng.between(1.0, 50.0))).unwrap_or_default(),
                    2 if i % 3 == 0 => {
                        world.set_appearance(*key, |a| a.is_enabled = rng.bits() % 2 == 0).expect("it lives")
                    }
                    3 => {
                        // The first comes back as others at the next addition, and the tree grows.
                        world.remove_lights(tree, &[0]).unwrap_or_default();
                    }
                    4 | 5 => {
                        let lights: Vec<Light> = (0..3).map(|_| light(&mut rng, round)).collect();
                        let added = world.add_lights(tree, &lights).expect("valid");
                        added.into_iter().for_each(|light| names.name(tree, light as usize));
                    }
                    6 if i % 2 == 0 => {
                        let lights = (0..2 + i % 90).map(|_| light(&mut rng, round)).collect();
                        world.replace_lights(tree, lights).expect("valid");
                        names.name_all(tree, &world);
                    }
                    7 if i % 2 == 0 => {
                        let other = world.add_instance(tree, Placement::IDENTITY, Policy::Budgeted).expect("valid");
                        let own = world.make_unique(*key).expect("it lives");
                        let same = names.of_trees[&tree].clone();
                        names.of_trees.insert(own, same);
                        world.remove_instance(other).expect("it lives");
                    }
                    _ => {}
                }
            }
            if round % 3 == 1 {
                for _ in 0..instances.len() / 3 {
                    let index = (rng.bits() % instances.len() as u64) as usize;
                    world.remove_instance(instances.swap_remove(index)).expect("it lives");
                }
            }
            if round > 9 {
                let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::splat(0.01) };
                suns.push(world.add_directional(sun).expect("valid"));
                if suns.len() > 3 {
                    world.remove_directional(suns.remove(0)).expect("it lives");
                }
            }
        }
        // The queries of the last frame first, then others.
        let fresh = (0..240).map(|i| {
            let key = instances[(rng.bits() % instances.len() as u64) as usize];
            let lights = &names.of_trees[&world.instance(key).expect("it lives").tree];
            let light = (rng.bits() % lights.len() as u64) as u32;
            let (instance, light) = match i {
                0..4 => (u32::MAX, i),
                // Beyond the lights of the tree.
                4..40 => (world.slot(key).expect("it lives"), lights.len() as u32 + light),
                _ => (world.slot(key).expect("it lives"), light),
            };
            query(rng.position(30.0), instance, light)
        });
        let queries: Vec<Query> = before.iter().map(|(query, ..)| *query).chain(fresh).collect();
        let answers = asker.frame(&mut world, &queries);
        for (query, now) in queries.iter().zip(&answers) {
            let light = match (query.instance, world.instance_at(query.instance)) {
                (u32::MAX, _) => world.directionals().nth(query.light as usize).map(LightId::Directional),
                (_, instance) => instance.map(|instance| LightId::Local { instance, light: query.light }),
            };
            let generation = light.and_then(|light| world.generation(light));
            assert_eq!(generation.unwrap_or(0) as f32, now[2], "round {round}: {query:?}");
            assert!(generation.is_some() || now[0] == 0.0, "round {round}: {query:?}");
        }
        for ((query, then, radiance), now) in before.iter().zip(&answers) {
            let is_same = then.is_some() && *then == names.of(query, &world);
            compared += usize::from(is_same && *radiance > 0.0);
            new += usize::from(!is_same && now[0] > 0.0);
            assert_eq!(now[1], if is_same { *radiance } else { 0.0 }, "round {round}: {query:?}");
        }
        let asked = queries.iter().zip(&answers).skip(before.len());
        before = asked.map(|(query, now)| (*query, names.of(query, &world), now[0])).collect();
    }
    assert!(compared > 2000 && new > 50, "{compared} {new}");
}

#[test]
fn the_sky_of_the_last_frame_is_as_bright_as_it_was() {
    let (mut asker, mut world) = (Asker::new(), LightWorld::new());
    let sky = world.set_sky(Sky::from_fn(8, |toward| Vec3::splat(2.0 + toward.x)).expect("a sound map"));
    let (instance, count) = {
        let tree = world.instance(sky).expect("it lives").tree;
        (world.slot(sky).expect("it lives"), world.tree(tree).expect("it lives").lights().len() as u32)
    };
    let queries: Vec<_> = (0..count).map(|light| query(Vec3::ZERO, instance, light)).collect();
    let [first, second] = [(); 2].map(|()| asker.frame(&mut world, &queries));
    assert!(first.iter().filter(|answer| answer[0] > 0.0).count() as u32 > count / 3);
    assert!(first.iter().zip(&second).all(|(first, second)| first[1] == 0.0 && second[1] == first[0]));
    // Dimmer, and the last frame has the sky as it was.
    world.set_appearance(sky, |a| a.factor = Vec3::splat(0.5)).expect("valid");
    let third = asker.frame(&mut world, &queries);
    assert!(third.iter().zip(&second).all(|(third, second)| third[1] == second[0] && 2.0 * third[0] == second[0]));
}

#[test]
fn a_build_that_was_dropped_belongs_to_the_frame_in_which_it_is_made() {
    let (mut asker, mut world) = (Asker::new(), LightWorld::new());
    let tree = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid"));
    let mut add = |x| world.add_instance(tree, Placement::at(Vec3::new(x, 1.0, 0.0).as_dvec3()), Policy::Budgeted);
    let keys: Vec<_> = (0..40).map(|i| add(3.0 * i as f32 - 60.0).expect("valid")).collect();
    let queries: Vec<_> = keys.iter().map(|key| query(Vec3::ZERO, world.slot(*key).expect("it lives"), 0)).collect();
    let first = asker.frame(&mut world, &queries);
    for (key, x) in keys.iter().zip(0..) {
        world.move_instance(*key, Placement::at(Vec3::new(50.0 - x as f32, 2.0, 9.0).as_dvec3())).expect("valid");
    }
    let mut encoder = asker.encoder();
    asker.lights.sync(&mut world, FrameBudget::NONE, &mut encoder).expect("room enough");
    drop(encoder);
    // Nothing changes any more, but the build is recorded again.
    let [made, next] = [(); 2].map(|_| asker.frame(&mut world, &queries));
    assert!(made.iter().zip(&first).any(|(made, first)| made[0] != first[0]));
    assert!(made.iter().zip(&next).all(|(made, next)| made[0] == next[0] && made[0] == next[1]));
}

#[test]
fn the_last_frame_keeps_the_origin_that_it_had() {
    let (mut asker, mut world, mut rng) = (Asker::new(), LightWorld::new(), Rng(72));
    let start = DVec3::new(6.0e6, -40.0, 8.0e6);
    world.set_origin_near(start).expect("within the limits");
    let mut keys = Vec::new();
    for round in 0..30 {
        let tree = tree(&mut world, &mut rng, round % 8);
        let at = Placement::at(start + rng.position(60.0).as_dvec3());
        keys.push(world.add_instance(tree, at, Policy::Budgeted).expect("valid"));
    }
    let queries: Vec<Query> = (0..200)
        .map(|i| {
            let position = (start + rng.position(50.0).as_dvec3() - world.origin()).as_vec3();
            query(position, world.slot(keys[i % keys.len()]).expect("it lives"), i as u32 % 4)
        })
        .collect();
    let first = asker.frame(&mut world, &queries);
    // The queries stay where they were, relative to the origin of the first frame.
    let mut last = first.clone();
    for step in [1.2, 2.4, 6.0e3, 6.0e3] {
        world.set_origin_near(start + DVec3::X * step * ORIGIN_GRID).expect("within the limits");
        let answers = asker.frame(&mut world, &queries);
        assert!(answers.iter().zip(&last).all(|(now, last)| now[1] == last[0]), "{step}");
        last = answers;
    }
    assert!(first.iter().filter(|answer| answer[0] > 0.0).count() > 60);
    assert!(first.iter().zip(&last).any(|(first, last)| first[0] != last[0]), "the origin has moved");
}

#[test]
fn lights_keep_their_generation_until_the_tree_that_replaces_theirs_has_come() {
    let (mut asker, mut world, mut rng) = (Asker::new(), LightWorld::new(), Rng(73));
    let lamps = |rng: &mut Rng| (0..3000).map(|_| light(rng, 0)).collect::<Vec<_>>();
    let (tree, key) = place_tree(&mut world, lamps(&mut rng), Placement::IDENTITY, Policy::Budgeted);
    let instance = world.slot(key).expect("it lives");
    let queries: Vec<Query> = (0..64).map(|i| query(rng.position(9.0), instance, 45 * i)).collect();
    let old = asker.frame(&mut world, &queries);
    asker.lights.set_frame_bytes(Some(40_000));
    world.replace_lights(tree, lamps(&mut rng)).expect("valid");
    let (mut last, mut frames) = (old.clone(), 0);
    loop {
        let now = asker.frame(&mut world, &queries);
        let has_come = !asker.lights.is_waiting(tree);
        for ((now, last), old) in now.iter().zip(&last).zip(&old) {
            assert_eq!(now[2] == old[2], !has_come);
            assert_eq!(now[1], if has_come { 0.0 } else { last[0] });
        }
        if has_come {
            break;
        }
        (last, frames) = (now, frames + 1);
    }
    assert!(frames > 3 && old.iter().any(|answer| answer[0] > 0.0), "{frames}");
    let lamp = LightId::Local { instance: key, light: 45 };
    let next = asker.frame(&mut world, &queries);
    assert_eq!(world.generation(lamp).map(|generation| generation as f32), Some(next[1][2]));
}
