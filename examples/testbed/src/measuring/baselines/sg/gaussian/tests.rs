use super::*;

/// The mean of a function over the sphere times its area, by the midpoint rule in the cosine to an
/// axis and the angle about it. The pole is at an angle of `cosine` from the axis; the function
/// takes the cosines to the axis and to the pole.
fn over_sphere(cosine: f64, function: impl Fn(f64, f64) -> f64) -> f64 {
    const RINGS: usize = 1_000;
    const STEPS: usize = 64;
    let sine = (1.0 - cosine * cosine).sqrt();
    let mut sum = 0.0;
    for ring in 0..RINGS {
        // Rings are denser at the axis, where sharp lobes are: cos = 1 - 2 s^4.
        let s = (ring as f64 + 0.5) / RINGS as f64;
        let along = 1.0 - 2.0 * s.powi(4);
        let across = (1.0 - along * along).sqrt();
        let width = 8.0 * s.powi(3) / RINGS as f64;
        for step in 0..STEPS {
            let turn = (step as f64 + 0.5) * std::f64::consts::PI / STEPS as f64;
            sum += width * function(along, along * cosine + across * sine * turn.cos());
        }
    }
    sum * 2.0 * std::f64::consts::PI / STEPS as f64
}

fn lobe(sharpness: f32, along: f64) -> f64 {
    (f64::from(sharpness) * (along - 1.0)).exp()
}

const SHARPNESSES: [f32; 9] = [1.0e-3, 0.1, 0.45, 0.55, 1.0, 3.0, 10.0, 100.0, 1_000.0];
const COSINES: [f32; 9] = [-1.0, -0.7, -0.3, -0.05, 0.0, 0.05, 0.4, 0.9, 1.0];

#[test]
fn powers_and_tails_have_the_digits_that_they_promise() {
    for i in 0..4_000 {
        let x = -0.01 * i as f32;
        let exact = f64::from(x).exp();
        assert!((f64::from(exp(x)) / exact - 1.0).abs() < 5.0e-6, "{x}");
    }
    assert!(exp(-1.0e30) > 0.0 && exp(-1.0e30) < 1.0e-17);
    for i in 0..200 {
        // erfc by Simpson's rule for the integral of exp(-2 x t - t^2), which is exp(x^2) erfc(x)
        // times sqrt(pi) / 2.
        let x = 0.05 * f64::from(i);
        let (steps, end) = (4_000, 8.0);
        let weigh = |k: i32| if k == 0 || k == steps { 1.0 } else { f64::from(2 + 2 * (k & 1)) };
        let value = |k: i32| {
            let t = f64::from(k) * end / f64::from(steps);
            weigh(k) * (-2.0 * x * t - t * t).exp()
        };
        let exact =
            (0..=steps).map(value).sum::<f64>() * end / f64::from(3 * steps) * 2.0 / std::f64::consts::PI.sqrt();
        assert!((f64::from(scaled_erfc(x as f32)) / exact - 1.0).abs() < 1.0e-6, "{x}");
    }
}

#[test]
fn the_integral_is_that_of_quadrature() {
    for sharpness in SHARPNESSES {
        let exact = over_sphere(1.0, |along, _| lobe(sharpness, along));
        assert!((f64::from(integral(sharpness)) / exact - 1.0).abs() < 2.0e-5, "{sharpness}");
    }
    assert_eq!(integral(0.0), 4.0 * PI);
}

#[test]
fn the_cosine_integral_is_close_to_quadrature_everywhere_and_exact_at_the_poles() {
    let mut worst = 0.0_f64;
    for sharpness in SHARPNESSES {
        // What all of the lobe would give along the normal: errors are shares of it.
        let most = f64::from(integral(sharpness)) / std::f64::consts::PI;
        for cosine in COSINES {
            let exact = over_sphere(cosine.into(), |along, up| lobe(sharpness, along) * up.max(0.0));
            let error = f64::from(cosine_integral(cosine, sharpness)) - exact / std::f64::consts::PI;
            worst = worst.max((error / most).abs());
            if cosine.abs() == 1.0 {
                assert!((error / most).abs() < 3.0e-5, "{sharpness} {cosine}: {error} of {most}");
            }
        }
    }
    assert!(worst < 1.0e-3, "{worst}");
}

#[test]
fn a_lobe_without_width_counts_as_its_cosine_and_one_without_sharpness_as_all_directions() {
    for cosine in COSINES {
        let sharp = 1.0e6;
        let expected = 2.0 * cosine.max(0.0) / sharp;
        assert!((cosine_integral(cosine, sharp) - expected).abs() < 1.0e-3 * 2.0 / sharp, "{cosine}");
        assert!((cosine_integral(cosine, 0.0) - 1.0).abs() < 1.0e-3, "{cosine}");
        assert!((share_above(cosine, sharp) - if cosine > 0.0 { 1.0 } else { 0.0 }).abs() < 0.6);
        assert!((share_above(cosine, 0.0) - 0.5).abs() < 1.0e-3, "{cosine}");
    }
    assert_eq!(share_above(0.5, 1.0e6), 1.0);
}

#[test]
fn the_share_above_is_close_to_quadrature() {
    for sharpness in SHARPNESSES {
        for cosine in COSINES {
            let above = |along, up: f64| if up > 0.0 { lobe(sharpness, along) } else { 0.0 };
            let exact = over_sphere(cosine.into(), above) / f64::from(integral(sharpness));
            let error = f64::from(share_above(cosine, sharpness)) - exact;
            assert!(error.abs() < 0.02, "{sharpness} {cosine}: {error}");
        }
    }
}

#[test]
fn the_sharpness_of_a_mean_direction_has_that_mean_direction() {
    for length in [0.01_f32, 0.3, 0.5, 2.0 / 3.0, 0.9, 0.99] {
        let sharpness = sharpness_of(length);
        let mean = over_sphere(1.0, |along, _| lobe(sharpness, along) * along) / f64::from(integral(sharpness));
        // The formula is an approximation.
        assert!((mean - f64::from(length)).abs() < 0.02, "{length}: {mean}");
    }
}
