//! Prepares a stage for samplers that know nothing of lights at infinity.

use crate::city::scene::{SceneError, Stage};
use girandole::FrameBudget;

/// Moves a stage to `time` in seconds, removes its directional lights, which belong to no tree, and
/// builds what waits for a rebuild.
pub fn prepare(mut stage: Stage, time: f64) -> Result<Stage, SceneError> {
    stage.animation.advance(time, &mut stage.scene, &mut stage.world)?;
    let directionals: Vec<_> = stage.world.directionals().map(|(key, _)| key).collect();
    directionals.into_iter().try_for_each(|key| stage.world.remove_directional(key))?;
    stage.world.update(FrameBudget::UNLIMITED);
    Ok(stage)
}
