//! Moves of instances, one by one and many at once.

use super::LightWorld;
use super::placing::{EffectChanges, first_refusal};
use crate::error::WorldError;
use crate::instance::placement::Placement;
use crate::keys::{InstanceKey, slot_of};

impl LightWorld {
    /// Moves an instance, at once. A linear part without inverse hides it, see [`Placement::linear`].
    /// A placement that equals the present one changes nothing. O(1).
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`], [`WorldError::Placement`].
    pub fn move_instance(&mut self, key: InstanceKey, placement: impl Into<Placement>) -> Result<(), WorldError> {
        let instance = self.scene.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        let mut effects = EffectChanges::default();
        if instance.place(&placement.into(), self.scene.origin.anchor(), &mut effects)? {
            self.effects.change(|counts| effects.apply(counts));
            self.log.moved(slot_of(key));
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
    /// [`WorldError::Move`], which names the first move that is refused. Moves that do not count
    /// are checked too.
    pub fn move_instances(&mut self, moves: &[(InstanceKey, Placement)]) -> Result<(), WorldError> {
        if let Some((index, source)) = first_refusal(moves, &self.scene) {
            return Err(WorldError::Move { index, source: Box::new(source) });
        }
        let effects = self.move_scratch.place_all(moves, &mut self.scene);
        self.effects.change(|counts| effects.apply(counts));
        let moved = &mut self.move_scratch.moved;
        if moved.len() > 0 {
            self.log.all_moved(moved);
            self.top.take();
        }
        Ok(())
    }
}
