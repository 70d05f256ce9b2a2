use super::*;

fn spot(direction: Vec3) -> Result<(), ValueError> {
    Light::spot(Vec3::ZERO, direction, 0.1, 0.2, Vec3::ONE).validate()
}

#[test]
fn a_direction_must_be_of_unit_length_and_the_error_states_its_length() {
    assert_eq!(spot(Vec3::X * (1.0 + 0.9 * UNIT_TOLERANCE)), Ok(()));
    let wrong =
        |length: f32| check_range("the length of direction", length, 1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE);
    for length in [0.0, 2.0, 1.0e-30, 0.99, MAX_COORDINATE] {
        assert!(wrong(length).is_err());
        assert_eq!(spot(Vec3::Y * length), wrong(length));
    }
    for component in [f32::NAN, f32::INFINITY, f32::MAX] {
        assert!(spot(Vec3::new(0.0, component, 0.0)).is_err());
    }
    let sun = DirectionalLight { direction: Vec3::new(0.0, 3.0, 4.0), illuminance: Vec3::ONE };
    assert_eq!(sun.validate(), wrong(5.0));
}

#[test]
fn a_range_must_be_above_zero_and_may_be_infinite() {
    let lamp = Light::point(Vec3::ZERO, Vec3::ONE);
    for value in [0.0, -0.0, -1.0, f32::NEG_INFINITY, f32::NAN] {
        let error = lamp.with_range(value).validate().expect_err("no range");
        assert!(error.to_string().ends_with("; it must be above 0, from 0 to inf"), "{error}");
    }
    assert!(lamp.with_range(f32::MIN_POSITIVE).validate().is_ok() && lamp.with_range(f32::INFINITY).validate().is_ok());
}

#[test]
fn the_falloff_of_a_spot_is_what_its_documentation_says() {
    let share = |inner: f32, outer: f32, angle: f32| {
        let (scale, offset) = spot_falloff(inner.to_radians(), outer.to_radians());
        (angle.to_radians().cos() * scale + offset).clamp(0.0, 1.0).powi(2)
    };
    // Cosines that differ by more than 0.001: full within the inner angle.
    assert_eq!([share(20.0, 30.0, 0.0), share(20.0, 30.0, 19.99), share(20.0, 30.0, 30.0)], [1.0, 1.0, 0.0]);
    // By less: not full at the inner angle, but at the angle whose cosine is greater by 0.001.
    assert!(share(29.99, 30.0, 29.99) < 0.01);
    let full = (30.0_f32.to_radians().cos() + 1.001e-3).acos().to_degrees();
    assert_eq!(share(29.99, 30.0, full), 1.0);
    // Where no angle has such a cosine, the axis has a share.
    assert!(share(0.0, 2.57, 0.0) == 1.0 && share(0.0, 2.55, 0.0) < 1.0);
    assert!((share(1.0, 2.0, 0.0) - 0.37).abs() < 0.005, "{}", share(1.0, 2.0, 0.0));
    assert!((share(0.5, 1.0, 0.0) - 0.023).abs() < 0.0005, "{}", share(0.5, 1.0, 0.0));
}

#[test]
fn the_range_window_is_that_of_its_formula_in_f64() {
    let exact =
        |dist_sq: f32, range: f32| (1.0 - (f64::from(dist_sq) / f64::from(range).powi(2)).powi(2)).clamp(0.0, 1.0);
    for power in -18..18 {
        for digits in [1.0, 1.3, 2.0, 3.7, 9.9] {
            let range = digits * 10.0_f32.powi(power);
            let distances = [0.0, 1.0e-4, 0.1, 0.5, 0.9, 0.999].map(|share| share * range);
            for dist in distances.into_iter().chain([range.next_down(), range, range.next_up(), 2.0 * range]) {
                let (dist_sq, window) = (dist * dist, range_window(dist * dist, range));
                let expected = exact(dist_sq, range);
                // Three roundings of the ratio, which is squared, and one of the result.
                assert!((f64::from(window) - expected).abs() < 4.0e-7, "{dist} of {range}: {window} {expected}");
                assert_eq!(window > 0.0, dist < range, "{dist} of {range}");
            }
            assert_eq!(range_window(0.0, range), 1.0);
            assert_eq!(range_window(0.25 * (range * range), range), 0.9375);
        }
    }
    for range in [UNLIMITED_RANGE, f32::MAX, f32::INFINITY] {
        assert_eq!([0.0, 1.0, 1.0e36, f32::MAX, f32::INFINITY].map(|dist_sq| range_window(dist_sq, range)), [1.0; 5]);
    }
}
