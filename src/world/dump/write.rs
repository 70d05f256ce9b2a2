//! Writes a dump.

use std::collections::HashMap;
use std::io::{self, Write};

use super::record::{Header, InstanceRecord};
use super::{FIRST_SLOT, LeftOut, MARK, SWITCHES};
use crate::effects::Effects;
use crate::file::FileWriter;
use crate::instance::sector;
use crate::keys::TreeKey;
use crate::light::Shape;
use crate::profile::Profile;
use crate::world::{LightWorld, TreeSource};

impl LightWorld {
    /// Writes the world as it is now, for [`LightWorld::from_dump`] on this machine or another one.
    /// Returns what the dump lacks.
    ///
    /// A dump is for people who look for a fault: a wrong transform, a light that is missing, a tree
    /// that has grown loose. It has the trees with the nodes that they have now, those that are
    /// loose included, how far they are opened, the profiles of their lights, the
    /// instances in their slots with everything that was set about them, the directional lights and
    /// the origin. It lacks keys, regions, what was learnt, the requests of trees for rebuilds, and what
    /// [`LeftOut`] counts.
    ///
    /// `out` receives many small writes. O(lights + instances). Memory: some kilobytes; for a
    /// tree whose lights were added to or removed from, a copy of it.
    ///
    /// # Errors
    /// Those of `out`.
    ///
    /// ```
    /// use girandole::{Light, LightTree, LightWorld, Placement, Policy, glam::Vec3};
    /// let mut world = LightWorld::new();
    /// let lamp = world.add_tree(LightTree::new(vec![Light::point(Vec3::Y, Vec3::ONE)])?);
    /// world.add_instance(lamp, Placement::IDENTITY, Policy::Budgeted)?;
    /// let mut file = Vec::new();
    /// let left_out = world.write_dump(&mut file)?;
    /// assert_eq!(LightWorld::from_dump(&file)?.1, left_out);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn write_dump(&self, out: &mut impl Write) -> io::Result<LeftOut> {
        let scene = &self.scene;
        let sky = scene.sky.as_ref().map(|(sky, _)| scene.instances[*sky].tree);
        let trees: Vec<TreeKey> = scene.trees.keys().filter(|tree| Some(*tree) != sky).collect();
        let profiles = self.profiles();
        let left_out = LeftOut {
            skies: u32::from(sky.is_some()),
            portals: scene.portals.len() as u32,
            waiting_trees: trees.iter().filter(|tree| !scene.trees[**tree].staged.is_empty()).count() as u32,
            gpu_trees: scene.sources.iter().flatten().count() as u32,
        };
        let LeftOut { skies, portals, waiting_trees, gpu_trees } = left_out;
        let switched = SWITCHES.iter().zip(0..).filter(|(effect, _)| self.effects.counts().has(**effect));
        let mut file = FileWriter::new(&MARK, out)?;
        file.value(&Header {
            sector: sector::number(scene.origin.as_vec3()).into(),
            switches: switched.map(|(_, bit)| 1 << bit).sum(),
            left_out: [skies, portals, waiting_trees, gpu_trees],
            profiles: profiles.len() as u32,
            trees: trees.len() as u32,
            slots: (scene.instances.slot_count().max(FIRST_SLOT) - FIRST_SLOT) as u32,
            directionals: scene.directionals.len() as u32,
        })?;
        for profile in profiles {
            let record = profile.record();
            file.value(&(record.len() as u32))?;
            file.list(&record)?;
        }
        for key in &trees {
            let entry = &scene.trees[*key];
            let source = self.light_source(*key).map_or(TreeSource::Cpu, |(source, _)| source);
            file.value(&[source as u32, entry.crowd.is_loose.into()])?;
            entry.tree.write_as_is(&mut file)?;
        }
        let numbers: HashMap<TreeKey, u32> = trees.into_iter().zip(1..).collect();
        for slot in FIRST_SLOT as u32..scene.instances.slot_count() as u32 {
            let instance = scene.instances.key_at(slot).map(|key| &scene.instances[key]);
            match instance.and_then(|instance| Some((numbers.get(&instance.tree)?, instance))) {
                Some((tree, instance)) => {
                    file.value(tree)?;
                    file.value(&InstanceRecord::of(&instance.placement, instance.policy, &instance.appearance))?;
                }
                None => file.value(&0_u32)?,
            }
        }
        for light in scene.directionals.values() {
            file.value(&[light.direction, light.illuminance])?;
        }
        file.finish()?;
        Ok(left_out)
    }

    /// The profiles of all lights, each once, in the order of the lights.
    fn profiles(&self) -> Vec<Profile> {
        let mut found: Vec<Profile> = Vec::new();
        let trees = self.scene.trees.values().filter(|entry| entry.tree.effects().has(Effects::PROFILES));
        for light in trees.flat_map(|entry| entry.tree.lights()) {
            if let Shape::Profile { profile, .. } = light.shape
                && !found.contains(&profile)
            {
                found.push(profile);
            }
        }
        found
    }
}
