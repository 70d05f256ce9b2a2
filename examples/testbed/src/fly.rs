//! The camera that the user flies.

use super::scene::Camera;
use girandole::glam::{Vec2, Vec3};
use std::f32::consts::FRAC_PI_2;

/// Radians by which the camera turns when the pointer is dragged by the height of the picture.
const TURN_PER_HEIGHT: f32 = 1.6;
/// The steepest view, short of straight up and down, where left and right are undefined.
const MAX_PITCH: f32 = FRAC_PI_2 - 0.01;
/// Speed at first, metres per second.
const SPEED: f32 = 6.0;
/// Factor on the speed while the user hurries.
const HURRY: f32 = 5.0;
/// The slowest and the fastest speed, metres per second.
const SPEEDS: [f32; 2] = [0.05, 2000.0];
/// Farthest coordinate that the camera reaches, metres.
const MAX_COORDINATE: f32 = 1e6;

/// Where the user wants to go: each from -1 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Motion {
    /// Along the view.
    pub forward: f32,
    /// To the right.
    pub right: f32,
    /// Up, whatever the view.
    pub up: f32,
    /// Five times as fast.
    pub hurries: bool,
}

/// A camera with a heading and a speed.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    eye: Vec3,
    /// Radians to the left of -Z.
    heading: f32,
    /// Radians above the horizon.
    pitch: f32,
    vertical_fov: f32,
    /// Metres per second.
    speed: f32,
}

impl Flight {
    /// Starts at a camera.
    pub fn new(camera: &Camera) -> Self {
        let forward = (camera.target - camera.eye).normalize_or(Vec3::NEG_Z);
        Self {
            eye: camera.eye,
            heading: (-forward.x).atan2(-forward.z),
            pitch: forward.y.clamp(-1.0, 1.0).asin().clamp(-MAX_PITCH, MAX_PITCH),
            vertical_fov: camera.vertical_fov,
            speed: SPEED,
        }
    }

    /// The present camera.
    pub fn camera(&self) -> Camera {
        Camera { eye: self.eye, target: self.eye + self.forward(), vertical_fov: self.vertical_fov, up: Vec3::Y }
    }

    /// Metres per second without hurry.
    pub fn speed(&self) -> f32 {
        self.speed
    }

    /// Turns the view with the pointer. `drag` is in heights of the picture, to the right and down.
    pub fn turn(&mut self, drag: Vec2) {
        // What is under the pointer follows it.
        self.heading += drag.x * TURN_PER_HEIGHT;
        self.pitch = (self.pitch + drag.y * TURN_PER_HEIGHT).clamp(-MAX_PITCH, MAX_PITCH);
    }

    /// Flies for some seconds.
    pub fn travel(&mut self, motion: Motion, seconds: f32) {
        let forward = self.forward();
        let right = forward.cross(Vec3::Y).normalize_or(Vec3::X);
        let direction = forward * motion.forward + right * motion.right + Vec3::Y * motion.up;
        let speed = if motion.hurries { self.speed * HURRY } else { self.speed };
        let step = direction.clamp_length_max(1.0) * speed * seconds.max(0.0);
        if step.is_finite() {
            self.eye = (self.eye + step).clamp(Vec3::splat(-MAX_COORDINATE), Vec3::splat(MAX_COORDINATE));
        }
    }

    /// Makes the camera faster, or slower for a negative number of steps.
    pub fn change_speed(&mut self, steps: f32) {
        let [slowest, fastest] = SPEEDS;
        self.speed = (self.speed * 1.25f32.powf(steps)).clamp(slowest, fastest);
    }

    fn forward(&self) -> Vec3 {
        let (sin_heading, cos_heading) = self.heading.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch.sin_cos();
        Vec3::new(-sin_heading * cos_pitch, sin_pitch, -cos_heading * cos_pitch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flight(target: Vec3) -> Flight {
        Flight::new(&Camera { eye: Vec3::new(1.0, 2.0, 3.0), target, vertical_fov: 1.0, up: Vec3::Y })
    }

    #[test]
    fn a_flight_starts_at_the_camera() {
        for target in [Vec3::ZERO, Vec3::new(1.0, 2.5, 9.0), Vec3::new(-40.0, 7.0, 3.0), Vec3::new(1.0, 99.0, 3.1)] {
            let camera = flight(target).camera();
            let wanted = (target - camera.eye).normalize();
            assert!((camera.target - camera.eye).dot(wanted) > 0.999, "{camera:?}");
        }
    }

    #[test]
    fn keys_move_along_the_view_and_a_drag_turns_it() {
        let mut flight = flight(Vec3::new(1.0, 2.0, -9.0));
        flight.travel(Motion { forward: 1.0, ..Motion::default() }, 0.5);
        assert!((flight.camera().eye - Vec3::new(1.0, 2.0, 0.0)).length() < 1e-4);
        flight.travel(Motion { right: 1.0, hurries: true, ..Motion::default() }, 0.1);
        assert!((flight.camera().eye - Vec3::new(4.0, 2.0, 0.0)).length() < 1e-4);
        // A drag to the right turns the view to the left.
        flight.turn(Vec2::new(FRAC_PI_2 / TURN_PER_HEIGHT, 0.0));
        let camera = flight.camera();
        assert!((camera.target - camera.eye).dot(Vec3::NEG_X) > 0.999);
        flight.turn(Vec2::new(0.0, -100.0));
        let camera = flight.camera();
        assert!((camera.target - camera.eye).y < -0.999 && camera.target.is_finite());
        flight.travel(Motion { right: 1.0, ..Motion::default() }, f32::INFINITY);
        assert!(flight.camera().eye.is_finite());
    }

    #[test]
    fn the_speed_stays_within_limits() {
        let mut flight = flight(Vec3::ZERO);
        flight.change_speed(1000.0);
        assert_eq!(flight.speed(), SPEEDS[1]);
        flight.change_speed(-10000.0);
        assert_eq!(flight.speed(), SPEEDS[0]);
    }
}
