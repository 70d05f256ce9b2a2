//! Quickstart: a street of lamps and a car, sampled on the CPU.
//!
//! Run with `cargo run --release --example quickstart`. It prints the illuminance of a spot of road, once estimated
//! with one sampled light per draw and once summed over all lights: the two must agree.

use std::error::Error;
use std::time::Duration;

use girandole::glam::{DVec3, Vec3};
use girandole::{FrameBudget, Light, LightWorld, Placement, Policy, ShadingPoint};

const DRAWS: u32 = 100_000;

#[allow(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut world = LightWorld::new();

    // One tree per kind of object, in its own space; a thousand lamps share one.
    let lamp = world.add_tree(vec![Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(800.0))])?;
    for i in 0..1000 {
        world.add_instance(lamp, Placement::at(DVec3::new(30.0 * f64::from(i), 0.0, 5.0)), Policy::Static)?;
    }
    let headlight = |z| Light::spot(Vec3::new(2.0, 0.7, z), Vec3::X, 0.2, 0.5, Vec3::splat(5000.0));
    let car = world.add_tree(vec![headlight(-0.6), headlight(0.6)])?;
    let car = world.add_instance(car, Placement::IDENTITY, Policy::RefitOnly)?;

    // Every frame: move what moves, then update.
    world.move_instance(car, Placement::at(DVec3::new(1000.0, 0.0, 0.0)))?;
    let report = world.update(FrameBudget::new(Duration::from_micros(300)));

    let sampler = world.sampler();
    let road = ShadingPoint::surface(Vec3::new(1010.0, 0.0, 0.0), Vec3::Y);
    let lux = |incident: girandole::Incident| incident.radiance.x * incident.direction.y / incident.pdf;

    let exact: f32 = sampler.all_lights().filter_map(|l| sampler.sample_light(&road, l, [0.5, 0.5])).map(lux).sum();
    let mut sum = 0.0;
    for i in 0..DRAWS {
        // Any well spread numbers do; here a rank-1 lattice.
        let u = [0.856_675, 0.733_892, 0.628_707, 0.538_597].map(|step| (f64::from(i) * step).fract() as f32);
        sum += sampler.sample(&road, u).map_or(0.0, |s| f64::from(lux(s.incident) / s.pmf));
    }
    let estimate = sum / f64::from(DRAWS);
    println!("{} lights, {} instances added or moved", world.light_count(), report.moved_instances);
    println!("illuminance {estimate:.4} lux sampled, {exact:.4} lux summed over all lights");
    Ok(())
}
