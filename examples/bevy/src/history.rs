//! The mean of the frames before, one for each camera.

use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    Extent3d, TextureDescriptor, TextureDimension, TextureFormat, TextureUsages, TextureView, TextureViewDescriptor,
};
use bevy::render::renderer::RenderDevice;

use crate::components::GirandoleCamera;

/// The mean, and the number of frames. 32 bits, so that a sample still changes a mean of thousands
/// of frames.
pub const MEAN_FORMAT: TextureFormat = TextureFormat::Rgba32Float;
/// The distance from the camera.
pub const DIST_FORMAT: TextureFormat = TextureFormat::R32Float;

/// What a frame leaves to the next one.
#[derive(Clone)]
pub struct Past {
    pub mean: TextureView,
    pub dist: TextureView,
}

/// The textures of a camera, which are read and written in alternate frames.
#[derive(Component)]
pub struct History {
    size: UVec2,
    sides: [Past; 2],
    number: u32,
    /// Under what the last mean was computed; `None` before the first.
    last: Option<Conditions>,
}

/// Under what a frame is drawn. The mean goes on from the frame before under the same conditions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// The number of the frame. A camera that was not drawn in the frame before has no past.
    pub frame: u64,
    /// `GirandoleCamera::history`.
    pub setting: u32,
    /// The exposure of the camera, on which the emission of surfaces depends.
    pub exposure: f32,
    /// Position and size of the viewport in pixels.
    pub viewport: Option<(UVec2, UVec2)>,
}

/// What the pass of one frame reads and writes.
pub struct HistoryFrame {
    pub number: u32,
    pub has_past: bool,
    pub past: Past,
    pub present: Past,
}

impl History {
    fn new(device: &RenderDevice, size: UVec2) -> Self {
        let texture = |label, format| {
            let texture = device.create_texture(&TextureDescriptor {
                label: Some(label),
                size: Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: TextureDimension::D2,
                format,
                usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
                view_formats: &[],
            });
            texture.create_view(&TextureViewDescriptor::default())
        };
        let side =
            || Past { mean: texture("girandole mean", MEAN_FORMAT), dist: texture("girandole distance", DIST_FORMAT) };
        Self { size, sides: [side(), side()], number: 0, last: None }
    }

    /// Advances to the next frame.
    pub fn next_frame(&mut self, conditions: Conditions) -> HistoryFrame {
        let number = self.number;
        self.number = number.wrapping_add(1);
        let before = Conditions { frame: conditions.frame.wrapping_sub(1), ..conditions };
        let has_past = self.last == Some(before);
        self.last = Some(conditions);
        let [past, present] = if number.is_multiple_of(2) { [0, 1] } else { [1, 0] };
        HistoryFrame { number, has_past, past: self.sides[past].clone(), present: self.sides[present].clone() }
    }
}

/// Gives each camera its textures, of the size of its target.
pub fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cameras: Query<(Entity, &ExtractedCamera, Option<&History>), With<GirandoleCamera>>,
) {
    for (entity, camera, history) in &cameras {
        let Some(size) = camera.physical_target_size.filter(|size| size.min_element() > 0) else { continue };
        if history.is_none_or(|history| history.size != size) {
            commands.entity(entity).insert(History::new(&device, size));
        }
    }
}
