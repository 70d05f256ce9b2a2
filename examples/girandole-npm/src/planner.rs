//! Plans: what a device has to do to follow a world.

use girandole::CutOptions;
use girandole::plan::{Commands, LightPlanner, NewBuffer, PlanLimits};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::failure::Failure;
use crate::player::PlanPlayer;
use crate::shader::names;
use crate::vectors::vector;
use crate::world::World;

/// What a device holds of one world. Keep one for each world and device.
#[wasm_bindgen(js_name = LightPlanner)]
pub struct Planner {
    planner: LightPlanner,
    /// The buffers of the cells, until they are made.
    cut_buffers: Vec<NewBuffer>,
    /// What is played before the next upload: the cells, and cameras.
    ahead: Vec<Commands>,
}

#[wasm_bindgen(js_class = LightPlanner)]
impl Planner {
    /// Creates a planner for a device that holds nothing yet. `largestBuffer` is the size in bytes of the
    /// largest storage buffer that it makes and binds. `cells` is the number of cells of neighbouring points that may
    /// share cuts, 1 to 65,536: by default 32,768, which take 67 MB on the device.
    #[wasm_bindgen(constructor)]
    pub fn new(
        #[wasm_bindgen(js_name = largestBuffer)] largest_buffer: f64,
        cells: Option<u32>,
    ) -> Result<Self, Failure> {
        let mut options = CutOptions::default();
        if let Some(cells) = cells {
            options = CutOptions::new(options.edge(), cells as usize)?;
        }
        // Saturates, and the limits are bounded.
        let mut planner = LightPlanner::new(PlanLimits::new(largest_buffer as u64));
        let plan = planner.reserve_cells(options, None).plan();
        Ok(Self { planner, cut_buffers: plan.new_buffers, ahead: vec![plan.upload] })
    }

    /// Makes cells follow the pixels of a camera from the next `play` on. `eye` is its position, and `pixel` the size
    /// of a pixel at a distance of one metre, both in metres. Without it all cells have the same size.
    #[wasm_bindgen(js_name = setCutView)]
    pub fn set_cut_view(
        &mut self,
        #[wasm_bindgen(unchecked_param_type = "ArrayLike<number>")] eye: &[f32],
        pixel: f32,
    ) -> Result<(), Failure> {
        self.ahead.push(self.planner.set_cut_view(vector("eye", eye)?.as_dvec3(), pixel));
        Ok(())
    }

    /// Plays what brings the device up to date with the world, as of the world's last update, and builds the cuts of
    /// the cells that shaders have marked since the last call. Returns the bytes that were written for the lights: 0 if
    /// nothing changed. If the player throws, so does this, and the next call sends everything again.
    pub fn play(&mut self, world: &World, player: &PlanPlayer) -> Result<f64, Failure> {
        let reservation = self.planner.reserve(world.lights())?;
        self.cut_buffers.iter().chain(reservation.new_buffers()).try_for_each(|buffer| player.make(buffer))?;
        let plan = reservation.plan();
        self.cut_buffers.clear();
        let (ahead, cuts) = (std::mem::take(&mut self.ahead), self.planner.build_cuts());
        let mut lists = ahead.iter().chain([&plan.upload, &plan.top, &cuts]);
        let played = lists.try_for_each(|commands| player.play(commands)).and_then(|()| player.let_go(&plan.freed));
        if played.is_err() {
            self.planner.lose();
        }
        played.map(|()| plan.report.bytes as f64)
    }

    /// The buffers that the page's shaders bind, in the order of the bindings of `wgsl`; `undefined` before
    /// the first plan. A plan that replaces one of them replaces the first one too.
    pub fn bindings(&self) -> Option<Vec<u32>> {
        let lights = self.planner.bindings()?;
        Some(lights.iter().chain(&self.planner.cells()?).map(|id| id.get()).collect())
    }

    /// The effects that the text of `wgsl` must support: those of the world at the last plan.
    pub fn effects(&self) -> Vec<String> {
        names(self.planner.effects())
    }
}
