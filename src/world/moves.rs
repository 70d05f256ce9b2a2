//! Moves of instances, one by one and many at once.

use glam::DVec3;
use slotmap::SlotMap;

use super::slot_set::SlotSet;
use super::{Instance, LightWorld};
use crate::error::WorldError;
use crate::keys::{InstanceKey, slot_of};
use crate::placement::{Placed, Placement};

/// Threads take this many moves at a time: about 30 µs of work, far more than it takes to share it.
#[cfg(feature = "parallel")]
const MOVES_PER_TASK: usize = 256;

/// What a move does, before anything is changed.
#[derive(Debug)]
enum Move {
    /// Nothing: the instance is already there.
    None,
    To(Option<Placed>),
    /// The call is refused.
    Refused(WorldError),
}

/// Memory of [`LightWorld::move_instances`], kept for the next call.
#[derive(Debug, Default)]
pub(super) struct MoveScratch {
    moves: Vec<Move>,
    /// The slots of the moves that were done so far.
    done: SlotSet,
}

impl Move {
    fn of(instances: &SlotMap<InstanceKey, Instance>, origin: DVec3, key: InstanceKey, placement: &Placement) -> Self {
        match instances.get(key) {
            None => Self::Refused(WorldError::NoSuchInstance(key)),
            Some(instance) if instance.placement == *placement => Self::None,
            Some(_) => match Placed::new(placement, origin) {
                Ok(placed) => Self::To(placed),
                Err(source) => Self::Refused(source.into()),
            },
        }
    }
}

impl LightWorld {
    /// Moves an instance, at once. A linear part of all zeros hides it, see [`Placement::linear`].
    /// A placement that equals the present one changes nothing. O(1).
    ///
    /// [`LightWorld::move_instances`] takes less time for many.
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`], [`WorldError::Placement`].
    pub fn move_instance(&mut self, key: InstanceKey, placement: impl Into<Placement>) -> Result<(), WorldError> {
        let placement = placement.into();
        match Move::of(&self.instances, self.origin, key, &placement) {
            Move::None => {}
            Move::To(placed) => self.place(key, placement, placed),
            Move::Refused(error) => return Err(error),
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
    /// O(moves). The world keeps its working memory, about 200 bytes for each move of the largest
    /// call so far: a call that is no larger, and whose instances were moved before, allocates
    /// nothing but what rayon needs to share the work.
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
        let mut scratch = std::mem::take(&mut self.move_scratch);
        let result = self.move_all(moves, &mut scratch);
        self.move_scratch = scratch;
        result
    }

    fn move_all(&mut self, moves: &[(InstanceKey, Placement)], scratch: &mut MoveScratch) -> Result<(), WorldError> {
        let Self { instances, origin, .. } = &*self;
        let check = |(key, placement): &(InstanceKey, Placement)| Move::of(instances, *origin, *key, placement);
        #[cfg(feature = "parallel")]
        {
            use rayon::prelude::*;
            moves.par_iter().with_min_len(MOVES_PER_TASK).map(check).collect_into_vec(&mut scratch.moves);
        }
        #[cfg(not(feature = "parallel"))]
        {
            scratch.moves.clear();
            scratch.moves.extend(moves.iter().map(check));
        }
        let refusal = |(index, checked): (usize, &Move)| match checked {
            Move::Refused(source) => Some((index, source.clone())),
            _ => None,
        };
        if let Some((index, source)) = scratch.moves.iter().enumerate().find_map(refusal) {
            return Err(WorldError::Move { index, source: Box::new(source) });
        }
        // The last one first, so that the earlier moves of an instance are known to be superseded.
        for ((key, placement), checked) in moves.iter().zip(scratch.moves.drain(..)).rev() {
            if scratch.done.insert(slot_of(*key))
                && let Move::To(placed) = checked
            {
                self.place(*key, *placement, placed);
            }
        }
        scratch.done.clear();
        Ok(())
    }

    /// Puts a live instance in another place.
    fn place(&mut self, key: InstanceKey, placement: Placement, placed: Option<Placed>) {
        let instance = &mut self.instances[key];
        let former = instance.effects();
        instance.placed = placed;
        instance.placement = placement;
        let present = instance.effects();
        if former != present {
            self.effects.change(|counts| {
                counts.add(present);
                counts.remove(former);
            });
        }
        self.changes.moved(slot_of(key));
        self.top.take();
    }
}
