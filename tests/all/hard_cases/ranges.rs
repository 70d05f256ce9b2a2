//! Ranges that end exactly at the shading point, to the last bit.

use super::*;

#[test]
fn lamps_whose_range_ends_at_the_shading_point_to_the_last_bit_are_covered() {
    let mut rng = Rng(160);
    let (mut lit, mut dark) = (0, 0);
    for round in 0..300 {
        let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        let scale = [1.0, 1.0, 1.0e-3, 7.3, 1.0e4][round % 5];
        let far = [0.0, 100.0, 1.0e6][round % 3];
        let placement = Placement { linear: turn * scale, translation: (rng.direction() * far).as_dvec3() };
        let size = 10.0_f32.powf(rng.between(-2.0, 2.0));
        let lamps: Vec<Vec3> = (0..12).map(|_| rng.position(size) / scale).collect();
        let unlimited = placed(lamps.iter().map(|lamp| Light::point(*lamp, Vec3::ONE)).collect(), [placement]);
        let instance = unlimited.instances().next().expect("one");
        let position = placement.translation.as_vec3() + rng.position(size);
        let at = ShadingPoint::surface(position, rng.direction());
        // The distance that sampling itself computes.
        let volume = ShadingPoint::volume(position);
        let sampler = unlimited.sampler();
        let distance = |light| {
            let id = LightId::Local { instance, light };
            sampler.sample_light(&volume, id, [0.5; 2]).map_or(1.0, |incident| incident.dist)
        };
        let ends: [fn(f32) -> f32; 5] =
            [|d| d, f32::next_up, f32::next_down, |d| d.next_up().next_up(), |d| 1.0001 * d];
        for end in ends {
            let limited =
                (0..).zip(&lamps).map(|(i, lamp)| Light::point(*lamp, Vec3::ONE).with_range(end(distance(i))));
            let world = placed(limited.collect(), [placement]);
            prove(&world, &[at, volume], round as u64);
            let sampler = world.sampler();
            let instance = world.instances().next().expect("one");
            for light in 0..12 {
                match sampler.sample_light(&volume, LightId::Local { instance, light }, [0.5; 2]) {
                    Some(_) => lit += 1,
                    None => dark += 1,
                }
            }
        }
    }
    // Some of them just reach the shading point, and others just do not.
    assert!(lit > 2000 && dark > 2000, "{lit} {dark}");
}
