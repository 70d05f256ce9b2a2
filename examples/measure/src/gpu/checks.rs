//! What must hold before times mean anything: the GPU chooses the lights that the CPU chooses, as often as their probabilities say.

use super::machine::Machine;
use super::timer::Timer;
use super::top_level::world;
use girandole::glam::Vec3;
use girandole::gpu::GpuLights;
use girandole::{LightId, LightWorld, ShadingPoint};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use testbed::common::batch::{self, SampleRecord, SampleRequest};
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// Seeds shading points and random numbers.
const SEED: u64 = 37;
/// The share of samples that may name another light than on the CPU: a random number may fall within
/// rounding of the border between two lights.
const MOST_OTHER_LIGHTS: f64 = 2.0e-3;
/// The greatest relative difference of the probabilities of the same light.
const MOST_DIFFERENCE: f32 = 2.0e-3;
/// The greatest distance of a count from its expectation, in standard deviations. With fewer than a
/// thousand counts, a correct kernel exceeds it in fewer than 1 of 10^5 runs with other seeds.
const MOST_DEVIATIONS: f64 = 6.2;
/// Shading points whose draws are counted, and draws for each.
const COUNTED_POINTS: usize = 4;
const DRAWS: usize = 16_384;
/// Counts with a lower expectation are not compared.
const LEAST_EXPECTED: f64 = 50.0;

/// What was compared, and how it went.
pub struct Check {
    pub name: &'static str,
    pub has_passed: bool,
    /// What was found, with numbers.
    pub found: String,
}

impl Check {
    pub fn to_json(&self) -> Value {
        json!({ "name": self.name, "passed": self.has_passed, "found": self.found })
    }
}

/// Makes all comparisons, with a world of so many instances.
pub fn run(machine: &Machine, timer: &Timer, instances: u32) -> Result<Vec<Check>, SceneError> {
    let mut checks = Vec::new();
    let refuse = |refusal| SceneError(format!("{instances} instances: {refusal}"));
    let (world, _) = world(instances)?;
    let mut lights = GpuLights::new(&machine.device, &machine.queue).map_err(refuse)?;
    lights.upload(&world).map_err(refuse)?;
    let mut rng = Rng::new(SEED, 0);
    let side = 10.0 * (instances as f32).sqrt();
    let mut point = || Vec3::new(rng.range(0.0, side), 0.0, rng.range(0.0, side));
    let points: Vec<Vec3> = (0..4096).map(|_| point()).collect();
    let requests: Vec<SampleRequest> = points.iter().zip(0..).map(|(point, index)| request(*point, index)).collect();
    let first = sample(machine, timer, &mut lights, &requests)?;
    checks.push(chooses_as_the_cpu(&world, &requests, &first));
    // Another upload of everything builds the top level again.
    let mut again = GpuLights::new(&machine.device, &machine.queue).map_err(refuse)?;
    again.upload(&world).map_err(refuse)?;
    let second = sample(machine, timer, &mut again, &requests)?;
    let same = first.iter().zip(&second).filter(|(a, b)| bytemuck::bytes_of(*a) == bytemuck::bytes_of(*b)).count();
    checks.push(Check {
        name: "two builds of one world give the same samples, bit for bit",
        has_passed: same == first.len(),
        found: format!("{same} of {} samples are equal", first.len()),
    });
    checks.push(chooses_by_probability(machine, timer, &mut lights, &points[..COUNTED_POINTS])?);
    Ok(checks)
}

/// A surface that faces up, with random numbers of its own.
fn request(position: Vec3, index: u32) -> SampleRequest {
    let mut rng = Rng::new(SEED, 1 + u64::from(index));
    let u = std::array::from_fn(|_| rng.range(0.0, 1.0));
    SampleRequest { position: position.to_array(), normal: Vec3::Y.to_array(), u, ..SampleRequest::default() }
}

/// Builds the top level if it is due, and makes a sample for each request.
fn sample(
    machine: &Machine,
    timer: &Timer,
    lights: &mut GpuLights,
    requests: &[SampleRequest],
) -> Result<Vec<SampleRecord>, SceneError> {
    let input = machine.storage("requests", size_of_val(requests) as u64);
    machine.queue.write_buffer(&input, 0, bytemuck::cast_slice(requests));
    let output = machine.storage("samples", size_of::<SampleRecord>() as u64 * requests.len() as u64);
    let mut encoder = machine.device.create_command_encoder(&Default::default());
    lights.build_top(&mut encoder);
    let shader = lights.shader(0, lights.effects());
    let pipeline = batch::pipeline(&machine.device, &shader.join(batch::STAGE), &shader.layout);
    let count = requests.len() as u32;
    batch::record(&machine.device, &mut encoder, &pipeline, lights.bind_group(), [&input, &output], count);
    machine.queue.submit([encoder.finish()]);
    timer.read(&output)
}

fn chooses_as_the_cpu(world: &LightWorld, requests: &[SampleRequest], records: &[SampleRecord]) -> Check {
    // No cell is built here.
    let sampler = world.sampler().from_roots();
    let (mut others, mut lit, mut difference) = (0, 0, 0.0_f32);
    for (request, record) in requests.iter().zip(records) {
        let point = ShadingPoint::surface(request.position.into(), request.normal.into());
        let twin = sampler.sample(&point, request.u);
        let own = (record.pmf > 0.0).then(|| {
            let instance = world.instance_at(record.instance)?;
            Some(LightId::Local { instance, light: record.light })
        });
        match (own.flatten(), twin) {
            (None, None) => {}
            (Some(light), Some(twin)) if light == twin.light => {
                lit += 1;
                difference = difference.max((record.pmf - twin.pmf).abs() / twin.pmf);
            }
            _ => others += 1,
        }
    }
    let is_near = difference <= MOST_DIFFERENCE && f64::from(others) <= MOST_OTHER_LIGHTS * requests.len() as f64;
    Check {
        name: "samples name the lights that the CPU chooses, with the same probabilities",
        // Most of these points see a light.
        has_passed: is_near && 2 * lit > requests.len(),
        found: format!(
            "{others} of {} samples name another light; probabilities of the same light differ by {difference:.1e} \
             at most",
            requests.len()
        ),
    }
}

fn chooses_by_probability(
    machine: &Machine,
    timer: &Timer,
    lights: &mut GpuLights,
    points: &[Vec3],
) -> Result<Check, SceneError> {
    let (mut counts, mut worst) = (0, 0.0_f64);
    for (point, index) in points.iter().zip(1..) {
        let of_point = (0..DRAWS as u32).map(|draw| request(*point, index * DRAWS as u32 + draw));
        let records = sample(machine, timer, lights, &of_point.collect::<Vec<_>>())?;
        let mut drawn: BTreeMap<(u32, u32), (f64, f64)> = BTreeMap::new();
        for record in records.iter().filter(|record| record.pmf > 0.0) {
            let (count, pmf) = drawn.entry((record.instance, record.light)).or_default();
            *count += 1.0;
            *pmf = f64::from(record.pmf);
        }
        for (count, pmf) in drawn.into_values() {
            let expected = DRAWS as f64 * pmf;
            if expected >= LEAST_EXPECTED {
                counts += 1;
                worst = worst.max((count - expected).abs() / (expected * (1.0 - pmf)).max(1.0).sqrt());
            }
        }
    }
    Ok(Check {
        name: "lights are chosen as often as their probabilities say",
        has_passed: counts >= points.len() && worst <= MOST_DEVIATIONS,
        found: format!("the worst of {counts} counts is {worst:.1} standard deviations from its expectation"),
    })
}
