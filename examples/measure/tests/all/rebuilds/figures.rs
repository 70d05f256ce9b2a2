//! The scenes and the noise of the measurements of rebuilds.

use std::sync::Arc;

use girandole::light::luminance;
use girandole::scheduler::SystemClock;
use girandole::{FrameBudget, Light};

use measure::rebuilds::figures::{Kind, Troupe};
use measure::rebuilds::motion::{FRAMES, Motion};
use measure::rebuilds::noise;
use measure::rebuilds::stage::{SceneKind, Stage, StageOptions};
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
