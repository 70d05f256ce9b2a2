//! Signs and films: surfaces that emit an image, cut into more and more parts.
//!
//! The noise is that of one sample of a matte surface without shadows, of the colour of the texel that it meets. The
//! baseline chooses texels by their brightness, whatever their distance and angle, as renderers do that warp by a
//! chain of mip maps.

use super::effort::Effort;
use girandole::glam::{Vec2, Vec3, vec3};
use girandole::light::luminance;
use girandole::{Light, LightId, LightTree, LightWorld, Placement, Policy, ShadingPoint};
use girandole_assets::AssetError;
use girandole_assets::texture::{Texture, TexturedSurface};
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use testbed::common::pcg::Rng;
use testbed::common::table::{Table, markdown_head, short};
use testbed::scene::SceneError;

const COLUMNS: [&str; 7] = ["image", "parts", "sigma_mean", "sigma_p95", "sample_ns", "cut_ms", "frame_ms"];

/// Columns and rows of the images.
const SIZE: [usize; 2] = [512, 256];
/// Half the width of the sign in metres; it is half as high.
const HALF: f32 = 4.0;
/// Nits of white.
const WHITE: f32 = 1000.0;
const PARTS: [usize; 5] = [1, 256, 1024, 4096, 16_384];
/// The relative noise of texels within parts, at which cutting ends.
const NOISE: f32 = 0.1;
const IMAGES: [&str; 3] = ["strokes, 5 % lit", "single texels, 5 % lit", "a film"];

/// An image of [`IMAGES`].
fn image(which: usize) -> Vec<Vec3> {
    let mut rng = Rng::new(45, 9);
    let [width, height] = SIZE;
    let mut texels = vec![Vec3::ZERO; width * height];
    let mut lit = 0;
    match which {
        0 => {
            while lit < texels.len() / 20 {
                let ([x, y], length) = ([rng.below(width - 32), rng.below(height - 32)], 4 + rng.below(28));
                let is_across = rng.below(2) == 0;
                for place in 0..4 * length {
                    let [a, b] = [place / 4, place % 4];
                    let texel = if is_across { width * (y + b) + x + a } else { width * (y + a) + x + b };
                    lit += usize::from(texels[texel] == Vec3::ZERO);
                    texels[texel] = vec3(1.0, 0.7, 0.2);
                }
            }
        }
        1 => texels.iter_mut().filter(|_| rng.unit() < 0.05).for_each(|texel| *texel = Vec3::ONE),
        _ => {
            // Soft shapes, edges and grain.
            for (i, texel) in texels.iter_mut().enumerate() {
                let at = Vec2::new((i % width) as f32, (i / width) as f32) / 40.0;
                let soft = 0.5 + 0.5 * (at.x + (0.7 * at.y).sin()).sin() * (at.y - 0.3 * at.x).cos();
                let edge = if (at - Vec2::new(5.0, 3.0)).length() < 1.5 { 0.9 } else { 0.1 };
                *texel = vec3(1.0, 0.8, 0.6) * (0.6 * soft.powi(3) + 0.3 * edge + 0.1 * rng.unit());
            }
        }
    }
    texels
}

fn surface() -> TexturedSurface {
    TexturedSurface::rectangle(
        vec3(0.0, 5.0, 0.0),
        vec3(HALF, 0.0, 0.0),
        vec3(0.0, 0.5 * HALF, 0.0),
        Vec3::splat(WHITE),
    )
}

/// The illuminance by a place on the sign, times the squared distance, over the luminance of its texel.
fn arriving(at: &ShadingPoint, place: Vec2) -> f32 {
    let point = vec3(HALF * (2.0 * place.x - 1.0), 5.0 + HALF * (place.y - 0.5), 0.0);
    let to = point - at.position;
    WHITE * (to.dot(at.normal).max(0.0) * to.z.abs()) / to.length_squared().powi(2)
}

/// The mean, and the relative standard deviation of a sample by texels.
fn by_texels(texels: &[Vec3], at: &ShadingPoint) -> (f64, f64) {
    let (mut light, mut sum, mut squares) = (0.0, 0.0, 0.0);
    let area = 2.0 * f64::from(HALF * HALF);
    for (i, color) in texels.iter().enumerate() {
        let row = SIZE[1] - 1 - i / SIZE[0];
        let place = Vec2::new((i % SIZE[0]) as f32 + 0.5, row as f32 + 0.5) / Vec2::new(SIZE[0] as f32, SIZE[1] as f32);
        let (weight, value) = (f64::from(luminance(*color)), f64::from(arriving(at, place)));
        light += weight;
        sum += weight * value;
        squares += weight * value * value;
    }
    let mean = sum / light;
    (mean * light * area / texels.len() as f64, (squares / light / (mean * mean) - 1.0).max(0.0).sqrt())
}

/// A sign in parts, alone in a world.
struct Sign<'a> {
    texture: Texture<'a>,
    parts: Vec<TexturedSurface>,
    world: LightWorld,
}

impl<'a> Sign<'a> {
    fn new(texels: &'a [Vec3], parts: usize) -> Result<Self, SceneError> {
        let mut texture = texture(texels)?;
        let parts = texture.split(&[surface()], NOISE, parts);
        let mut world = LightWorld::new();
        let tree = world.add_tree(LightTree::new(parts.iter().map(|part| texture.light(part)).collect())?);
        world.add_instance(tree, Placement::IDENTITY, Policy::Static)?;
        Ok(Self { texture, parts, world })
    }

    /// A sample of the illuminance, in lux, by the texel that it meets.
    fn sample(&self, at: &ShadingPoint, u: [f32; 4]) -> f32 {
        let sampler = self.world.sampler();
        sampler.sample(at, u).map_or(0.0, |sample| {
            let place = sampler.place_on_light(at, &sample).unwrap_or(Vec2::ZERO);
            let LightId::Local { light, .. } = sample.light else { return 0.0 };
            let color = self.texture.color(self.parts[light as usize].tex_coord(place));
            let cosine = sample.incident.direction.dot(at.normal).max(0.0);
            WHITE * luminance(color) * cosine / (sample.pmf * sample.incident.pdf)
        })
    }
}

fn texture(texels: &[Vec3]) -> Result<Texture<'_>, SceneError> {
    Texture::linear(SIZE[0], texels).map_err(|error: AssetError| SceneError(error.to_string()))
}

/// Points on the ground and on walls, from 2 to 30 m in front of the sign.
fn points(count: usize) -> Vec<ShadingPoint> {
    let mut rng = Rng::new(47, 2);
    let point = |i: usize| {
        let position = vec3(rng.range(-15.0, 15.0), rng.range(0.0, 3.0), rng.range(2.0, 30.0));
        ShadingPoint::surface(position, if i.is_multiple_of(2) { Vec3::Y } else { Vec3::NEG_Z })
    };
    (0..count).map(point).collect()
}

/// Measures all images, prints a table and writes it as CSV.
pub fn run(count: usize, effort: Effort, out: &Path) -> Result<(), SceneError> {
    let mut table = Table::create(out, &COLUMNS).map_err(SceneError)?;
    testbed::say!("{}", markdown_head(&COLUMNS).trim_end());
    let points = points(effort.select(count.min(40), 4));
    let (samples, rounds) = effort.select((100_000, 5), (100, 1));
    for (which, name) in IMAGES.into_iter().enumerate() {
        let texels = image(which);
        let mut add = |parts: String, mut sigmas: Vec<f64>, times: [Option<f64>; 3]| {
            sigmas.sort_by(f64::total_cmp);
            let mean = sigmas.iter().sum::<f64>() / sigmas.len() as f64;
            let p95 = sigmas[(sigmas.len() * 95 / 100).min(sigmas.len() - 1)];
            let [ns, cut, frame] = times.map(|time| time.map_or_else(String::new, short));
            let row = [name.to_owned(), parts, short(mean), short(p95), ns, cut, frame];
            testbed::say!("| {} |", row.join(" | "));
            table.add(&row).map_err(SceneError)
        };
        for most in effort.select(&PARTS[..], &PARTS[..2]) {
            let mut sign = Sign::new(&texels, *most)?;
            let mut rng = Rng::new(48, 4);
            let mut ns = f64::INFINITY;
            let sigma = |at: &ShadingPoint| {
                let (mean, _) = by_texels(&texels, at);
                let mut squares = 0.0;
                let start = Instant::now();
                for _ in 0..samples {
                    let value = f64::from(sign.sample(at, [(); 4].map(|()| rng.unit())));
                    squares += value * value;
                }
                ns = ns.min(start.elapsed().as_secs_f64() * 1.0e9 / f64::from(samples));
                (squares / f64::from(samples) / (mean * mean) - 1.0).max(0.0).sqrt()
            };
            let sigmas: Vec<f64> = points.iter().map(sigma).collect();
            let fastest = |run: &mut dyn FnMut()| {
                let times = (0..rounds).map(|_| {
                    let start = Instant::now();
                    run();
                    start.elapsed().as_secs_f64() * 1.0e3
                });
                times.fold(f64::INFINITY, f64::min)
            };
            let cut = fastest(&mut || {
                black_box(texture(&texels).map(|mut texture| texture.split(&[surface()], NOISE, *most)).ok());
            });
            // What another frame of a film costs: its averages, and a refit.
            let tree = sign.world.trees().next();
            let frame = fastest(&mut || {
                let Ok(mut frame) = texture(&texels) else { return };
                let lights: Vec<Light> = sign.parts.iter().map(|part| frame.light(part)).collect();
                let _ = black_box(tree.map(|tree| sign.world.set_light_range(tree, 0, &lights)));
                black_box(sign.world.update(girandole::FrameBudget::NONE));
            });
            add(sign.parts.len().to_string(), sigmas, [Some(ns), Some(cut), Some(frame)])?;
        }
        add("texels by brightness".to_owned(), points.iter().map(|at| by_texels(&texels, at).1).collect(), [None; 3])?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_have_the_mean_of_the_texels() {
        let texels = image(0);
        let sign = Sign::new(&texels, 256).expect("a valid sign");
        let mut rng = Rng::new(3, 3);
        for at in points(2) {
            let (mean, _) = by_texels(&texels, &at);
            let count = 200_000;
            let values: Vec<f64> =
                (0..count).map(|_| f64::from(sign.sample(&at, [(); 4].map(|()| rng.unit()))) / mean).collect();
            let found = values.iter().sum::<f64>() / f64::from(count);
            let variance = values.iter().map(|value| (value - found).powi(2)).sum::<f64>() / f64::from(count);
            // Four standard errors.
            assert!((found - 1.0).abs() < 4.0 * (variance / f64::from(count)).sqrt(), "{found} {variance}");
        }
    }
}
