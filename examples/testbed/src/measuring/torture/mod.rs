//! Scenes that are hard for a choice of lights: scaled, overlapping and deformed instances, shading
//! points near and on emitters, narrow beams, great contrasts.
//!
//! They are a search for *cliffs*: scenes in which a sampler that is good on cities is worse than a
//! simple one. None has shadows, so sigma is exact.

pub mod cliffs;
mod contrasts;
pub mod cuts;
mod emitters;
pub mod gloss;
mod instances;
mod scene;
pub mod table;

pub use scene::TortureScene;

/// All scenes. They are the same in every run.
pub fn scenes() -> Vec<TortureScene> {
    let lists = [instances::SCENES, cuts::SCENES, emitters::SCENES, contrasts::SCENES, gloss::SCENES];
    let scene = |(name, make): &(&str, scene::Make)| TortureScene::new((*name).into(), make, scene::SHADING_POINTS);
    lists.into_iter().flatten().map(scene).collect()
}
