//! What is at stake in each scene: noise after two seconds without a rebuild, beside the same lights in fresh trees.

use super::motion::Motion;
use super::noise::sigmas;
use super::scene::SceneError;
use super::stage::{SceneKind, Stage};
use girandole::FrameBudget;
use girandole::scheduler::SystemClock;
use std::sync::Arc;

/// Frames that are played.
const FRAMES: u32 = 120;

/// Plays every motion of a scene and prints a line for each.
pub fn run(kind: SceneKind, shading_points: usize) -> Result<(), SceneError> {
    println!(
        "| scene | lights | of trees that deform | refits a frame | sigma fresh | refitted | beside trees | in view |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for motion in Motion::ALL {
        let mut stage = Stage::new(kind, motion, shading_points, Arc::new(SystemClock::default()))?;
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
        let sum = |sigmas: &[f64], of: &[usize]| -> f64 {
            of.iter().map(|first| sigmas.iter().skip(*first).step_by(2).sum::<f64>()).sum()
        };
        let rise = |of: &[usize]| format!("{:+.1} %", 100.0 * (sum(&refitted, of) / sum(&fresh, of) - 1.0));
        let mean = |sigmas: &[f64]| sum(sigmas, &[0, 1]) / sigmas.len() as f64;
        println!(
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
