//! Hard cases at the ends of every range: brightness, depth, distance, scale, infinity and NaN.

use super::*;

#[test]
fn thousands_of_lights_at_one_point_have_equal_probabilities() {
    let mut world = alone((0..6000).map(|_| Light::point(Vec3::splat(3.0), Vec3::ONE)).collect());
    let all = [ShadingPoint::volume(Vec3::ZERO), ShadingPoint::volume(Vec3::splat(3.0))];
    prove(&world, &all, 8);
    let sum: f64 = all_pmfs(&world.sampler(), &all[0]).iter().map(|(_, p)| f64::from(*p)).sum();
    assert!((sum - 1.0).abs() < SUM_TOLERANCE, "{sum}");
    // Many instances of the tree at the same point.
    let tree = world.trees().next().expect("a tree");
    for _ in 0..500 {
        world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("allowed");
    }
    for splits in SPLITS {
        let pick = world.sampler().with_splits(splits).pick(&all[0], [0.3, 0.7]).expect("a light");
        // Nodes pack flux with 8 bits. A share and its sum are each off by up to 2^-9, on each of
        // at least 8 levels.
        let tolerance = 8.0 * 2.0 / 512.0;
        assert!((f64::from(pick.pmf) * 6000.0 * 501.0 - 1.0).abs() < tolerance, "{splits}: {pick:?}");
    }
    prove_on_gpu(&mut world, &all, 8);
}

#[test]
fn twenty_four_decades_of_brightness_in_one_tree_are_covered() {
    let mut rng = Rng(107);
    for spread in [12.0, 15.0, 40.0] {
        let lights: Vec<_> = (0..400)
            .map(|i| {
                let power = (spread * (i as f32 / 199.5 - 1.0)).clamp(-44.9, 15.0);
                let emission = Vec3::splat(10.0_f32.powf(power).min(MAX_EMISSION));
                match i % 3 {
                    0 => Light::point(rng.position(10.0), emission),
                    1 => Light::sphere(rng.position(10.0), 0.1, emission),
                    _ => Light::rectangle(rng.position(10.0), rng.direction(), rng.direction(), emission).two_sided(),
                }
            })
            .collect();
        let first = lights[399];
        let mut world = alone(lights);
        let mut all = shading_points(&mut rng, 20, 15.0);
        all.push(ShadingPoint::volume(first.aabb().center() + Vec3::X * 1.0e-9));
        assert!(prove(&world, &all, 9) > 1000);
        if spread < 40.0 {
            // Below 1e-38 a light may be dark on a GPU, which flushes denormals, and not on the
            // CPU.
            prove_on_gpu(&mut world, &all, 9);
        }
    }
}

#[test]
fn emissions_that_round_to_no_flux_are_dark_everywhere() {
    let faint = f32::from_bits(1);
    let emissions = [Vec3::splat(faint), Vec3::new(0.0, 0.0, faint), Vec3::new(faint, 0.0, 0.0), Vec3::splat(1.0e-40)];
    let lights = emissions.into_iter().flat_map(|e| {
        [Light::point(Vec3::ZERO, e), Light::sphere(Vec3::X, 0.1, e), Light::rectangle(Vec3::Y, Vec3::X, Vec3::Z, e)]
    });
    let mut world = alone(lights.collect());
    world
        .add_directional(DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::new(0.0, 0.0, faint) })
        .expect("allowed");
    let all: Vec<_> = [1.0e-10, 1.0e-3, 1.0, 1.0e6].into_iter().flat_map(|d| at_point(Vec3::splat(d))).collect();
    prove(&world, &all, 10);
}

#[test]
fn faint_lamps_beside_a_bright_moon_are_covered() {
    let mut world = alone((0..20).map(|i| Light::point(Vec3::X * i as f32, Vec3::splat(1.0e-14))).collect());
    for illuminance in [Vec3::splat(MAX_EMISSION), Vec3::splat(f32::from_bits(1)), Vec3::splat(1.0e-30)] {
        world.add_directional(DirectionalLight { direction: Vec3::NEG_Y, illuminance }).expect("allowed");
    }
    let all: Vec<_> = [Vec3::ZERO, Vec3::splat(1.0e6), Vec3::splat(1.0e9)].into_iter().flat_map(at_point).collect();
    assert!(prove(&world, &all, 11) > 100);
}

#[test]
fn lights_at_halving_distances_make_a_deep_tree_and_are_covered() {
    for falling in [1.0_f32, 0.5, 0.1] {
        let lights: Vec<_> = (0..140)
            .map(|k| {
                let place = Vec3::new(0.5_f32.powi(k), 0.0, 0.0);
                Light::point(place, Vec3::splat((1.0e15 * falling.powi(k)).max(1.0e-15)))
            })
            .collect();
        let mut world = alone(lights);
        let mut all: Vec<_> = [1.0, 1.0 + 1.0e-6, 0.0, 0.25, 1.0e-9, 1.0e-18, 1.0e3]
            .into_iter()
            .flat_map(|x| at_point(Vec3::X * x))
            .collect();
        all.extend(at_point(Vec3::new(1.0, 1.0e-7, 0.0)));
        assert!(prove(&world, &all, 12) > 1000);
        prove_on_gpu(&mut world, &all, 12);
    }
}

#[test]
fn centimetres_count_ten_thousand_kilometres_from_the_origin() {
    let mut rng = Rng(108);
    let origin = DVec3::new(9_766.0, 0.0, 9_766.0) * ORIGIN_GRID;
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(rng.lights(40, 0.05)).expect("allowed"));
    for i in 0..100 {
        let at = origin + DVec3::new(f64::from(i) * 0.01, 0.0, f64::from(i % 7) * 0.01);
        world.add_instance(tree, Placement::at(at), Policy::Static).expect("allowed");
    }
    // Far from the origin positions are a metre apart; every light is still covered.
    let far: Vec<_> =
        (0..10).map(|_| ShadingPoint::surface(origin.as_vec3() + rng.position(3.0), rng.direction())).collect();
    prove(&world, &far, 13);
    prove_on_gpu(&mut world, &far, 13);
    world.set_origin_near(origin).expect("near enough");
    let near = shading_points(&mut rng, 20, 0.5);
    assert!(prove(&world, &near, 13) > 1000);
    prove_on_gpu(&mut world, &near, 13);
    // The next instance, a centimetre away, sends its light from another direction.
    let sampler = world.sampler();
    let mut ids = world.instances();
    let mut distance = || {
        let id = LightId::Local { instance: ids.next().expect("a hundred"), light: 0 };
        (0..100).find_map(|i| sampler.sample_light(&ShadingPoint::volume(Vec3::Y * (0.5 + i as f32)), id, [0.5; 2]))
    };
    assert_ne!(distance().map(|i| i.direction), distance().map(|i| i.direction));
}

#[test]
fn a_lamp_post_far_from_the_origin_keeps_its_horizon_and_its_range() {
    let mut rng = Rng(109);
    for round in 0..200 {
        let far = 10.0_f32.powf(rng.between(3.0, 8.0));
        let translation = (rng.direction() * far).as_dvec3();
        let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        let mut lights = one_of_each(&mut rng, Vec3::Y, 0.3);
        lights.push(Light::point(Vec3::Y, Vec3::ONE).with_range(0.5));
        let world = placed(lights, [Placement { linear: turn, translation }]);
        // f32 rounds the positions; offsets within two metres are tried at every distance.
        let all: Vec<_> = (0..60)
            .map(|_| {
                let offset = rng.position(2.0);
                let place = translation.as_vec3() + offset;
                ShadingPoint::surface(place, rng.direction())
            })
            .collect();
        prove(&world, &all, round);
    }
}

#[test]
fn the_largest_coordinates_and_scales_are_covered() {
    let mut rng = Rng(110);
    let m = MAX_COORDINATE;
    let bright = Vec3::splat(MAX_EMISSION);
    let mut lights = Vec::new();
    for corner in [Vec3::splat(m), Vec3::splat(-m), Vec3::new(m, -m, m), Vec3::ZERO] {
        lights.push(Light::point(corner, bright));
        lights.push(Light::spot(corner, Vec3::X, 0.1, 1.0, bright));
        lights.push(Light::rectangle(corner, Vec3::X * m, Vec3::Y * m, bright));
        lights.push(Light::rectangle(corner, Vec3::new(m, m, m), Vec3::new(-m, m, m), bright).two_sided());
        lights.push(Light::triangle([corner, -corner, Vec3::new(-m, m, 0.0)], bright).two_sided());
        lights.push(Light::sphere(corner, m, bright));
        lights.push(Light::sphere(corner, 1.0, bright).with_range(1.0e30));
    }
    lights.extend((0..60).map(|_| Light::rectangle(rng.position(m), Vec3::X * m, Vec3::Y * m, bright)));
    let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), 1.0));
    let even = |s: f32| Mat3::from_diagonal(Vec3::splat(s));
    let least = 1.001 / MAX_SCALE;
    for linear in [
        Mat3::IDENTITY,
        even(MAX_SCALE),
        even(-MAX_SCALE),
        even(least),
        turn * even(0.9 * MAX_SCALE),
        turn * even(least),
        Mat3::from_diagonal(Vec3::new(1.0, MAX_SCALE, MAX_SCALE)),
        Mat3::from_diagonal(Vec3::new(1.0, 1.0, 1.0e-8)),
        Mat3::from_cols(Vec3::splat(MAX_SCALE), Vec3::new(-MAX_SCALE, MAX_SCALE, 0.0), Vec3::new(0.0, 0.0, MAX_SCALE)),
    ] {
        for translation in [DVec3::ZERO, DVec3::splat(1.0e9), DVec3::new(-1.0e9, 1.0e9, 0.0)] {
            let mut world = placed(lights.clone(), [Placement { linear, translation }]);
            let tree = world.trees().next().expect("a tree");
            world.add_instance(tree, Placement::at(-translation), Policy::Budgeted).expect("allowed");
            let tree = world.tree(tree).expect("a live tree");
            let flux = tree.flux();
            assert!(flux.area.is_finite() && flux.punctual.is_finite(), "{flux:?}");
            let a = tree.attributes();
            assert!([a.distance, a.overlap, a.variance, a.splitting_cost].into_iter().all(f32::is_finite), "{a:?}");
            let mut all = shading_points(&mut rng, 8, 1.0);
            all.extend(shading_points(&mut rng, 8, m));
            all.extend([m, -m].into_iter().flat_map(|x| at_point(Vec3::splat(x))));
            assert!(prove(&world, &all, 14) > 0);
            prove_on_gpu(&mut world, &all, 14);
        }
    }
}

#[test]
fn ill_conditioned_placements_are_covered_or_refused() {
    let mut rng = Rng(111);
    for round in 0..200 {
        let turn = |rng: &mut Rng| Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
        let thin = 10.0_f32.powf(rng.between(-9.0, 0.0));
        let shape = turn(&mut rng) * Mat3::from_diagonal(Vec3::new(1.0, 1.0, thin)) * turn(&mut rng);
        let mut lights = one_of_each(&mut rng, Vec3::ZERO, 0.3);
        let ranged: Vec<_> = lights.iter().map(|l| l.with_range(1.0)).collect();
        lights.extend(ranged);
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(lights).expect("allowed"));
        let placement = Placement { linear: shape, translation: rng.position(100.0).as_dvec3() };
        if world.add_instance(tree, placement, Policy::Static).is_err() {
            continue;
        }
        let middle = placement.translation.as_vec3();
        let all: Vec<_> = (0..40).map(|_| ShadingPoint::surface(middle + rng.position(1.2), rng.direction())).collect();
        prove(&world, &all, round);
    }
}

#[test]
fn twenty_thousand_refits_leave_a_tree_no_looser_than_its_lights() {
    let mut rng = Rng(112);
    let mut lights = rng.lights(40, 5.0);
    let mut tree = LightTree::new(lights.clone()).expect("allowed");
    for round in 0..20_000_u32 {
        let index = (rng.bits() % 40) as usize;
        let step = rng.position(0.05);
        lights[index] = moved(&lights[index], step);
        tree.set_lights(&[(index as u32, lights[index])]).expect("allowed");
        tree.refit();
        if round % 1000 == 0 {
            tree.check().expect("a sound tree after every step");
        }
    }
    tree.check().expect("a sound tree at the end");
    // The root equals that of a new tree over the same lights: no error adds up.
    let mut fresh = LightTree::new(lights.clone()).expect("allowed");
    let fresh_root = fresh.cluster();
    let root = tree.cluster();
    assert_eq!((root.aabb, root.range), (fresh_root.aabb, fresh_root.range));
    // The sums of 40 terms have another order.
    assert!((root.flux / fresh_root.flux - 1.0).abs() < 1.0e-5, "{root:?} {fresh_root:?}");
    assert!(root.mean.distance(fresh_root.mean) < 1.0e-4, "{root:?} {fresh_root:?}");
    assert!((root.variance / fresh_root.variance - 1.0).abs() < 1.0e-4, "{root:?} {fresh_root:?}");
    let before = tree.nodes().to_vec();
    tree.refit();
    assert_eq!(tree.nodes(), before, "a refit without a change changes nothing");
    tree.rebuild();
    fresh.rebuild();
    assert_eq!(tree.nodes(), fresh.nodes());
}

fn moved(light: &Light, step: Vec3) -> Light {
    use girandole::Shape;
    let mut light = *light;
    match &mut light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } => *position += step,
        Shape::Rectangle { center, .. } | Shape::Sphere { center, .. } => *center += step,
        Shape::Triangle { vertices, .. } => *vertices = vertices.map(|v| v + step),
        &mut _ => unreachable!("this version has no others"),
    }
    light
}

#[test]
fn a_world_that_is_switched_off_and_on_again_has_the_same_probabilities() {
    let mut rng = Rng(113);
    // So few parts that all are in one cell, and apart: planes, and which trees are loose, depend on what was before.
    let mut world = rng.world(2, 12, 3, 10.0);
    let trees: Vec<_> = world.trees().collect();
    let all = shading_points(&mut rng, 10, 240.0);
    for (key, i) in world.instances().collect::<Vec<_>>().into_iter().zip(0..) {
        let place = world.instance(key).expect("it lives").placement;
        let place = Placement { translation: DVec3::new(f64::from(i % 3), 0.0, f64::from(i / 3)) * 160.0, ..place };
        world.move_instance(key, place).expect("valid");
    }
    world.update(FrameBudget::NONE);
    let before: Vec<_> = all.iter().map(|r| all_pmfs(&world.sampler(), r)).collect();
    for tree in &trees {
        let lights = world.tree(*tree).expect("a live tree").lights().to_vec();
        let off: Vec<_> = (0..).zip(&lights).map(|(i, l)| (i, l.with_emission(Vec3::ZERO))).collect();
        world.set_lights(*tree, &off).expect("dark is allowed");
        world.update(FrameBudget::NONE);
        prove(&world, &all, 15);
        prove_on_gpu(&mut world, &all, 15);
        let on: Vec<_> = (0..).zip(lights).collect();
        world.set_lights(*tree, &on).expect("allowed");
        world.update(FrameBudget::NONE);
    }
    let after: Vec<_> = all.iter().map(|r| all_pmfs(&world.sampler(), r)).collect();
    assert_eq!(before, after);
}

#[test]
fn normals_that_are_not_of_unit_length_give_valid_probabilities() {
    let mut rng = Rng(114);
    let world = rng.world(3, 40, 3, 10.0);
    let mut all = Vec::new();
    for length in [0.0, 1.0e-44, 1.0e-30, 1.0e-20, 1.0e-3, 0.5, 2.0, 1.0e6, 1.0e15] {
        all.extend((0..5).map(|_| ShadingPoint::surface(rng.position(12.0), rng.direction() * length)));
    }
    assert!(prove(&world, &all, 16) > 1000);
}

#[test]
fn infinite_and_nan_positions_give_valid_probabilities() {
    let mut rng = Rng(115);
    let world = rng.world(3, 40, 3, 10.0);
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX] {
        let all = [
            ShadingPoint::volume(Vec3::splat(bad)),
            ShadingPoint::volume(Vec3::X * bad),
            ShadingPoint::surface(Vec3::ONE, Vec3::splat(bad)),
            ShadingPoint::surface(Vec3::ONE, Vec3::Y * bad),
            ShadingPoint::surface(Vec3::ONE, Vec3::X * bad),
            ShadingPoint::surface(Vec3::splat(bad), Vec3::Y),
        ];
        prove(&world, &all, 17);
    }
}

#[test]
fn very_distant_shading_points_are_lit_by_small_instances() {
    let mut rng = Rng(116);
    for scale in [1.0, 1.0e-3, 1.0e-8] {
        let at = Placement { linear: Mat3::from_diagonal(Vec3::splat(scale)), translation: DVec3::ONE };
        let lights = [Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z]
            .map(|d| Light::spot(Vec3::ZERO, d, 0.5, 1.0, Vec3::splat(MAX_EMISSION)).with_range(1.0e17));
        let mut world = placed(lights.to_vec(), [at]);
        let all: Vec<_> = (9..18)
            .flat_map(|k| (0..10).map(move |_| k))
            .map(|k| ShadingPoint::volume(rng.direction() * 10.0_f32.powi(k)))
            .collect();
        assert!(prove(&world, &all, 18) > 50);
        prove_on_gpu(&mut world, &all, 18);
    }
}

/// A log-uniform number of either sign; the bounds are powers of ten.
fn any_size(rng: &mut Rng, least: f32, most: f32) -> f32 {
    let size = 10.0_f32.powf(rng.between(least, most));
    if rng.bits().is_multiple_of(2) { size } else { -size }
}

/// A position at a log-uniform distance from the origin.
fn any_place(rng: &mut Rng, least: f32, most: f32) -> Vec3 {
    let largest = any_size(rng, least, most).abs();
    rng.direction() * largest
}

#[test]
fn random_allowed_scenes_are_covered() {
    let mut contributions = 0;
    for round in 0..rounds(600) {
        let mut rng = Rng(2000 + round);
        let size = any_size(&mut rng, -6.0, 6.0).abs();
        let middle = any_place(&mut rng, -3.0, 8.0);
        let lights: Vec<Light> = (0..30)
            .map(|i| {
                let at = if i % 7 == 0 { middle } else { middle + rng.position(size) };
                let (u, v) = (any_place(&mut rng, -9.0, 1.0) * size, any_place(&mut rng, -9.0, 1.0) * size);
                let emission = Vec3::new(rng.unit(), rng.unit(), rng.unit()) * any_size(&mut rng, -20.0, 14.9).abs();
                let outer = any_size(&mut rng, -6.0, 0.49).abs();
                let light = match rng.bits() % 6 {
                    0 => Light::point(at, emission),
                    1 => Light::spot(at, rng.direction(), outer * rng.unit(), outer, emission),
                    2 => Light::rectangle(at, u, v, emission),
                    3 => Light::triangle([at, at + u, at + v], emission),
                    4 => Light::triangle([at, at + u, at + v], emission).two_sided(),
                    _ => Light::sphere(at, u.length(), emission),
                };
                if rng.bits().is_multiple_of(3) { light.with_range(any_size(&mut rng, -9.0, 9.0).abs()) } else { light }
            })
            .collect();
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(lights.clone()).expect("allowed lights"));
        world.tree(tree).expect("just added").check().expect("a sound tree");
        let mut targets = Vec::new();
        for _ in 0..3 {
            let turn = |rng: &mut Rng| Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
            let even = any_size(&mut rng, -8.0, 8.0);
            let uneven =
                Vec3::new(any_size(&mut rng, -1.0, 1.0), any_size(&mut rng, -1.0, 1.0), any_size(&mut rng, -1.0, 1.0));
            let linear = match rng.bits() % 4 {
                0 => Mat3::IDENTITY,
                1 => turn(&mut rng),
                2 => turn(&mut rng) * even,
                _ => turn(&mut rng) * Mat3::from_diagonal(uneven) * turn(&mut rng),
            };
            let translation = if rng.bits().is_multiple_of(3) {
                // Moves the lights near the origin.
                -(linear.as_dmat3() * middle.as_dvec3())
            } else {
                any_place(&mut rng, -3.0, 8.9).as_dvec3()
            };
            // A large scale may move the translation out of the world, which is refused.
            if world.add_instance(tree, Placement { linear, translation }, Policy::Static).is_ok() {
                targets.push((linear, translation.as_vec3()));
            }
        }
        let mut all = Vec::new();
        for (linear, translation) in targets {
            for _ in 0..8 {
                let light = &lights[(rng.bits() % 30) as usize];
                let away = rng.direction() * any_size(&mut rng, -6.0, 3.0) * size;
                let position = linear * (light.aabb().center() + away) + translation;
                let toward = (linear * away).normalize_or(Vec3::X);
                // Half of them have the light on the horizon.
                let side = toward.cross(rng.direction()).normalize_or(Vec3::Y);
                all.push(ShadingPoint::surface(position, if rng.bits().is_multiple_of(2) { side } else { -toward }));
            }
        }
        contributions += prove(&world, &all, round);
    }
    assert!(contributions as u64 > 160 * rounds(600), "{contributions}");
}
