//! Plans: what a device has to do to follow a world.

use girandole::plan::{LightPlanner, PlanLimits};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::failure::Failure;
use crate::player::PlanPlayer;
use crate::shader::names;
use crate::world::World;

/// What a device holds of one world. Keep one for each world and device.
#[wasm_bindgen(js_name = LightPlanner)]
pub struct Planner(LightPlanner);

#[wasm_bindgen(js_class = LightPlanner)]
impl Planner {
    /// Creates a planner for a device that holds nothing yet. `largestBuffer` is the size in bytes of the
    /// largest storage buffer that it makes and binds.
    #[wasm_bindgen(constructor)]
    pub fn new(#[wasm_bindgen(js_name = largestBuffer)] largest_buffer: f64) -> Self {
        // Saturates, and the limits are bounded.
        Self(LightPlanner::new(PlanLimits::new(largest_buffer as u64)))
    }

    /// Plays what brings the device up to date with the world, as of the world's last update: nothing if
    /// nothing changed. Returns the bytes that were written. If the player throws, so does this, and the
    /// next call sends everything again.
    pub fn play(&mut self, world: &World, player: &PlanPlayer) -> Result<f64, Failure> {
        let reservation = self.0.reserve(world.lights())?;
        reservation.new_buffers().iter().try_for_each(|buffer| player.make(buffer))?;
        let plan = reservation.plan();
        let played = player.play(&plan.upload).and_then(|()| player.play(&plan.top));
        let played = played.and_then(|()| player.let_go(&plan.freed));
        if played.is_err() {
            self.0.lose();
        }
        played.map(|()| plan.report.bytes as f64)
    }

    /// The buffers that the page's shaders bind, in the order of the bindings of `wgsl`; `undefined` before
    /// the first plan. A plan that replaces one of them replaces the first one too.
    pub fn bindings(&self) -> Option<Vec<u32>> {
        self.0.bindings().map(|buffers| buffers.iter().map(|id| id.get()).collect())
    }

    /// The effects that the text of `wgsl` must support: those of the world at the last plan.
    pub fn effects(&self) -> Vec<String> {
        names(self.0.effects())
    }
}
