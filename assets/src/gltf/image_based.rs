//! EXT_lights_image_based: the light of a scene's surroundings, as a cube of images.

use ::gltf::Document;
use ::gltf::json::Value;
use girandole::{Placement, Sky};
use glam::{DQuat, Mat3, Vec3};

use super::check::{LIGHTS_IMAGE_BASED as NAME, document_error};
use super::nodes::{index_of, rotation_of, scene_of};
use super::texture::TextureImage;
use crate::error::{AssetError, invalid};
use crate::texture::LINEAR;

/// Columns of the sky for each column of a face: a quarter of a turn.
const COLUMNS_OF_FACE: usize = 4;

/// The most pixels along a side of a face as it is stored. Small suns keep their light in larger pixels.
const MAX_SIDE: usize = 1024;

/// What a document says about the light of its scene.
pub(super) struct ImageBasedLight {
    /// The index of the light.
    light: usize,
    /// The images of the cube's faces at +X, -X, +Y, -Y, +Z and -Z.
    faces: [usize; 6],
    intensity: f32,
    /// How the cube is turned.
    pub placement: Placement,
}

impl ImageBasedLight {
    /// The light of the document's scene, if it has one.
    pub fn of(document: &Document) -> Result<Option<Self>, AssetError> {
        let Some(scene) = scene_of(document) else { return Ok(None) };
        let Some(extension) = scene.extension_value(NAME) else { return Ok(None) };
        let light = extension.get("light").and_then(index_of);
        let light = light.ok_or_else(|| document_error(&format!("scene {}: {NAME} has no light", scene.index())))?;
        let refused = |what: &str| invalid(format!("image based light {light}: {what}"));
        let lights = document.extension_value(NAME).and_then(|extension| extension.get("lights")?.as_array());
        let found = lights.and_then(|lights| lights.get(light));
        let found = found.ok_or_else(|| refused("the document has no such light"))?;
        let faces = found.get("specularImages").and_then(|levels| levels.get(0)?.as_array());
        let faces: Option<Vec<usize>> = faces.and_then(|faces| faces.iter().map(index_of).collect());
        let faces: Option<[usize; 6]> = faces.and_then(|faces| faces.try_into().ok());
        let faces = faces.ok_or_else(|| refused("its first specularImages are not six images"))?;
        if faces.iter().any(|image| *image >= document.images().len()) {
            return Err(refused("its specularImages refer to no image"));
        }
        let intensity = found.get("intensity").map_or(Some(1.0), Value::as_f64).map(|intensity| intensity as f32);
        let intensity = intensity.filter(|intensity| intensity.is_finite() && *intensity >= 0.0);
        let intensity = intensity.ok_or_else(|| refused("its intensity is no finite number of 0 or more"))?;
        let rotation = found.get("rotation").map_or(Some(DQuat::IDENTITY), rotation);
        let rotation = rotation.ok_or_else(|| refused("its rotation is not four numbers, or has no length"))?;
        let placement = Placement { linear: Mat3::from_quat(rotation.as_quat()), ..Placement::IDENTITY };
        Ok(Some(Self { light, faces, intensity, placement }))
    }

    /// The sky; `None` if one of the images is not there.
    pub fn sky(&self, images: &[Option<TextureImage<'_>>]) -> Result<Option<Sky>, AssetError> {
        let refused = |message: String| invalid(format!("image based light {}: {message}", self.light));
        let mut faces = Vec::with_capacity(self.faces.len());
        for index in self.faces {
            let Some(image) = images.get(index).copied().flatten() else { return Ok(None) };
            image.check(index)?;
            faces.push(image);
        }
        let side = faces[0].width;
        if let Some(other) = faces.iter().find(|face| [face.width, face.height] != [side; 2]) {
            let (width, height) = (other.width, other.height);
            return Err(refused(format!("an image of {width} x {height} pixels is no face of a cube of {side}")));
        }
        let side = side as usize;
        let nits = |pixel: &[u8]| {
            let color = Vec3::from_array([0, 1, 2].map(|channel| LINEAR[usize::from(pixel[channel])]));
            // The least divisor in place of 0, which writers store for what is brighter still.
            color * (255.0 / f32::from(pixel[3].max(1)) * self.intensity)
        };
        // Large faces are reduced by whole numbers: their squares of pixels are averaged.
        let square = side.div_ceil(MAX_SIDE);
        let reduced = side.div_ceil(square);
        let mean = |face: &TextureImage<'_>, x: usize, y: usize| {
            let [columns, rows] = [x, y].map(|first| first * square..((first + 1) * square).min(side));
            let count = columns.len() * rows.len();
            let places = rows.flat_map(|y| columns.clone().map(move |x| 4 * (y * side + x)));
            places.map(|at| nits(&face.rgba[at..at + 4])).sum::<Vec3>() / count as f32
        };
        let texels = |face| (0..reduced * reduced).map(move |i| mean(face, i % reduced, i / reduced)).collect();
        let faces: Vec<Vec<Vec3>> = faces.iter().map(texels).collect();
        let radiance = |direction: Vec3| {
            let (face, at) = on_cube(direction);
            let [column, row] = at.map(|at| (((0.5 * at + 0.5) * side as f32) as usize).min(side - 1) / square);
            faces[face][row * reduced + column]
        };
        Sky::averaged(COLUMNS_OF_FACE * reduced, radiance).map(Some).map_err(|error| refused(error.to_string()))
    }
}

/// The face of a cube that a direction meets, and where on its image: from -1 to 1, to the right and down.
///
/// Each image is what is seen from the middle of the cube. The extension asks for that: images for OpenGL, which show
/// the cube from outside, are flipped about their vertical axis. +Y is at the top of the four images around; -Z is at
/// the top of the image of +Y, and +Z at the top of that of -Y.
fn on_cube(direction: Vec3) -> (usize, [f32; 2]) {
    let [x, y, z] = direction.to_array();
    let size = direction.abs();
    let (face, right, down) = if size.x >= size.y && size.x >= size.z {
        if x >= 0.0 { (0, z, -y) } else { (1, -z, -y) }
    } else if size.y >= size.z {
        if y >= 0.0 { (2, -x, z) } else { (3, -x, -z) }
    } else if z >= 0.0 {
        (4, -x, -y)
    } else {
        (5, x, -y)
    };
    (face, [right, down].map(|at| at / size.max_element()))
}

/// A quaternion of unit length; `None` if it is not four numbers or has no direction.
fn rotation(value: &Value) -> Option<DQuat> {
    let numbers: Option<Vec<f64>> = value.as_array()?.iter().map(Value::as_f64).collect();
    rotation_of(numbers?.try_into().ok()?)
}
