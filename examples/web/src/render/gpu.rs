//! What the shader of the city reads.

use super::{geometry, image, scene, sequence, shading};

#[path = "../../../city/render/gpu/pipeline.rs"]
pub mod pipeline;
#[path = "../../../city/render/gpu/records.rs"]
pub mod records;
#[path = "../../../city/render/gpu/scene_buffers.rs"]
pub mod scene_buffers;
#[path = "../../../city/render/gpu/texels.rs"]
pub mod texels;
