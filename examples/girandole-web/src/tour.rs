//! The camera before anyone touches it: a slow flight along the avenue and back.

use std::f32::consts::TAU;

use girandole::glam::vec3;

use testbed::scene::Camera;

/// Seconds of a flight there and back.
const PERIOD: f64 = 90.0;
/// Metres between the ends of the flight.
const REACH: f32 = 70.0;
/// Metres by which the camera rises.
const RISE: f32 = 13.0;
/// Metres at the target by which the view sways to both sides.
const SWAY: f32 = 16.0;

/// The camera after some seconds. The flight starts at `start`, in the direction of `start`.
pub fn camera(start: &Camera, seconds: f64) -> Camera {
    let turn = (seconds / PERIOD).fract() as f32 * TAU;
    let share = 0.5 - 0.5 * turn.cos();
    let travel = vec3(0.0, RISE * share, -REACH * share);
    let look = vec3(SWAY * (2.0 * turn).sin() * share.sqrt(), RISE * share * 0.4, -REACH * share);
    Camera { eye: start.eye + travel, target: start.target + look, ..*start }
}
