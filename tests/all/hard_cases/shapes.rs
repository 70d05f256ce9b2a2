//! Hard cases of shapes, placements and positions of shading points.

use super::*;

#[test]
fn emitters_back_to_back_light_both_sides() {
    let mut rng = Rng(100);
    for _ in 0..20 {
        let (u, v) = (rng.direction(), rng.direction());
        let mut lights = vec![];
        for i in 0..30 {
            let at = rng.position(1.0e-3);
            lights.push(if i % 2 == 0 {
                Light::rectangle(at, u, v, Vec3::ONE)
            } else {
                Light::rectangle(at, v, u, Vec3::ONE)
            });
            let axis = u * if i % 2 == 0 { 1.0 } else { -1.0 };
            lights.push(Light::spot(at, axis, 0.0, 0.3, Vec3::ONE));
        }
        let mut world = alone(lights);
        let all = shading_points(&mut rng, 40, 5.0);
        assert!(prove(&world, &all, 1) > 500);
        prove_on_gpu(&mut world, &all, 1);
    }
}

#[test]
fn beams_whose_mean_direction_cancels_keep_their_probabilities_at_every_scale() {
    // Two equal beams are opposite, so the mean direction is that of a faint third beam. Its length
    // goes from a millionth down to lengths whose squares leave f32, alone and multiplied by the
    // areas of small instances.
    let mut rng = Rng(117);
    for k in 0..18 {
        let (axis, third) = (Vec3::X, Vec3::Y);
        let bright = Vec3::splat(MAX_EMISSION);
        let faint = Light::spot(Vec3::ZERO, third, 0.1, 0.3, Vec3::splat(10.0_f32.powi(8 - k)));
        let beam = |axis| Light::spot(Vec3::ZERO, axis, 0.1, 0.2, bright);
        // Other lights put the beams below the root.
        let others = (0..12).map(|_| Light::spot(rng.position(1.0) + 99.0, axis, 0.4, 0.5, faint.emission));
        let below: Vec<_> = [beam(axis), beam(-axis), faint].into_iter().chain(others).collect();
        for lights in [below[..3].to_vec(), below] {
            for scale in [1.0, 1.0e-2, 1.0e-4, 1.0e-6, 1.0e-8] {
                let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
                let mut world = placed(lights.clone(), [linear(turn * scale)]);
                let on_axes = [axis, -axis, third].map(|d| ShadingPoint::volume(turn * d * (scale * 10.0)));
                assert!(prove(&world, &on_axes, k as u64) >= 9);
                if k % 9 == 8 {
                    prove_on_gpu(&mut world, &on_axes, k as u64);
                }
            }
        }
    }
}

#[test]
fn a_shading_point_on_a_light_or_inside_many_boxes_gets_finite_answers() {
    let mut rng = Rng(101);
    let spots = [Vec3::ZERO, Vec3::splat(1.0), Vec3::new(-1000.0, 0.1, 7.3)];
    for at in spots {
        let mut lights: Vec<Light> = (0..12).flat_map(|_| one_of_each(&mut rng, at, 3.0)).collect();
        lights.extend(rng.lights(100, 5.0));
        let mut world = alone(lights);
        let mut all = at_point(at);
        for k in 0..45 {
            let near = at + rng.direction() * 10.0_f32.powi(-k);
            all.extend(at_point(near));
        }
        assert!(prove(&world, &all, 2) > 1000);
        prove_on_gpu(&mut world, &all, 2);
    }
}

#[test]
fn the_brightest_lamp_next_to_a_shading_point_has_a_finite_radiance() {
    let lamp = Light::point(Vec3::ZERO, Vec3::splat(MAX_EMISSION));
    let mut world = alone(vec![lamp, Light::sphere(Vec3::ZERO, 1.0e-20, Vec3::splat(MAX_EMISSION))]);
    let all: Vec<_> = (0..46).flat_map(|k| at_point(Vec3::X * 10.0_f32.powi(-k))).collect();
    assert!(prove(&world, &all, 3) > 10);
    prove_on_gpu(&mut world, &all, 3);
}

#[test]
fn collinear_lamps_light_points_on_their_line() {
    let lamps = (0..2000).map(|i| {
        let at = Vec3::new(i as f32 * 10.0, 6.0, 0.0);
        if i % 2 == 0 {
            Light::point(at, Vec3::splat(500.0))
        } else {
            Light::spot(at, Vec3::NEG_Y, 0.3, 0.9, Vec3::splat(500.0)).with_range(60.0)
        }
    });
    let mut world = alone(lamps.collect());
    let all: Vec<_> = [-5.0, 0.0, 1234.0, 9999.5, 19990.0, 25000.0]
        .into_iter()
        .flat_map(|x| [0.0, 6.0].map(|y| Vec3::new(x, y, 0.0)))
        .flat_map(at_point)
        .collect();
    assert!(prove(&world, &all, 4) > 1000);
    prove_on_gpu(&mut world, &all, 4);
}

#[test]
fn every_kind_of_light_is_covered_in_every_kind_of_placement() {
    let mut rng = Rng(103);
    for round in 0..rounds(400) {
        let size = 10.0_f32.powf(rng.between(-3.0, 3.0));
        let at = rng.position(10.0 * size);
        let mut lights = one_of_each(&mut rng, at, size);
        let with_range: Vec<_> = lights.iter().map(|l| l.with_range(rng.between(0.5, 20.0) * size)).collect();
        lights.extend(with_range);
        let turn = |rng: &mut Rng| Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        // Stretched by up to 10^4, mirrored, rotated before and after.
        let stretch = [0, 1, 2, 4][round as usize % 4] as f32;
        let mut power = || 10.0_f32.powf(rng.between(-0.5, 0.5) * stretch);
        let diagonal = Vec3::new(power(), power(), power()) * if round % 3 == 0 { -1.0 } else { 1.0 };
        let shape = turn(&mut rng) * Mat3::from_diagonal(diagonal) * turn(&mut rng);
        let far = 10.0_f64.powf(f64::from(rng.between(0.0, 7.0)));
        let translation = rng.direction().as_dvec3() * far;
        let mut world = placed(lights, [Placement { linear: shape, translation }]);
        let middle = shape * at + translation.as_vec3();
        // Many shading points nearby. Half of them lie almost exactly in planes of the lights, or
        // have them on the horizon.
        let mut all = Vec::new();
        for i in 0..60 {
            let away = rng.position(3.0 * size);
            let mut shading_point = ShadingPoint::surface(middle + shape * away, rng.direction());
            if i % 2 == 0 {
                let toward = (shape * away).normalize_or(Vec3::X);
                shading_point.normal = toward.cross(shading_point.normal).normalize_or(Vec3::Y);
            }
            all.push(shading_point);
        }
        prove(&world, &all, round);
        if round % 40 < 4 {
            prove_on_gpu(&mut world, &all, round);
        }
    }
}

#[test]
fn rotated_slivers_and_degenerate_triangles_keep_their_sides() {
    let mut rng = Rng(104);
    for round in 0..rounds(300) {
        let at = rng.position(10.0);
        let edge = rng.direction();
        let mut lights = Vec::new();
        for k in 0..8 {
            let other = edge * rng.between(0.3, 3.0) + rng.direction() * 10.0_f32.powi(-k);
            lights.push(Light::triangle([at, at + edge, at + other], Vec3::ONE));
            lights.push(Light::rectangle(at, edge, other, Vec3::ONE));
        }
        lights.push(Light::triangle([at, at + edge, at + edge * 2.0], Vec3::ONE));
        lights.push(Light::rectangle(at, edge, edge * 3.0, Vec3::ONE));
        lights.push(Light::triangle([at, at, at], Vec3::ONE));
        let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        let mut world = placed(lights, [Placement { linear: turn, translation: rng.position(100.0).as_dvec3() }]);
        let middle = world
            .instance(world.instances().next().expect("one instance"))
            .map(|i| i.placement)
            .expect("a live instance")
            .translation
            .as_vec3();
        let all: Vec<_> = (0..20).map(|_| ShadingPoint::volume(middle + turn * (at + rng.position(3.0)))).collect();
        prove(&world, &all, round);
        if round % 50 == 0 {
            prove_on_gpu(&mut world, &all, round);
        }
    }
}

#[test]
fn spots_of_every_width_are_covered() {
    let mut rng = Rng(105);
    let widths = [0.0, 1.0e-30, 1.0e-9, 1.0e-6, 1.0e-4, 5.0e-4, 1.0e-3, 2.0e-3, 0.03, 0.5 * PI, 3.1, PI - 1.0e-6, PI];
    for _ in 0..20 {
        let mut lights = Vec::new();
        let axis = rng.direction();
        for outer in widths {
            for inner in [0.0, 0.5 * outer, outer] {
                lights.push(Light::spot(rng.position(1.0e-3), axis, inner, outer, Vec3::splat(1000.0)));
            }
        }
        let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        let mut world = placed(lights, [Placement::IDENTITY, linear(turn), linear(turn * 3.0)]);
        let side = axis.any_orthonormal_vector();
        let mut all = Vec::new();
        for tree in [Mat3::IDENTITY, turn] {
            for outer in widths {
                // On the axis, and near the rim.
                for angle in [0.0, outer, outer + 3.0e-4, outer + 9.0e-4, outer - 3.0e-4] {
                    let direction = tree * (axis * angle.cos() + side * angle.sin());
                    all.push(ShadingPoint::volume(direction * rng.between(1.0, 100.0)));
                }
            }
        }
        assert!(prove(&world, &all, 6) > 1000);
        // The GPU is compared away from the rims, where f32 leaves few digits of the falloff, a
        // difference of two cosines.
        let side_lights = shading_points(&mut rng, 40, 30.0);
        prove_on_gpu(&mut world, &side_lights, 6);
    }
}

#[test]
fn tiny_and_huge_lights_in_one_tree_are_covered() {
    let mut rng = Rng(106);
    for round in 0..30 {
        let mut lights = Vec::new();
        for k in -44..=8 {
            let at = rng.position(10.0);
            let size = 10.0_f32.powi(k);
            let (u, v) = (rng.direction() * size, rng.direction() * size);
            let emission = Vec3::splat(10.0_f32.powf(rng.between(-12.0, 12.0)));
            lights.push(Light::rectangle(at, u, v, emission));
            lights.push(Light::triangle([at, at + u, at + v], emission));
            lights.push(Light::triangle([Vec3::ZERO, u, v], emission));
            lights.push(Light::sphere(at, size, emission));
            lights.push(Light::point(at, emission).with_range(size.max(1.0e-44)));
        }
        let scales = [1.0, 1.0e3, 1.0e-3, 1.0e9, 1.1e-9];
        let mut world = placed(lights, [linear(Mat3::from_diagonal(Vec3::splat(scales[round % scales.len()])))]);
        let mut all = shading_points(&mut rng, 10, 20.0);
        all.extend(shading_points(&mut rng, 10, 1.0e-6));
        all.extend(shading_points(&mut rng, 10, 1.0e9));
        assert!(prove(&world, &all, 7) > 100);
        prove_on_gpu(&mut world, &all, 7);
    }
}
