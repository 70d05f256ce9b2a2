//! Merged and placed clusters.

use glam::{DVec3, Mat3, Vec3};

use super::{direction, exact, size, turn};
use crate::cluster::bounds::Aabb;
use crate::cluster::cone::CAP_PADDING;
use crate::cluster::{Cluster, Linear};
use crate::f64_reference::ROUNDING;
use crate::f64_reference::merge::{angle, merged};
use crate::f64_reference::place::placed;
use crate::tree::testing::Rng;
use crate::tree::{WIDTH, WideCluster};
use testbed::measuring::reference::place::Map;

/// A random cluster whose box has this extent, about a centre.
fn cluster(rng: &mut Rng, center: Vec3, extent: f32) -> Cluster {
    let corners = [0, 1].map(|_| center + rng.position(0.5 * extent));
    let aabb = Aabb::around(corners);
    let mean = corners[0].lerp(corners[1], rng.unit()).clamp(aabb.min, aabb.max);
    let flux = size(rng, -12.0, 12.0);
    let length = [0.0, 2.0 / 3.0, rng.unit(), 0.9999][rng.below(4)];
    let area_flux = flux * rng.unit();
    Cluster {
        aabb,
        flux,
        area_flux,
        punctual_flux: flux - area_flux,
        mean,
        variance: 0.25 * rng.unit() * aabb.extent().length_squared(),
        axis: direction(rng) * length,
        cos_half_angle: if length > 0.0 { rng.between(-1.0, 1.0) } else { -1.0 },
        range: f32::INFINITY,
    }
}

/// The largest error of each quantity, in the unit of its bound.
#[derive(Debug, Default)]
struct Errors {
    flux: f64,
    mean: f64,
    variance: f64,
    axis: f64,
    too_narrow: f64,
    too_wide: f64,
}

#[test]
fn merged_clusters_have_the_moments_and_the_caps_of_sums_in_f64() {
    let mut rng = Rng(500);
    let mut most = Errors::default();
    let mut caps = 0;
    for _ in 0..60_000 {
        let center = direction(&mut rng) * if rng.below(4) == 0 { 0.0 } else { size(&mut rng, -3.0, 9.0) };
        let extent = size(&mut rng, -6.0, 6.0);
        let count = 1 + rng.below(WIDTH);
        // A third of the groups agree in their directions, as beams do.
        let (axis, agree) = (direction(&mut rng), rng.below(3) == 0);
        let clusters: Vec<Cluster> = (0..count)
            .map(|_| {
                let spread = extent * rng.unit();
                let place = center + rng.position(0.5 * extent);
                let mut one = cluster(&mut rng, place, spread);
                if agree && one.axis != Vec3::ZERO {
                    let scatter = direction(&mut rng) * size(&mut rng, -6.0, -1.0);
                    one.axis = (axis + scatter).normalize() * one.axis.length();
                    one.cos_half_angle = size(&mut rng, -4.0, 0.0).cos();
                }
                one
            })
            .collect();
        let mut wide = WideCluster::EMPTY;
        clusters.iter().enumerate().for_each(|(lane, cluster)| wide.set(lane, cluster));
        let (ours, exact_one) = (wide.merged().cluster, merged(&clusters));
        let note = |error: &mut f64, value: f64| *error = error.max(value);
        note(&mut most.flux, (f64::from(ours.flux) / exact_one.flux - 1.0).abs() / ROUNDING);
        note(&mut most.flux, (f64::from(ours.area_flux) / exact_one.area_flux - 1.0).abs() / ROUNDING);
        // Roundings of a coordinate, and of a length inside of the box.
        let extent = exact(ours.aabb.extent()).length();
        let coordinate = exact(ours.aabb.min).abs().max(exact(ours.aabb.max).abs()).max_element();
        let unit = ROUNDING * (coordinate + extent);
        note(&mut most.mean, (exact(ours.mean) - exact_one.mean).abs().max_element() / unit);
        // The variance is a mean of squares: its root is a length.
        let deviation = f64::from(ours.variance).sqrt() - exact_one.variance.sqrt();
        note(&mut most.variance, deviation.abs() / (unit + ROUNDING * extent));
        note(&mut most.axis, exact(ours.axis).distance(exact_one.axis) / ROUNDING);
        // The cap holds that of the exact mean direction, turned to our own.
        if ours.cos_half_angle > -1.0 {
            caps += 1;
            let turned = angle(exact(ours.axis), exact_one.axis);
            let half_angle = f64::from(ours.cos_half_angle).acos();
            note(&mut most.too_narrow, (exact_one.half_angle - turned - half_angle).max(0.0));
            let excess =
                (exact_one.half_angle + turned).min(std::f64::consts::PI).cos() - f64::from(ours.cos_half_angle);
            note(&mut most.too_wide, excess);
        } else {
            // All directions are the answer only where the cap reaches nearly that far.
            let reach = exact_one.half_angle + angle(exact(ours.axis), exact_one.axis);
            note(&mut most.too_wide, reach.min(std::f64::consts::PI).cos() + 1.0);
        }
    }
    // Seven additions in three steps, after one product each.
    assert!(most.flux < 4.0 && most.axis < 6.0, "{most:?}");
    // An ulp of the largest coordinate, or half of that for a deviation.
    assert!(most.mean < 2.0 && most.variance < 1.0, "{most:?}");
    // The padding of caps covers all rounding, and nothing but rounding is added to it.
    assert!(most.too_narrow == 0.0 && most.too_wide < f64::from(CAP_PADDING) + 1.0e-6, "{most:?}");
    assert!(caps > 10_000, "{caps}");
}

#[test]
fn placed_clusters_have_the_moments_and_caps_of_the_same_maps_in_f64() {
    let mut rng = Rng(501);
    let mut most = Errors::default();
    for i in 0..40_000 {
        let extent = size(&mut rng, -3.0, 3.0);
        let middle = rng.position(extent);
        let one = cluster(&mut rng, middle, extent);
        let stretch = |rng: &mut Rng| size(rng, -1.0, 1.0);
        let linear = match i % 4 {
            0 => turn(&mut rng),
            1 => turn(&mut rng) * size(&mut rng, -6.0, 6.0),
            2 => {
                let diagonal = Vec3::new(-stretch(&mut rng), stretch(&mut rng), stretch(&mut rng));
                turn(&mut rng) * Mat3::from_diagonal(diagonal) * turn(&mut rng)
            }
            _ => turn(&mut rng) * Mat3::from_cols(Vec3::X, Vec3::new(rng.between(-1.0, 1.0), 1.0, 0.0), Vec3::Z),
        };
        let translation = direction(&mut rng) * size(&mut rng, -3.0, 7.0);
        let (map, reference) = (Linear::new(linear), Map::new(linear.as_dmat3()));
        let flux = map.flux(one.punctual_flux, one.area_flux, one.axis);
        let ours = one.transformed(&map, translation, flux);
        let expected = placed(&one, &reference, exact(translation), 1.0);
        let note = |error: &mut f64, value: f64| *error = error.max(value);
        note(&mut most.flux, (f64::from(ours.flux) / expected.flux - 1.0).abs() / ROUNDING);
        let columns = DVec3::from([0, 1, 2].map(|k| exact(linear.col(k)).abs().max_element()));
        let unit = ROUNDING * (columns.dot(exact(one.mean).abs()) + exact(translation).abs().max_element());
        note(&mut most.mean, (exact(ours.mean) - expected.mean).abs().max_element() / unit);
        note(&mut most.variance, (f64::from(ours.variance) / expected.variance - 1.0).abs() / ROUNDING);
        note(&mut most.axis, exact(ours.axis).distance(expected.axis) / ROUNDING);
        let narrower = f64::from(ours.cos_half_angle) - expected.half_angle.cos();
        note(&mut most.too_narrow, narrower);
        // Of half spaces the margin grows as areas shrink across the axis.
        let normals = reference.cofactor();
        let greatest = normals.to_cols_array().iter().map(|e| e * e).sum::<f64>().sqrt();
        let shrinks = greatest / (normals * exact(one.axis).normalize_or(DVec3::X)).length();
        note(&mut most.too_wide, -narrower / shrinks);
    }
    // Sums of nine squares, and products of three numbers with them.
    assert!(most.flux < 16.0 && most.axis < 16.0 && most.variance < 6.0, "{most:?}");
    // Three products and three additions.
    assert!(most.mean < 4.0, "{most:?}");
    // Cosines: the caller has margins for 1e-7, and the turn has its own of 1e-6.
    assert!(most.too_narrow < 1.0e-7 && most.too_wide < 4.0e-6, "{most:?}");
}
