//! The scenes, the measurements and the statistics of the budget example.

use std::sync::Arc;

use girandole::light::luminance;
use girandole::scheduler::SystemClock;
use girandole::{FrameBudget, Light};

use budget::figures::{Kind, Troupe};
use budget::motion::{FRAMES, Motion};
use budget::noise;
use budget::regression::{Line, MAX_FEATURES, Point, best_tenth, fit, predict, spearman, spread};
use budget::stage::{SceneKind, Stage, StageOptions};
use testbed::testing::support::{Rng, all_pmfs};

#[test]
fn the_lights_of_a_frame_do_not_depend_on_which_earlier_frames_were_shown() {
    for (kind, motion) in Kind::ALL.into_iter().flat_map(|kind| Motion::ALL.map(|motion| (kind, motion))) {
        let (mut every_frame, mut some_frames) = (Troupe::new(kind, motion, 5), Troupe::new(kind, motion, 5));
        let start = every_frame.lights().to_vec();
        assert!(start.len() >= 20, "{kind:?}");
        for frame in 0..FRAMES {
            every_frame.advance(frame);
            if frame % 50 == 49 {
                some_frames.advance(frame);
                assert!(every_frame.lights() == some_frames.lights(), "{kind:?} {motion:?} in frame {frame}");
            }
        }
        assert!(every_frame.lights() != start, "{kind:?} {motion:?} never moves");
        assert!(motion != Motion::Rest || !every_frame.advance(FRAMES), "{kind:?} does not rest");
    }
}

/// The smallest stage, with 20 shading points.
fn stage_with_seed(seed: u64) -> Stage {
    let options = StageOptions { kind: SceneKind::S10, motion: Motion::Teleporting, seed, shading_points: 20 };
    Stage::new(&options, Arc::new(SystemClock::default())).expect("a stage")
}

#[test]
fn the_seed_changes_the_lights_and_the_shading_points_of_a_scene() {
    let stages = [1, 2].map(stage_with_seed);
    assert!(stages[0].shading_points != stages[1].shading_points);
    let lights = stages.each_ref().map(|stage| {
        let trees = stage.trees.iter().map(|tree| stage.world.tree(*tree).expect("a tree").lights().to_vec());
        trees.collect::<Vec<_>>()
    });
    assert!(lights[0].iter().zip(&lights[1]).all(|(a, b)| a != b));
}

#[test]
fn the_lights_of_a_scene_do_not_depend_on_what_is_rebuilt() {
    let mut stages = [0, 1].map(|_| stage_with_seed(1));
    assert_eq!(stages[0].shading_points, stages[1].shading_points);
    assert_eq!((stages[0].shading_points.len(), stages[0].trees.len()), (20, 10));
    let mut rebuilt = 0;
    for frame in 1..=100 {
        for (stage, budget) in stages.iter_mut().zip([FrameBudget::NONE, FrameBudget::UNLIMITED]) {
            stage.advance(frame).expect("a frame");
            rebuilt += stage.world.update(budget).rebuilt_trees;
        }
    }
    assert!(rebuilt > 10, "{rebuilt}");
    let lights = |stage: &Stage| -> Vec<Light> {
        stage.trees.iter().flat_map(|tree| stage.world.tree(*tree).expect("a tree").lights().to_vec()).collect()
    };
    assert!(lights(&stages[0]) == lights(&stages[1]));
    // The scene shows the value of rebuilds: without them it is noisier.
    let [refitted, rebuilt] =
        stages.map(|stage| noise::sigmas(&stage.world, &stage.shading_points).iter().sum::<f64>());
    assert!(refitted > 1.1 * rebuilt, "{refitted} {rebuilt}");
}

#[test]
fn sigmas_equal_a_sum_over_all_lights() {
    let mut rng = Rng(81);
    let world = rng.world(3, 40, 4, 20.0);
    let shading_points: Vec<_> = (0..20).map(|_| rng.shading_point(20.0)).collect();
    let sampler = world.sampler();
    for (shading_point, sigma) in shading_points.iter().zip(noise::sigmas(&world, &shading_points)) {
        let (mut sum, mut second_moment) = (0.0, 0.0);
        for (light, pmf) in all_pmfs(&sampler, shading_point) {
            let Some(incident) = sampler.sample_light(shading_point, light, [0.5, 0.5]) else { continue };
            let cosine = incident.direction.dot(shading_point.normal).max(0.0);
            let lux = f64::from(luminance(incident.radiance) * cosine / incident.pdf);
            sum += lux;
            second_moment += if lux > 0.0 { lux * lux / f64::from(pmf) } else { 0.0 };
        }
        let expected = if sum > 0.0 { (second_moment / (sum * sum) - 1.0).max(0.0).sqrt() } else { 0.0 };
        // The probabilities differ by rounding, at most 1e-5, and sigma is the root of a
        // difference.
        assert!((sigma - expected).abs() <= 1.0e-3 * expected + 1.0e-2, "{sigma} {expected}");
    }
    assert!(noise::sigmas(&girandole::LightWorld::new(), &shading_points[..1]) == [0.0]);
}

fn point(x: &[f64], y: f64) -> Point {
    Point { x: std::array::from_fn(|i| x.get(i).copied().unwrap_or(0.0)), y }
}

#[test]
fn least_squares_recover_the_coefficients_of_the_points() {
    let mut rng = Rng(82);
    let mut number = || f64::from(rng.unit());
    let points: Vec<Point> =
        (0..50).map(|_| [number(), number(), number()]).map(|x| point(&x, 2.0 * x[0] + 0.5 * x[1] - x[2])).collect();
    let all: Vec<&Point> = points.iter().collect();
    let line = Line::fit(&all, &[0, 1, 2]);
    let near = |a: f64, b: f64| (a - b).abs() < 1.0e-9;
    assert!(near(line.constant, 0.0) && near(line.coefficients[2], -1.0) && near(line.coefficients[0], 2.0));
    // The fit without a constant has no negative coefficients, so it leaves the third out.
    let coefficients = fit(&all, &[0, 1, 2]);
    assert!(coefficients[2] == 0.0 && coefficients[0] > 1.0 && coefficients.iter().all(|c| *c >= 0.0));
    let left = |c: &[f64; MAX_FEATURES]| points.iter().map(|p| (p.y - predict(c, &p.x)).powi(2)).sum::<f64>();
    for i in [0, 1] {
        for step in [-0.01, 0.01] {
            let mut other = coefficients;
            other[i] = (other[i] + step).max(0.0);
            assert!(left(&other) >= left(&coefficients));
        }
    }
}

#[test]
fn rank_correlation_and_best_tenth_equal_values_computed_by_hand() {
    assert!((spearman(&[1.0, 2.0, 3.0], &[10.0, 30.0, 20.0]) - 0.5).abs() < 1.0e-12);
    assert!((spearman(&[1.0, 1.0, 2.0], &[5.0, 5.0, 9.0]) - 1.0).abs() < 1.0e-12);
    let gain: Vec<f64> = (0..20).map(f64::from).collect();
    let negated: Vec<f64> = gain.iter().map(|g| -g).collect();
    assert_eq!(best_tenth(&gain, &gain), 1.0);
    assert_eq!(best_tenth(&negated, &gain), 1.0 / 37.0);
}

#[test]
fn the_fit_recovers_the_spread_of_coefficients_between_groups() {
    let mut rng = Rng(83);
    // The sum of twelve uniform numbers has the variance of one normal number.
    let mut normal = || (0..12).map(|_| f64::from(rng.unit())).sum::<f64>() - 6.0;
    let groups: Vec<Vec<Point>> = (0..400)
        .map(|_| {
            let own = [1.0 + 0.5 * normal(), 2.0 + 0.2 * normal()];
            (0..20)
                .map(|_| {
                    let x = [normal(), normal()];
                    point(&x, own[0] * x[0] + own[1] * x[1] + 0.3 * normal())
                })
                .collect()
        })
        .collect();
    let groups: Vec<Vec<&Point>> = groups.iter().map(|group| group.iter().collect()).collect();
    let coefficients = [1.0, 2.0, 0.0, 0.0, 0.0, 0.0];
    let found = spread(&groups, &coefficients, &[0, 1]);
    let deviations = [0, 1].map(|i| found.covariance[i][i].sqrt());
    // 400 draws determine a standard deviation to 4 %. The tolerance is five times that, and the
    // seed is fixed.
    assert!((deviations[0] / 0.5 - 1.0).abs() < 0.2 && (deviations[1] / 0.2 - 1.0).abs() < 0.2, "{deviations:?}");
    assert!((found.noise / 0.3 - 1.0).abs() < 0.1, "{}", found.noise);
    assert!(found.covariance[0][1].abs() < 0.25 * deviations[0] * deviations[1]);
}
