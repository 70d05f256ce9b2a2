//! Absolute values of what lights emit and of the densities of samples, against closed forms and
//! numeric integrals in f64.
//!
//! Other tests compare the two sides of one formula: the CPU with the GPU, what is sampled with
//! what is evaluated. A mistake that both sides share passes them, and fails here. Nothing in this
//! folder uses a formula of the library: they follow from the definitions of the shapes.

mod densities;
mod flux;
mod spheres;
mod spots;
mod windows;

use girandole::glam::{DVec3, Vec3};
use girandole::{Light, LightId, LightWorld, Policy};
use testbed::testing::support;

/// A world with one light, where it is placed.
fn world_of(light: Light) -> (LightWorld, LightId) {
    let (world, _, instance) = support::world_of(vec![light], Policy::Static);
    (world, LightId::Local { instance, light: 0 })
}

/// The integral of a smooth function, by Gauss's rule with five points in each of `panels` equal
/// parts. It is exact for polynomials up to the ninth degree.
fn integral(from: f64, to: f64, panels: u32, f: impl Fn(f64) -> f64) -> f64 {
    let inner = (5.0 - 2.0 * (10.0_f64 / 7.0).sqrt()).sqrt() / 3.0;
    let outer = (5.0 + 2.0 * (10.0_f64 / 7.0).sqrt()).sqrt() / 3.0;
    let [weight, inner_weight, outer_weight] =
        [128.0 / 225.0, (322.0 + 13.0 * 70.0_f64.sqrt()) / 900.0, (322.0 - 13.0 * 70.0_f64.sqrt()) / 900.0];
    let half = 0.5 * (to - from) / f64::from(panels);
    let panel = |i: u32| {
        let middle = from + half * f64::from(2 * i + 1);
        let pair = |x: f64| f(middle - x * half) + f(middle + x * half);
        half * (weight * f(middle) + inner_weight * pair(inner) + outer_weight * pair(outer))
    };
    (0..panels).map(panel).sum()
}

/// The middles of `side` times `side` equal squares.
fn squares(side: u32) -> impl Iterator<Item = [f32; 2]> {
    let middle = move |i: u32| (i as f32 + 0.5) / side as f32;
    (0..side * side).map(move |i| [middle(i / side), middle(i % side)])
}

fn exact(v: Vec3) -> DVec3 {
    v.as_dvec3()
}
