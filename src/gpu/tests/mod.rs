//! Tests that need a device: of the plans' commands, one by one, and of [`GpuLights`] as a whole.

mod heat_map;
mod lights;
mod lost;
mod pool;
mod profile;
mod scatter;
mod sky;
mod sort;
mod sources;
mod top;
mod upload;

use super::player::Player;
use super::testing::{gpu, read};
use crate::plan::buffers::Ids;
use crate::plan::draft::{Draft, Growth};
use crate::plan::{BufferId, Commands, NewBuffer};

/// Plays commands of single parts of the planner on the shared device.
pub(super) struct Rig {
    pub player: Player,
    pub ids: Ids,
}

impl Rig {
    pub fn new() -> Self {
        let (device, queue) = gpu();
        let mut player = Player::new(&device, &queue);
        player.is_shared = true;
        Self { player, ids: Ids::default() }
    }

    /// Makes the buffers and plays the upload of a draft.
    pub fn draft<R>(&mut self, growth: Growth, make: impl FnOnce(&mut Draft) -> R) -> R {
        let mut draft = Draft::new(self.ids, growth);
        let result = make(&mut draft);
        self.ids = draft.ids;
        self.player.create(&draft.plan.new_buffers).expect("room enough");
        self.player.play(&draft.plan.upload);
        result
    }

    /// Makes buffers and plays what `plan` adds.
    pub fn play(&mut self, new: &[NewBuffer], plan: impl FnOnce(&mut Commands)) {
        self.player.create(new).expect("room enough");
        let mut commands = Commands::default();
        plan(&mut commands);
        self.player.play(&commands);
    }

    /// The content of a buffer.
    pub fn read<T: bytemuck::Pod>(&self, id: BufferId) -> Vec<T> {
        let (device, queue) = gpu();
        read(&device, &queue, self.player.buffer(id))
    }
}
