//! Edits of what an instance changes about the lights of its tree, besides their place.

use super::LightWorld;
use super::delta::Delta;
use super::log::InstanceChange;
use crate::error::WorldError;
use crate::instance::appearance::{Appearance, check_factor};
use crate::keys::InstanceKey;

impl LightWorld {
    /// Changes the [appearance](Appearance) of an instance, at once: whether its lights shine, their colour, which
    /// shading points they reach and what their samples carry. O(1).
    ///
    /// One of 5,000 cars dims without a tree of its own: the next upload sends one record of
    /// 160 bytes, and the top level is built again. A change of user data alone does not build it. An appearance that
    /// equals the present one changes nothing.
    ///
    /// ```
    /// # use girandole::glam::Vec3;
    /// # use girandole::{Light, LightTree, LightWorld, Placement, Policy};
    /// # let mut world = LightWorld::new();
    /// # let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)])?);
    /// # let car = world.add_instance(lamp, Placement::IDENTITY, Policy::Budgeted)?;
    /// world.set_appearance(car, |appearance| appearance.factor = Vec3::splat(0.2))?;
    /// world.set_appearance(car, |appearance| appearance.is_enabled = false)?;
    /// assert_eq!(world.instance(car).map(|car| car.appearance.factor.x), Some(0.2));
    /// # Ok::<(), girandole::WorldError>(())
    /// ```
    ///
    /// # Errors
    /// [`WorldError::Value`] for a channel that is negative, NaN or too large;
    /// [`WorldError::NoSuchInstance`].
    pub fn set_appearance(&mut self, key: InstanceKey, change: impl FnOnce(&mut Appearance)) -> Result<(), WorldError> {
        let instance = self.scene.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        let (former, was_shown) = (instance.appearance, instance.shown().is_some());
        let mut appearance = former;
        change(&mut appearance);
        if appearance == former {
            return Ok(());
        }
        check_factor(appearance.factor)?;
        instance.appearance = appearance;
        let change = match (was_shown, instance.shown().is_some()) {
            // It has no record on the GPU until it is shown.
            (false, false) => return Ok(()),
            (true, true) if appearance.is_alike(&former) => InstanceChange::UserData,
            (true, true) => InstanceChange::Altered,
            _ => InstanceChange::Shown,
        };
        self.record(Delta::Instance(key, change));
        Ok(())
    }
}
