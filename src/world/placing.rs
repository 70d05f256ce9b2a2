//! Puts instances in other places.

use super::scene::{Instance, Scene};
use super::slot_set::SlotSet;
use crate::effects::EffectCounts;
use crate::error::{PlacementError, WorldError};
use crate::instance::placement::{Anchor, Placed, Placement};
use crate::keys::{InstanceKey, slot_of};

/// Threads take this many moves at a time, and share the work of four times as many: about 300 µs,
/// several times what it takes to wake a thread.
#[cfg(feature = "parallel")]
const MOVES_PER_TASK: usize = 256;

/// Memory of [`LightWorld::move_instances`](crate::LightWorld::move_instances), kept for the next call.
#[derive(Debug, Default)]
pub(super) struct MoveScratch {
    /// The slots of instances that are moved to another place.
    pub moved: SlotSet,
    /// The slots of instances whose last move was done.
    done: SlotSet,
    /// For each slot, the index of its last move, where threads share the work.
    #[cfg(feature = "parallel")]
    last: Vec<usize>,
}

/// The effects of instances that change with their placement, as they are now and as they were.
#[derive(Default)]
pub(super) struct EffectChanges {
    present: EffectCounts,
    former: EffectCounts,
}

impl EffectChanges {
    #[cfg(feature = "parallel")]
    fn merge(mut self, other: Self) -> Self {
        self.present.add_all(&other.present);
        self.former.add_all(&other.former);
        self
    }

    pub fn apply(&self, counts: &mut EffectCounts) {
        counts.add_all(&self.present);
        counts.remove_all(&self.former);
    }
}

impl Instance {
    /// Puts the instance in a place. Returns whether it was elsewhere.
    pub(super) fn place(
        &mut self,
        placement: &Placement,
        anchor: Anchor,
        effects: &mut EffectChanges,
    ) -> Result<bool, PlacementError> {
        if *placement == self.placement {
            return Ok(false);
        }
        // Effects depend on the linear part alone.
        let former = (placement.linear != self.placement.linear).then(|| self.effects());
        Placed::move_to(&mut self.placed, &mut self.placement, placement, anchor)?;
        let Some(former) = former else { return Ok(true) };
        let present = self.effects();
        if former != present {
            effects.present.add(present);
            effects.former.add(former);
        }
        Ok(true)
    }
}

impl MoveScratch {
    /// Puts the instances of moves that were checked in their places, and collects the slots of
    /// those that were elsewhere.
    pub fn place_all(&mut self, moves: &[(InstanceKey, Placement)], scene: &mut Scene) -> EffectChanges {
        #[cfg(feature = "parallel")]
        if is_shared(moves) {
            return self.place_on_threads(moves, scene);
        }
        let Self { moved, done, .. } = self;
        let mut effects = EffectChanges::default();
        // The last move first: the earlier ones of an instance do not count.
        for (key, placement) in moves.iter().rev().filter(|(key, _)| done.insert(slot_of(*key))) {
            let instance = &mut scene.instances[*key];
            if instance.place(placement, scene.origin.anchor(), &mut effects).expect("checked before") {
                moved.insert(slot_of(*key));
            }
        }
        done.drain(|_| {});
        effects
    }

    /// [`MoveScratch::place_all`] on rayon's threads. Each has some of the slots, so that no two of
    /// them place one instance.
    #[cfg(feature = "parallel")]
    fn place_on_threads(&mut self, moves: &[(InstanceKey, Placement)], scene: &mut Scene) -> EffectChanges {
        let (Self { moved, last, .. }, Scene { instances, origin, .. }) = (self, scene);
        let anchor = origin.anchor();
        last.resize(instances.slot_count(), 0);
        for (index, (key, _)) in moves.iter().enumerate() {
            moved.insert(slot_of(*key));
            last[slot_of(*key) as usize] = index;
        }
        let place = |effects: &mut EffectChanges, slot: &mut Option<(InstanceKey, Instance)>| {
            let (key, instance) = slot.as_mut().expect("checked before");
            let (_, placement) = &moves[last[slot_of(*key) as usize]];
            instance.place(placement, anchor, effects).expect("checked before")
        };
        moved.retain_on_threads(instances.slots_mut(), place, EffectChanges::merge)
    }
}

/// The first move that is refused, with its index and the reason.
pub(super) fn first_refusal(moves: &[(InstanceKey, Placement)], scene: &Scene) -> Option<(usize, WorldError)> {
    let anchor = scene.origin.anchor();
    let refusal = |(index, (key, placement)): (usize, &(InstanceKey, Placement))| {
        let Some(instance) = scene.instances.get(*key) else {
            return Some((index, WorldError::NoSuchInstance(*key)));
        };
        Placed::check(&instance.placement, placement, anchor).err().map(|source| (index, source.into()))
    };
    #[cfg(feature = "parallel")]
    if is_shared(moves) {
        use rayon::prelude::*;
        return moves.par_iter().with_min_len(MOVES_PER_TASK).enumerate().find_map_first(refusal);
    }
    moves.iter().enumerate().find_map(refusal)
}

/// Whether threads share the work of these moves. A single thread does it faster in turn.
#[cfg(feature = "parallel")]
fn is_shared(moves: &[(InstanceKey, Placement)]) -> bool {
    moves.len() >= 4 * MOVES_PER_TASK && rayon::current_num_threads() > 1
}
