//! Reads a dump.

use std::error::Error;

use glam::Vec3;

use super::record::{Header, InstanceRecord};
use super::{LeftOut, MARK, SOURCES, SWITCHES};
use crate::error::{LoadError, check_point};
use crate::file::FileReader;
use crate::instance::appearance::check_factor;
use crate::instance::placement::{MAX_DISTANCE, Placed, Placement};
use crate::instance::sector::ORIGIN_GRID;
use crate::keys::{InstanceKey, TreeKey};
use crate::light::DirectionalLight;
use crate::policy::Policy;
use crate::profile::Profile;
use crate::tree::LightTree;
use crate::world::delta::Delta;
use crate::world::opening::MAX_OPENINGS;
use crate::world::{Instance, LightWorld};

/// The most openings and particles of all instances but the first of each tree, for whose ones the dump has nodes: what
/// a world has while it changes. Each is a part of the top level, which takes some 100 bytes for it.
const MOST_PARTS: usize = 2 * MAX_OPENINGS;

impl LightWorld {
    /// Reads a world that [`LightWorld::write_dump`] has written, on any machine. Also returns what
    /// the dump lacks.
    ///
    /// Trees and instances come in the order of the world that was dumped, with new keys. Instances
    /// have the [slots](LightWorld::slot) that they had. Samples and probabilities are those of that
    /// world, bit for bit, if nothing had moved in it since its first update. Otherwise they differ a little,
    /// because the top level is divided anew.
    /// Nothing is built until the world is edited: trees count as built, and stay opened as far as
    /// they are until an instance is added.
    ///
    /// O(bytes).
    ///
    /// # Errors
    /// [`LoadError`]. Whatever the bytes are, nothing panics, and a world that is returned can be
    /// sampled and edited; see also [`LightTree::from_baked`]. It takes memory in proportion to the
    /// bytes that were given. The top level then takes some for each opening and each particle of each
    /// instance, of which there are at most 2,097,152 beyond those of the first instance of each tree.
    pub fn from_dump(bytes: &[u8]) -> Result<(Self, LeftOut), LoadError> {
        let mut file = FileReader::open("a dump of a light world", &MARK, bytes)?;
        let mut reader = Reader { world: Self::new(), trees: Vec::new() };
        let header: Header = file.value()?;
        reader.header(&header).map_err(|why| LoadError::content("the header", why))?;
        for index in 0..header.profiles {
            read_profile(&mut file).map_err(|why| LoadError::content(format_args!("profile {index}"), why))?;
        }
        for index in 0..header.trees {
            reader.tree(&mut file).map_err(|why| LoadError::content(format_args!("tree {index}"), why))?;
        }
        reader.instances(&mut file, header.slots)?;
        for index in 0..header.directionals {
            let [direction, illuminance]: [Vec3; 2] = file.value()?;
            let added = reader.world.add_directional(DirectionalLight { direction, illuminance });
            added.map_err(|why| LoadError::content(format_args!("directional light {index}"), why))?;
        }
        file.finish()?;
        let [skies, portals, waiting_trees, gpu_trees] = header.left_out;
        Ok((reader.world, LeftOut { skies, portals, waiting_trees, gpu_trees }))
    }
}

struct Reader {
    world: LightWorld,
    trees: Vec<TreeKey>,
}

impl Reader {
    fn header(&mut self, header: &Header) -> Result<(), Box<dyn Error>> {
        if header.switches >> SWITCHES.len() != 0 {
            return Err("an effect is switched on that has no switch".into());
        }
        let origin = header.sector.as_dvec3() * ORIGIN_GRID;
        check_point("a coordinate of the origin", origin, MAX_DISTANCE)?;
        self.world.scene.origin = origin;
        self.world.record(Delta::Origin);
        for (effect, bit) in SWITCHES.into_iter().zip(0..) {
            self.world.record(Delta::Switch(effect, header.switches >> bit & 1 == 1));
        }
        Ok(())
    }

    fn tree(&mut self, file: &mut FileReader<'_>) -> Result<(), Box<dyn Error>> {
        let [source, is_loose]: [u32; 2] = file.value()?;
        let source = *SOURCES.get(source as usize).ok_or("no tree has such a source")?;
        let is_loose = *[false, true].get(is_loose as usize).ok_or("whether it is loose is neither 0 nor 1")?;
        let key = self.world.add_tree(LightTree::read(file)?);
        self.world.set_light_source(key, source)?;
        let entry = &mut self.world.scene.trees[key];
        entry.crowd.is_loose = is_loose;
        entry.openings = entry.openings_due();
        self.world.record(Delta::Counts(key));
        self.trees.push(key);
        Ok(())
    }

    /// Instances get their slots, because the top level depends on them. Empty slots are filled until
    /// all have come.
    fn instances(&mut self, file: &mut FileReader<'_>, slots: u32) -> Result<(), LoadError> {
        let of_fillers = self.world.add_tree(LightTree::default());
        let mut fillers: Vec<InstanceKey> = Vec::new();
        let mut parts = 0;
        let mut is_placed = vec![false; self.trees.len()];
        for index in 0..slots {
            let number: u32 = file.value()?;
            if number == 0 {
                let placed = Placed::new(&Placement::IDENTITY).unwrap_or_default();
                let filler = Instance::new(of_fillers, Placement::IDENTITY, Policy::Static, placed);
                fillers.push(self.world.insert_as_is(filler));
                continue;
            }
            let refused = |why| LoadError::content(format_args!("instance {index}"), why);
            let instance = self.instance(number, &file.value()?).map_err(refused)?;
            if std::mem::replace(&mut is_placed[number as usize - 1], true) {
                parts += self.world.scene.trees[instance.tree].openings.len();
            }
            if parts > MOST_PARTS {
                let beside = "openings and particles, beside those of the first instance of each tree";
                return Err(refused(format!("more than {MOST_PARTS} {beside}").into()));
            }
            self.world.insert_as_is(instance);
        }
        let world = &mut self.world;
        let removed = fillers.into_iter().try_for_each(|key| world.remove_instance(key));
        let removed = removed.and_then(|()| world.remove_tree(of_fillers));
        removed.map_err(|why| LoadError::content("the slots", why))
    }

    /// The instance of a record, of the tree with this number.
    fn instance(&self, number: u32, record: &InstanceRecord) -> Result<Instance, Box<dyn Error>> {
        let tree = *self.trees.get(number as usize - 1).ok_or("the dump has no such tree")?;
        let (placement, policy, appearance) = record.read().ok_or("a field has a value that is never written")?;
        policy.validate()?;
        check_factor(appearance.factor)?;
        let placed = Placed::new(&placement)?;
        Ok(Instance { appearance, ..Instance::new(tree, placement, policy, placed) })
    }
}

fn read_profile(file: &mut FileReader<'_>) -> Result<Profile, Box<dyn Error>> {
    let count: u32 = file.value()?;
    Ok(Profile::of_record(&file.list(count as usize)?).ok_or("its table is that of no profile")?)
}
