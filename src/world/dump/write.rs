//! Writes a dump.

use std::collections::HashMap;
use std::io::{self, Write};

use super::words::{Sink, of_point, of_vector};
use super::{FIRST_SLOT, LeftOut, MAGIC, SWITCHES, VERSION, record};
use crate::effects::Effects;
use crate::keys::TreeKey;
use crate::light::Shape;
use crate::profile::Profile;
use crate::world::{LightWorld, OriginMode, TreeSource};

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
    /// `out` receives many small writes. O(lights + instances). Memory: the bytes of the largest
    /// tree.
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
        let mut sink = Sink::new(out);
        sink.bytes(&MAGIC)?;
        sink.words(&[VERSION, mode_of(scene.origin.mode)])?;
        sink.words(&of_point(scene.origin.position))?;
        let switched = SWITCHES.iter().zip(0..).filter(|(effect, _)| self.effects.counts().has(**effect));
        let LeftOut { skies, portals, waiting_trees, gpu_trees } = left_out;
        sink.words(&[switched.map(|(_, bit)| 1 << bit).sum(), skies, portals, waiting_trees, gpu_trees])?;
        let counts = [
            profiles.len(),
            trees.len(),
            scene.instances.slot_count().max(FIRST_SLOT) - FIRST_SLOT,
            scene.directionals.len(),
        ];
        sink.words(&counts.map(|count| count as u32))?;
        for profile in profiles {
            let record = profile.record();
            sink.words(&[record.len() as u32])?;
            sink.words(&record)?;
        }
        for key in &trees {
            let entry = &scene.trees[*key];
            let tree = entry.tree.bake_as_is();
            let source = self.light_source(*key).map_or(TreeSource::Cpu, |(source, _)| source);
            let bytes = tree.len() as u64;
            sink.words(&[source as u32, entry.crowd.is_loose.into(), bytes as u32, (bytes >> 32) as u32])?;
            sink.bytes(&tree)?;
        }
        let numbers: HashMap<TreeKey, u32> = trees.into_iter().zip(1..).collect();
        for slot in FIRST_SLOT as u32..scene.instances.slot_count() as u32 {
            let instance = scene.instances.key_at(slot).map(|key| &scene.instances[key]);
            match instance.and_then(|instance| Some((numbers.get(&instance.tree)?, instance))) {
                Some((tree, instance)) => {
                    sink.words(&[*tree])?;
                    sink.words(&record::encode(&instance.placement, instance.policy, &instance.appearance))?;
                }
                None => sink.words(&[0])?,
            }
        }
        for light in scene.directionals.values() {
            sink.words(&of_vector(light.direction))?;
            sink.words(&of_vector(light.illuminance))?;
        }
        sink.finish()?;
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

fn mode_of(mode: OriginMode) -> u32 {
    match mode {
        OriginMode::Free => 0,
        OriginMode::Grid => 1,
        OriginMode::Following => 2,
    }
}
