//! Compares the samples of two worlds.

use girandole::glam::Vec3;
use girandole::{LightWorld, Placement, ShadingPoint};
use testbed::common::split_mix::Rng;

/// Shading points lie within this distance of a light along each axis, in metres.
const NEAR: f32 = 5.0;

/// Samples both worlds at points near their lights. Returns how many samples are equal bit for bit.
pub fn equal_samples(one: &LightWorld, other: &LightWorld, samples: usize) -> usize {
    let mut rng = Rng(15);
    let samplers = [one.sampler(), other.sampler()];
    let is_equal = |rng: &mut Rng| {
        let at = ShadingPoint::surface(near_a_light(one, rng), direction(rng));
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        // Debug texts of floats are equal only if their bits are, but for NaN, which no sample has.
        let [one, other] = samplers.each_ref().map(|sampler| format!("{:?}", sampler.sample(&at, u)));
        one == other
    };
    (0..samples).filter(|_| is_equal(&mut rng)).count()
}

/// A position near a light of an instance; near the origin in a world without such lights.
fn near_a_light(world: &LightWorld, rng: &mut Rng) -> Vec3 {
    let offset = NEAR * cube(rng);
    let instance = pick(world.instances().count(), rng).and_then(|index| world.instances().nth(index));
    let lights = instance.and_then(|key| world.instance(key).map(|i| i.tree)).and_then(|tree| world.tree(tree));
    let light = lights.and_then(|tree| pick(tree.lights().len(), rng).map(|index| tree.lights()[index]));
    let position =
        light.zip(instance.and_then(|key| world.instance(key).map(|i| i.placement))).map(|(light, placement)| {
            let Placement { linear, translation } = placement;
            linear * light.cluster().mean + (translation - world.origin()).as_vec3()
        });
    position.unwrap_or_default() + offset
}

fn pick(count: usize, rng: &mut Rng) -> Option<usize> {
    (count > 0).then(|| (rng.bits() % count as u64) as usize)
}

fn cube(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.between(-1.0, 1.0), rng.between(-1.0, 1.0), rng.between(-1.0, 1.0))
}

fn direction(rng: &mut Rng) -> Vec3 {
    cube(rng).normalize_or(Vec3::Y)
}
