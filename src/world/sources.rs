//! Trees whose lights a kernel of the engine writes on the GPU.

use super::LightWorld;
use super::delta::Delta;
use super::scene::Scene;
use super::source::{Source, TreeSource};
use crate::effects::Effects;
use crate::error::WorldError;
use crate::keys::TreeKey;

impl LightWorld {
    /// Lets a kernel of the engine write the lights of a tree on the GPU, or the CPU again.
    ///
    /// The tree is added with as many lights as the kernel may write, of the kinds, ranges, sides and
    /// opening angles that they keep. The kernel may change positions, shapes and emission, and makes
    /// lights dark that are not in use. It runs in each frame between the upload and the build of the top
    /// level, and calls functions of `girandole::plan::wgsl_of_sources`, with the
    /// [number](LightWorld::light_source) of the tree. Before the top level is built, the GPU refits the
    /// tree from what was written.
    ///
    /// What the CPU knows of such a tree are the lights as they were last [set](LightWorld::set_lights):
    /// a [`LightSampler`](crate::LightSampler) samples these, crowds are counted and stand-ins are made from
    /// them. So set them where the lights really are about, before or after this call. The top level follows what is
    /// read back of them: see `GpuLights::follow_sources`.
    ///
    /// | | [`TreeSource::GpuMesh`] | [`TreeSource::GpuParticles`] |
    /// |---|---|---|
    /// | work in a frame | O(lights), the refit | O(lights), and the top level has a leaf for each light of each instance |
    /// | noise | grows as lights part from their neighbours, until a rebuild | as of a fresh build |
    /// | rebuilds | as policies request them: see `GpuLights::follow_sources` | none |
    ///
    /// O(1) for [`TreeSource::GpuMesh`], O(lights · log lights) for [`TreeSource::GpuParticles`].
    ///
    /// # Errors
    /// [`WorldError::NoSuchTree`]; [`WorldError::ProfileOnGpu`] if a light of the tree has a profile. While a
    /// later edit gives it such a light, writes of the kernel do nothing.
    pub fn set_light_source(&mut self, tree: TreeKey, source: TreeSource) -> Result<(), WorldError> {
        let Scene { trees, sources, .. } = &mut self.scene;
        let entry = trees.get_mut(tree).ok_or(WorldError::NoSuchTree(tree))?;
        let (former, is_cpu) = (entry.source.as_ref(), source == TreeSource::Cpu);
        if source == former.map_or(TreeSource::Cpu, |former| former.by) {
            return Ok(());
        }
        if !is_cpu && entry.tree.effects().has(Effects::PROFILES) {
            return Err(WorldError::ProfileOnGpu);
        }
        let free = || sources.iter().position(Option::is_none).unwrap_or(sources.len());
        let number = former.map_or_else(free, |former| former.number as usize);
        sources.resize(sources.len().max(number + 1), None);
        sources[number] = (!is_cpu).then_some(tree);
        entry.source = (!is_cpu).then(|| Box::new(Source { by: source, number: number as u32, refused: (0, 0) }));
        self.record(Delta::WholeTree(tree));
        self.open(tree);
        self.crowds.look_at_soon(tree);
        Ok(())
    }

    /// Who writes the lights of a tree, with the number by which kernels know its source; `None` for a stale
    /// key and for a tree whose lights the CPU writes. The number stays the same while the tree has a source.
    pub fn light_source(&self, tree: TreeKey) -> Option<(TreeSource, u32)> {
        self.scene.trees.get(tree)?.source.as_ref().map(|source| (source.by, source.number))
    }

    /// How many writes of lights of a tree kernels were refused, as far as the GPU has told so far: see
    /// [`wgsl_of_sources`](crate::plan::wgsl_of_sources). 0 for a tree without a source.
    pub fn refused_writes(&self, tree: TreeKey) -> u64 {
        self.scene.trees.get(tree).and_then(|entry| entry.source.as_ref()).map_or(0, |source| source.refused.1)
    }
}

#[cfg(test)]
mod tests {
    use glam::{Quat, Vec3};

    use super::*;
    use crate::profile::tests::street_lamp;
    use crate::{FrameBudget, Light, LightTree, Placement, Policy};

    fn tree(count: usize) -> LightTree {
        LightTree::new((0..count).map(|i| Light::point(Vec3::X * i as f32, Vec3::ONE)).collect()).expect("valid")
    }

    #[test]
    fn numbers_stay_while_a_tree_has_a_source_and_are_used_again_after_it() {
        let mut world = LightWorld::new();
        let trees: Vec<_> = (0..4).map(|_| world.add_tree(tree(20))).collect();
        for key in &trees[..3] {
            world.set_light_source(*key, TreeSource::GpuMesh).expect("no profiles");
        }
        let number = |world: &LightWorld, key| world.light_source(key).map(|(_, number)| number);
        assert_eq!([0, 1, 2, 3].map(|i| number(&world, trees[i])), [Some(0), Some(1), Some(2), None]);
        assert_eq!(world.effect_counts().of(Effects::MOVING), 3);
        world.set_light_source(trees[1], TreeSource::GpuParticles).expect("no profiles");
        assert_eq!(world.light_source(trees[1]), Some((TreeSource::GpuParticles, 1)));
        world.set_light_source(trees[0], TreeSource::Cpu).expect("always");
        world.remove_tree(trees[1]).expect("no instances");
        assert_eq!(world.effect_counts().of(Effects::MOVING), 1);
        assert_eq!((world.light_source(trees[0]), world.light_source(trees[1])), (None, None));
        world.set_light_source(trees[3], TreeSource::GpuMesh).expect("no profiles");
        assert_eq!(number(&world, trees[3]), Some(0));
        assert_eq!(world.set_light_source(trees[1], TreeSource::Cpu), Err(WorldError::NoSuchTree(trees[1])));
    }

    #[test]
    fn each_particle_is_a_part_of_each_instance_whatever_happens_to_the_tree() {
        let mut world = LightWorld::new();
        let key = world.add_tree(tree(300));
        for place in [0.0, 7.0] {
            world.add_instance(key, Placement::at(glam::DVec3::Y * place), Policy::Budgeted).expect("valid");
        }
        world.set_light_source(key, TreeSource::GpuParticles).expect("no profiles");
        let parts = |world: &mut LightWorld| world.update(FrameBudget::NONE).parts;
        assert_eq!(parts(&mut world), 600);
        world.rebuild_tree(key).expect("live");
        assert_eq!(parts(&mut world), 600);
        world.replace_lights(key, tree(50).lights().to_vec()).expect("valid");
        assert_eq!(parts(&mut world), 100);
        world.set_light_source(key, TreeSource::Cpu).expect("always");
        assert!(parts(&mut world) < 100);
    }

    #[test]
    fn lights_with_profiles_are_refused() {
        let mut world = LightWorld::new();
        let lamp = Light::profile(Vec3::ZERO, Quat::IDENTITY, street_lamp(3), Vec3::ONE);
        let key = world.add_tree(LightTree::new(vec![lamp]).expect("valid"));
        assert_eq!(world.set_light_source(key, TreeSource::GpuMesh), Err(WorldError::ProfileOnGpu));
        assert_eq!((world.light_source(key), WorldError::ProfileOnGpu.code()), (None, 216));
    }
}
