//! What rebuilds can gain in a scene: noise after two seconds without a rebuild, and noise of the
//! same lights in fresh trees.

use super::motion::Motion;
use super::noise::sigmas;
use super::stage::{SceneKind, Stage, StageOptions};
use girandole::FrameBudget;
use girandole::scheduler::SystemClock;
use std::sync::Arc;
use testbed::common::table::markdown_head;
use testbed::scene::SceneError;

/// The number of frames.
const FRAMES: u32 = 120;

/// Plays a scene in every motion and prints a row for each. "Near trees" and "in view" are the two
/// halves of the shading points (`stage.rs`).
pub fn run(kind: SceneKind, seed: u64, shading_points: usize) -> Result<(), SceneError> {
    let columns = [
        "scene",
        "lights",
        "lights in deforming trees",
        "refits per frame",
        "sigma fresh",
        "sigma refitted",
        "near trees",
        "in view",
    ];
    testbed::say!("{}", markdown_head(&columns));
    for motion in Motion::ALL {
        let mut stage =
            Stage::new(&StageOptions { kind, motion, seed, shading_points }, Arc::new(SystemClock::default()))?;
        let mut refits = 0;
        for frame in 1..=FRAMES {
            stage.advance(frame)?;
            refits += stage.world.update(FrameBudget::NONE).refit_trees;
        }
        let refitted = sigmas(&stage.world, &stage.shading_points);
        for tree in &stage.trees {
            stage.world.rebuild_tree(*tree)?;
        }
        let fresh = sigmas(&stage.world, &stage.shading_points);
        let deforming: usize =
            stage.trees.iter().filter_map(|tree| stage.world.tree(*tree)).map(|tree| tree.lights().len()).sum();
        // Shading points near trees have even indices, those in view odd ones.
        let sum = |sigmas: &[f64], halves: &[usize]| -> f64 {
            halves.iter().map(|first| sigmas.iter().skip(*first).step_by(2).sum::<f64>()).sum()
        };
        let rise = |halves: &[usize]| format!("{:+.1} %", 100.0 * (sum(&refitted, halves) / sum(&fresh, halves) - 1.0));
        let mean = |sigmas: &[f64]| sum(sigmas, &[0, 1]) / sigmas.len() as f64;
        testbed::say!(
            "| {} | {} | {deforming} | {} | {:.3} | {:.3} ({}) | {} | {} |",
            stage.name,
            stage.world.light_count(),
            refits / FRAMES as usize,
            mean(&fresh),
            mean(&refitted),
            rise(&[0, 1]),
            rise(&[0]),
            rise(&[1]),
        );
    }
    Ok(())
}
