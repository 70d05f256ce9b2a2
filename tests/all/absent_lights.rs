//! Lights that shaders are asked about and that are not there: beyond the lights of a tree, in slots without an
//! instance, and stand-ins in place of a tree or the reverse.

use girandole::glam::{DVec3, Vec3};
use girandole::gpu::GpuLights;
use girandole::{
    DirectionalLight, Effects, FrameBudget, InstanceKey, Light, LightId, LightTree, LightWorld, Placement, Policy,
    ShadingPoint, Shape, Sky, TreeKey,
};

use crate::gpu::{answers, asker, gpu, gpu_lights};
use testbed::testing::support::Rng;

/// The index of the first stand-in of a tree, and the most stand-ins.
const STAND_IN: u32 = 1 << 30;
const MOST_STAND_INS: u32 = 64;

/// What each function says about a light: 0 if it is not there.
const TEXT: &str = "
    struct Query { position: vec3<f32>, instance: u32, point: vec3<f32>, light: u32, mask: u32 }
    fn answer(q: Query) -> array<f32, 8> {
        let at = light_masked_point(light_volume_point(q.position), q.mask);
        let ray = light_masked_point(light_segment(q.position, vec3(0.6, 0.0, 0.8), 5.0), q.mask);
        let s = light_reservoir_sample(at, light_reservoir_of(q.instance, q.light, vec2(0.3, 0.6)));
        let on_ray = light_reservoir_sample(ray, light_reservoir_of(q.instance, q.light, vec2(0.3, 0.6)));
        let toward = normalize(q.point - q.position);
        let hit = LightSample(toward, 1.0, vec3(1.0), 1.0, 1.0, q.instance, q.light, 0u);
        let place = light_place_on(at, hit);
        return array(
            light_pmf(at, q.instance, q.light), f32(light_generation(q.instance, q.light)),
            s.pmf + on_ray.pmf, s.radiance.x + s.radiance.y + s.radiance.z + on_ray.radiance.x,
            light_pdf(at, q.instance, q.light, q.point), light_sample_along(ray, q.instance, q.light, 0.4).pdf,
            light_along_pdf(ray, q.instance, q.light, 2.5), place.x + place.y,
        );
    }";

#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
struct Query {
    position: [f32; 3],
    instance: u32,
    point: [f32; 3],
    light: u32,
    mask: u32,
    padding: [u32; 3],
}

fn lights(rng: &mut Rng, count: usize) -> Vec<Light> {
    let one = |rng: &mut Rng| match rng.bits() % 5 {
        0 => Light::rectangle(rng.position(3.0), Vec3::X, Vec3::Z, Vec3::splat(2.0)),
        1 => Light::spot(rng.position(3.0), rng.direction(), 0.3, 1.2, Vec3::splat(9.0)),
        2 => Light::point(rng.position(3.0), Vec3::ZERO),
        _ => Light::point(rng.position(3.0), Vec3::splat(rng.between(1.0, 9.0))),
    };
    (0..count).map(|_| one(rng)).collect()
}

/// Trees of 0 to 300 lights, one of them dark, with an instance each, two suns and a sky.
fn world(rng: &mut Rng) -> (LightWorld, Vec<(TreeKey, InstanceKey)>) {
    let mut world = LightWorld::new();
    let of_count = |world: &mut LightWorld, rng: &mut Rng, count: usize| {
        let tree = world.add_tree(LightTree::new(lights(rng, count)).expect("valid"));
        let at = Placement::at(rng.position(12.0).as_dvec3());
        (tree, world.add_instance(tree, at, Policy::Budgeted).expect("valid"))
    };
    let counts = [300, 1, 0, 6, 8, 9, 40, 17, 0, 100, 3, 30];
    let mut all: Vec<_> = counts.iter().map(|count| of_count(&mut world, rng, *count)).collect();
    let dark = world.add_tree(LightTree::new(vec![Light::point(Vec3::ONE, Vec3::ZERO); 20]).expect("valid"));
    all.push((dark, world.add_instance(dark, Placement::IDENTITY, Policy::Budgeted).expect("valid")));
    for x in [0.1, -0.2] {
        let direction = Vec3::new(x, -1.0, 0.0).normalize();
        world.add_directional(DirectionalLight { direction, illuminance: Vec3::splat(0.01) }).expect("valid");
    }
    let pixels: Vec<Vec3> = (0..16 * 8).map(|i| Vec3::splat(0.001 * (1 + i % 3) as f32)).collect();
    world.set_sky(Sky::equirectangular(16, &pixels).expect("sound"));
    (world, all)
}

/// Random edits, which leave ranges with slack, removed lights, and slots without an instance.
fn edit(world: &mut LightWorld, all: &mut Vec<(TreeKey, InstanceKey)>, rng: &mut Rng) {
    for index in (0..all.len()).rev() {
        let (tree, key) = all[index];
        let count = world.tree(tree).expect("it lives").lights().len();
        match rng.bits() % 9 {
            0 | 1 => {
                let added = 1 + (rng.bits() % 9) as usize;
                world.add_lights(tree, &lights(rng, added)).expect("valid");
            }
            2 if count > 0 => {
                let last = count as u32 - 1;
                world.remove_lights(tree, &[last]).unwrap_or_default();
            }
            3 => {
                let count = (rng.bits() % 50) as usize;
                world.replace_lights(tree, lights(rng, count)).expect("valid");
            }
            4 => world.set_appearance(key, |a| a.is_enabled = rng.bits().is_multiple_of(2)).expect("it lives"),
            5 => world.set_appearance(key, |a| a.mask = 1 << (rng.bits() % 2)).expect("it lives"),
            6 if all.len() > 8 => {
                world.remove_instance(key).expect("it lives");
                world.remove_tree(tree).expect("unused");
                all.swap_remove(index);
            }
            7 => world.move_instance(key, Placement::at(rng.position(12.0).as_dvec3() + DVec3::Y)).expect("valid"),
            _ => {}
        }
    }
    // Of lights that were added and removed before the update.
    let (tree, _) = all[(rng.bits() % all.len() as u64) as usize];
    let added = world.add_lights(tree, &lights(rng, 2)).expect("valid");
    world.remove_lights(tree, &added).expect("they were added");
}

/// The light that a query names; `None` if it is not there.
fn named(query: &Query, world: &LightWorld, gpu: &GpuLights) -> Option<LightId> {
    let Query { instance, light, .. } = *query;
    if instance == u32::MAX {
        return world.directionals().nth(light as usize).map(LightId::Directional);
    }
    let key = world
        .instance_at(instance)
        .filter(|key| world.instance(*key).map(|i| i.appearance.is_enabled) == Some(true))?;
    let tree = world.instance(key)?.tree;
    let is_there = match gpu.stands_in(tree) {
        true => (STAND_IN..STAND_IN + MOST_STAND_INS).contains(&light),
        false => (light as usize) < world.tree(tree)?.lights().len(),
    };
    is_there.then_some(LightId::Local { instance: key, light })
}

fn queries(world: &LightWorld, rng: &mut Rng) -> Vec<Query> {
    // More than there ever were.
    let slots = 24;
    let query = |i: u32| {
        let instance = match rng.bits() % 16 {
            0 => u32::MAX,
            // Products with the size of a record wrap around.
            1 => [u32::MAX - 1, 0x3333_3334, 0x1999_999a, 1 << 30][i as usize % 4],
            2 => slots + i % 40,
            _ => (rng.bits() % u64::from(slots)) as u32,
        };
        let tree = world.instance_at(instance).and_then(|key| world.tree(world.instance(key)?.tree));
        let count = tree.map_or(2, |tree| tree.lights().len()) as u32;
        let light = match rng.bits() % 10 {
            0 => count,
            1 => count + 1 + (rng.bits() % 9) as u32,
            2 => count + (rng.bits() % 600) as u32,
            3 => rng.bits() as u32,
            4 => STAND_IN + (rng.bits() % 80) as u32,
            5 => u32::MAX - i % 3,
            _ => (rng.bits() % u64::from(count.max(1))) as u32,
        };
        let mask = [u32::MAX, 1, 2, 4, 0][(rng.bits() % 5) as usize];
        let place = world.instance_at(instance).and_then(|key| world.instance(key).map(|i| i.placement));
        let near = place.map_or(Vec3::ZERO, |place| place.translation.as_vec3());
        let point = tree.and_then(|tree| tree.lights().get(light as usize)).map_or(rng.position(12.0), |light| {
            match light.shape {
                // Nothing is turned.
                Shape::Rectangle { center, .. } => near + center,
                _ => near,
            }
        });
        let position = rng.position(15.0).to_array();
        Query { position, instance, point: point.to_array(), light, mask, padding: [0; 3] }
    };
    (0..4000).map(query).collect()
}

#[test]
fn shaders_say_that_a_light_that_is_not_there_is_not_there() {
    let mut rng = Rng(67);
    let (mut world, mut all) = world(&mut rng);
    let mut gpu_lights = gpu_lights();
    let effects = Effects::all() - Effects::GLOSSY - Effects::SOLID_ANGLES - Effects::NON_RIGID - Effects::PORTALS;
    let shader = asker(&gpu(), &gpu_lights, effects, TEXT);
    let (mut absent, mut wrong, mut told) = (0, Vec::new(), [0; 8]);
    for round in 0..12 {
        // Trees of more than 16 lights are shown as stand-ins at first.
        gpu_lights.set_frame_bytes((round == 0).then_some(0));
        if round > 1 {
            edit(&mut world, &mut all, &mut rng);
        }
        world.update(FrameBudget::NONE);
        gpu_lights.upload(&world).expect("room enough");
        assert!(effects.contains(gpu_lights.effects()));
        let asked = queries(&world, &mut rng);
        let answers: Vec<[f32; 8]> = answers(&gpu(), &shader, &mut gpu_lights, &asked);
        let sampler = world.sampler().from_roots();
        for (query, answer) in asked.iter().zip(&answers) {
            let light = named(query, &world, &gpu_lights);
            let at = ShadingPoint::volume(query.position.into()).with_mask(query.mask);
            let Some(light) = light else {
                absent += 1;
                if *answer != [0.0; 8] {
                    wrong.push(format!("round {round}: {query:?} is not there: {answer:?}"));
                }
                continue;
            };
            if query.light >= STAND_IN {
                continue;
            }
            told.iter_mut().zip(*answer).for_each(|(told, number)| *told += usize::from(number > 0.0));
            let is_alike = world.generation(light).map(|generation| generation as f32) == Some(answer[1])
                && (sampler.pmf(&at, light) > 0.0) == (answer[0] > 0.0);
            if !is_alike {
                wrong.push(format!("round {round}: {query:?} is {light:?}: {answer:?}"));
            }
        }
    }
    assert!(absent > 15_000 && told.iter().all(|told| *told > 50), "{absent} {told:?}");
    assert!(wrong.is_empty(), "{} of {absent} and {told:?}, first {}", wrong.len(), wrong[0]);
}
