//! Accumulates frames into one picture with less noise.
//!
//! While nothing changes, each frame adds its samples to those of the frames before it. While the
//! camera or the scene moves, each pixel looks up where its surface was in the last picture
//! (temporal reprojection, as in Karis, High-Quality Temporal Supersampling, 2014; the surfaces are
//! compared as in SVGF [Schied et al. 2017]), and keeps a limited number of frames, since light
//! changes too.

use girandole::glam::{Affine3A, Vec2, Vec3};
use girandole::light::luminance;
use rayon::prelude::*;
use testbed::render::geometry::Geometry;
use testbed::render::image::Image;
use testbed::render::shading::View;
use testbed::scene::{Camera, Scene};

/// Most frames of a pixel while anything moves. More of them lower the noise, but changes of light
/// appear later.
const MAX_FRAMES_IN_MOTION: f32 = 12.0;
/// The same for pixels that show the sky or an emissive surface. Such pixels have no noise but at
/// edges, and are so bright that old frames would leave trails behind moving lamps.
const MAX_CLEAR_FRAMES_IN_MOTION: f32 = 2.0;
/// A pixel of the last picture shows the same surface if the distance of the surface from the plane
/// of that pixel was at most this many widths of the pixel.
const TOLERANCE: f32 = 2.0;
/// Fewer frames do not estimate their own variance well.
const MIN_FRAMES_FOR_VARIANCE: f32 = 6.0;
/// The object of pixels that show the sky.
const SKY: u32 = u32::MAX;

/// What a pixel shows.
#[derive(Clone, Copy)]
struct Visible {
    /// Index into the scene's objects, or [`SKY`].
    object: u32,
    /// Where the ray through the middle of the pixel ends; for the sky, its direction.
    place: Vec3,
    /// The unit normal; zero for the sky.
    normal: Vec3,
    /// Width of the pixel at this place, metres.
    footprint: f32,
    /// Whether it is the sky or an emissive surface.
    is_clear: bool,
}

/// A pixel of the accumulated picture.
#[derive(Clone, Copy)]
struct Pixel {
    visible: Visible,
    mean: Vec3,
    /// The mean of the square of the frames' luminance.
    mean_square: f32,
    /// The square of the standard error of the mean's luminance, as the frames estimate it.
    variance: f32,
    /// Frames in the mean.
    frames: f32,
}

impl Pixel {
    /// The square of the standard error of the mean's luminance: from the differences between
    /// frames if there are enough of them. A frame of one sample does not show its error.
    fn variance(&self) -> f32 {
        if self.frames < MIN_FRAMES_FOR_VARIANCE {
            return self.variance;
        }
        let square = luminance(self.mean).powi(2);
        // Rounding of the squares must not look like noise.
        let spread = self.mean_square - square;
        if spread < square * 1e-5 { 0.0 } else { spread / (self.frames - 1.0) }
    }
}

/// The accumulated picture and what is needed to look up a surface in it.
struct Last {
    width: u32,
    height: u32,
    camera: Camera,
    transforms: Vec<Affine3A>,
    pixels: Vec<Pixel>,
}

/// Accumulates the frames of a moving scene.
#[derive(Default)]
pub struct Accumulation {
    last: Option<Last>,
}

impl Accumulation {
    /// Forgets all frames: the next one does not resemble them.
    pub fn clear(&mut self) {
        self.last = None;
    }

    /// Adds a frame, and returns the picture of this and earlier frames. `image` must show the
    /// present scene and geometry. `is_still` is whether the scene is that of the last frame.
    pub fn add(&mut self, image: &Image, scene: &Scene, geometry: &Geometry, is_still: bool) -> Image {
        let last = self.last.take().filter(|last| (last.width, last.height) == (image.width, image.height));
        let is_same_view = last.as_ref().is_some_and(|last| is_still && last.camera == scene.camera);
        let pixels = match &last {
            Some(last) if is_same_view => {
                last.pixels.par_iter().zip(fresh(image)).map(|(old, new)| add(old, new)).collect()
            }
            last => reprojected(image, scene, geometry, last.as_ref()),
        };
        let transforms = scene.objects.iter().map(|object| object.transform).collect();
        let last = Last { width: image.width, height: image.height, camera: scene.camera, transforms, pixels };
        let accumulated = Image {
            width: image.width,
            height: image.height,
            pixels: last.pixels.iter().map(|pixel| pixel.mean).collect(),
            variance: last.pixels.iter().map(Pixel::variance).collect(),
        };
        self.last = Some(last);
        accumulated
    }

    /// Whether each pixel shows the sky or an emissive surface.
    pub fn clear_pixels(&self) -> Vec<bool> {
        self.last.iter().flat_map(|last| &last.pixels).map(|pixel| pixel.visible.is_clear).collect()
    }

    /// The mean number of frames in a pixel.
    pub fn mean_frames(&self) -> f32 {
        let frames = |last: &Last| last.pixels.iter().map(|pixel| pixel.frames).sum::<f32>() / last.pixels.len() as f32;
        self.last.as_ref().map_or(0.0, frames)
    }
}

/// The pixels of a frame, added to where their surfaces were in the last picture.
fn reprojected(image: &Image, scene: &Scene, geometry: &Geometry, last: Option<&Last>) -> Vec<Pixel> {
    let size = Vec2::new(image.width as f32, image.height as f32);
    let view = View::new(&scene.camera, image.width, image.height);
    let past = last.map(|last| (last, View::new(&last.camera, last.width, last.height)));
    let pixel = |(index, (mean, variance)): (usize, (Vec3, f32))| {
        let middle = Vec2::new((index as u32 % image.width) as f32, (index as u32 / image.width) as f32) + 0.5;
        let visible = visible(scene, geometry, &view, middle, size);
        let old = past.as_ref().and_then(|(last, view)| {
            let place = last.place_of(&visible, scene)?;
            last.look_up(view, visible.object, place)
        });
        match old {
            Some(old) => Pixel { visible, ..add(&old, (mean, variance)) },
            None => Pixel { visible, mean, mean_square: luminance(mean).powi(2), variance, frames: 1.0 },
        }
    };
    fresh(image).enumerate().map(pixel).collect()
}

/// The pixels of a frame and their variances.
fn fresh(image: &Image) -> impl IndexedParallelIterator<Item = (Vec3, f32)> {
    image.pixels.par_iter().copied().zip(image.variance.par_iter().copied())
}

/// A pixel with one frame more.
fn add(old: &Pixel, (mean, variance): (Vec3, f32)) -> Pixel {
    let frames = old.frames + 1.0;
    let [kept, added] = [old.frames / frames, 1.0 / frames];
    Pixel {
        visible: old.visible,
        mean: old.mean * kept + mean * added,
        mean_square: old.mean_square * kept + luminance(mean).powi(2) * added,
        variance: old.variance * kept * kept + variance * added * added,
        frames,
    }
}

/// What the middle of a pixel shows.
fn visible(scene: &Scene, geometry: &Geometry, view: &View, middle: Vec2, size: Vec2) -> Visible {
    let direction = view.direction(middle, size);
    let spread = view.up.length() * 2.0 / size.y;
    match geometry.nearest(view.eye, direction) {
        Some(hit) => Visible {
            object: hit.object,
            place: view.eye + direction * hit.distance,
            normal: geometry.normal(&hit),
            footprint: hit.distance * spread,
            is_clear: geometry.material(scene, &hit).emission != Vec3::ZERO,
        },
        None => Visible { object: SKY, place: direction, normal: Vec3::ZERO, footprint: spread, is_clear: true },
    }
}

impl Last {
    /// Where a surface of the present scene was in the last frame; `None` if its object is new.
    fn place_of(&self, visible: &Visible, scene: &Scene) -> Option<Vec3> {
        if visible.object == SKY {
            return Some(visible.place);
        }
        let now = scene.objects.get(visible.object as usize)?.transform;
        let then = *self.transforms.get(visible.object as usize)?;
        if now == then {
            return Some(visible.place);
        }
        let place = then.transform_point3(now.inverse().transform_point3(visible.place));
        place.is_finite().then_some(place)
    }

    /// The last picture at a place that its camera saw, with the number of frames limited; `None`
    /// where it showed something else.
    fn look_up(&self, view: &View, object: u32, place: Vec3) -> Option<Pixel> {
        let toward = if object == SKY { place } else { place - view.eye };
        let size = Vec2::new(self.width as f32, self.height as f32);
        let at = view.place(toward, size)?.0 - 0.5;
        let corner = at.floor();
        let (mut weight_sum, mut mean, mut mean_square) = (0.0, Vec3::ZERO, 0.0);
        let (mut variance, mut frames) = (0.0, f32::INFINITY);
        let mut nearest: Option<Visible> = None;
        for offset in [Vec2::ZERO, Vec2::X, Vec2::Y, Vec2::ONE] {
            let tap = corner + offset;
            if tap.cmplt(Vec2::ZERO).any() || tap.cmpge(size).any() {
                continue;
            }
            let pixel = &self.pixels[tap.y as usize * self.width as usize + tap.x as usize];
            let Visible { normal, footprint, .. } = pixel.visible;
            let off_plane = normal.dot(place - pixel.visible.place).abs();
            if pixel.visible.object != object || off_plane > TOLERANCE * footprint {
                continue;
            }
            let shares = Vec2::ONE - (at - tap).abs();
            let weight = shares.x * shares.y;
            weight_sum += weight;
            mean += pixel.mean * weight;
            mean_square += pixel.mean_square * weight;
            variance += pixel.variance * weight;
            frames = frames.min(pixel.frames);
            nearest = nearest.or(Some(pixel.visible));
        }
        let visible = nearest.filter(|_| weight_sum > 0.01)?;
        let most = if visible.is_clear { MAX_CLEAR_FRAMES_IN_MOTION } else { MAX_FRAMES_IN_MOTION };
        let (mean, mean_square, variance) = (mean / weight_sum, mean_square / weight_sum, variance / weight_sum);
        Some(Pixel { visible, mean, mean_square, variance, frames: frames.min(most - 1.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use testbed::scene::{Material, Mesh, Object, Sky, Triangle};

    /// A wall that fills the view, 10 m away.
    fn scene() -> Scene {
        let corners = [Vec3::new(-90.0, -90.0, 0.0), Vec3::new(90.0, -90.0, 0.0), Vec3::new(0.0, 180.0, 0.0)];
        Scene {
            materials: vec![Material::default()],
            textures: Vec::new(),
            meshes: vec![Mesh { triangles: vec![Triangle { vertices: corners, material: 0 }], ..Mesh::default() }],
            objects: vec![Object { mesh: 0, transform: Affine3A::IDENTITY, emission_scale: 1.0, visible: true }],
            festival: None,
            camera: Camera { eye: Vec3::new(0.0, 0.0, 10.0), target: Vec3::ZERO, vertical_fov: 0.8, up: Vec3::Y },
            sky: Sky::default(),
            lamp_clearance: 0.1,
            exposure: 1.0,
            is_metered: false,
            warnings: Vec::new(),
        }
    }

    /// A picture of 16 by 9 pixels of one value, with a column of another.
    fn picture(value: f32, column: Option<(u32, f32)>) -> Image {
        let pixel = |i: u32| match column {
            Some((x, value)) if i % 16 == x => Vec3::splat(value),
            _ => Vec3::splat(value),
        };
        Image { width: 16, height: 9, pixels: (0..16 * 9).map(pixel).collect(), variance: vec![1.0; 16 * 9] }
    }

    #[test]
    fn a_still_picture_is_the_mean_of_all_frames() {
        let scene = scene();
        let geometry = Geometry::new(&scene).expect("a valid scene");
        let mut accumulation = Accumulation::default();
        let mut last = picture(0.0, None);
        for frame in 0..100 {
            last = accumulation.add(&picture(frame as f32, None), &scene, &geometry, frame > 0);
        }
        assert!(last.pixels.iter().all(|pixel| (pixel.x - 49.5).abs() < 1e-3), "{:?}", last.pixels[0]);
        // The variance of the numbers from 0 to 99 is (100 * 100 - 1) / 12.
        let expected = 9999.0 / 12.0 / 99.0;
        assert!(
            last.variance.iter().all(|variance| (variance / expected - 1.0).abs() < 1e-3),
            "{:?}",
            last.variance[0]
        );
        assert_eq!(accumulation.mean_frames(), 100.0);
    }

    #[test]
    fn equal_frames_have_no_noise() {
        let scene = scene();
        let geometry = Geometry::new(&scene).expect("a valid scene");
        let mut accumulation = Accumulation::default();
        for frame in 0..300 {
            let shown = accumulation.add(&picture(0.123, None), &scene, &geometry, frame > 0);
            // A few frames know only what each of them says.
            let expected = if frame < 5 { 1.0 / (frame + 1) as f32 } else { 0.0 };
            assert!(shown.variance.iter().all(|variance| (variance - expected).abs() < 1e-6), "frame {frame}");
        }
    }

    #[test]
    fn a_moving_camera_finds_surfaces_again() {
        let mut scene = scene();
        let geometry = Geometry::new(&scene).expect("a valid scene");
        let mut accumulation = Accumulation::default();
        // Two pixels are this wide on the wall.
        let step = 2.0 * 2.0 * 10.0 * 0.4f32.tan() / 9.0;
        accumulation.add(&picture(0.0, Some((7, 8.0))), &scene, &geometry, false);
        scene.camera.eye.x += step;
        scene.camera.target.x += step;
        let moved = accumulation.add(&picture(0.0, Some((5, 8.0))), &scene, &geometry, true);
        for y in 0..9 {
            // The column is where it was seen before, two pixels to the left, and nowhere else.
            let row: Vec<f32> = (0..16).map(|x| moved.pixels[y * 16 + x].x).collect();
            assert!((row[5] - 8.0).abs() < 0.05 && row[7] < 0.05, "{row:?}");
        }
        // The columns that came into view have one frame, all others two.
        assert_eq!(accumulation.mean_frames(), (2.0 * 14.0 + 2.0) / 16.0);
    }

    #[test]
    fn a_moving_object_takes_its_light_along_and_a_new_one_starts_anew() {
        let mut scene = scene();
        let mut geometry = Geometry::new(&scene).expect("a valid scene");
        let mut accumulation = Accumulation::default();
        accumulation.add(&picture(0.0, None), &scene, &geometry, false);
        // The wall moves within its own plane: all of it was seen before, except at the edge of the
        // picture.
        let step = 2.0 * 2.0 * 10.0 * 0.4f32.tan() / 9.0;
        scene.objects[0].transform = Affine3A::from_translation(Vec3::new(step, 0.0, 0.0));
        geometry.update(&scene).expect("a valid scene");
        accumulation.add(&picture(0.0, None), &scene, &geometry, false);
        assert_eq!(accumulation.mean_frames(), (2.0 * 14.0 + 2.0) / 16.0);
        // A wall in another place is another surface.
        scene.objects[0].transform = Affine3A::from_translation(Vec3::new(0.0, 0.0, 5.0));
        let mut other = scene.clone();
        other.objects.push(other.objects[0]);
        other.objects[0].visible = false;
        let geometry = Geometry::new(&other).expect("a valid scene");
        accumulation.add(&picture(1.0, None), &other, &geometry, false);
        assert_eq!(accumulation.mean_frames(), 1.0);
    }

    #[test]
    fn in_motion_lamps_leave_no_trails() {
        let mut scene = scene();
        scene.materials[0].emission = Vec3::ONE;
        let geometry = Geometry::new(&scene).expect("a valid scene");
        let mut accumulation = Accumulation::default();
        for frame in 0..20 {
            let image = picture(if frame < 10 { 1000.0 } else { 0.0 }, None);
            let shown = accumulation.add(&image, &scene, &geometry, false);
            if frame == 19 {
                // 1000 / 2^10 is left.
                assert!(shown.pixels.iter().all(|pixel| pixel.x < 1.0), "{:?}", shown.pixels[0]);
            }
        }
        assert_eq!(accumulation.mean_frames(), MAX_CLEAR_FRAMES_IN_MOTION);
    }

    #[test]
    fn in_motion_old_frames_fade() {
        let mut scene = scene();
        let geometry = Geometry::new(&scene).expect("a valid scene");
        let mut accumulation = Accumulation::default();
        for frame in 0..200 {
            let image = picture(if frame < 100 { 1.0 } else { 0.0 }, None);
            let shown = accumulation.add(&image, &scene, &geometry, false);
            if frame == 199 {
                // (11/12)^100 is 1.7e-4.
                assert!(shown.pixels.iter().all(|pixel| pixel.x < 1e-3), "{:?}", shown.pixels[0]);
            }
            scene.lamp_clearance += 0.001;
        }
        assert_eq!(accumulation.mean_frames(), MAX_FRAMES_IN_MOTION);
    }
}
