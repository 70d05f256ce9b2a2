use super::*;
use crate::common::pcg::Rng;
use crate::measuring::reflection::reflection;
use girandole::Gloss;
use girandole::glam::{Vec3, vec3};

fn lights(rng: &mut Rng, count: usize) -> Vec<Light> {
    let kinds = (0..count).map(|i| {
        let mut v = |half: f32| vec3(rng.range(-half, half), rng.range(-half, half), rng.range(-half, half));
        let (position, direction, u, w) = (v(12.0) + Vec3::Y * 12.0, v(1.0).normalize(), v(0.5), v(0.5));
        let emission = Vec3::splat(rng.range(0.1, 5.0));
        match i % 4 {
            0 => Light::point(position, emission),
            1 => Light::spot(position, direction, 0.3, 0.8, emission),
            2 => Light::rectangle(position, u, w, emission),
            // Dark lights have no leaf.
            _ => Light::sphere(position, 0.2, if i % 8 == 3 { Vec3::ZERO } else { emission }),
        }
    });
    kinds.collect()
}

fn shading_points() -> [ShadingPoint; 3] {
    let matte = ShadingPoint::surface(vec3(0.5, 3.0, -1.0), vec3(0.3, 0.9, 0.1).normalize());
    let gloss = Gloss { view: vec3(1.0, 0.4, 0.0), roughness: 0.4, specular: 0.3, diffuse: 0.3 };
    [matte, matte.with_gloss(gloss), ShadingPoint::volume(matte.position)]
}

/// Draws at many points, evenly over [0, 1): the sum over lights of f is the mean of f / p.
fn check<const N: usize, const LANES: usize>(tree: &GaussianTree<N, LANES>, lights: &[Light]) {
    const DRAWS: usize = 100_000;
    for at in shading_points() {
        let pmfs = tree.pmfs(&at);
        let sum: f64 = pmfs.iter().map(|pmf| f64::from(*pmf)).sum();
        // Groups whose lights are all below the horizon may still have a box above it: draws end there.
        assert!(sum > 0.9 && sum < 1.0 + 1.0e-5, "{sum}");
        let light: Vec<f64> = lights.iter().map(|light| reflection(light, &at)).collect();
        let mut hits = vec![0; lights.len()];
        let (mut mean, mut square, mut dead) = (0.0, 0.0, 0.0);
        let mut rng = Rng::new(9, 4);
        for _ in 0..DRAWS {
            let u = f64::from(rng.unit()) + f64::from(rng.unit()) * 0.5_f64.powi(24);
            let Some((index, pmf)) = tree.pick(&at, u.min(1.0 - f64::EPSILON)) else {
                dead += 1.0;
                continue;
            };
            let exact = pmfs[index as usize];
            assert!((pmf - exact).abs() <= 1.0e-5 * exact, "{pmf} {exact}");
            hits[index as usize] += 1;
            let value = light[index as usize] / f64::from(pmf);
            (mean, square) = (mean + value / DRAWS as f64, square + value * value / DRAWS as f64);
        }
        let (all, error) = (light.iter().sum::<f64>(), ((square - mean * mean).max(0.0) / DRAWS as f64).sqrt());
        assert!((mean - all).abs() < 5.0 * error, "{mean} {all} {error}");
        let expected = (1.0 - sum).max(0.0) * DRAWS as f64;
        assert!((dead - expected).abs() < 5.5 * expected.sqrt() + 5.0, "{dead} {expected}");
        for (pmf, hits) in pmfs.iter().zip(hits) {
            let expected = f64::from(*pmf) * DRAWS as f64;
            assert!((f64::from(hits) - expected).abs() < 5.5 * expected.sqrt() + 5.0, "{hits} {expected}");
        }
        // Every light that contributes may be drawn.
        assert!(light.iter().zip(&pmfs).all(|(light, pmf)| *light == 0.0 || *pmf > 0.0));
    }
}

#[test]
fn draws_have_their_probabilities_and_their_mean_is_the_sum_over_all_lights() {
    let mut rng = Rng::new(17, 2);
    for count in [1, 2, 3, 9, 200] {
        let lights = lights(&mut rng, count);
        check(&GaussianTree::binary(&lights), &lights);
        let tree = LightTree::new(lights.clone()).expect("sound lights");
        check(&GaussianTree::wide(&tree), &lights);
    }
}

#[test]
fn without_lights_nothing_is_drawn() {
    let dark = [Light::point(Vec3::ZERO, Vec3::ZERO)];
    for lights in [&[][..], &dark] {
        let binary = GaussianTree::binary(lights);
        let wide = GaussianTree::wide(&LightTree::new(lights.to_vec()).expect("sound lights"));
        for at in shading_points() {
            assert!(binary.pick(&at, 0.5).is_none() && wide.pick(&at, 0.5).is_none());
            assert!(binary.pmfs(&at).iter().chain(&wide.pmfs(&at)).all(|pmf| *pmf == 0.0));
        }
    }
}
