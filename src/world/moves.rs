//! Moves of instances, one by one and many at once.

use super::slot_set::SlotSet;
use super::{Instance, LightWorld};
use crate::effects::EffectCounts;
use crate::error::{PlacementError, WorldError};
use crate::instance::placement::{Anchor, Placed, Placement};
use crate::keys::{InstanceKey, slot_of};

/// Threads take this many moves at a time, and share the work of four times as many: about 300 µs,
/// several times what it takes to wake a thread.
#[cfg(feature = "parallel")]
const MOVES_PER_TASK: usize = 256;

/// Memory of [`LightWorld::move_instances`], kept for the next call.
#[derive(Debug, Default)]
pub(super) struct MoveScratch {
    /// The slots of instances that are moved to another place.
    moved: SlotSet,
    /// The slots of instances whose last move was done.
    done: SlotSet,
    /// For each slot, the index of its last move, where threads share the work.
    #[cfg(feature = "parallel")]
    last: Vec<usize>,
}

/// The effects of instances that change with their placement, as they are now and as they were.
#[derive(Default)]
struct EffectChanges {
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

    fn apply(&self, counts: &mut EffectCounts) {
        counts.add_all(&self.present);
        counts.remove_all(&self.former);
    }
}

impl Instance {
    /// Puts the instance in a place. Returns whether it was elsewhere.
    fn place(
        &mut self,
        placement: &Placement,
        anchor: Anchor,
        effects: &mut EffectChanges,
    ) -> Result<bool, PlacementError> {
        if *placement == self.placement {
            return Ok(false);
        }
        let placed = Placed::moved(self.placed.as_ref(), &self.placement, placement, anchor)?;
        let former = self.effects();
        self.placed = placed;
        self.placement = *placement;
        let present = self.effects();
        if former != present {
            effects.present.add(present);
            effects.former.add(former);
        }
        Ok(true)
    }
}

impl LightWorld {
    /// Moves an instance, at once. A linear part of all zeros hides it, see [`Placement::linear`].
    /// A placement that equals the present one changes nothing. O(1).
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`], [`WorldError::Placement`].
    pub fn move_instance(&mut self, key: InstanceKey, placement: impl Into<Placement>) -> Result<(), WorldError> {
        let instance = self.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        let mut effects = EffectChanges::default();
        if instance.place(&placement.into(), self.origin.anchor(), &mut effects)? {
            self.effects.change(|counts| effects.apply(counts));
            self.changes.moved(slot_of(key));
            self.top.take();
        }
        Ok(())
    }

    /// Moves many instances, at once and on rayon's threads. The world is then the same, bit for
    /// bit, as after [`LightWorld::move_instance`] for each of them.
    ///
    /// Of several moves of one instance, the last one counts, and the others leave no trace: an
    /// instance whose last placement equals its present one is not reported, and nothing is sent
    /// for it. If a move is refused, nothing is moved.
    ///
    /// O(moves), and a look at 8 bytes for each 4096 slots. The world keeps 8 bytes for each slot
    /// from the first call on. Calls for instances that were moved before allocate nothing but what
    /// rayon needs to share the work.
    ///
    /// ```
    /// use girandole::glam::{DVec3, Vec3};
    /// use girandole::{Light, LightWorld, Placement, Policy};
    /// let mut world = LightWorld::new();
    /// let lamp = world.add_tree(vec![Light::point(Vec3::Y, Vec3::ONE)])?;
    /// let cars: Vec<_> = (0..100)
    ///     .map(|_| world.add_instance(lamp, Placement::IDENTITY, Policy::Budgeted))
    ///     .collect::<Result<_, _>>()?;
    /// world.take_delta();
    /// let moves: Vec<_> =
    ///     (0..50).map(|i| (cars[2 * i], Placement::at(DVec3::X * i as f64))).collect();
    /// world.move_instances(&moves)?;
    /// // The first one is where it was.
    /// assert_eq!(world.take_delta().moved_instances().len(), 49);
    /// # Ok::<(), girandole::WorldError>(())
    /// ```
    ///
    /// # Errors
    /// [`WorldError::Move`], which names the first move that is refused. Moves that do not count
    /// are checked too.
    pub fn move_instances(&mut self, moves: &[(InstanceKey, Placement)]) -> Result<(), WorldError> {
        if let Some((index, source)) = self.first_refusal(moves) {
            return Err(WorldError::Move { index, source: Box::new(source) });
        }
        let effects = self.place_all(moves);
        self.effects.change(|counts| effects.apply(counts));
        let moved = &mut self.move_scratch.moved;
        self.changes.all_moved(moved);
        if moved.clear() > 0 {
            self.top.take();
        }
        Ok(())
    }

    /// The first move that is refused, with its index and the reason.
    fn first_refusal(&self, moves: &[(InstanceKey, Placement)]) -> Option<(usize, WorldError)> {
        let anchor = self.origin.anchor();
        let refusal = |(index, (key, placement)): (usize, &(InstanceKey, Placement))| {
            let Some(instance) = self.instances.get(*key) else {
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

    /// Puts the instances of moves that were checked in their places, and collects the slots of
    /// those that were elsewhere.
    fn place_all(&mut self, moves: &[(InstanceKey, Placement)]) -> EffectChanges {
        #[cfg(feature = "parallel")]
        if is_shared(moves) {
            return self.place_on_threads(moves);
        }
        let MoveScratch { moved, done, .. } = &mut self.move_scratch;
        let mut effects = EffectChanges::default();
        // The last move first: the earlier ones of an instance do not count.
        for (key, placement) in moves.iter().rev().filter(|(key, _)| done.insert(slot_of(*key))) {
            let instance = &mut self.instances[*key];
            if instance.place(placement, self.origin.anchor(), &mut effects).expect("checked before") {
                moved.insert(slot_of(*key));
            }
        }
        done.clear();
        effects
    }

    /// [`LightWorld::place_all`] on rayon's threads. Each has some of the slots, so that no two of
    /// them place one instance.
    #[cfg(feature = "parallel")]
    fn place_on_threads(&mut self, moves: &[(InstanceKey, Placement)]) -> EffectChanges {
        let Self { instances, origin, move_scratch: MoveScratch { moved, last, .. }, .. } = self;
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

/// Whether threads share the work of these moves. A single thread does it faster in turn.
#[cfg(feature = "parallel")]
fn is_shared(moves: &[(InstanceKey, Placement)]) -> bool {
    moves.len() >= 4 * MOVES_PER_TASK && rayon::current_num_threads() > 1
}
