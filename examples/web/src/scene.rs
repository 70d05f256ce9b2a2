//! The scene of the procedural city. The loaders of files are left out.

#[path = "../../city/scene/stage.rs"]
mod stage;
#[path = "../../city/scene/texture.rs"]
pub mod texture;

#[path = "../../city/scene/assembly.rs"]
pub mod assembly;
#[path = "../../city/scene/palette.rs"]
pub mod palette;
#[path = "../../city/scene/part.rs"]
pub mod part;

#[path = "../../city/scene/designs/mod.rs"]
pub mod designs;
#[path = "../../city/scene/procedural/mod.rs"]
pub mod procedural;

pub use crate::common::pcg as rng;
pub use stage::*;
