//! Instances that are stretched, sheared and mirrored: what their panels cannot reach stays dark.

use super::*;

/// Rotations, uneven scales, mirrors and shears, with their scales.
fn stretches(rng: &mut Rng) -> Vec<(Mat3, Vec3)> {
    let mut turn = || Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 2.0 * PI)));
    let scales = [[5.0, 5.0, 1.0], [-1.0, 2.0, 1.0], [1.0, 0.1, 1.0], [0.5, -3.0, 20.0], [1.0, 1.0, 1.0e-3]];
    let mut all = vec![(Mat3::from_diagonal(Vec3::from(scales[0])), Vec3::from(scales[0]))];
    for scale in scales.map(Vec3::from) {
        all.extend([Mat3::IDENTITY, turn(), turn()].map(|inner| (Mat3::from_diagonal(scale) * inner, scale)));
        all.extend([Mat3::IDENTITY, turn()].map(|inner| (turn() * Mat3::from_diagonal(scale) * inner, scale)));
    }
    all
}

/// The probabilities of all lights together, over all numbers of splits.
fn any_pmf(world: &LightWorld, at: &ShadingPoint) -> f32 {
    SPLITS.into_iter().flat_map(|splits| all_pmfs(&world.sampler().with_splits(splits), at)).map(|(_, pmf)| pmf).sum()
}

#[test]
fn panels_of_stretched_instances_are_dark_behind() {
    let mut rng = Rng(610);
    let [mut dark, mut on_gpu] = [0; 2];
    for (round, (matrix, scales)) in stretches(&mut rng).into_iter().enumerate() {
        let (least, greatest) = (scales.abs().min_element(), scales.abs().max_element());
        let image = matrix.inverse().transpose() * Vec3::Z;
        // Normals of panels that agree are stored as half a degree apart, and spread by this factor.
        let is_tight = 1.0 / (least * image.length()) < 15.0;
        let (normal, size) = (image.normalize(), 100.0 * greatest);
        for count in [1, 30] {
            let panel = |i: i32| {
                let place = Vec3::new((i % 6) as f32, (i / 6) as f32, 0.0) * 3.0;
                Light::rectangle(place, Vec3::X, Vec3::Y, Vec3::splat(10.0))
            };
            let lights: Vec<Light> = (0..count).map(panel).collect();
            // As the only instance, and as one of two leaves of the top level.
            for instances in 1..=2 {
                let beside = normal.any_orthonormal_vector() * (0.5 * size);
                let placements =
                    [DVec3::ZERO, beside.as_dvec3()].map(|translation| Placement { linear: matrix, translation });
                let mut world = placed(lights.clone(), placements.into_iter().take(instances));
                let points: Vec<ShadingPoint> = [1.0, 10.0, 100.0, -1.0, -10.0, -100.0]
                    .into_iter()
                    .map(|dist| normal * (dist * size))
                    .flat_map(|p| [ShadingPoint::volume(p), ShadingPoint::surface(p, -p)])
                    .collect();
                assert!(prove(&world, &points, 611) > 0, "{matrix}");
                for at in &points {
                    let pmf = any_pmf(&world, at);
                    if at.position.dot(normal) > 0.0 {
                        assert!(pmf > 0.9, "{matrix} {at:?}: {pmf} in front");
                    } else if is_tight {
                        assert_eq!(pmf, 0.0, "{matrix} {at:?}, {count} panels in {instances} instances");
                        dark += 1;
                    }
                }
                if round % 5 == 0 {
                    prove_on_gpu(&mut world, &points, 612);
                    on_gpu += 1;
                }
            }
        }
    }
    assert!(dark > 200 && on_gpu > 12, "{dark} {on_gpu}");
}

/// Spots keep their angles in the world, and panels their half spaces: of two lights in one node a
/// matrix may turn either farther. Shading points are inside the rims of the spots' beams.
#[test]
fn beams_of_stretched_instances_are_found_up_to_their_rims() {
    let mut rng = Rng(613);
    let mut found = 0;
    for (round, (matrix, _)) in stretches(&mut rng).into_iter().enumerate() {
        for half_angle in [0.01_f32, 0.3, 1.2] {
            for panels in [0, 1, 20] {
                let mean = rng.direction();
                let mut lights = Vec::new();
                let mut points = Vec::new();
                for i in 0..20 + panels {
                    let place = rng.direction();
                    let toward = (mean + 0.3 * half_angle * rng.direction()).normalize();
                    if i >= 20 {
                        let u = toward.any_orthonormal_vector();
                        lights.push(Light::rectangle(place, u, toward.cross(u), Vec3::ONE));
                        continue;
                    }
                    lights.push(Light::spot(place, toward, 0.9 * half_angle, half_angle, Vec3::ONE));
                    let axis = (matrix * toward).normalize();
                    let angle = rng.between(0.85, 0.95) * half_angle;
                    let side = Quat::from_axis_angle(axis, rng.between(0.0, 2.0 * PI)) * axis.any_orthonormal_vector();
                    let beam = axis * angle.cos() + side * angle.sin();
                    points.push(ShadingPoint::volume(matrix * place + beam * rng.between(1.0, 1000.0)));
                }
                for instances in 1..=2 {
                    let away = [DVec3::ZERO, DVec3::X * 5000.0];
                    let placements = away.map(|translation| Placement { linear: matrix, translation });
                    let mut world = placed(lights.clone(), placements.into_iter().take(instances));
                    found += prove(&world, &points, 614);
                    if round % 5 == 0 && half_angle == 0.3 {
                        prove_on_gpu(&mut world, &points, 615);
                    }
                }
            }
        }
    }
    assert!(found > 10_000, "{found}");
}
