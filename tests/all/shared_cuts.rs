//! Cuts that neighbours share change which lights are chosen, and leave probabilities exact.

use girandole::glam::{DVec3, Vec3};
use girandole::{
    CutOptions, CutReport, CutTable, DirectionalLight, FrameBudget, Gloss, Incident, Light, LightSampler, LightTree,
    LightWorld, Placement, Policy, ShadingPoint, VisibilityTable,
};
use rayon::prelude::*;

use testbed::measuring::sigma::Noise;
use testbed::testing::support::{Rng, all_pmfs, rounds};

/// As in `sampling.rs`: rounding of products of two dozen ratios.
const SUM_TOLERANCE: f64 = 1.0e-4;

/// Two rounded products of as many ratios, one downward and one upward.
const PMF_TOLERANCE: f32 = 1.0e-4;

/// Few large cells, so that many points share one, each built for any single mark.
fn table() -> CutTable {
    CutTable::new(CutOptions::new(4.0, 4096).expect("valid").with_min_marks(1))
}

fn points(rng: &mut Rng, count: usize, size: f32) -> Vec<ShadingPoint> {
    (0..count).map(|_| rng.shading_point(size)).collect()
}

/// Points of the same cells, which the cuts do not know: at other places and with other normals.
fn others(at: &[ShadingPoint], rng: &mut Rng) -> Vec<ShadingPoint> {
    let other = |at: &ShadingPoint| {
        let mut other = *at;
        other.position += rng.position(2.0);
        if at.normal != Vec3::ZERO {
            other.normal = (at.normal + rng.position(0.2)).normalize();
        }
        other
    };
    at.iter().map(other).collect()
}

fn build(table: &mut CutTable, world: &LightWorld, at: &[ShadingPoint]) {
    let sampler = world.sampler().with_cuts(table);
    at.iter().for_each(|at| sampler.mark(at));
    table.build(world.sampler());
}

/// Checks the probabilities of all lights at some points, and returns the share of those that a table
/// changed.
fn assert_exact(world: &LightWorld, table: &CutTable, at: &[ShadingPoint], rng: &mut Rng) -> f64 {
    let (without, with) = (world.sampler(), world.sampler().with_cuts(table));
    let (mut changed, mut total) = (0, 0);
    for at in at {
        let pmfs = all_pmfs(&with, at);
        let sum: f64 = pmfs.iter().map(|(_, p)| f64::from(*p)).sum();
        assert!(sum <= 1.0 + SUM_TOLERANCE, "{sum}");
        let mut all = Vec::new();
        with.distribution(at, &mut all);
        assert_eq!(all.len(), pmfs.len());
        for ((light, pmf), other) in pmfs.iter().zip(&all) {
            assert!((pmf - other).abs() <= PMF_TOLERANCE * pmf, "{pmf} {other}");
            let before = without.pmf(at, *light);
            // Nothing that can be chosen without a table gets lost.
            assert!(*pmf > 0.0 || before == 0.0, "{light:?} at {at:?}: {before}");
            changed += usize::from((pmf - before).abs() > 0.1 * before);
            total += usize::from(before > 0.0);
        }
        for _ in 0..10 {
            let pick = with.pick(at, [rng.unit(), rng.unit()]);
            if let Some(pick) = pick {
                assert!((pick.pmf / with.pmf(at, pick.light) - 1.0).abs() < PMF_TOLERANCE);
            } else {
                assert!(sum < 1.0 - SUM_TOLERANCE, "a draw ends without a light, though all add up to {sum}");
            }
        }
    }
    f64::from(changed as u32) / f64::from(total as u32)
}

#[test]
fn options_out_of_range_are_refused_and_the_limits_are_accepted() {
    for edge in [0.0, -1.0, f32::NAN, f32::INFINITY, 0.01_f32.next_down(), 1.0e4_f32.next_up(), 1.0e5] {
        let error = CutOptions::new(edge, 64).unwrap_err();
        assert!(error.to_string().ends_with("; it must be from 0.01 to 10000"), "{error}");
    }
    for cells in [0, 65_537, 655_360, usize::MAX] {
        let error = CutOptions::new(1.0, cells).unwrap_err();
        assert!(error.to_string().ends_with("; it must be from 1 to 65536"), "{error}");
    }
    assert!([0.01, 1.0e4].into_iter().all(|edge| CutOptions::new(edge, 1).is_ok()));
    assert!(CutOptions::new(1.0, 65_536).is_ok());
}

#[test]
fn without_cells_and_after_a_change_the_bits_are_those_without_a_table() {
    let mut rng = Rng(170);
    let mut world = rng.world(4, 40, 5, 20.0);
    let at = points(&mut rng, 200, 20.0);
    let mut cuts = table();
    let assert_alike = |world: &LightWorld, cuts: &CutTable, rng: &mut Rng| {
        let (without, with) = (world.sampler(), world.sampler().with_cuts(cuts));
        for at in &at {
            let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
            assert_eq!(with.sample(at, u), without.sample(at, u));
        }
    };
    assert_alike(&world, &cuts, &mut rng);
    build(&mut cuts, &world, &at);
    let with = world.sampler().with_cuts(&cuts);
    let differs = |at: &&ShadingPoint| with.pick(at, [0.3, 0.6]) != world.sampler().pick(at, [0.3, 0.6]);
    assert!(at.iter().filter(differs).count() > 100, "the table matters");
    // Another world with the same content has other trees.
    assert_alike(&Rng(170).world(4, 40, 5, 20.0), &cuts, &mut rng);
    let instance = world.instances().next().expect("an instance");
    world.move_instance(instance, Placement::at(DVec3::ONE)).expect("valid");
    assert_alike(&world, &cuts, &mut rng);
    build(&mut cuts, &world, &[]);
    assert_alike(&world, &cuts, &mut rng);
}

#[test]
fn probabilities_are_exact_at_points_that_a_cut_does_not_know() {
    let mut rng = Rng(171);
    let mut changed = 0.0;
    for round in 0..6 {
        let mut world = rng.world(4, 30, 5, 20.0);
        if round % 2 == 1 {
            let sun = DirectionalLight { direction: Vec3::new(0.6, -0.8, 0.0), illuminance: Vec3::splat(0.4) };
            world.add_directional(sun).expect("valid");
        }
        let at = points(&mut rng, 60, 20.0);
        let mut cuts = table();
        build(&mut cuts, &world, &at);
        let report = cuts.report();
        assert!(report.marked > 20 && report.built == report.marked && report.refused == 0, "{report:?}");
        changed += assert_exact(&world, &cuts, &others(&at, &mut rng), &mut rng);
    }
    // Most of the points lie in cells that were not marked.
    assert!(changed > 0.6, "the table matters: {changed}");
}

#[test]
fn moving_worlds_keep_their_probabilities_with_marks_of_the_frame_before() {
    let mut rng = Rng(172);
    let mut world = rng.world(4, 30, 5, 20.0);
    let at = points(&mut rng, 40, 20.0);
    let mut cuts = table();
    build(&mut cuts, &world, &at);
    for frame in 0..8 {
        let sampler = world.sampler().with_cuts(&cuts);
        at.iter().for_each(|at| sampler.mark(at));
        let instances: Vec<_> = world.instances().collect();
        for instance in &instances {
            let place = Placement::at(rng.position(20.0).as_dvec3());
            world.move_instance(*instance, place).expect("valid");
        }
        if frame % 3 == 2 {
            let tree = world.trees().next().expect("a tree");
            world.rebuild_tree(tree).expect("a tree");
            world.set_origin_near(DVec3::new(f64::from(frame), 3.0, -1100.0)).expect("valid");
        }
        world.update(FrameBudget::UNLIMITED);
        cuts.build(world.sampler());
        assert!(cuts.report().built > 10);
        let shift = world.origin().as_vec3();
        let mut moved = at.clone();
        moved.iter_mut().for_each(|at| at.position -= shift);
        let sampler = world.sampler().with_cuts(&cuts);
        let differs = |at: &&ShadingPoint| sampler.pick(at, [0.3, 0.6]) != world.sampler().pick(at, [0.3, 0.6]);
        // Marks lie where they were in the world, whatever the origin is now.
        assert!(frame % 3 == 2 || at.iter().filter(differs).count() > 10);
        assert_exact(&world, &cuts, &others(&moved, &mut rng)[..10], &mut rng);
        if frame % 3 == 2 {
            assert!(moved.iter().filter(differs).count() > 10);
            world.set_origin_near(DVec3::Z).expect("valid");
        }
    }
}

/// One change of a world, of any kind.
fn edit(world: &mut LightWorld, rng: &mut Rng) {
    let (instances, trees): (Vec<_>, Vec<_>) = (world.instances().collect(), world.trees().collect());
    let instance = instances[rng.bits() as usize % instances.len()];
    let tree = trees[rng.bits() as usize % trees.len()];
    let count = world.tree(tree).expect("it lives").lights().len() as u32;
    let light = rng.bits() as u32 % count;
    match rng.bits() % 13 {
        0 | 1 => {
            let mut placement = world.instance(instance).expect("it lives").placement;
            placement.translation += rng.position(0.5).as_dvec3();
            world.move_instance(instance, placement).expect("valid");
        }
        2 => drop(world.add_instance(tree, rng.affine(20.0), Policy::Budgeted).expect("valid")),
        3 if instances.len() > 8 => world.remove_instance(instance).expect("it lives"),
        4 => world
            .set_appearance(instance, |a| a.factor = Vec3::splat([0.0, 1.0, 100.0][rng.bits() as usize % 3]))
            .expect("valid"),
        5 => world
            .set_appearance(instance, |a| a.mask = [u32::MAX, 0b01, 0b10][rng.bits() as usize % 3])
            .expect("it lives"),
        6 => world.set_appearance(instance, |a| a.is_enabled = rng.bits().is_multiple_of(2)).expect("it lives"),
        7 => {
            let mut new = rng.light(2.0);
            new.emission *= [0.0, 1.0, 1000.0][rng.bits() as usize % 3];
            // A light that was removed is refused.
            let _ = world.set_lights(tree, &[(light, new)]);
        }
        8 => drop(world.add_lights(tree, &rng.lights(3, 2.0)).expect("valid")),
        9 => drop(world.remove_lights(tree, &[light])),
        10 => drop(world.rebuild_tree(tree).expect("it lives")),
        11 => {
            let by = LightTree::new(rng.lights(30, 2.0)).expect("valid");
            world.replace_tree(tree, by).expect("it lives");
        }
        _ if world.directionals().len() > 0 => {
            let suns: Vec<_> = world.directionals().collect();
            suns.into_iter().for_each(|sun| world.remove_directional(sun).expect("it lives"));
        }
        _ => {
            let sun = DirectionalLight { direction: rng.direction(), illuminance: Vec3::ONE };
            world.add_directional(sun).expect("valid");
        }
    }
}

#[test]
fn cuts_that_are_kept_stay_exact_whatever_is_edited() {
    let mut kept = 0;
    for seed in 0..rounds(16) {
        let mut rng = Rng(190 + seed);
        let mut world = rng.varied_world(4, 30, 5, 20.0);
        let at: Vec<_> = (0..30).map(|_| rng.masked_point(20.0)).collect();
        let mut cuts = table();
        for frame in 0..60 {
            (0..1 + frame % 3).for_each(|_| edit(&mut world, &mut rng));
            world.update(if frame % 2 == 0 { FrameBudget::UNLIMITED } else { FrameBudget::NONE });
            build(&mut cuts, &world, &at);
            assert_exact(&world, &cuts, &others(&at, &mut rng)[..4], &mut rng);
            kept += cuts.report().kept;
        }
    }
    assert!(kept > 1000, "{kept}");
}

/// The mean exact noise of a sampler at some points.
fn mean_sigma(sampler: &LightSampler<'_>, at: &[ShadingPoint]) -> f64 {
    let ids: Vec<_> = sampler.all_lights().collect();
    let sigma = |at: &ShadingPoint| {
        let mut pmfs = Vec::new();
        sampler.distribution(at, &mut pmfs);
        let lux = |incident: Incident| incident.radiance.y * incident.direction.dot(at.normal) / incident.pdf;
        let contributions: Vec<f32> =
            ids.iter().map(|id| sampler.sample_light(at, *id, [0.5; 2]).map_or(0.0, lux)).collect();
        Noise::of(&contributions, &pmfs).expect("lamps shine there").sigma
    };
    at.par_iter().map(sigma).sum::<f64>() / at.len() as f64
}

#[test]
fn a_coarser_cell_stands_in_where_a_cell_was_not_marked() {
    let mut rng = Rng(182);
    let world = rng.world(40, 30, 5, 20.0);
    let mut floor = |edge: f32, count: usize| -> Vec<ShadingPoint> {
        let at = |rng: &mut Rng| rng.position(edge) * Vec3::new(1.0, 0.0, 1.0);
        (0..count).map(|_| ShadingPoint::surface(at(&mut rng), Vec3::Y)).collect()
    };
    // Cells have edges of 6 cm, and their stand-ins of 25 cm.
    let around: Vec<_> = floor(2.0, 100_000).into_iter().filter(|at| at.position.length() > 0.1).collect();
    let hole = floor(0.02, 50);
    let mut cuts = CutTable::default();
    cuts.set_view(3.0 * DVec3::Y, 0.00107);
    build(&mut cuts, &world, &around);
    let (with, own) = (world.sampler().with_cuts(&cuts), world.sampler());
    let share = mean_sigma(&with, &hole) / mean_sigma(&own, &hole);
    assert!(share < 0.8, "{share}");
    assert_exact(&world, &cuts, &hole, &mut rng);
    // Beyond all marked cells, points split for themselves.
    let far = ShadingPoint::surface(5.0 * Vec3::X, Vec3::Y);
    assert_eq!(with.pick(&far, [0.3, 0.7]), own.pick(&far, [0.3, 0.7]));
}

#[test]
fn masked_lights_are_chosen_only_where_they_are_seen() {
    let mut rng = Rng(173);
    let mut world = rng.world(4, 20, 6, 20.0);
    let instances: Vec<_> = world.instances().collect();
    for (index, instance) in instances.iter().enumerate() {
        world.set_appearance(*instance, |a| a.mask = 1 << (index % 3)).expect("an instance");
    }
    let at: Vec<_> = points(&mut rng, 60, 20.0).into_iter().map(|at| at.with_mask(1 + rng.bits() as u32 % 7)).collect();
    let mut cuts = table();
    build(&mut cuts, &world, &at);
    assert_exact(&world, &cuts, &others(&at, &mut rng), &mut rng);
}

#[test]
fn glossy_points_share_cuts_with_what_the_camera_sees() {
    let mut rng = Rng(174);
    let world = rng.world(4, 30, 5, 20.0);
    let eye = Vec3::new(3.0, 8.0, -2.0);
    let glossy =
        |at: ShadingPoint, view: Vec3| at.with_gloss(Gloss { view, roughness: 0.3, specular: 0.5, diffuse: 0.2 });
    let at: Vec<_> = points(&mut rng, 60, 20.0).into_iter().filter(|at| at.normal != Vec3::ZERO).collect();
    let seen: Vec<_> = at.iter().map(|at| glossy(*at, eye - at.position)).collect();
    let reflected: Vec<_> = at.iter().map(|at| glossy(*at, at.position - eye)).collect();
    let mut cuts = table();
    build(&mut cuts, &world, &seen);
    assert_eq!(cuts.report().marked, 0, "without a view there is no camera");
    cuts.set_view(eye.as_dvec3(), 0.02);
    build(&mut cuts, &world, &reflected);
    assert_eq!(cuts.report().marked, 0, "these are not seen from the camera");
    build(&mut cuts, &world, &seen);
    assert!(cuts.report().built > 20);
    assert!(assert_exact(&world, &cuts, &seen, &mut rng) > 0.3);
    cuts.set_view(DVec3::NAN, 0.02);
    build(&mut cuts, &world, &seen);
    assert_eq!(cuts.report().marked, 0);
}

#[test]
fn the_order_and_the_threads_of_marks_have_no_effect() {
    let mut rng = Rng(175);
    let world = rng.world(4, 30, 5, 20.0);
    let at = points(&mut rng, 3000, 20.0);
    // Room for all cells, and for a few.
    for cells in [4096, 16] {
        assert_order_has_no_effect(&world, &at, CutOptions::new(4.0, cells).expect("valid").with_min_marks(1));
    }
}

fn assert_order_has_no_effect(world: &LightWorld, at: &[ShadingPoint], options: CutOptions) {
    let pmfs = |mark: &dyn Fn(&LightSampler<'_>)| {
        let mut cuts = CutTable::new(options);
        mark(&world.sampler().with_cuts(&cuts));
        cuts.build(world.sampler());
        let sampler = world.sampler().with_cuts(&cuts);
        at.iter().step_by(10).map(|at| sampler.pick(at, [0.3, 0.7])).collect::<Vec<_>>()
    };
    let first = pmfs(&|sampler| at.iter().for_each(|at| sampler.mark(at)));
    assert_eq!(first, pmfs(&|sampler| at.iter().rev().for_each(|at| sampler.mark(at))));
    assert_eq!(first, pmfs(&|sampler| at.par_iter().for_each(|at| sampler.mark(at))));
}

#[test]
fn cells_keep_their_cuts_while_neither_the_world_nor_the_view_changes() {
    let mut rng = Rng(178);
    let mut world = rng.world(4, 30, 5, 20.0);
    let gloss = |view| Gloss { view, roughness: 0.3, specular: 0.5, diffuse: 0.2 };
    let matte = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let mut cuts = table();
    let mut built_and_kept = |world: &LightWorld, eye: Vec3, at: &[ShadingPoint]| {
        cuts.set_view(eye.as_dvec3(), 0.02);
        build(&mut cuts, world, at);
        [cuts.report().built, cuts.report().kept]
    };
    let eyes = [Vec3::new(0.0, 3.0, 3.0), Vec3::new(0.0, 3.0, 3.1), Vec3::new(0.0, 3.0, 3.6)];
    let both = eyes.map(|eye| [matte, matte.with_gloss(gloss(eye))]);
    assert_eq!(built_and_kept(&world, eyes[0], &both[0]), [2, 0]);
    assert_eq!(built_and_kept(&world, eyes[0], &both[0]), [0, 2]);
    // The direction to the eye turns by one degree. Each cell has its turn.
    let turns: usize = (1..=12).map(|i| built_and_kept(&world, eyes[i % 2], &both[i % 2])[0]).sum();
    assert_eq!(turns, 2);
    let [built, kept] = built_and_kept(&world, eyes[2], &both[2]);
    assert!(built >= 1 && built + kept == 2, "the glossy cell sees another reflection");
    for _ in 0..13 {
        built_and_kept(&world, eyes[1], &both[1]);
    }
    assert_eq!(built_and_kept(&world, eyes[1], &both[1]), [0, 2], "nothing has changed for twelve builds");
    let more: Vec<_> = (0..20).map(|i| ShadingPoint::surface(Vec3::X * 0.01 * i as f32, Vec3::Y)).collect();
    assert_eq!(built_and_kept(&world, eyes[1], &more), [2, 0], "more points are known, and the coarse cell is marked");
    assert_eq!(built_and_kept(&world, eyes[1], &both[1]), [1, 1], "the glossy cell was not marked");
    let instance = world.instances().next().expect("an instance");
    world.move_instance(instance, Placement::at(DVec3::ONE)).expect("valid");
    assert_eq!(built_and_kept(&world, eyes[1], &both[1]), [2, 0]);
}

#[test]
fn a_cleared_table_has_no_cuts_and_no_marks() {
    let mut rng = Rng(179);
    let world = rng.world(4, 30, 5, 20.0);
    let at = points(&mut rng, 4000, 100.0);
    let mut cuts = table();
    assert!(cuts.memory_bytes() < 4096, "{}", cuts.memory_bytes());
    build(&mut cuts, &world, &at);
    let (built, memory) = (cuts.report(), cuts.memory_bytes());
    let of_cell = memory as f64 / built.built as f64;
    assert!(built.built > 3500 && (1600.0..1850.0).contains(&of_cell), "{of_cell}");
    at.iter().for_each(|at| world.sampler().with_cuts(&cuts).mark(at));
    cuts.clear();
    assert_eq!(cuts.report(), CutReport::default());
    assert!(cuts.memory_bytes() < memory / 10, "{}", cuts.memory_bytes());
    let pick = |sampler: LightSampler<'_>| at.iter().map(|at| sampler.pick(at, [0.3, 0.6])).collect::<Vec<_>>();
    assert_eq!(pick(world.sampler().with_cuts(&cuts)), pick(world.sampler()));
    build(&mut cuts, &world, &[]);
    assert_eq!(cuts.report(), CutReport::default(), "the marks are forgotten");
    build(&mut cuts, &world, &at);
    assert_eq!((cuts.report(), cuts.memory_bytes()), (built, memory), "nothing is kept");
}

#[test]
fn a_table_keeps_the_cells_with_the_most_marks_at_its_cap_and_past_it() {
    let world = Rng(176).world(2, 10, 2, 5.0);
    let at = |cell: usize| ShadingPoint::surface(Vec3::X * (cell as f32 + 0.5), Vec3::Y);
    for count in [16, 17, 160] {
        let mut cuts = CutTable::new(CutOptions::new(1.0, 16).expect("valid").with_min_marks(2));
        let sampler = world.sampler().with_cuts(&cuts);
        for cell in 0..count {
            (0..2 + usize::from(cell % 10 == 0)).for_each(|_| sampler.mark(&at(cell)));
        }
        sampler.mark(&at(1000));
        cuts.build(world.sampler());
        let report = cuts.report();
        assert_eq!((report.built, report.refused), (16, report.marked - report.rare - 16), "{count}: {report:?}");
        let sampler = world.sampler().with_cuts(&cuts);
        let has_cut =
            |cell: &usize| sampler.pick(&at(*cell), [0.4, 0.2]) != world.sampler().pick(&at(*cell), [0.4, 0.2]);
        assert_eq!((report.marked, report.rare, report.lost_marks), (count + 1, 1, 0), "{count}: {report:?}");
        assert!((0..count).step_by(10).all(|cell| has_cut(&cell)), "those with three marks come first");
    }
}

#[test]
fn means_equal_the_sum_over_all_lights() {
    let mut rng = Rng(177);
    let world = rng.world(3, 10, 4, 8.0);
    let at: Vec<_> = points(&mut rng, 12, 8.0);
    let mut cuts = table();
    build(&mut cuts, &world, &at);
    let sampler = world.sampler().with_cuts(&cuts);
    for at in others(&at, &mut rng) {
        let lux = |light, u| {
            let incident = sampler.sample_light(&at, light, u)?;
            let cosine = if at.normal == Vec3::ZERO { 1.0 } else { incident.direction.dot(at.normal) };
            Some(f64::from(incident.radiance.element_sum() * cosine / incident.pdf))
        };
        // A light counts with the same point both times, so the sum is exact.
        let exact: f64 = sampler.all_lights().filter_map(|light| lux(light, [0.4, 0.6])).sum();
        for candidates in [1, 4] {
            let (count, mut sum, mut squares) = (20_000, 0.0, 0.0);
            for _ in 0..count {
                let value = match candidates {
                    1 => sampler
                        .pick(&at, [rng.unit(), rng.unit()])
                        .map_or(0.0, |pick| lux(pick.light, [0.4, 0.6]).map_or(0.0, |lux| lux / f64::from(pick.pmf))),
                    _ => {
                        let u = [(); 5].map(|()| rng.unit());
                        let kept = sampler.resample(&at, u, candidates);
                        let lux = kept.light.and_then(|light| lux(light, [0.4, 0.6]));
                        lux.map_or(0.0, |lux| lux * f64::from(kept.weight))
                    }
                };
                sum += value;
                squares += value * value;
            }
            let mean = sum / f64::from(count);
            let error = ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
            // Twenty-four checks of five standard errors: a false alarm in 70,000 runs.
            assert!((mean - exact).abs() <= 5.0 * error + 1.0e-4 * exact, "{candidates}: {mean} {exact} {error}");
        }
    }
}

#[test]
fn cells_know_what_shadow_rays_have_taught_and_are_built_again_while_they_are_young_and_in_turn() {
    let mut world = LightWorld::new();
    let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid"));
    for x in [-3.0, 3.0] {
        world.add_instance(lamp, Placement::at(DVec3::new(x, 2.0, 0.0)), Policy::Static).expect("valid");
    }
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    // A cell so small that its middle is as far from both lamps as the point.
    let options = CutOptions::new(0.01, 64).expect("valid").with_min_marks(1);
    let (mut cuts, mut learnt) = (CutTable::new(options), VisibilityTable::default());
    let build = |cuts: &mut CutTable, learnt: &VisibilityTable| {
        world.sampler().with_cuts(cuts).mark(&at);
        cuts.build(world.sampler().with_visibility(learnt));
        [cuts.report().built, cuts.report().kept]
    };
    let hidden = world.sampler().all_lights().nth(1).expect("two lamps");
    // The hidden lamp is looked at ever less, so it takes hundreds of samples until its share is the least.
    let mut built = Vec::new();
    for frame in 0..600 {
        let [is_built, is_kept] = build(&mut cuts, &learnt);
        assert_eq!(is_built + is_kept, 1, "{frame}");
        built.extend((is_built == 1).then_some(frame));
        let sampler = world.sampler().with_cuts(&cuts).with_visibility(&learnt);
        let sample = sampler.sample(&at, [(frame as f32 * 0.618) % 1.0, 0.5, 0.5, 0.5]).expect("a lamp");
        sampler.record_visibility(&at, &sample, sample.light != hidden);
        learnt.end_frame();
    }
    // The first record asks for a row of the table and teaches nothing.
    let turns: Vec<i32> = built.iter().copied().filter(|frame| *frame > 4).collect();
    assert!(built.starts_with(&[0, 2, 4]) && (49..=50).contains(&turns.len()), "{built:?}");
    assert!(turns.windows(2).all(|pair| pair[1] - pair[0] == 12), "{built:?}");
    let pmf = |cuts: &CutTable| world.sampler().with_cuts(cuts).pmf(&at, hidden);
    let again: usize = (0..12).map(|_| build(&mut cuts, &learnt)[0]).sum();
    assert_eq!(again, 1);
    // The least share is 6/256. Of the samples 1 % is spread evenly, and 1 % by the middle of the cell, where nothing
    // is learnt.
    let expected = 0.98 * 6.0 / (6.0 + 256.0) + 0.02 * 0.5;
    assert!((pmf(&cuts) - expected).abs() < 1.0e-3, "{} {expected}", pmf(&cuts));
    learnt.end_frame();
    build(&mut cuts, &learnt);
    assert_eq!(build(&mut cuts, &learnt), [0, 1], "nothing is learnt any more");
    let again: usize = (0..12).map(|_| build(&mut cuts, &VisibilityTable::default())[0]).sum();
    assert!(again == 1 && (pmf(&cuts) - 0.5).abs() < 1.0e-3);
}

#[test]
fn probabilities_are_exact_whatever_was_learnt() {
    let mut rng = Rng(177);
    let world = rng.world(4, 40, 5, 20.0);
    let at = points(&mut rng, 60, 20.0);
    let mut learnt = VisibilityTable::default();
    for _ in 0..20 {
        let sampler = world.sampler().with_visibility(&learnt);
        for at in &at {
            if let Some(sample) = sampler.sample(at, [rng.unit(), rng.unit(), 0.5, 0.5]) {
                sampler.record_visibility(at, &sample, rng.unit() < 0.3);
            }
        }
        learnt.end_frame();
    }
    let mut cuts = table();
    build(&mut cuts, &world, &at);
    let plain: Vec<_> = at.iter().map(|at| all_pmfs(&world.sampler().with_cuts(&cuts), at)).collect();
    at.iter().for_each(|at| world.sampler().with_cuts(&cuts).mark(at));
    cuts.build(world.sampler().with_visibility(&learnt));
    let differs = |(at, plain): &(&ShadingPoint, &Vec<_>)| all_pmfs(&world.sampler().with_cuts(&cuts), at) != **plain;
    assert!(at.iter().zip(&plain).filter(differs).count() > 30, "what is learnt matters");
    assert_exact(&world, &cuts, &others(&at, &mut rng), &mut rng);
}

#[test]
fn empty_worlds_and_dark_cells_have_no_cuts_and_no_samples() {
    let mut world = LightWorld::new();
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let mut cuts = table();
    build(&mut cuts, &world, &[at]);
    assert_eq!(world.sampler().with_cuts(&cuts).pick(&at, [0.5, 0.5]), None);
    world.add_directional(DirectionalLight { direction: Vec3::NEG_Y, illuminance: Vec3::ONE }).expect("valid");
    build(&mut cuts, &world, &[at]);
    let pick = world.sampler().with_cuts(&cuts).pick(&at, [0.5, 0.5]).expect("the sun");
    assert_eq!(pick.pmf, 1.0);
    for position in [f32::NAN, f32::INFINITY, 3.0e38, -1.0e12] {
        let at = ShadingPoint::surface(Vec3::splat(position), Vec3::new(0.0, f32::NAN, 1.0));
        build(&mut cuts, &world, &[at]);
        world.sampler().with_cuts(&cuts).pick(&at, [0.5, 0.5]);
    }
}
