//! A screen over the street that plays a film: the light that it sends follows each frame.

use girandole::glam::{Affine2, Affine3A, Vec2, Vec2Swizzles, Vec3, vec3};
use girandole::{LightTree, LightWorld, Placement, Policy, TreeKey};
use girandole_assets::texture::{Texture, TexturedSurface};
use std::f32::consts::TAU;
use std::sync::Arc;

use super::assembly::Assembly;
use super::part::Part;
use super::texture::{Pixels, Texture as SceneTexture, Wrap};
use super::{Animation, Material, Mesh, Scene, SceneError, Stage};

/// Columns and rows of a frame.
const SIZE: [usize; 2] = [64, 36];
/// Frames of the film, which repeats, and frames in a second.
const FRAMES: usize = 48;
const RATE: f64 = 12.0;
/// Nits of white.
const WHITE: f32 = 30.0;
/// Parts of the screen: as many as there are squares of two texels, so that each film is cut alike.
const PARTS: usize = 576;
/// Half the width and the height of the screen, in metres, and how far its frame reaches beyond.
const HALF: [f32; 2] = [4.8, 2.7];
const RIM: f32 = 0.15;

/// A film on a screen, and what moves the rest of its scene.
struct Screen {
    rest: Box<dyn Animation>,
    tree: TreeKey,
    parts: Vec<TexturedSurface>,
    /// The object that shows each frame; one of them is visible.
    objects: Vec<usize>,
    images: Vec<Arc<Pixels>>,
    shown: usize,
}

/// A frame: a sun behind waves, bars of colour that pass, and black below.
fn frame(number: usize) -> Pixels {
    let time = number as f32 / FRAMES as f32 * TAU;
    let [width, height] = SIZE;
    let pixel = |i: usize| {
        let [x, y] = [(i % width) as f32 / width as f32, (i / width) as f32 / height as f32];
        let sun = vec3(1.7778 * (x - 0.5 - 0.3 * time.cos()), y - 0.45 - 0.1 * time.sin(), 0.0).length();
        let wave = 0.72 + 0.08 * (9.0 * x + time).sin() + 0.04 * (23.0 * x - 2.0 * time).sin();
        let bar = ((8.0 * x + time / TAU * 8.0).floor() as usize) % 8;
        let color = if y > 0.9 {
            vec3((bar & 1) as f32, (bar >> 1 & 1) as f32, (bar >> 2 & 1) as f32)
        } else if y > wave {
            vec3(0.02, 0.16, 0.32)
        } else if sun < 0.2 {
            vec3(1.0, 0.85, 0.3)
        } else {
            vec3(0.45, 0.08, 0.2).lerp(vec3(0.05, 0.03, 0.22), (1.4 * (wave - y)).clamp(0.0, 1.0))
        };
        // The bytes count as sRGB-encoded.
        let [r, g, b] = color.powf(1.0 / 2.2).to_array().map(|channel| (255.0 * channel + 0.5) as u8);
        [r, g, b, 255]
    };
    Pixels { width: width as u32, height: height as u32, rgba: (0..width * height).map(pixel).collect() }
}

fn texture(pixels: &Pixels) -> Result<Texture<'_>, SceneError> {
    Ok(Texture::srgb(SIZE[0], pixels.rgba.as_flattened())?)
}

/// Hangs a screen in a stage: `center` is its middle, and it faces +Z.
pub fn hang(stage: Stage, center: Vec3) -> Result<Stage, SceneError> {
    let Stage { scene, world, animation } = stage;
    let mut assembly = Assembly { scene, world };
    let [half_u, half_v] = [Vec3::X * HALF[0], Vec3::Y * HALF[1]];
    let surface = TexturedSurface::rectangle(Vec3::ZERO, half_u, half_v, Vec3::splat(WHITE));
    // Cut as a picture whose texels all differ is cut: evenly.
    let noisy: Vec<Vec3> = (0..SIZE[0] * SIZE[1]).map(|i| Vec3::splat(((i * 7919) % 1009) as f32)).collect();
    let parts = Texture::linear(SIZE[0], &noisy[..])?.split(&[surface], 0.0, PARTS);
    let images: Vec<Arc<Pixels>> = (0..FRAMES).map(|number| Arc::new(frame(number))).collect();
    let mut first = texture(&images[0])?;
    let tree = assembly.world.add_tree(LightTree::new(parts.iter().map(|part| first.light(part)).collect())?);
    assembly.world.add_instance(tree, Placement::at(center.as_dvec3()), Policy::Budgeted)?;
    let objects = images.iter().map(|image| add_picture(&mut assembly, image, center)).collect();
    add_frame(&mut assembly, center);
    let Assembly { scene, world } = assembly;
    let screen = Screen { rest: animation, tree, parts, objects, images, shown: FRAMES };
    Ok(Stage { scene, world, animation: Box::new(screen) })
}

/// Adds a rectangle that shows a picture, hidden.
fn add_picture(assembly: &mut Assembly, image: &Arc<Pixels>, center: Vec3) -> usize {
    let Scene { textures, materials, .. } = &mut assembly.scene;
    textures.push(SceneTexture {
        pixels: image.clone(),
        coordinates: 0,
        transform: Affine2::IDENTITY,
        wrap: [Wrap::Clamp; 2],
        is_nearest: true,
        is_srgb: true,
    });
    let (emission, base_color) = (Vec3::splat(WHITE), Vec3::splat(0.03));
    let emission_texture = Some(textures.len() as u32 - 1);
    materials.push(Material { emission, base_color, emission_texture, ..Material::default() });
    let mut part = Part::default();
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    part.quad(corners.map(|[x, y]| vec3(x * HALF[0], y * HALF[1], 0.0)), materials.len() as u32 - 1);
    let at = |[x, y]: [f32; 2]| Vec2::new(0.5 + 0.5 * x, 0.5 - 0.5 * y).xyxy();
    let [a, b, c, d] = corners.map(at);
    let mesh = assembly.mesh(Mesh { tex_coords: vec![[a, b, c], [a, c, d]], ..part.mesh });
    let object = assembly.object(mesh, Affine3A::from_translation(center));
    assembly.scene.objects[object].visible = false;
    object
}

/// Adds the back of the screen, with a rim, and two posts that carry it.
fn add_frame(assembly: &mut Assembly, center: Vec3) {
    let material = assembly.scene.materials.len() as u32;
    assembly.scene.materials.push(Material { base_color: Vec3::splat(0.04), roughness: 0.4, ..Material::default() });
    let mut part = Part::default();
    let rim = vec3(HALF[0] + RIM, HALF[1] + RIM, 0.0);
    part.cuboid(-rim - Vec3::Z * 0.4, rim - Vec3::Z * 0.02, material);
    for x in [-HALF[0] - 1.2, HALF[0] + 1.2] {
        part.column(vec3(x, -center.y, -0.2), center.y + HALF[1], [0.2, 0.14], 10, material);
    }
    part.beam(vec3(-HALF[0] - 1.2, HALF[1], -0.2), vec3(HALF[0] + 1.2, HALF[1], -0.2), 0.12, material);
    let mesh = assembly.mesh(part.mesh);
    assembly.object(mesh, Affine3A::from_translation(center));
}

impl Animation for Screen {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.rest.advance(time, scene, world)?;
        let number = (time * RATE) as usize % FRAMES;
        if number == self.shown {
            return Ok(());
        }
        self.shown = number;
        for (frame, object) in self.objects.iter().enumerate() {
            scene.objects[*object].visible = frame == number;
        }
        let mut texture = texture(&self.images[number])?;
        let lights: Vec<_> = self.parts.iter().map(|part| texture.light(part)).collect();
        Ok(world.set_light_range(self.tree, 0, &lights)?)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Object;
    use super::super::procedural::{CityOptions, Size, stage};
    use super::*;

    #[test]
    fn the_light_of_the_screen_is_that_of_the_frame_that_is_shown() {
        let city = stage(&CityOptions { size: Size::S, cars: Some(0), seed: 1, lamp_profile: None }).expect("a city");
        let mut stage = hang(city, vec3(0.0, 12.0, 60.0)).expect("a screen");
        let mut fluxes = Vec::new();
        for time in [0.0, 1.0, 2.5] {
            stage.animation.advance(time, &mut stage.scene, &mut stage.world).expect("a frame");
            stage.world.update(girandole::FrameBudget::NONE);
            let shown: Vec<&Object> = stage.scene.objects.iter().filter(|object| object.visible).collect();
            let textured = |object: &&&Object| {
                let material = stage.scene.meshes[object.mesh as usize].triangles[0].material;
                stage.scene.materials[material as usize].emission_texture
            };
            let pictures: Vec<u32> = shown.iter().filter_map(|object| textured(&object)).collect();
            assert_eq!(pictures.len(), 1);
            let mut image = texture(&stage.scene.textures[pictures[0] as usize].pixels).expect("a frame");
            let whole =
                TexturedSurface::rectangle(Vec3::ZERO, Vec3::X * HALF[0], Vec3::Y * HALF[1], Vec3::splat(WHITE));
            let expected = image.light(&whole).flux();
            let is_screen = |lights: &&[girandole::Light]| lights.len() > 300 && lights.len() <= PARTS;
            let trees = stage.world.trees().filter_map(|key| Some(stage.world.tree(key)?.lights()));
            let found: Vec<f32> =
                trees.filter(is_screen).map(|lights| lights.iter().map(girandole::Light::flux).sum()).collect();
            assert!(found.iter().any(|flux| (flux / expected - 1.0).abs() < 1.0e-3), "{found:?} {expected}");
            fluxes.push(expected);
        }
        assert!((fluxes[0] / fluxes[2] - 1.0).abs() > 0.01, "{fluxes:?}");
    }
}
