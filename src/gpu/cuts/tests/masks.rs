//! Masks of points and of instances, where cells share cuts.

use super::*;
use crate::gpu::testing::small_sky;
use crate::keys::InstanceKey;
use crate::light::{DirectionalLight, Light};
use crate::policy::Policy;
use crate::tree::LightTree;

/// A pick, and the probability of the light that the bits of the last two numbers name.
const PICK_AND_ASK: &str = "
        let pick = light_pick(at, inputs[id.x].u.xy);
        let asked = bitcast<vec2<u32>>(inputs[id.x].u.zw);
        outputs[id.x] = vec4(
            pick.instance, pick.light, bitcast<u32>(pick.pmf), bitcast<u32>(light_pmf(at, asked.x, asked.y)),
        );";

/// Lights of two instances, and a sky. Returns the instances.
fn two_rooms() -> (LightWorld, [InstanceKey; 3]) {
    let mut world = LightWorld::new();
    let room = |x: f64| {
        let lamp = |i: u32| Light::point(Vec3::new(unit(i) * 5.0, 2.0, unit(i + 99) * 5.0), Vec3::splat(3.0));
        let tree = world.add_tree(LightTree::new((0..40).map(lamp).collect()).expect("valid"));
        world.add_instance(tree, Placement::at(DVec3::X * x), Policy::Static).expect("valid")
    };
    let [first, second] = [0.0, 6.0].map(room);
    let sky = world.set_sky(small_sky());
    (world, [first, second, sky])
}

/// Points of a few cells with every kind of mask. Each names a light of some instance.
fn masked_inputs(world: &LightWorld, instances: [InstanceKey; 3]) -> Vec<Input> {
    let mut points = inputs(1500, EYE, 0);
    for (i, input) in points.iter_mut().enumerate() {
        let middle = Vec3::new((i / 30 % 8) as f32, 0.05, (i / 240) as f32);
        input.position = (middle + Vec3::from_array(input.position) * 0.01).to_array();
        input.roughness = -1.0;
        input.mask = [0, 1, 2, 4, 3, u32::MAX][i / 5 % 6];
        let slot = world.slot(instances[i % instances.len()]).expect("it lives");
        input.u[2..].copy_from_slice(&[slot, i as u32 / 7 % 40].map(f32::from_bits));
    }
    points
}

/// The instances whose lights may be chosen, as all calls on both sides tell for a point.
fn chosen(sampler: &LightSampler<'_>, input: &Input, output: &Output) -> Vec<u32> {
    let (world, at) = (sampler.world, point(input));
    let [slot, light] = [input.u[2].to_bits(), input.u[3].to_bits()];
    let asked = LightId::Local { instance: world.instance_at(slot).expect("it lives"), light };
    let picked = match sampler.pick(&at, [input.u[0], input.u[1]]).map(|pick| pick.light) {
        Some(LightId::Local { instance, .. }) => world.slot(instance),
        _ => None,
    };
    let all = [
        (output.pmf > 0.0 && output.instance != u32::MAX).then_some(output.instance),
        (output.pmf_of_light > 0.0).then_some(slot),
        picked,
        (sampler.pmf(&at, asked) > 0.0).then_some(slot),
    ];
    all.into_iter().flatten().collect()
}

#[test]
fn no_cell_brings_lights_that_the_mask_of_a_point_does_not_see() {
    let effects = Effects::MASKS | Effects::DIRECTIONAL | Effects::SKY;
    let (mut all, mut unseen) = (0, Vec::new());
    let mut rig = Rig::choosing(effects, options(), PICK_AND_ASK);
    let (mut world, instances) = two_rooms();
    for case in 0..8 {
        let (has_sun, has_masks, has_sky) = (case & 1 != 0, case & 2 != 0, case & 4 != 0);
        let sun = world.directionals().next();
        match sun {
            Some(sun) if !has_sun => world.remove_directional(sun).expect("it lives"),
            None if has_sun => {
                let sun = DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::ONE };
                world.add_directional(sun).map(drop).expect("valid");
            }
            _ => {}
        }
        world.set_appearance(instances[2], |a| a.is_enabled = has_sky).expect("it lives");
        for (key, mask) in instances.into_iter().zip([1, 2, 2]) {
            world.set_appearance(key, |a| a.mask = if has_masks { mask } else { u32::MAX }).expect("it lives");
        }
        rig.lights.upload(&world).expect("room enough");
        let points = masked_inputs(&world, instances);
        // A world that has changed has no cuts.
        for is_marked in [false, true] {
            let mut table = CutTable::new(options());
            if is_marked {
                mark(&world, &table, &points);
                table.build(world.sampler());
                assert!(table.report().built > 40, "{:?}", table.report());
            }
            let outputs = rig.run(if is_marked { &points } else { &[] }, &points);
            let sampler = world.sampler().with_cuts(&table);
            let others = others(&sampler, &points, &outputs);
            assert!(others <= points.len() / 50, "{others} differ: {case} {is_marked}");
            for (input, output) in points.iter().zip(&outputs) {
                let slots = chosen(&sampler, input, output);
                all += slots.len();
                let mask = |slot: &u32| {
                    world.instance_at(*slot).and_then(|key| world.instance(key).map(|i| i.appearance.mask)).unwrap_or(0)
                };
                if slots.iter().any(|slot| mask(slot) & input.mask == 0) {
                    unseen.push((case, is_marked, input.mask, slots));
                }
            }
        }
    }
    assert!(unseen.is_empty() && all > 50_000, "{} of {all}: {:?}", unseen.len(), unseen.first());
}
