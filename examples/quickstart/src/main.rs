//! The first steps on the CPU: a street with a thousand lamps and a car.
//!
//! ```text
//! cargo run --release -p quickstart
//! ```
//!
//! The program prints the illuminance of a point on the road twice: estimated from 100,000 samples
//! of one light each, and summed over all lights. Expect both to be 16.39 lux.

use std::error::Error;
use std::time::Duration;

use girandole::glam::{DVec3, Vec3};
use girandole::{FrameBudget, Incident, Light, LightTree, LightWorld, Placement, Policy, ShadingPoint};

const SAMPLES: u32 = 100_000;

#[allow(clippy::print_stdout, reason = "an example shows its result")]
fn main() -> Result<(), Box<dyn Error>> {
    let mut world = LightWorld::new();

    // Each kind of object has one tree, in its own space. A thousand instances share the tree of
    // the lamp.
    let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::new(0.0, 6.0, 0.0), Vec3::splat(800.0))])?);
    for i in 0..1000 {
        world.add_instance(lamp, Placement::at(DVec3::new(30.0 * f64::from(i), 0.0, 5.0)), Policy::Static)?;
    }
    let headlight = |z| Light::spot(Vec3::new(2.0, 0.7, z), Vec3::X, 0.2, 0.5, Vec3::splat(5000.0));
    let car = world.add_tree(LightTree::new(vec![headlight(-0.6), headlight(0.6)])?);
    let car = world.add_instance(car, Placement::IDENTITY, Policy::RefitOnly)?;

    // In every frame, move the objects that have moved and update the world once.
    world.move_instance(car, Placement::at(DVec3::new(1000.0, 0.0, 0.0)))?;
    world.update(FrameBudget::new(Duration::from_micros(300)));

    let sampler = world.sampler();
    let road = ShadingPoint::surface(Vec3::new(1010.0, 0.0, 0.0), Vec3::Y);
    let lux = |incident: Incident| incident.radiance.x * incident.direction.y / incident.pdf;

    let mut sum = 0.0;
    for i in 0..SAMPLES {
        // Any four numbers that are uniform in [0, 1) will do. These are a rank-1 lattice.
        let u = [0.856_675, 0.733_892, 0.628_707, 0.538_597].map(|step| (f64::from(i) * step).fract() as f32);
        sum += sampler.sample(&road, u).map_or(0.0, |sample| f64::from(lux(sample.incident) / sample.pmf));
    }
    let estimate = sum / f64::from(SAMPLES);
    let exact: f32 = sampler.all_lights().filter_map(|l| sampler.sample_light(&road, l, [0.5, 0.5])).map(lux).sum();
    println!("{} lights in {} instances", world.light_count(), world.instances().len());
    println!("illuminance: {estimate:.4} lux from samples, {exact:.4} lux as the sum over all lights");
    Ok(())
}
