//! The path of the camera: a figure of eight, flown at a constant speed.

use super::settings::Settings;
use girandole::glam::{DVec2, DVec3};
use std::f64::consts::TAU;

/// Metres above the ground.
const HEIGHT: f64 = 120.0;
/// Half of the extent of the path along x and z, before it is scaled to its length.
const EXTENT: DVec2 = DVec2::new(2.0, 1.0);
/// The number of straight pieces that measure the length of the path.
const PIECES: u32 = 4096;

/// A closed path through the middle of the world.
#[derive(Clone, Debug)]
pub struct Route {
    middle: DVec2,
    extent: DVec2,
    /// The length from the start to the end of each piece.
    lengths: Vec<f64>,
}

impl Route {
    pub fn new(settings: &Settings) -> Self {
        let size = settings.world_size();
        let mut route = Self { middle: DVec2::splat(0.5 * size), extent: EXTENT, lengths: Vec::new() };
        let mut length = 0.0;
        for piece in 0..PIECES {
            let ends = [piece, piece + 1].map(|end| route.at_angle(TAU * f64::from(end) / f64::from(PIECES)));
            length += ends[0].distance(ends[1]);
            route.lengths.push(length);
        }
        let scale = settings.length() / length;
        route.extent *= scale;
        route.lengths.iter_mut().for_each(|length| *length *= scale);
        route
    }

    fn at_angle(&self, angle: f64) -> DVec2 {
        self.middle + self.extent * DVec2::new(angle.cos(), (2.0 * angle).sin())
    }

    /// The position of the camera after a share of a round; 1 is the start again.
    pub fn camera(&self, share: f64) -> DVec3 {
        let target = share.rem_euclid(1.0) * self.lengths[self.lengths.len() - 1];
        let piece = self.lengths.partition_point(|length| *length <= target).min(self.lengths.len() - 1);
        let start = if piece == 0 { 0.0 } else { self.lengths[piece - 1] };
        let inside = (target - start) / (self.lengths[piece] - start);
        let place = self.at_angle(TAU * (piece as f64 + inside) / f64::from(PIECES));
        DVec3::new(place.x, HEIGHT, place.y)
    }
}
