//! Learnt visibility changes which lights are chosen, and leaves probabilities exact.

use std::collections::HashMap;

use girandole::glam::{DVec3, Vec3};
use girandole::{
    Light, LightId, LightSample, LightSampler, LightTree, LightWorld, Placement, Policy, ShadingPoint,
    VisibilityOptions, VisibilityTable,
};
use rayon::prelude::*;

use testbed::testing::support::{Rng, SPLITS, all_pmfs};

/// As in `sampling.rs`: rounding of products of two dozen ratios.
const SUM_TOLERANCE: f64 = 1.0e-4;

/// Two rounded products of as many ratios, one downward and one upward.
const PMF_TOLERANCE: f32 = 1.0e-4;

/// The least share that a table knows: 6/256. A cut weighs two groups by it at worst, so a
/// probability falls to this part of itself at most.
const MIN_SHARE: f32 = 6.0 / 256.0;

/// What hides lights from shading points in these tests: a half of all directions, which differs
/// from cube to cube.
pub(crate) fn is_visible(position: Vec3, direction: Vec3) -> bool {
    let cube = (position / 4.0).floor();
    direction.dot(Vec3::new(cube.x.sin(), (cube.y * 2.0).cos(), cube.z.cos())) > 0.0
}

/// Takes samples at shading points and records what is visible, for some frames.
fn teach(world: &LightWorld, table: &mut VisibilityTable, points: &[ShadingPoint], frames: u32, rng: &mut Rng) {
    for _ in 0..frames {
        let sampler = world.sampler().with_visibility(table);
        for at in points {
            if let Some(sample) = sampler.sample(at, [rng.unit(), rng.unit(), rng.unit(), rng.unit()]) {
                sampler.record_visibility(at, &sample, is_visible(at.position, sample.incident.direction));
            }
        }
        table.end_frame();
    }
}

/// Picks lights at shading points and records the same for all of them, for some frames: whether
/// they are visible, and how often.
fn teach_alike(
    world: &LightWorld,
    table: &mut VisibilityTable,
    points: &[ShadingPoint],
    frames: u32,
    (is_visible, records): (bool, u32),
    rng: &mut Rng,
) {
    for _ in 0..frames {
        let sampler = world.sampler().with_visibility(table);
        for at in points {
            if let Some(sample) = sampler.sample(at, [rng.unit(), rng.unit(), 0.5, 0.5]) {
                (0..records).for_each(|_| sampler.record_visibility(at, &sample, is_visible));
            }
        }
        table.end_frame();
    }
}

/// A table with few large cells, so that many samples share one.
fn table() -> VisibilityTable {
    VisibilityTable::new(VisibilityOptions::new(8.0, 4096).expect("valid"))
}

fn points(rng: &mut Rng, count: usize, size: f32) -> Vec<ShadingPoint> {
    (0..count).map(|_| rng.shading_point(size)).collect()
}

/// A world, a table that has learnt in it, and shading points that it knows.
fn learnt(rng: &mut Rng, size: f32) -> (LightWorld, VisibilityTable, Vec<ShadingPoint>) {
    let world = rng.world(4, 30, 5, size);
    let at = points(rng, 300, size);
    let mut table = table();
    teach(&world, &mut table, &at, 30, rng);
    (world, table, at)
}

#[test]
fn an_empty_table_gives_the_same_bits_as_none() {
    let mut rng = Rng(70);
    let world = rng.world(4, 40, 5, 20.0);
    let empty = VisibilityTable::default();
    for round in 0..500 {
        let at = rng.shading_point(30.0);
        let without = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
        let with = without.with_visibility(&empty);
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        assert_eq!(with.sample(&at, u), without.sample(&at, u));
        let light = without.all_lights().nth(round).expect("a light");
        assert_eq!(with.pmf(&at, light).to_bits(), without.pmf(&at, light).to_bits());
    }
}

#[test]
fn where_everything_is_visible_the_bits_stay_the_same() {
    let mut rng = Rng(77);
    let world = rng.world(4, 30, 5, 20.0);
    let at = points(&mut rng, 100, 20.0);
    let mut table = table();
    teach_alike(&world, &mut table, &at, 10, (true, 1), &mut rng);
    assert!(table.cell_count() > 50, "{table:?}");
    let sampler = world.sampler().with_visibility(&table);
    for at in &at {
        let u = [rng.unit(), rng.unit()];
        assert_eq!(sampler.pick(at, u), world.sampler().pick(at, u));
    }
}

#[test]
fn probabilities_are_exact_sum_to_one_at_most_and_keep_a_part_of_themselves() {
    let mut rng = Rng(71);
    let (mut changed, mut total) = (0, 0);
    for _ in 0..3 {
        let (world, table, at) = learnt(&mut rng, 20.0);
        for (round, at) in at.iter().take(60).enumerate() {
            let without = world.sampler().with_splits(SPLITS[round % SPLITS.len()]);
            let with = without.with_visibility(&table);
            let pmfs = all_pmfs(&with, at);
            let sum: f64 = pmfs.iter().map(|(_, p)| f64::from(*p)).sum();
            assert!(sum <= 1.0 + SUM_TOLERANCE, "{sum}");
            let mut all = Vec::new();
            with.distribution(at, &mut all);
            for ((light, pmf), other) in pmfs.iter().zip(&all) {
                assert!((pmf - other).abs() <= PMF_TOLERANCE * pmf, "{pmf} {other}");
                let before = without.pmf(at, *light);
                // Nothing that can be chosen without a table gets lost. Splits go elsewhere, so
                // single lights may lose more than the share of their group.
                assert_eq!(*pmf > 0.0, before > 0.0, "{light:?} at {at:?}");
                if round % SPLITS.len() == 0 {
                    assert!(*pmf >= before * MIN_SHARE * (1.0 - PMF_TOLERANCE), "{pmf} {before}");
                }
                changed += usize::from((pmf - before).abs() > 0.1 * before);
                total += usize::from(before > 0.0);
            }
            for _ in 0..10 {
                if let Some(pick) = with.pick(at, [rng.unit(), rng.unit()]) {
                    assert!((pick.pmf / with.pmf(at, pick.light) - 1.0).abs() < PMF_TOLERANCE);
                }
            }
        }
    }
    assert!(changed * 4 > total, "the table matters: {changed} of {total} probabilities changed");
}

#[test]
fn every_light_that_contributes_has_a_probability_whatever_was_learnt() {
    let mut rng = Rng(72);
    let world = rng.world(4, 30, 5, 15.0);
    let at = points(&mut rng, 100, 15.0);
    let mut table = table();
    // What is recorded is wrong: everything counts as hidden, often.
    teach_alike(&world, &mut table, &at, 40, (false, 20), &mut rng);
    let sampler = world.sampler().with_visibility(&table);
    let mut contributions = 0;
    for at in &at {
        for (light, pmf) in all_pmfs(&sampler, at) {
            if sampler.sample_light(at, light, [rng.unit(), rng.unit()]).is_some() {
                assert!(pmf > 0.0, "{light:?} at {at:?}");
                contributions += 1;
            }
        }
    }
    assert!(contributions > 10_000, "{contributions}");
}

#[test]
fn frequencies_agree_with_the_probabilities() {
    let mut rng = Rng(73);
    let (world, table, at) = learnt(&mut rng, 10.0);
    for (round, at) in at.iter().take(10).enumerate() {
        let sampler = world.sampler().with_splits(SPLITS[round % SPLITS.len()]).with_visibility(&table);
        let draws = 100_000;
        let mut counts: HashMap<Option<LightId>, u32> = HashMap::new();
        for _ in 0..draws {
            *counts.entry(sampler.pick(at, [rng.unit(), rng.unit()]).map(|p| p.light)).or_default() += 1;
        }
        let (mut chi_sq, mut cells) = (0.0, 0.0);
        for (light, pmf) in all_pmfs(&sampler, at) {
            let expected = f64::from(pmf) * f64::from(draws);
            if expected >= 5.0 {
                let observed = f64::from(counts.get(&Some(light)).copied().unwrap_or(0));
                chi_sq += (observed - expected).powi(2) / expected;
                cells += 1.0;
            }
        }
        // Chi squared with at most `cells` degrees of freedom exceeds this with a probability below
        // 1e-6, so the ten rounds raise a false alarm in one of 100,000 seeds.
        assert!(chi_sq < cells + 5.0 * (2.0_f64 * cells).sqrt() + 15.0, "{chi_sq} over {cells}");
    }
}

/// The mean illuminance of many estimates and its standard error.
fn estimate(sampler: &LightSampler, at: &ShadingPoint, candidates: u32, rng: &mut Rng) -> (f64, f64) {
    let count = 10_000;
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..count {
        let u = [rng.unit(), rng.unit(), rng.unit(), rng.unit(), rng.unit()];
        let value = sampler.reservoir_sample(at, &sampler.resample(at, u, candidates)).map_or(0.0, |kept| {
            let incident = kept.incident;
            let lit = is_visible(at.position, incident.direction);
            let cosine = if at.normal == Vec3::ZERO { 1.0 } else { incident.direction.dot(at.normal) };
            if lit { f64::from(incident.radiance.x * cosine / (kept.pmf * incident.pdf)) } else { 0.0 }
        });
        sum += value;
        squares += value * value;
    }
    let n = f64::from(count);
    (sum / n, ((squares / n - (sum / n).powi(2)) / n).sqrt())
}

#[test]
fn estimates_with_a_table_have_the_same_mean_also_for_resampled_lights() {
    let mut rng = Rng(74);
    let (world, table, at) = learnt(&mut rng, 10.0);
    for at in at.iter().take(6) {
        for candidates in [1, 4] {
            let without = estimate(&world.sampler(), at, candidates, &mut rng);
            let with = estimate(&world.sampler().with_visibility(&table), at, candidates, &mut rng);
            // Five standard errors, at twelve comparisons: a false alarm in one of 100,000 seeds.
            let error = (without.1 * without.1 + with.1 * with.1).sqrt();
            assert!((without.0 - with.0).abs() <= 5.0 * error, "{without:?} {with:?}");
        }
    }
}

#[test]
fn what_is_learnt_does_not_depend_on_the_threads() {
    let mut rng = Rng(75);
    let world = rng.world(4, 30, 5, 15.0);
    let at = points(&mut rng, 1000, 15.0);
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let mut table = VisibilityTable::new(VisibilityOptions::new(2.0, 256).expect("valid"));
        for frame in 0..6_u32 {
            let sampler = world.sampler().with_visibility(&table);
            pool.install(|| {
                at.par_iter().enumerate().for_each(|(i, at)| {
                    let mut rng = Rng(1 + i as u64 * 64 + u64::from(frame));
                    if let Some(sample) = sampler.sample(at, [rng.unit(), rng.unit(), rng.unit(), rng.unit()]) {
                        let is_visible = is_visible(at.position, sample.incident.direction);
                        sampler.record_visibility(at, &sample, is_visible);
                    }
                });
            });
            table.end_frame();
        }
        // More cells want rows than there are.
        assert!(table.cell_count() > 250, "{}", table.cell_count());
        let sampler = world.sampler().with_visibility(&table);
        at.iter().step_by(5).flat_map(|at| all_pmfs(&sampler, at)).map(|(_, pmf)| pmf.to_bits()).collect::<Vec<_>>()
    };
    assert!(run(1) == run(4));
}

/// Two lamps, a table, and what it makes of the second one at a point of the world between them.
fn pmf_of_hidden_lamp(at: DVec3, origins: &[DVec3]) -> Vec<f32> {
    let mut world = LightWorld::new();
    let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::ZERO, Vec3::ONE)]).expect("valid"));
    world.set_origin_near(origins[0]).expect("finite");
    for x in [-3.0, 3.0] {
        let placement = Placement::at(at + DVec3::new(x, 2.0, 0.0));
        world.add_instance(lamp, placement, Policy::Static).expect("valid");
    }
    let mut table = VisibilityTable::default();
    let point = |world: &LightWorld| ShadingPoint::surface((at - world.origin()).as_vec3(), Vec3::Y);
    for i in 0..200 {
        let (sampler, point) = (world.sampler().with_visibility(&table), point(&world));
        let sample = sampler.sample(&point, [(i as f32 * 0.618) % 1.0, 0.5, 0.5, 0.5]).expect("a lamp");
        let is_visible = Some(sample.light) == sampler.all_lights().next();
        sampler.record_visibility(&point, &sample, is_visible);
        table.end_frame();
    }
    let pmf = |origin: &DVec3| {
        world.set_origin_near(*origin).expect("finite");
        let sampler = world.sampler().with_visibility(&table);
        sampler.pmf(&point(&world), sampler.all_lights().nth(1).expect("two lamps"))
    };
    origins.iter().map(pmf).collect()
}

#[test]
fn cells_stay_in_place_far_from_zero_and_when_the_origin_moves() {
    let near = pmf_of_hidden_lamp(DVec3::new(0.3, 0.3, 0.3), &[DVec3::ZERO])[0];
    assert!((0.02..0.04).contains(&near), "the hidden lamp has about a fortieth of the draws: {near}");
    let at = DVec3::new(1.0e7 + 0.3, 0.3, -1.0e7 + 0.3);
    let origins = [at.floor(), at + DVec3::new(0.2, -50.0, 3.0), at + 1500.0, at.floor()];
    for pmf in pmf_of_hidden_lamp(at, &origins) {
        // Within the rounding of positions, which moves the shading point by up to 1e-4 m.
        assert!((pmf / near - 1.0).abs() < 1.0e-3, "{pmf} {near}");
    }
}

#[test]
fn directional_lights_stale_lights_and_samplers_without_a_table_record_nothing() {
    let mut rng = Rng(76);
    let mut world = rng.world(2, 5, 2, 10.0);
    let instance = world.instances().next().expect("an instance");
    let mut table = VisibilityTable::default();
    let at = ShadingPoint::surface(Vec3::ZERO, Vec3::Y);
    let directional = world.directionals().next().map(LightId::Directional).expect("a sun");
    let lost = LightId::Local { instance, light: 5 };
    let first = LightId::Local { instance, light: 0 };
    let local = world.sampler().all_lights().find_map(|light| world.sampler().sample_light(&at, light, [0.5; 2]));
    let incident = local.expect("a light in sight");
    let sample = |light| LightSample { light, pmf: 1.0, incident, user_data: 0 };
    world.sampler().record_visibility(&at, &sample(first), true);
    let sampler = world.sampler().with_visibility(&table);
    [directional, lost].into_iter().for_each(|light| sampler.record_visibility(&at, &sample(light), true));
    world.remove_instance(instance).expect("it lives");
    let sampler = world.sampler().with_visibility(&table);
    sampler.record_visibility(&at, &sample(first), true);
    table.end_frame();
    assert_eq!(table.cell_count(), 0);
}
