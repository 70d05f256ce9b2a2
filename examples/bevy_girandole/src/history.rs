//! The mean of the frames before, and the lights that pixels keep, for each camera.

use bevy::prelude::*;
use bevy::render::camera::ExtractedCamera;
use bevy::render::render_resource::{
    Buffer, BufferDescriptor, BufferUsages, Extent3d, TextureDescriptor, TextureDimension, TextureFormat,
    TextureUsages, TextureView, TextureViewDescriptor,
};
use bevy::render::renderer::RenderDevice;

use crate::components::{Estimate, GirandoleCamera};
use crate::pass::PassPipeline;

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
    /// A `LightReservoir` for each pixel.
    pub kept: Buffer,
}

/// The bytes of a `LightReservoir`.
const RESERVOIR_BYTES: u64 = 28;

/// The bytes that the pixels of a picture keep.
fn bytes_kept(size: UVec2) -> u64 {
    u64::from(size.x) * u64::from(size.y) * RESERVOIR_BYTES
}

/// The textures and buffers of a camera, which are read and written in alternate frames.
#[derive(Component)]
pub struct History {
    size: UVec2,
    /// Whether pixels keep lights.
    keeps: bool,
    sides: [Past; 2],
    number: u32,
    /// What the last frame that was drawn was of.
    last: Option<FrameKey>,
    /// Pipelines that were not ready in that frame.
    waiting: usize,
    /// Frames in which the mean stays short, so that surfaces as they were leave it.
    unsettled: u32,
}

/// The first frames that a camera draws, in which Bevy may still draw surfaces with other materials: none of them is in
/// the mean.
const FIRST_FRAMES: u32 = 4;

/// The mean stays short for so many times its length after a change of surfaces: of what it held before, a fiftieth is
/// left then.
const SETTLING: u32 = 4;

/// What must be known of two frames to tell whether the second one can go on with the mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameKey {
    /// The number of the frame of the render world.
    pub frame: u64,
    /// The setting `history` of the camera.
    pub setting: u32,
    pub estimate: Estimate,
    /// Position and size in pixels, if the camera does not fill its target.
    pub viewport: Option<[UVec2; 2]>,
    pub exposure: f32,
}

impl FrameKey {
    /// Whether the mean goes on: this is the next frame of the same picture.
    fn follows(&self, last: &Self) -> bool {
        self.frame == last.frame + 1
            && (self.setting, self.estimate) == (last.setting, last.estimate)
            && self.viewport == last.viewport
    }
}

/// What the pass of one frame reads and writes.
pub struct HistoryFrame {
    pub number: u32,
    pub has_past: bool,
    /// Whether the exposure is another one than in the frame before.
    pub has_new_exposure: bool,
    /// Of the picture in pixels.
    pub width: u32,
    /// Whether pixels keep lights.
    pub keeps: bool,
    pub past: Past,
    pub present: Past,
}

impl History {
    fn new(device: &RenderDevice, size: UVec2, keeps: bool) -> Self {
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
        let kept = || {
            device.create_buffer(&BufferDescriptor {
                label: Some("girandole reservoirs"),
                size: if keeps { bytes_kept(size) } else { RESERVOIR_BYTES },
                usage: BufferUsages::STORAGE,
                mapped_at_creation: false,
            })
        };
        let side = || Past {
            mean: texture("girandole mean", MEAN_FORMAT),
            dist: texture("girandole distance", DIST_FORMAT),
            kept: kept(),
        };
        Self { size, keeps, sides: [side(), side()], number: 0, last: None, waiting: 0, unsettled: 0 }
    }

    /// Advances to the next frame.
    pub fn next_frame(&mut self, key: FrameKey) -> HistoryFrame {
        let number = self.number;
        self.number = number.wrapping_add(1);
        let last = self.last.replace(key);
        let has_past = number >= FIRST_FRAMES && last.is_some_and(|last| key.follows(&last));
        let has_new_exposure = last.is_some_and(|last| key.exposure != last.exposure);
        let [past, present] = if number.is_multiple_of(2) { [0, 1] } else { [1, 0] };
        let [past, present] = [past, present].map(|side| self.sides[side].clone());
        HistoryFrame { number, has_past, has_new_exposure, width: self.size.x, keeps: self.keeps, past, present }
    }
}

impl History {
    /// Whether the mean stays short in this frame: surfaces changed a while ago, or a pipeline was made that draws some.
    pub fn settles(&mut self, has_new_surfaces: bool, waiting: usize, moving_frames: u32) -> bool {
        let has_new_pipelines = std::mem::replace(&mut self.waiting, waiting) != waiting;
        self.unsettled = match has_new_surfaces || has_new_pipelines {
            true => SETTLING * moving_frames,
            false => self.unsettled.saturating_sub(1),
        };
        self.unsettled > 0
    }
}

/// Removes what belongs to a device that was lost.
pub fn forget(mut commands: Commands, cameras: Query<Entity, Or<(With<History>, With<PassPipeline>)>>) {
    for entity in &cameras {
        commands.entity(entity).remove::<(History, PassPipeline)>();
    }
}

/// Gives each camera its textures, of the size of its target.
pub fn prepare(
    mut commands: Commands,
    device: Res<RenderDevice>,
    cameras: Query<(Entity, &ExtractedCamera, Option<&History>, &GirandoleCamera)>,
) {
    let most = u64::from(device.limits().max_storage_buffer_binding_size);
    for (entity, camera, history, settings) in &cameras {
        let Some(size) = camera.physical_target_size.filter(|size| size.min_element() > 0) else { continue };
        let keeps = settings.reused_frames > 0 && bytes_kept(size) <= most;
        if history.is_none_or(|history| (history.size, history.keeps) != (size, keeps)) {
            commands.entity(entity).insert(History::new(&device, size, keeps));
        }
    }
}
