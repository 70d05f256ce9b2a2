//! Shading points, and how much light each cluster is estimated to send there.

pub(crate) mod gloss;
pub(crate) mod importance;
pub(crate) mod rough;
pub(crate) mod segment;
pub(crate) mod shading_point;
pub(crate) mod world_map;
