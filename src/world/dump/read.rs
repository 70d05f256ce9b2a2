//! Reads a dump.

use super::words::{Rest, WORD, to_point, to_vector};
use super::{DumpError, LeftOut, MAGIC, SWITCHES, VERSION, record};
use crate::error::WorldError;
use crate::instance::placement::{Anchor, Placed, Placement};
use crate::keys::{InstanceKey, TreeKey};
use crate::light::DirectionalLight;
use crate::policy::Policy;
use crate::profile::Profile;
use crate::tree::LightTree;
use crate::world::delta::Delta;
use crate::world::opening::MAX_OPENINGS;
use crate::world::{Instance, LightWorld, OriginMode, TreeSource};

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
    /// [`DumpError`]. Whatever the bytes are, nothing panics, and a world that is returned can be
    /// sampled and edited; see also [`LightTree::from_baked`]. It takes memory in proportion to the
    /// bytes that were given. The top level then takes some for each opening and each particle of each
    /// instance, of which there are at most 2,097,152 beyond those of the first instance of each tree.
    pub fn from_dump(bytes: &[u8]) -> Result<(Self, LeftOut), DumpError> {
        let (mut rest, version) = check(bytes)?;
        if version != VERSION {
            return Err(DumpError::Version { given: version, supported: VERSION });
        }
        let mut reader = Reader { world: Self::new(), trees: Vec::new() };
        let header = reader.header(&mut rest)?;
        let [profiles, trees, slots, directionals] = header.counts;
        for index in 0..profiles as usize {
            read_profile(&mut rest).ok_or(DumpError::Record { what: "profile", index })?;
        }
        for index in 0..trees as usize {
            reader.tree(&mut rest, index)?;
        }
        reader.instances(&mut rest, slots as usize)?;
        for index in 0..directionals as usize {
            let words = rest.words::<6>().ok_or(DumpError::Record { what: "directional light", index })?;
            let [direction, illuminance] = [0, 3].map(|at| to_vector([words[at], words[at + 1], words[at + 2]]));
            let added = reader.world.add_directional(DirectionalLight { direction, illuminance });
            added.map_err(|source| DumpError::World { what: "directional light", index, source })?;
        }
        if rest.0.is_empty() {
            Ok((reader.world, header.left_out))
        } else {
            Err(DumpError::Record { what: "the end, byte", index: bytes.len() - WORD - rest.0.len() })
        }
    }
}

/// Checks that some bytes are a dump, whole and undamaged. Returns what follows its version.
fn check(bytes: &[u8]) -> Result<(Rest<'_>, u32), DumpError> {
    let content = bytes.strip_prefix(&MAGIC).ok_or(DumpError::NotADump)?;
    // A file that is too short for both has no right checksum either.
    let (content, stored) = content.split_at(content.len().saturating_sub(WORD));
    let stored = Rest(stored).words::<1>().map_or(0, |[stored]| stored);
    let summed = &bytes[..MAGIC.len() + content.len()];
    let mut rest = Rest(content);
    let version = rest.words::<1>();
    let computed = crc32fast::hash(summed);
    match version {
        // Other versions may be sealed in another way.
        Some([version]) if version != VERSION || stored == computed => Ok((rest, version)),
        _ => Err(DumpError::Checksum { stored, computed }),
    }
}

/// The values of the world as a whole.
struct Header {
    left_out: LeftOut,
    /// Profiles, trees, slots of instances, directional lights.
    counts: [u32; 4],
}

struct Reader {
    world: LightWorld,
    trees: Vec<TreeKey>,
}

impl Reader {
    fn header(&mut self, rest: &mut Rest<'_>) -> Result<Header, DumpError> {
        let refused = DumpError::Record { what: "the header, field", index: 0 };
        let words = rest.words::<12>().ok_or(refused.clone())?;
        let [mode, x, y, z, u, v, w, switches, skies, portals, waiting_trees, gpu_trees] = words;
        let counts = rest.words::<4>().ok_or(refused.clone())?;
        let modes = [OriginMode::Free, OriginMode::Grid, OriginMode::Following];
        let mode = *modes.get(mode as usize).ok_or(refused.clone())?;
        let world = &mut self.world;
        let placed = world.set_origin_mode(mode).and_then(|()| world.set_origin(to_point([x, y, z, u, v, w])));
        placed.map_err(|source| DumpError::World { what: "the header, field", index: 1, source })?;
        if switches >> SWITCHES.len() != 0 {
            return Err(refused);
        }
        SWITCHES
            .iter()
            .zip(0..)
            .for_each(|(effect, bit)| world.record(Delta::Switch(*effect, switches >> bit & 1 == 1)));
        Ok(Header { left_out: LeftOut { skies, portals, waiting_trees, gpu_trees }, counts })
    }

    fn tree(&mut self, rest: &mut Rest<'_>, index: usize) -> Result<(), DumpError> {
        let refused = DumpError::Record { what: "tree", index };
        let (source, is_loose, bytes) = read_tree(rest).ok_or(refused)?;
        let tree = LightTree::from_baked(bytes).map_err(|source| DumpError::Tree { index, source })?;
        let key = self.world.add_tree(tree);
        let sourced = self.world.set_light_source(key, source);
        sourced.map_err(|source| DumpError::World { what: "tree", index, source })?;
        let entry = &mut self.world.scene.trees[key];
        entry.crowd.is_loose = is_loose;
        entry.openings = entry.openings_due();
        self.world.record(Delta::Counts(key));
        self.trees.push(key);
        Ok(())
    }

    /// Instances get their slots, because the top level depends on them. Empty slots are filled until
    /// all have come.
    fn instances(&mut self, rest: &mut Rest<'_>, slots: usize) -> Result<(), DumpError> {
        let of_fillers = self.world.add_tree(LightTree::default());
        let mut fillers: Vec<InstanceKey> = Vec::new();
        let mut parts = 0;
        let mut is_placed = vec![false; self.trees.len()];
        for index in 0..slots {
            let refused = DumpError::Record { what: "instance", index };
            let wrong = |source: WorldError| DumpError::World { what: "instance", index, source };
            let [number] = rest.words().ok_or(refused.clone())?;
            if number == 0 {
                let placed = Placed::new(&Placement::IDENTITY, Anchor::Sector).unwrap_or_default();
                let filler = Instance::new(of_fillers, Placement::IDENTITY, Policy::Static, placed);
                fillers.push(self.world.insert_as_is(filler));
                continue;
            }
            let place = number as usize - 1;
            let tree = *self.trees.get(place).ok_or(refused.clone())?;
            let words = rest.words().ok_or(refused.clone())?;
            let (placement, policy, appearance) = record::decode(&words).ok_or(refused.clone())?.map_err(wrong)?;
            let placed = Placed::new(&placement, self.world.scene.origin.anchor());
            let placed = placed.map_err(|source| wrong(source.into()))?;
            if std::mem::replace(&mut is_placed[place], true) {
                let entry = &self.world.scene.trees[tree];
                parts += entry.openings.len();
            }
            if parts > MOST_PARTS {
                return Err(DumpError::Parts { index, most: MOST_PARTS });
            }
            let instance = Instance { appearance, ..Instance::new(tree, placement, policy, placed) };
            self.world.insert_as_is(instance);
        }
        let world = &mut self.world;
        let removed = fillers.into_iter().try_for_each(|key| world.remove_instance(key));
        let removed = removed.and_then(|()| world.remove_tree(of_fillers));
        removed.map_err(|source| DumpError::World { what: "slot", index: 0, source })
    }
}

fn read_profile(rest: &mut Rest<'_>) -> Option<Profile> {
    let [count] = rest.words()?;
    Profile::of_record(&rest.list(count as usize)?)
}

/// The source of a tree, whether its crowd makes it loose, and the baked tree.
fn read_tree<'a>(rest: &mut Rest<'a>) -> Option<(TreeSource, bool, &'a [u8])> {
    let [source, is_loose @ (0 | 1), low, high] = rest.words()? else { return None };
    let bytes = usize::try_from(u64::from(low) | u64::from(high) << 32).ok()?;
    let sources = [TreeSource::Cpu, TreeSource::GpuMesh, TreeSource::GpuParticles];
    Some((*sources.get(source as usize)?, is_loose == 1, rest.bytes(bytes)?))
}
