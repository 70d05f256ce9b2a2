use std::f32::consts::PI;

use glam::Vec3;

use super::patches::{PATCHES, Patch};
use super::{MAX_SIZE, Sky};
use crate::error::SkyError;
use crate::light::luminance;
use crate::tree::testing::Rng;

/// A map with clouds, black texels and a sun of one texel.
pub(crate) fn cloudy(size: [usize; 2], seed: u64) -> Vec<Vec3> {
    let mut rng = Rng(seed);
    let mut pixels: Vec<Vec3> = (0..size[0] * size[1])
        .map(|_| match rng.unit() {
            dark if dark < 0.2 => Vec3::ZERO,
            bright => Vec3::new(0.3, 0.6, 1.0) * 2000.0 * bright.powi(4),
        })
        .collect();
    pixels[size[0] * (size[1] / 4) + size[0] / 3] = Vec3::splat(2.0e6);
    pixels
}

fn sky(size: [usize; 2], seed: u64) -> Sky {
    Sky::equirectangular(size[0], &cloudy(size, seed)).expect("sound pixels")
}

/// The direction of the middle of a texel.
fn middle(sky: &Sky, x: usize, y: usize) -> Vec3 {
    sky.levels.direction([x as f32 + 0.5, y as f32 + 0.5])
}

#[test]
fn each_lit_texel_lies_in_one_patch_and_is_chosen_in_proportion_to_its_light() {
    for (size, seed) in [([1, 1], 0), ([2, 1], 1), ([5, 3], 2), ([64, 32], 3), ([200, 90], 4), ([512, 256], 5)] {
        let sky = sky(size, seed);
        assert!((1..=PATCHES).contains(&sky.patches.len()), "{size:?}: {}", sky.patches.len());
        let mut parts = vec![0.0_f64; sky.patches.len()];
        for y in 0..size[1] {
            let theta = |row: usize| PI * row as f32 / size[1] as f32;
            let angle = 2.0 * PI / size[0] as f32 * (theta(y).cos() - theta(y + 1).cos());
            for x in 0..size[0] {
                let direction = middle(&sky, x, y);
                let holders = sky.patches.iter().filter(|patch| patch.place.contains([x, y])).count();
                let radiance = sky.radiance(direction);
                match sky.point(direction) {
                    Some((patch, point)) => {
                        assert!(radiance == point.radiance && holders == 1);
                        assert!(point.pdf > 0.0, "{size:?} {x} {y}");
                        parts[patch as usize] += f64::from(point.pdf * angle);
                        let Patch { mean, radius, .. } = sky.patches[patch as usize];
                        assert!(mean.distance(direction) <= radius);
                    }
                    None => assert!(radiance == Vec3::ZERO),
                }
            }
        }
        for part in parts {
            assert!((part - 1.0).abs() < 1.0e-4, "{size:?}: {part}");
        }
    }
}

#[test]
fn directions_of_a_patch_are_those_that_its_density_says() {
    let sky = sky([300, 150], 7);
    let mut rng = Rng(8);
    let mut wrong = 0;
    for patch in 0..sky.patches.len() as u32 {
        let place = sky.patches[patch as usize];
        let (count, mut angle) = (200, 0.0);
        for i in 0..count {
            let u = [(i as f32 + rng.unit()) / count as f32, rng.unit()];
            let point = sky.sample(patch, u).expect("a patch");
            assert!((point.direction.length() - 1.0).abs() < 1.0e-6);
            assert!(point.direction.distance(place.mean) <= place.radius);
            // The border of a texel belongs to either.
            wrong += usize::from(sky.point(point.direction).is_none_or(|(_, other)| other.pdf != point.pdf));
            angle += luminance(point.radiance) / point.pdf / count as f32;
        }
        assert!((angle / place.lux - 1.0).abs() < 1.0e-4);
    }
    assert!(wrong <= 20 * sky.patches.len() / 1000 + 5, "{wrong}");
    assert!(sky.sample(sky.patches.len() as u32, [0.5, 0.5]).is_none());
}

#[test]
fn points_of_a_texel_are_spread_evenly_over_its_solid_angle() {
    // One texel at the zenith, and one beside the horizon.
    for row in [0, 7] {
        let mut pixels = vec![Vec3::ZERO; 32 * 16];
        pixels[32 * row + 3] = Vec3::ONE;
        let sky = Sky::equirectangular(32, &pixels).expect("sound pixels");
        assert_eq!(sky.patches.len(), 1);
        let cosines = (0..1000).map(|i| sky.sample(0, [0.5, (i as f32 + 0.5) / 1000.0]).expect("lit").direction.y);
        let step = PI / 16.0;
        let [top, bottom] = [row as f32, row as f32 + 1.0].map(|row| (step * row).cos());
        let sum: f32 = cosines.sum();
        assert!((sum / 1000.0 - 0.5 * (top + bottom)).abs() < 1.0e-4, "{row}");
    }
}

#[test]
fn a_sun_gets_a_patch_of_its_own() {
    let size = [256, 128];
    let sky = sky(size, 9);
    let sun = [size[0] / 3, size[1] / 4];
    let patch = sky.patches.iter().find(|patch| patch.place.contains(sun)).expect("it is lit");
    assert_eq!(patch.place.level, 0);
}

#[test]
fn a_part_that_changes_leaves_what_a_new_map_has() {
    let size = [70, 40];
    let mut pixels = cloudy(size, 10);
    let mut sky = Sky::equirectangular(size[0], &pixels).expect("sound pixels");
    let mut rng = Rng(11);
    for step in 0..20 {
        let corner = size.map(|side| (rng.unit() * side as f32) as usize);
        let part = [0, 1].map(|k| (rng.unit() * (size[k] - corner[k] + 1) as f32) as usize);
        // Much brighter than all before in the end.
        let bright = if step == 19 { 1.0e9 } else { 1.0e3 };
        let new: Vec<Vec3> = (0..part[0] * part[1]).map(|_| Vec3::splat(bright * rng.unit())).collect();
        sky.set_part(corner, part, &new).expect("within the map");
        for y in 0..part[1] {
            for x in 0..part[0] {
                pixels[size[0] * (corner[1] + y) + corner[0] + x] = new[part[0] * y + x];
            }
        }
        let greatest = pixels.iter().fold(0.0_f32, |greatest, pixel| greatest.max(pixel.max_element()));
        for (i, pixel) in pixels.iter().enumerate() {
            let found = sky.radiance(middle(&sky, i % size[0], i / size[0]));
            let error = (found - *pixel).abs().max_element();
            assert!(error <= pixel.max_element() / 500.0 + greatest * 2.0_f32.powi(-30), "{step} {pixel} {found}");
        }
        // No patch is older than its texels.
        assert!(sky.patches.iter().all(|patch| patch.lux == sky.levels.lux(patch.place)), "{step}");
        let total: f32 = sky.patches.iter().map(|patch| patch.lux).sum();
        let fresh = Sky::equirectangular(size[0], &pixels).expect("sound pixels");
        let expected: f32 = fresh.patches.iter().map(|patch| patch.lux).sum();
        assert!((total / expected - 1.0).abs() < 1.0e-3, "{total} {expected}");
    }
}

#[test]
fn what_is_no_map_is_refused() {
    let some = vec![Vec3::ONE; 12];
    assert!(Sky::equirectangular(4, &some).is_ok_and(|sky| sky.size() == [4, 3]));
    for width in [0, 5, 13, usize::MAX] {
        assert!(matches!(Sky::equirectangular(width, &some), Err(SkyError::Size { .. })), "{width}");
    }
    assert!(matches!(Sky::equirectangular(1, &[]), Err(SkyError::Size { .. })));
    for side in [MAX_SIZE, MAX_SIZE + 1, 10 * MAX_SIZE] {
        let row = vec![Vec3::ONE; side];
        assert_eq!(Sky::equirectangular(side, &row).is_ok(), side <= MAX_SIZE);
        assert_eq!(Sky::equirectangular(1, &row).is_ok(), side <= MAX_SIZE);
    }
    for value in [-1.0, f32::NAN, f32::INFINITY, 1.0e16] {
        let mut pixels = some.clone();
        pixels[7].y = value;
        let error = Sky::equirectangular(4, &pixels).expect_err("a bad pixel");
        assert!(matches!(error, SkyError::Pixel { pixel: 7, .. }) && error.code() == 1301, "{error}");
    }
    let mut sky = Sky::equirectangular(4, &some).expect("sound pixels");
    for (corner, size, count) in [
        ([3, 0], [2, 1], 2),
        ([0, 3], [1, 1], 1),
        ([0, 0], [2, 2], 3),
        ([usize::MAX, 0], [2, 1], 2),
        ([0, 0], [usize::MAX, 2], 2),
    ] {
        assert!(matches!(sky.set_part(corner, size, &some[..count]), Err(SkyError::Part { .. })), "{corner:?}");
    }
    assert!(sky.set_part([0, 0], [0, 0], &[]).is_ok() && sky.set_part([3, 2], [1, 1], &some[..1]).is_ok());
    assert!(sky.set_part([0, 0], [1, 1], &[Vec3::NAN]).is_err());
    assert_eq!(sky.radiance(Vec3::NAN), sky.radiance(Vec3::ZERO));
}

#[test]
fn a_black_map_has_no_patches_and_a_dark_one_keeps_its_digits() {
    assert!(Sky::equirectangular(8, &[Vec3::ZERO; 32]).expect("sound pixels").patches.is_empty());
    for radiance in [1.0e-30, 1.0e-6, 1.0e15] {
        let sky = Sky::equirectangular(8, &[Vec3::splat(radiance); 32]).expect("sound pixels");
        assert!((sky.radiance(Vec3::X).x / radiance - 1.0).abs() < 2.0e-3, "{radiance}");
    }
}

/// The direction of a place on an octahedral map, from -1 to 1 along both axes, and the solid angle of a unit of area.
fn of_octahedral([u, v]: [f32; 2]) -> (Vec3, f32) {
    let y = 1.0 - u.abs() - v.abs();
    // Below the horizon, the square is mirrored at the diagonal of its quarter.
    let [x, z] = if y >= 0.0 { [u, v] } else { [(1.0 - v.abs()).copysign(u), (1.0 - u.abs()).copysign(v)] };
    let point = Vec3::new(x, y, z);
    (point.normalize(), point.length().powi(-3))
}

#[test]
fn octahedral_maps_have_the_zenith_in_the_middle_and_the_nadir_in_the_corners() {
    // Colours by place: the middle, the corners, and the sides to the right and at the bottom.
    let width = 64;
    let at = |i: usize| [i % width, i / width].map(|k| (k as f32 + 0.5) / width as f32 * 2.0 - 1.0);
    let pixels: Vec<Vec3> = (0..width * width).map(|i| Vec3::new(2.0 + at(i)[0], 2.0 + at(i)[1], 1.0)).collect();
    let sky = Sky::octahedral(width, &pixels).expect("sound pixels");
    assert_eq!(sky.size(), [2 * width, width]);
    for (direction, [u, v]) in [
        (Vec3::Y, [0.0, 0.0]),
        (Vec3::X, [1.0, 0.0]),
        (Vec3::NEG_X, [-1.0, 0.0]),
        (Vec3::Z, [0.0, 1.0]),
        (Vec3::NEG_Z, [0.0, -1.0]),
        (Vec3::new(1.0, -20.0, 1.0), [20.0 / 22.0, 20.0 / 22.0]),
        (Vec3::new(-1.0, -20.0, 1.0), [-20.0 / 22.0, 20.0 / 22.0]),
        (Vec3::new(2.0, 1.0, -1.0), [0.5, -0.25]),
        (Vec3::new(2.0, -1.0, -1.0), [0.75, -0.5]),
    ] {
        let expected = Vec3::new(2.0 + u, 2.0 + v, 1.0);
        assert!((sky.radiance(direction) - expected).length() < 0.1, "{direction}: {}", sky.radiance(direction));
    }
}

#[test]
fn octahedral_maps_keep_their_pixels_and_their_light() {
    let even = Sky::octahedral(9, &[Vec3::new(3.0, 2.0, 1.0); 81]).expect("sound pixels");
    let mut rng = Rng(12);
    for _ in 0..1000 {
        let found = even.radiance(rng.position(1.0));
        assert!((found - Vec3::new(3.0, 2.0, 1.0)).abs().max_element() < 0.01, "{found}");
    }
    // Squares of 8 x 8 pixels, whose middles are away from borders.
    let (blocks, width) = (12, 96);
    for seed in 13..16 {
        let mut rng = Rng(seed);
        let colors: Vec<Vec3> = (0..blocks * blocks).map(|_| Vec3::splat(1000.0 * rng.unit().powi(3))).collect();
        let pixel = |i: usize| colors[i / width / 8 * blocks + i % width / 8];
        let pixels: Vec<Vec3> = (0..width * width).map(pixel).collect();
        let sky = Sky::octahedral(width, &pixels).expect("sound pixels");
        let (mut light, points) = (0.0, 8 * width);
        for i in 0..points * points {
            let at = [i % points, i / points].map(|k| (k as f32 + 0.5) / points as f32 * 2.0 - 1.0);
            let (direction, angle) = of_octahedral(at);
            let source = pixels[i / points / 8 * width + i % points / 8];
            light += f64::from(luminance(source) * angle) * 4.0 / (points * points) as f64;
            // Within the inner half of a square.
            if [i % points, i / points].iter().all(|k| (16..48).contains(&(k % 64))) {
                let found = sky.radiance(direction);
                assert!((found - source).abs().max_element() < 0.01 * source.x + 0.01, "{at:?} {found} {source}");
            }
        }
        let kept: f64 = sky.patches.iter().map(|patch| f64::from(patch.lux)).sum();
        assert!((kept / light - 1.0).abs() < 2.0e-3, "{kept} {light}");
    }
}

#[test]
fn the_light_of_a_small_sun_in_an_octahedral_map_is_kept() {
    let width = 128;
    let mut rng = Rng(17);
    let errors = (0..40).map(|_| {
        let sun = [0; 2].map(|_| rng.below(width));
        let mut pixels = vec![Vec3::ZERO; width * width];
        pixels[sun[1] * width + sun[0]] = Vec3::splat(1.0e6);
        let of_points = (0..256).map(|i| {
            let at = [i % 16, i / 16].map(|k| (k as f32 + 0.5) / 16.0);
            of_octahedral([0, 1].map(|k| (sun[k] as f32 + at[k]) / width as f32 * 2.0 - 1.0)).1
        });
        let light = 1.0e6 * of_points.sum::<f32>() / 256.0 * 4.0 / (width * width) as f32;
        let kept: f32 = Sky::octahedral(width, &pixels).expect("sound").patches.iter().map(|patch| patch.lux).sum();
        (kept / light - 1.0).powi(2)
    });
    // The root of the mean square is 0.03 over all places.
    let error = (errors.sum::<f32>() / 40.0).sqrt();
    assert!(error < 0.06, "{error}");
}

#[test]
fn what_is_no_octahedral_map_is_refused() {
    for (width, count) in [(0, 0), (3, 6), (3, 12), (4, 12), (usize::MAX, 1), (20_000, 1)] {
        let error = Sky::octahedral(width, &vec![Vec3::ONE; count]).expect_err("no square");
        assert!(matches!(error, SkyError::Size { max: 16_384, .. }) && error.code() == 1300, "{width}: {error}");
    }
    for value in [-1.0, f32::NAN, 1.0e16] {
        let mut pixels = [Vec3::ONE; 9];
        pixels[7].z = value;
        let error = Sky::octahedral(3, &pixels).expect_err("a bad pixel");
        assert!(matches!(error, SkyError::Pixel { pixel: 7, .. }), "{error}");
    }
    // The mean of the brightest pixels is none brighter.
    assert!(Sky::octahedral(5, &[Vec3::splat(crate::light::MAX_EMISSION); 25]).is_ok());
    assert_eq!(Sky::octahedral(1, &[Vec3::ONE]).expect("a pixel").size(), [2, 1]);
}
