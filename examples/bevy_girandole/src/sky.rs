//! The sky: an image as a map of what arrives from all around, and the search for its changes.

use std::f32::consts::PI;
use std::time::Instant;

use bevy::asset::{AssetEvent, AssetId, Assets};
use bevy::ecs::entity::Entity;
use bevy::ecs::message::MessageReader;
use bevy::ecs::system::{Local, Query, Res, ResMut};
use bevy::image::Image;
use bevy::log::warn_once;
use bevy::math::{Vec3, Vec4};
use girandole::{Sky, SkyError};

use crate::components::GirandoleSky;
use crate::gather::changed;
use crate::gathered::Changes;
use crate::texels::Texels;
use crate::units::UNIT;

/// The texels along an edge of a face beyond which faces are reduced.
const MAX_EDGE: usize = 512;
/// The columns of a map that is made of a cubemap, for each texel along an edge of a face: as many as there are around
/// the horizon.
const COLUMNS_PER_TEXEL: usize = 4;
/// The least width of such a map.
const MIN_WIDTH: usize = 64;
/// Places along each axis of a pixel at which texels are read. Texels at the corners of faces are half as wide as
/// pixels are.
const PLACES: usize = 3;
/// The faces of a cubemap.
const FACES: usize = 6;

/// What was sent of the sky. Floats are compared by their bits.
#[derive(Default)]
pub struct Sent {
    entity: Option<Entity>,
    image: Option<AssetId<Image>>,
    /// Rotation and intensity.
    adjusted: Option<[u32; 5]>,
}

/// A sky that is new, gone or changed, or whose image was.
pub fn gather(
    mut changes: ResMut<Changes>,
    mut events: MessageReader<AssetEvent<Image>>,
    images: Res<Assets<Image>>,
    skies: Query<(Entity, &GirandoleSky)>,
    mut sent: Local<Sent>,
) {
    let started = Instant::now();
    if skies.iter().len() > 1 {
        warn_once!("girandole: there is one sky, but several entities have the component");
    }
    let found = sent.entity.and_then(|entity| skies.get(entity).ok()).or_else(|| skies.iter().next());
    sent.entity = found.map(|(entity, _)| entity);
    let sky = found.map(|(_, sky)| sky);
    let image = sky.map(|sky| sky.image.id());
    let has_changed = events.read().filter_map(changed).filter(|id| Some(*id) == image).count() > 0;
    if has_changed || image != sent.image {
        let map = image.and_then(|id| images.get(id)).and_then(map);
        changes.set_sky(map);
        *sent = Sent { image, adjusted: None, ..*sent };
    }
    if let Some(sky) = sky {
        let [x, y, z, w] = sky.rotation.to_array();
        let adjusted = [x, y, z, w, sky.intensity].map(f32::to_bits);
        if sent.adjusted != Some(adjusted) {
            changes.adjust_sky(sky.rotation, sky.intensity / UNIT);
            sent.adjusted = Some(adjusted);
        }
    }
    changes.took(started);
}

/// The map of an image, with [`UNIT`] nits for a texel of 1; `None` for one that cannot be a sky.
fn map(image: &Image) -> Option<Sky> {
    let texels = Texels::new(image);
    let sky = match &texels {
        Some(texels) if texels.layers == FACES && texels.size[0] == texels.size[1] => Cubemap::new(texels).sky(),
        // Faces of a cubemap that are still stacked in one layer are higher than they are wide.
        Some(texels) if texels.layers == 1 && texels.size[1] <= texels.size[0] => {
            let [width, height] = texels.size;
            let pixels = (0..height).flat_map(|y| (0..width).map(move |x| [x, y]));
            let pixels: Vec<Vec3> = pixels.map(|at| UNIT * texels.texel(0, at).truncate()).collect();
            Sky::equirectangular(width, &pixels)
        }
        _ => {
            warn_once!("girandole: the image of a sky is neither readable as a cubemap nor as an equirectangular map");
            return None;
        }
    };
    sky.inspect_err(|error| warn_once!("girandole: the image of a sky was refused: {error}")).ok()
}

/// The radiance of the faces, with [`UNIT`] nits for a texel of 1.
struct Cubemap {
    edge: usize,
    /// In rows, one face after the other.
    texels: Vec<Vec3>,
}

impl Cubemap {
    fn new(image: &Texels) -> Self {
        let full = image.size[0];
        let edge = full.min(MAX_EDGE);
        let mut sums = vec![Vec4::ZERO; FACES * edge * edge];
        for face in 0..FACES {
            for y in 0..full {
                for x in 0..full {
                    let [column, row] = [x, y].map(|place| place * edge / full);
                    let texel = image.texel(face, [x, y]).truncate() * UNIT;
                    sums[(face * edge + row) * edge + column] += texel.extend(1.0);
                }
            }
        }
        Self { edge, texels: sums.into_iter().map(|sum| sum.truncate() / sum.w).collect() }
    }

    /// The map. A pixel has the average of the texels at evenly spaced places.
    fn sky(&self) -> Result<Sky, SkyError> {
        let width = (COLUMNS_PER_TEXEL * self.edge).max(MIN_WIDTH);
        let height = width / 2;
        let angle = |i: usize, count: usize| PI * (i as f32 + 0.5) / (PLACES * count) as f32;
        let columns: Vec<(f32, f32)> = (0..PLACES * width).map(|x| (2.0 * angle(x, width) - PI).sin_cos()).collect();
        let mut pixels = vec![Vec3::ZERO; width * height];
        for y in 0..PLACES * height {
            let (sin_theta, cos_theta) = angle(y, height).sin_cos();
            for (x, (sin_phi, cos_phi)) in columns.iter().enumerate() {
                let direction = Vec3::new(sin_theta * cos_phi, cos_theta, sin_theta * sin_phi);
                pixels[y / PLACES * width + x / PLACES] += self.radiance(direction) / (PLACES * PLACES) as f32;
            }
        }
        Sky::equirectangular(width, &pixels)
    }

    /// The texel in a direction of the world. Cubemaps are left-handed, so Bevy negates z.
    fn radiance(&self, direction: Vec3) -> Vec3 {
        let Vec3 { x, y, z } = direction * Vec3::new(1.0, 1.0, -1.0);
        let size = direction.abs();
        let (face, across, down) = if size.x >= size.y && size.x >= size.z {
            if x >= 0.0 { (0, -z, -y) } else { (1, z, -y) }
        } else if size.y >= size.z {
            if y >= 0.0 { (2, x, z) } else { (3, x, -z) }
        } else if z >= 0.0 {
            (4, x, -y)
        } else {
            (5, -x, -y)
        };
        let half = 0.5 * self.edge as f32;
        let place = |along: f32| ((half + half * along / size.max_element()) as usize).min(self.edge - 1);
        self.texels[(face * self.edge + place(down)) * self.edge + place(across)]
    }
}

#[cfg(test)]
mod tests;
