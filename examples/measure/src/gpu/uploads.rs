//! Upload of moved instances.

use super::machine::Machine;
use super::spread::Spread;
use super::timer::Timer;
use super::top_level::{place, world};
use girandole::FrameBudget;
use girandole::gpu::GpuLights;
use serde_json::{Value, json};
use std::time::Instant;
use testbed::scene::SceneError;
use testbed::scene::rng::Rng;

/// Seeds the moves.
const SEED: u64 = 31;
/// The shares of the instances that move, in percent.
const SHARES: [u32; 3] = [1, 10, 100];
/// The side of the square that they move within, in metres.
const SIDE: f32 = 1000.0;

/// The upload of one share of the instances.
pub struct Row {
    pub percent: u32,
    pub moved: usize,
    pub bytes: u64,
    /// The call of `upload` on the CPU.
    pub call: Spread,
    /// From the submission of the written data until the GPU has it.
    pub transfer: Spread,
}

impl Row {
    pub fn to_json(&self, instances: u32) -> Value {
        json!({
            "instances": instances,
            "percent_moved": self.percent,
            "moved": self.moved,
            "bytes": self.bytes,
            "upload_call": self.call.to_json(),
            "submit_and_wait": self.transfer.to_json(),
        })
    }
}

/// Times the upload after random instances have moved. Neighbours in the buffer rarely move
/// together, unless all do.
pub fn measure(machine: &Machine, timer: &Timer, instances: u32) -> Result<Vec<Row>, SceneError> {
    let refuse = |refusal| SceneError(format!("{instances} instances: {refusal}"));
    let (mut world, mut keys) = world(instances)?;
    let mut lights = GpuLights::new(&machine.device, &machine.queue).map_err(refuse)?;
    lights.upload(&world).map_err(refuse)?;
    let mut rng = Rng::new(SEED, 0);
    let mut rows = Vec::new();
    for percent in SHARES {
        let moved = keys.len() * percent as usize / 100;
        let mut bytes = 0;
        let times = timer.repeat(|| {
            for i in 0..moved {
                // The front of the list becomes a random choice (Fisher and Yates).
                let other = i + rng.below(keys.len() - i);
                keys.swap(i, other);
                world.move_instance(keys[i], place(&mut rng, SIDE))?;
            }
            world.update(FrameBudget::NONE);
            machine.queue.submit([]);
            timer.wait()?;
            let start = Instant::now();
            bytes = lights.upload(&world).map_err(refuse)?.bytes;
            let call = start.elapsed().as_secs_f64();
            let start = Instant::now();
            machine.queue.submit([]);
            timer.wait()?;
            Ok((call, start.elapsed().as_secs_f64()))
        })?;
        let (calls, transfers): (Vec<f64>, Vec<f64>) = times.into_iter().unzip();
        let (Some(call), Some(transfer)) = (Spread::of(calls), Spread::of(transfers)) else { continue };
        rows.push(Row { percent, moved, bytes, call, transfer });
    }
    Ok(rows)
}
