//! Flux and moments of single lights.

use std::f64::consts::PI;

use girandole::glam::{DVec3, Vec3};
use girandole::{Light, LightId, LightSampler, ShadingPoint, Shape};

use super::{exact, integral, squares, world_of};
use testbed::testing::support::Rng;

/// A light of every shape, with a size in metres, about the origin.
fn shapes(rng: &mut Rng, size: f32) -> [Light; 7] {
    let (u, v) = (rng.direction() * (0.3 * size), rng.direction() * (0.4 * size));
    let corners = [rng.direction(), rng.direction(), rng.direction()].map(|d| d * (0.5 * size));
    let outer = rng.between(0.8, 3.0);
    let emission = Vec3::new(rng.unit(), rng.unit(), rng.unit()) + 0.1;
    [
        Light::point(Vec3::ZERO, emission),
        Light::spot(Vec3::ZERO, rng.direction(), 0.5 * outer, outer, emission),
        Light::rectangle(Vec3::ZERO, u, v, emission),
        Light::rectangle(Vec3::ZERO, u, v, emission).two_sided(),
        Light::triangle(corners, emission),
        Light::triangle(corners, emission).two_sided(),
        Light::sphere(Vec3::ZERO, 0.5 * size, emission),
    ]
}

/// Luminance by the coefficients of Rec. 709.
fn luminance(rgb: Vec3) -> f64 {
    exact(rgb).dot(DVec3::new(0.2126, 0.7152, 0.0722))
}

/// The area of a triangle by Heron's formula.
fn heron([a, b, c]: [DVec3; 3]) -> f64 {
    let [x, y, z] = [a.distance(b), b.distance(c), c.distance(a)];
    let s = 0.5 * (x + y + z);
    (s * (s - x) * (s - y) * (s - z)).max(0.0).sqrt()
}

/// The emitting area with both sides; `None` for lights without size.
fn area(light: &Light) -> Option<f64> {
    let sides = |two_sided: bool| if two_sided { 2.0 } else { 1.0 };
    match light.shape {
        Shape::Point { .. } | Shape::Spot { .. } => None,
        Shape::Rectangle { half_u, half_v, two_sided, .. } => {
            let (u, v) = (2.0 * exact(half_u), 2.0 * exact(half_v));
            Some(2.0 * heron([DVec3::ZERO, u, v]) * sides(two_sided))
        }
        Shape::Triangle { vertices, two_sided } => Some(heron(vertices.map(exact)) * sides(two_sided)),
        Shape::Sphere { radius, .. } => Some(4.0 * PI * f64::from(radius).powi(2)),
        _ => unreachable!("this version has no others"),
    }
}

#[test]
fn the_flux_of_each_shape_is_that_of_its_closed_form_at_every_size() {
    let mut rng = Rng(420);
    for size in [1.0e-6, 1.0e-3, 1.0, 1.0e3, 1.0e6] {
        for light in (0..50).flat_map(|_| shapes(&mut rng, size)) {
            if matches!(light.shape, Shape::Spot { .. }) {
                continue;
            }
            // Lambert's law: each square metre emits π lumens per nit.
            let area = area(&light);
            let expected = luminance(light.emission) * area.map_or(4.0 * PI, |area| PI * area);
            // Edges of triangles are differences in f32, which slivers magnify.
            let thinness = match light.shape {
                Shape::Triangle { .. } => exact(light.aabb().extent()).length_squared() / area.unwrap_or(1.0),
                _ => 0.0,
            };
            for flux in [light.flux(), light.cluster().flux] {
                let error = f64::from(flux) / expected - 1.0;
                let tolerance = 4.0e-7 + 1.2e-7 * thinness;
                assert!(error.abs() < tolerance, "{light:?}: {flux} and not {expected}, by {error:e}");
            }
        }
    }
}

/// The illuminance of a surface, in luminance, by the middles of many strata of the light.
fn lux(sampler: &LightSampler, id: LightId, at: &ShadingPoint, side: u32) -> f64 {
    let sent = |u| {
        sampler.sample_light(at, id, u).map_or(0.0, |incident| {
            luminance(incident.radiance) * f64::from(at.normal.dot(incident.direction)) / f64::from(incident.pdf)
        })
    };
    squares(side).map(sent).sum::<f64>() / f64::from(side * side)
}

#[test]
fn what_arrives_at_a_sphere_around_a_light_adds_up_to_its_flux() {
    let mut rng = Rng(421);
    let radius = 4.0;
    for light in (0..2).flat_map(|_| shapes(&mut rng, 2.0)) {
        let (world, id) = world_of(light);
        let sampler = world.sampler();
        // Rows of equal height have equal areas.
        let (rows, columns) = (100, 60);
        let mut sum = 0.0;
        for i in 0..rows * columns {
            let z = (2.0 * f64::from(i / columns) + 1.0) / f64::from(rows) - 1.0;
            let turn = 2.0 * PI * (f64::from(i % columns) + 0.5) / f64::from(columns);
            let around = DVec3::new(turn.cos(), turn.sin(), 0.0) * (1.0 - z * z).sqrt();
            let away = (around + DVec3::Z * z).as_vec3();
            let side = if light.area().is_some() { 6 } else { 1 };
            sum += lux(&sampler, id, &ShadingPoint::surface(away * radius, -away), side);
        }
        let arrives = sum / f64::from(rows * columns) * 4.0 * PI * f64::from(radius).powi(2);
        let deviation = arrives / f64::from(light.flux()) - 1.0;
        // The error of the strata, which is greatest for spots.
        assert!(deviation.abs() < 5.0e-4, "{light:?}: {arrives} arrives of {}, {deviation:e}", light.flux());
    }
}

/// Mean position and variance of the points of a light, as integrals over its area.
fn moments(light: &Light) -> (DVec3, f64) {
    let over_square = |place: &dyn Fn(f64, f64) -> (DVec3, f64)| {
        let moment = |f: &dyn Fn(DVec3) -> f64| {
            integral(0.0, 1.0, 4, |s| {
                integral(0.0, 1.0, 4, |t| {
                    let (point, weight) = place(s, t);
                    weight * f(point)
                })
            })
        };
        let area = moment(&|_| 1.0);
        let mean = DVec3::from([0, 1, 2].map(|k| moment(&|p| p[k]))) / area;
        (mean, moment(&|p| (p - mean).length_squared()) / area)
    };
    match light.shape {
        Shape::Point { position } | Shape::Spot { position, .. } => (exact(position), 0.0),
        Shape::Rectangle { center, half_u, half_v, .. } => {
            let [center, u, v] = [center, half_u, half_v].map(exact);
            over_square(&|s, t| (center + u * (2.0 * s - 1.0) + v * (2.0 * t - 1.0), 1.0))
        }
        Shape::Triangle { vertices, .. } => {
            let [a, b, c] = vertices.map(exact);
            // The square is folded to a triangle by a map with the determinant 1 − s.
            over_square(&|s, t| (a + (b - a) * s + (c - a) * ((1.0 - s) * t), 1.0 - s))
        }
        Shape::Sphere { center, radius } => {
            let (center, radius) = (exact(center), f64::from(radius));
            over_square(&|s, t| {
                let (z, turn) = (2.0 * s - 1.0, 2.0 * PI * t);
                let around = DVec3::new(turn.cos(), turn.sin(), 0.0) * (1.0 - z * z).sqrt();
                (center + (around + DVec3::Z * z) * radius, 1.0)
            })
        }
        _ => unreachable!("this version has no others"),
    }
}

#[test]
fn the_mean_and_the_variance_of_each_shape_are_integrals_over_its_area() {
    let mut rng = Rng(422);
    for size in [1.0e-6, 1.0e-3, 1.0, 1.0e3, 1.0e6] {
        for light in (0..20).flat_map(|_| shapes(&mut rng, size)) {
            let (cluster, (mean, variance)) = (light.cluster(), moments(&light));
            let extent = f64::from(light.aabb().extent().length());
            assert!(exact(cluster.mean).distance(mean) <= 2.0e-7 * extent, "{light:?} {} {mean}", cluster.mean);
            let error = f64::from(cluster.variance) - variance;
            // The integral over a sphere has roots at the poles.
            let tolerance = if matches!(light.shape, Shape::Sphere { .. }) { 1.0e-3 } else { 1.0e-6 };
            assert!(error.abs() <= tolerance * variance, "{light:?} {} {variance}", cluster.variance);
        }
    }
}

#[test]
fn the_mean_direction_of_a_flat_light_is_two_thirds_of_the_normal_of_its_front() {
    // Lambert's law: the mean of the cosine, weighted by the cosine, over a half sphere.
    let weighted = |power: i32| integral(0.0, 0.5 * PI, 20, |angle| angle.cos().powi(power) * angle.sin());
    let mean = weighted(2) / weighted(1);
    let mut rng = Rng(423);
    for _ in 0..100 {
        for light in shapes(&mut rng, 3.0) {
            let front = match light.shape {
                Shape::Rectangle { half_u, half_v, two_sided: false, .. } => exact(half_u).cross(exact(half_v)),
                Shape::Triangle { vertices: [a, b, c], two_sided: false } => {
                    (exact(b) - exact(a)).cross(exact(c) - exact(a))
                }
                Shape::Spot { .. } => continue,
                _ => DVec3::ZERO,
            };
            let expected = front.normalize_or_zero() * mean;
            // The normals of slivers are left open: they count as emitting to all sides.
            let axis = exact(light.cluster().axis);
            let is_thin = axis == DVec3::ZERO && front != DVec3::ZERO;
            assert!(is_thin || axis.distance(expected) < 2.0e-5, "{light:?}: {axis} and not {expected}");
        }
    }
}
