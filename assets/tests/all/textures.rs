//! Surfaces that emit an image: averages, parts, means against a sum over texels, and noise.

use girandole_assets::AssetError;
use girandole_assets::girandole::glam::{Vec2, Vec3};
use girandole_assets::girandole::light::luminance;
use girandole_assets::girandole::{Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};
use girandole_assets::texture::{Texture, TextureWrap, TexturedSurface};

use testbed::testing::support::Rng;

/// A billboard of 256 x 64 texels: strokes of three texels on a dark ground, 5 % of it.
fn billboard() -> Vec<Vec3> {
    let mut texels = vec![Vec3::ZERO; 256 * 64];
    let mut rng = Rng(4501);
    let mut lit = 0;
    while lit < texels.len() / 20 {
        let [x, y] = [4 + rng.below(244), 4 + rng.below(56)];
        let is_across = rng.below(2) == 0;
        for along in 0..rng.below(12) {
            for width in 0..3 {
                let [x, y] = if is_across { [x + along, y + width] } else { [x + width, (y + along).min(63)] };
                let texel = &mut texels[256 * y + x.min(255)];
                lit += usize::from(*texel == Vec3::ZERO);
                *texel = Vec3::new(1.0, 0.7, 0.2);
            }
        }
    }
    texels
}

/// The sign, 8 m wide and 2 m high, in the plane of x and y; white has 1,000 nits.
fn sign() -> TexturedSurface {
    TexturedSurface::rectangle(Vec3::new(0.0, 4.0, 0.0), 4.0 * Vec3::X, Vec3::Y, Vec3::splat(1000.0))
}

fn world_of(lights: Vec<Light>) -> LightWorld {
    let mut world = LightWorld::new();
    let tree = world.add_tree(LightTree::new(lights).expect("valid"));
    world.add_instance(tree, Placement::IDENTITY, Policy::Static).expect("valid");
    world
}

/// The illuminance by the sign, summed over texels: each is small beside its distance.
fn lux_of_sum(texels: &[Vec3], at: &ShadingPoint) -> f64 {
    let mut sum = 0.0;
    for (texel, color) in texels.iter().enumerate().filter(|(_, color)| **color != Vec3::ZERO) {
        let place = Vec2::new((texel % 256) as f32 + 0.5, 63.5 - (texel / 256) as f32) / Vec2::new(256.0, 64.0);
        let point = Vec3::new(8.0 * place.x - 4.0, 3.0 + 2.0 * place.y, 0.0);
        let to = point - at.position;
        let cosines = f64::from(to.z.abs() * to.dot(at.normal)) / f64::from(to.length()).powi(4);
        sum += 1000.0 * f64::from(luminance(*color)) * cosines * (16.0 / texels.len() as f64);
    }
    sum
}

/// The mean of a sample's illuminance, of the colour of the texel that it meets, and its relative standard deviation.
fn measured(parts: &[TexturedSurface], texture: &mut Texture<'_>, at: &ShadingPoint, count: u32) -> (f64, f64) {
    let world = world_of(parts.iter().map(|part| texture.light(part)).collect());
    let sampler = world.sampler();
    let mut rng = Rng(4502);
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..count {
        let Some(sample) = sampler.sample(at, [rng.unit(), rng.unit(), rng.unit(), rng.unit()]) else { continue };
        let girandole::LightId::Local { light, .. } = sample.light else { continue };
        let place = sampler.place_on_light(at, &sample).expect("a rectangle");
        let color = texture.color(parts[light as usize].tex_coord(place));
        let cosine = at.normal.dot(sample.incident.direction);
        let lux = 1000.0 * f64::from(luminance(color) * cosine / (sample.pmf * sample.incident.pdf));
        sum += lux;
        squares += lux * lux;
    }
    let mean = sum / f64::from(count);
    (mean, (squares / f64::from(count) / (mean * mean) - 1.0).max(0.0).sqrt())
}

/// Fixed seeds; the false-alarm rate of each mean is 0.3 %.
#[test]
fn parts_of_a_billboard_have_the_mean_of_its_texels_and_a_third_of_the_noise() {
    let texels = billboard();
    let mut texture = Texture::linear(256, &texels[..]).expect("sound");
    let parts = texture.split(&[sign()], 0.3, 1024);
    for (position, normal) in [(Vec3::new(1.0, 0.0, 6.0), Vec3::Y), (Vec3::new(-9.0, 2.0, 5.0), Vec3::X)] {
        let at = ShadingPoint::surface(position, normal);
        let expected = lux_of_sum(&texels, &at);
        let count = 400_000;
        let (mean, sigma) = measured(&parts, &mut texture, &at, count);
        let error = sigma / f64::from(count).sqrt();
        assert!(error < 0.002, "{error}");
        assert!((mean / expected - 1.0).abs() < 3.0 * error + 1.0e-4, "{mean} instead of {expected}");
        let (_, of_average) = measured(&[sign()], &mut texture, &at, count);
        assert!(sigma < of_average / 3.0, "{sigma} of {of_average}");
    }
}

#[test]
fn parts_cover_their_surface_and_each_lit_texel_lies_in_one_that_shines() {
    let texels = billboard();
    let mut texture = Texture::linear(256, &texels[..]).expect("sound");
    let vertices = [Vec3::ZERO, Vec3::new(3.0, 0.0, 1.0), Vec3::new(1.0, 2.0, 0.0)];
    let corners = [Vec2::new(0.1, 0.9), Vec2::new(0.9, 0.8), Vec2::new(0.4, 0.05)];
    let triangle = TexturedSurface::triangle(vertices, corners, Vec3::splat(50.0)).expect("finite").two_sided();
    for surface in [sign(), triangle] {
        let whole = texture.light(&surface);
        let parts = texture.split(&[surface], 0.3, 400);
        let lights: Vec<Light> = parts.iter().map(|part| texture.light(part)).collect();
        let sum = |of: fn(&Light) -> f32| lights.iter().map(|light| f64::from(of(light))).sum::<f64>();
        let area = sum(|light| light.area().unwrap_or(0.0)) / f64::from(whole.area().unwrap_or(0.0));
        assert!((area - 1.0).abs() < 1.0e-5, "{area}");
        let flux = sum(Light::flux) / f64::from(whole.flux());
        // The whole is averaged over a copy that is reduced to 128 columns.
        assert!((flux - 1.0).abs() < 0.02, "{flux}");
        let mut rng = Rng(4503);
        for (part, light) in parts.iter().zip(&lights) {
            for _ in 0..20 {
                let [x, y] = [rng.unit(), rng.unit()];
                let place = if matches!(light.shape, girandole::Shape::Triangle { .. }) && x + y > 1.0 {
                    Vec2::new(1.0 - x, 1.0 - y)
                } else {
                    Vec2::new(x, y)
                };
                let is_lit = texture.color(part.tex_coord(place)) != Vec3::ZERO;
                assert!(!is_lit || light.flux() > 0.0, "{part:?} {place}");
            }
        }
    }
}

#[test]
fn surfaces_are_cut_until_little_noise_is_left_and_never_into_more_parts_than_asked_for() {
    let texels = billboard();
    let mut texture = Texture::linear(256, &texels[..]).expect("sound");
    let count = |texture: &mut Texture<'_>, noise: f32, most: usize| texture.split(&[sign(); 2], noise, most).len();
    for (most, expected) in [(0, 2), (1, 2), (2, 2), (4, 2), (5, 5), (7, 5), (8, 8), (50, 50), (500, 500)] {
        assert_eq!(count(&mut texture, 0.0, most), expected, "{most}");
    }
    let [rough, fine] = [0.5, 0.1].map(|noise| count(&mut texture, noise, 1 << 16));
    assert!(rough < fine && fine < 12_000, "{rough} {fine}");
    // An even texture is never cut, nor is a black one, nor one of no extent.
    for color in [Vec3::ZERO, Vec3::splat(0.3)] {
        let even = vec![color; 4096];
        assert_eq!(Texture::linear(64, &even[..]).expect("sound").split(&[sign()], 0.0, 100).len(), 1);
    }
    let point = sign().with_tex_coords([Vec2::ONE; 3]).expect("finite");
    assert_eq!(texture.split(&[point], 0.0, 100).len(), 1);
    let thin = TexturedSurface::rectangle(Vec3::ZERO, Vec3::X, Vec3::ZERO, Vec3::ONE);
    assert_eq!(texture.split(&[thin], 0.0, 100).len(), 1);
    assert!(texture.split(&[], 0.0, 100).is_empty());
}

#[test]
fn a_rectangle_shows_its_image_upright_and_turned_as_its_coordinates_say() {
    // Red, green; blue, white.
    let texels = [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE];
    let mut texture = Texture::linear(2, &texels[..]).expect("sound").with_wrap([TextureWrap::Clamp; 2]);
    let surface = TexturedSurface::rectangle(Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE);
    let quarters = texture.split(&[surface], 0.0, 4);
    assert_eq!(quarters.len(), 4);
    for part in quarters {
        let light = texture.light(&part);
        let girandole::Shape::Rectangle { center, .. } = light.shape else { panic!("a rectangle") };
        let expected = texels[usize::from(center.x > 0.0) + 2 * usize::from(center.y < 0.0)];
        assert_eq!(light.emission, expected, "{center}");
    }
    // A square that stands on a corner of the image has a quarter of its area in each texel, or so.
    let tilted = [Vec2::new(0.5, 0.0), Vec2::new(1.0, 0.5), Vec2::new(0.0, 0.5)];
    let mean = texture.light(&surface.with_tex_coords(tilted).expect("finite")).emission;
    assert!(mean.abs_diff_eq(Vec3::splat(0.5), 1.0e-6), "{mean}");
}

#[test]
fn bad_textures_are_refused() {
    let says = |refused: Result<Texture<'_>, AssetError>, beginning: &str| {
        let error = refused.expect_err(beginning);
        assert!(error.code() == 700 && error.to_string().starts_with(beginning), "{error}");
    };
    says(Texture::linear(0, vec![]), "0 texels are not 1 to 32768 whole rows of 0");
    says(Texture::linear(3, vec![Vec3::ONE; 4]), "4 texels are not 1 to 32768 whole rows of 3");
    says(Texture::srgb(1, vec![0; 7]), "0 texels are not");
    assert!(Texture::srgb(1 << 15, vec![0; 4 << 15]).is_ok());
    says(Texture::srgb((1 << 15) + 1, vec![0; (4 << 15) + 4]), "32769 texels are not");
    for bad in [-1.0, f32::NAN, f32::INFINITY, 2.0e15] {
        says(Texture::linear(1, vec![Vec3::ONE, Vec3::new(0.0, bad, 0.0)]), "texel 1 is ");
    }
    let bad = TexturedSurface::triangle([Vec3::ZERO; 3], [Vec2::ZERO, Vec2::NAN, Vec2::ZERO], Vec3::ONE);
    assert!(bad.expect_err("no coordinate").to_string().ends_with("are not finite"));
}
