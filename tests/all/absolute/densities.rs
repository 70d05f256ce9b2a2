//! Densities of the directions to flat lights: by area, and by solid angle.

use std::f64::consts::PI;

use girandole::glam::{DVec3, Vec3};
use girandole::{Light, ShadingPoint, Shape};

use super::{exact, squares, world_of};
use testbed::testing::support::Rng;

/// The solid angle of a spherical triangle by Girard's theorem: the sum of its angles, less π.
fn girard(corners: [DVec3; 3]) -> f64 {
    let [a, b, c] = corners.map(DVec3::normalize);
    // The angle at a corner between the planes through the two edges.
    let angle = |a: DVec3, b: DVec3, c: DVec3| {
        let (p, q) = (a.cross(b), a.cross(c));
        p.cross(q).length().atan2(p.dot(q))
    };
    angle(a, b, c) + angle(b, c, a) + angle(c, a, b) - PI
}

/// The corners of a flat light, in order.
fn corners(light: &Light) -> Vec<DVec3> {
    match light.shape {
        Shape::Rectangle { center, half_u, half_v, .. } => {
            let [c, u, v] = [center, half_u, half_v].map(exact);
            vec![c - u - v, c + u - v, c + u + v, c - u + v]
        }
        Shape::Triangle { vertices, .. } => vertices.map(exact).to_vec(),
        _ => unreachable!("only flat lights are tested here"),
    }
}

/// The solid angle of a flat light, as the sum of those of its triangles.
fn solid_angle(light: &Light, at: DVec3) -> f64 {
    let to: Vec<_> = corners(light).into_iter().map(|corner| corner - at).collect();
    (1..to.len() - 1).map(|i| girard([to[0], to[i], to[i + 1]])).sum()
}

/// The normal of a flat light, times its area.
fn normal_area(light: &Light) -> DVec3 {
    let at = corners(light);
    (1..at.len() - 1).map(|i| 0.5 * (at[i] - at[0]).cross(at[i + 1] - at[0])).sum()
}

fn square() -> Light {
    Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE).two_sided()
}

fn shapes() -> [Light; 5] {
    let triangle = [Vec3::new(-1.0, -0.7, 0.2), Vec3::new(1.2, -0.8, 0.0), Vec3::new(0.1, 1.1, 0.3)];
    [
        square(),
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::new(0.6, 0.05, 0.0), Vec3::ONE).two_sided(),
        Light::rectangle(Vec3::ZERO, Vec3::X, Vec3::new(0.3, 0.8, 0.1), Vec3::ONE).two_sided(),
        Light::triangle(triangle, Vec3::ONE).two_sided(),
        Light::triangle([Vec3::ZERO, Vec3::X, Vec3::new(0.9, 0.03, 0.0)], Vec3::ONE).two_sided(),
    ]
}

#[test]
fn densities_by_area_are_exact_and_their_inverses_integrate_to_the_solid_angle() {
    let mut rng = Rng(431);
    for light in shapes() {
        let (world, id) = world_of(light);
        let sampler = world.sampler();
        let normal_area = normal_area(&light);
        for distance in [0.7, 1.5, 6.0, 50.0, 1.0e4] {
            let mut at = rng.direction() * distance;
            // Off the plane of the light, where the integrand would be a needle.
            at.z = at.z.signum() * at.z.abs().max(0.5 * distance);
            let shading_point = ShadingPoint::volume(at);
            let side = 80;
            let mut sum = 0.0;
            for u in squares(side) {
                let incident = sampler.sample_light(&shading_point, id, u).expect("both sides are lit");
                let point = exact(at) + exact(incident.direction) * f64::from(incident.dist);
                // The height over the plane does not depend on the point.
                let facing = normal_area.dot(corners(&light)[0] - exact(at)).abs();
                let expected = f64::from(incident.dist).powi(3) / facing;
                let error = f64::from(incident.pdf) / expected - 1.0;
                assert!(error.abs() < 2.0e-6, "{light:?} from {at} to {point}: {error:e}");
                sum += 1.0 / f64::from(incident.pdf);
            }
            let (mean, expected) = (sum / f64::from(side * side), solid_angle(&light, exact(at)));
            // The error of the strata falls with the squared distance; at 10 km solid angles of 1e-8
            // are differences of angles in f64.
            let tolerance = 1.0e-5 + 1.0e-3 / f64::from(distance * distance);
            let error = mean / expected - 1.0;
            assert!(error.abs() < tolerance, "{light:?} from {at}: {mean} and not {expected}, by {error:e}");
        }
    }
}

#[test]
fn densities_by_solid_angle_are_the_inverse_of_the_exact_solid_angle() {
    let mut rng = Rng(432);
    let mut near = 0;
    for light in shapes() {
        let (mut world, id) = world_of(light);
        for _ in 0..400 {
            // Over the light, and from a thousandth of its size to the limit of what counts as near.
            let foot = corners(&light)[0].lerp(corners(&light)[2], rng.unit().into()).as_vec3();
            let height = 10.0_f32.powf(rng.between(-3.0, 0.5));
            let at = foot + 0.3 * rng.position(1.0) * Vec3::new(1.0, 1.0, 0.0) + Vec3::Z * height;
            let (shading_point, u) = (ShadingPoint::volume(at), [rng.unit(), rng.unit()]);
            world.set_solid_angle_sampling(false);
            let by_area = world.sampler().sample_light(&shading_point, id, u);
            world.set_solid_angle_sampling(true);
            let incident = world.sampler().sample_light(&shading_point, id, u).expect("both sides are lit");
            if by_area == Some(incident) {
                continue;
            }
            near += 1;
            let expected = 1.0 / solid_angle(&light, exact(at));
            let error = f64::from(incident.pdf) / expected - 1.0;
            assert!(error.abs() < 1.0e-4, "{light:?} from {at}: {} and not {expected}, {error:e}", incident.pdf);
        }
    }
    assert!(near > 1000, "{near}");
}
