//! Moves of instances, one by one and many at once.

use super::LightWorld;
use super::delta::Delta;
use super::log::InstanceChange;
use super::scene::{Instance, Scene};
use crate::error::{ValueError, WorldError};
use crate::instance::placement::{Placed, Placement};
use crate::keys::{InstanceKey, slot_of};

/// A thread takes at most this many moves at a time: about 60 µs, several times what it takes to wake it.
#[cfg(feature = "parallel")]
const MOVES_PER_TASK: usize = 256;

/// In place of the number of a move that leaves its instance where it is.
const STAYS: u32 = u32::MAX;

impl LightWorld {
    /// Moves an instance, at once. A linear part without inverse hides it, see [`Placement::linear`].
    /// A placement that equals the present one changes nothing. O(1).
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`], [`WorldError::Value`].
    pub fn move_instance(&mut self, key: InstanceKey, placement: impl Into<Placement>) -> Result<(), WorldError> {
        let instance = self.scene.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        let placement = placement.into();
        if placement != instance.placement {
            instance.place(&placement)?;
            self.record(Delta::Instance(key, InstanceChange::Moved));
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
    /// O(moves · log moves). The world keeps 8 bytes for each move of the largest call. Calls of no more moves allocate
    /// nothing but what rayon needs to share the work.
    ///
    /// ```
    /// use girandole::glam::{DVec3, Vec3};
    /// use girandole::{Light, LightTree, LightWorld, Placement, Policy};
    /// let mut world = LightWorld::new();
    /// let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)])?);
    /// let cars: Vec<_> = (0..100)
    ///     .map(|_| world.add_instance(lamp, Placement::IDENTITY, Policy::Budgeted))
    ///     .collect::<Result<_, _>>()?;
    /// let before = world.revision();
    /// let moves: Vec<_> =
    ///     (0..50).map(|i| (cars[2 * i], Placement::at(DVec3::X * i as f64))).collect();
    /// world.move_instances(&moves)?;
    /// // The first one is where it was.
    /// assert_eq!(world.changes_since(before).moved_instances().count(), 49);
    /// # Ok::<(), girandole::WorldError>(())
    /// ```
    ///
    /// # Errors
    /// [`WorldError::Entry`], which names the first move that is refused. Moves that do not count
    /// are checked too.
    pub fn move_instances(&mut self, moves: &[(InstanceKey, Placement)]) -> Result<(), WorldError> {
        if let Some((index, source)) = first_refusal(moves, &self.scene) {
            return Err(WorldError::entry("move", index, source));
        }
        let mut order = std::mem::take(&mut self.move_order);
        order.extend(moves.iter().zip(0..).map(|((key, _), index)| (slot_of(*key), index)));
        order.sort_unstable();
        // The last move of each slot counts.
        order.dedup_by(|later, kept| {
            let is_same = later.0 == kept.0;
            kept.1 = if is_same { later.1 } else { kept.1 };
            is_same
        });
        place(&mut order, 0, self.scene.instances.slots_mut(), moves);
        for (_, index) in order.drain(..).filter(|(_, index)| *index != STAYS) {
            self.record(Delta::Instance(moves[index as usize].0, InstanceChange::Moved));
        }
        self.move_order = order;
        Ok(())
    }
}

impl Instance {
    /// Puts the instance in a place, as far as its data go.
    pub(super) fn place(&mut self, placement: &Placement) -> Result<(), ValueError> {
        Placed::move_to(&mut self.placed, &mut self.placement, placement)
    }
}

/// Puts the instances of some slots, the first of which is `first`, in the places of moves that were checked. `order`
/// are slots in ascending order with their moves; those of instances that were there already get [`STAYS`]. Halves of
/// many moves are done by two threads, so that no two of them write one instance, and memory is read in order.
fn place(
    order: &mut [(u32, u32)],
    first: u32,
    slots: &mut [Option<(InstanceKey, Instance)>],
    moves: &[(InstanceKey, Placement)],
) {
    #[cfg(feature = "parallel")]
    if order.len() > MOVES_PER_TASK {
        let (low, high) = order.split_at_mut(order.len() / 2);
        let middle = high[0].0;
        let (of_low, of_high) = slots.split_at_mut((middle - first) as usize);
        rayon::join(|| place(low, first, of_low, moves), || place(high, middle, of_high, moves));
        return;
    }
    for (slot, index) in order {
        let (_, instance) = slots[(*slot - first) as usize].as_mut().expect("checked before");
        let (_, placement) = &moves[*index as usize];
        if *placement == instance.placement {
            *index = STAYS;
        } else {
            instance.place(placement).expect("checked before");
        }
    }
}

/// The first move that is refused, with its index and the reason.
fn first_refusal(moves: &[(InstanceKey, Placement)], scene: &Scene) -> Option<(usize, WorldError)> {
    let refusal = |(index, (key, placement)): (usize, &(InstanceKey, Placement))| {
        let Some(instance) = scene.instances.get(*key) else {
            return Some((index, WorldError::NoSuchInstance(*key)));
        };
        Placed::check(&instance.placement, placement).err().map(|source| (index, source.into()))
    };
    #[cfg(feature = "parallel")]
    if moves.len() > MOVES_PER_TASK {
        use rayon::prelude::*;
        return moves.par_iter().with_min_len(MOVES_PER_TASK).enumerate().find_map_first(refusal);
    }
    moves.iter().enumerate().find_map(refusal)
}
