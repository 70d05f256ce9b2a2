//! What an instance adds to its tree: its placement, its appearance, and the parts of it that are
//! leaves of the top level.

pub(crate) mod appearance;
pub(crate) mod part;
pub(crate) mod placement;
pub(crate) mod portal;
pub(crate) mod sector;
pub(crate) mod transform;
