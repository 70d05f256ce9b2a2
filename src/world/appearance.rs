//! Edits of what an instance changes about the lights of its tree, besides their place.

use glam::Vec3;

use super::LightWorld;
use crate::error::WorldError;
use crate::instance::appearance::{Appearance, check_factor};
use crate::keys::{InstanceKey, slot_of};

impl LightWorld {
    /// Enables or disables all lights of an instance, at once. A disabled instance is treated as
    /// one that its placement hides: it keeps its key, slot, placement and policy, and
    /// contributes nothing. Instances are enabled at first. A value that equals the present one
    /// changes nothing. O(1).
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`].
    pub fn set_enabled(&mut self, instance: InstanceKey, is_enabled: bool) -> Result<(), WorldError> {
        self.change_appearance(instance, |appearance| appearance.set_enabled(is_enabled))
    }

    /// Whether an instance is enabled; `None` for a stale key.
    pub fn is_enabled(&self, instance: InstanceKey) -> Option<bool> {
        self.instance(instance).map(|instance| instance.appearance.is_enabled())
    }

    /// Sets what the emission of an instance's lights is multiplied by, at once: a linear colour,
    /// each channel from 0 to [`MAX_FACTOR`](crate::MAX_FACTOR). It is 1 at first.
    ///
    /// One of 5,000 cars dims without a tree of its own: the next upload sends one record of 96 or
    /// 144 bytes, and the top level is built again. Samples, probabilities and all sums over lights
    /// follow the factor; [`LightWorld::tree`] holds the lights without it. Lights are chosen by
    /// the luminance of the factor, so a factor whose colour differs from that of the lights costs
    /// some noise. An instance whose factor has no luminance in f32 is not shown, as if it were
    /// disabled. A value that equals the present one changes nothing. O(1).
    ///
    /// Instances with a factor other than 1 have [`Effects::FACTORS`](crate::Effects::FACTORS).
    ///
    /// # Errors
    /// [`WorldError::Factor`] for a channel that is negative, NaN or too large;
    /// [`WorldError::NoSuchInstance`].
    pub fn set_factor(&mut self, instance: InstanceKey, factor: Vec3) -> Result<(), WorldError> {
        check_factor(factor)?;
        self.change_appearance(instance, |appearance| appearance.set_factor(factor))
    }

    /// The factor of an instance; `None` for a stale key.
    pub fn factor(&self, instance: InstanceKey) -> Option<Vec3> {
        self.instance(instance).map(|instance| instance.appearance.factor())
    }

    /// Sets which shading points the lights of an instance reach, at once: those whose
    /// [mask](crate::ShadingPoint::mask) has a bit in common with this one. All bits are set at
    /// first. A mask of 0 meets no shading point.
    ///
    /// A light that does not reach a shading point is never chosen there: its probability is 0, it
    /// sends nothing, and those of the other lights add up as if it did not exist. Use it to link
    /// lights with rooms or with objects. Directional lights reach all shading points. A value that
    /// equals the present one changes nothing. O(1).
    ///
    /// Instances with another mask than that of all bits have
    /// [`Effects::MASKS`](crate::Effects::MASKS). The next upload sends one record, and the top
    /// level is built again. Shaders without the effect ignore the masks of shading points.
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`].
    pub fn set_mask(&mut self, instance: InstanceKey, mask: u32) -> Result<(), WorldError> {
        self.change_appearance(instance, |appearance| appearance.mask = mask)
    }

    /// The mask of an instance; `None` for a stale key.
    pub fn mask(&self, instance: InstanceKey) -> Option<u32> {
        self.instance(instance).map(|instance| instance.appearance.mask)
    }

    /// Sets 32 bits that each sample of the instance's lights returns:
    /// [`LightSample::user_data`](crate::LightSample::user_data) on the CPU, and
    /// `light_user_data(sample.instance)` in shaders. They are 0 at first, and the library does not
    /// interpret them. Takes effect at once.
    ///
    /// The next upload sends the record of the instance, and the top level is not built again. A
    /// value that equals the present one changes nothing. O(1).
    ///
    /// # Errors
    /// [`WorldError::NoSuchInstance`].
    pub fn set_user_data(&mut self, instance: InstanceKey, user_data: u32) -> Result<(), WorldError> {
        self.change_appearance(instance, |appearance| appearance.user_data = user_data)
    }

    /// The user data of an instance; `None` for a stale key.
    pub fn user_data(&self, instance: InstanceKey) -> Option<u32> {
        self.instance(instance).map(|instance| instance.appearance.user_data)
    }

    /// Changes the appearance of an instance, and records what follows from that. An instance that
    /// is not shown has no record on the GPU, so a change of it has no consequences until it is
    /// shown.
    fn change_appearance(&mut self, key: InstanceKey, change: impl FnOnce(&mut Appearance)) -> Result<(), WorldError> {
        let instance = self.scene.instances.get_mut(key).ok_or(WorldError::NoSuchInstance(key))?;
        let mut appearance = instance.appearance;
        change(&mut appearance);
        let is_alike = appearance.is_alike(&instance.appearance);
        if is_alike && appearance.user_data == instance.appearance.user_data {
            return Ok(());
        }
        let (was_shown, former) = (instance.shown().is_some(), instance.effects());
        instance.appearance = appearance;
        let (is_shown, present) = (instance.shown().is_some(), instance.effects());
        if former != present {
            self.effects.change(|counts| {
                counts.add(present);
                counts.remove(former);
            });
        }
        match (was_shown, is_shown) {
            (false, false) => {}
            (true, true) if is_alike => self.log.user_data(slot_of(key)),
            (true, true) => {
                self.log.altered(slot_of(key));
                self.top.take();
            }
            _ => self.instance_changed(key),
        }
        Ok(())
    }
}
