//! Prepares a stage for samplers that know nothing of lights at infinity.

use crate::scene::{SceneError, Stage};
use girandole::FrameBudget;

/// Moves a stage to `time` in seconds, removes its directional lights, which belong to no tree, and
/// builds what waits for a rebuild.
pub fn prepare(mut stage: Stage, time: f64) -> Result<Stage, SceneError> {
    stage.animation.advance(time, &mut stage.scene, &mut stage.world)?;
    stage.remove_directionals()?;
    stage.world.update(FrameBudget::UNLIMITED);
    Ok(stage)
}
