//! Files with wrong contents and a right checksum, at random: a tree that loads can be sampled,
//! refitted and rebuilt, and its probabilities are true.

use proptest::prelude::*;

use super::*;
use crate::file::seal;
use crate::policy::Policy;
use crate::shading::shading_point::ShadingPoint;
use crate::tree::testing::Rng;
use crate::world::LightWorld;

/// A pick multiplies probabilities on the way down and a pmf on the way up, so both round
/// differently.
const PMF_TOLERANCE: f32 = 1.0e-5;

/// Samples the tree in a world, and uses it in all other ways.
fn use_tree(tree: LightTree, rng: &mut Rng) -> Result<(), TestCaseError> {
    let mut world = LightWorld::new();
    let key = world.add_tree(tree.clone());
    world.add_instance(key, Placement::IDENTITY, Policy::Budgeted).expect("valid");
    let sampler = world.sampler();
    for _ in 0..8 {
        let at = ShadingPoint::surface(rng.position(40.0), rng.position(1.0).normalize_or(Vec3::Y));
        let pmfs: Vec<f32> = sampler.all_lights().map(|light| sampler.pmf(&at, light)).collect();
        prop_assert!(pmfs.iter().all(|pmf| (0.0..=1.0 + PMF_TOLERANCE).contains(pmf)), "{pmfs:?}");
        let sum: f32 = pmfs.iter().sum();
        prop_assert!(sum <= 1.0 + 1.0e-4, "the probabilities of all lights sum to {sum}");
        for _ in 0..8 {
            if let Some(pick) = sampler.pick(&at, [rng.unit(), rng.unit()]) {
                let pmf = sampler.pmf(&at, pick.light);
                prop_assert!(pick.pmf > 0.0 && (pick.pmf - pmf).abs() <= PMF_TOLERANCE * pmf, "{} {pmf}", pick.pmf);
            }
        }
    }
    let mut tree = tree;
    if !tree.lights().is_empty() {
        let changes: Vec<_> = (0..tree.lights().len() as u32).step_by(3).map(|i| (i, any_light(rng))).collect();
        tree.apply(&changes);
        tree.refit();
        // The first refit makes all nodes anew, so nothing of the file is left but its shape.
        prop_assert!(tree.check().is_ok(), "{:?}", tree.check());
    }
    tree.rebuild();
    prop_assert!(tree.check().is_ok());
    Ok(())
}

/// Whether each light that sends something to one of some shading points can be chosen there.
fn is_covered(tree: LightTree) -> bool {
    let mut rng = Rng(5);
    let mut world = LightWorld::new();
    let key = world.add_tree(tree);
    world.add_instance(key, Placement::IDENTITY, Policy::Budgeted).expect("valid");
    let sampler = world.sampler();
    (0..4).all(|_| {
        let at = ShadingPoint::surface(rng.position(40.0), rng.position(1.0).normalize_or(Vec3::Y));
        sampler
            .all_lights()
            .filter(|light| sampler.sample_light(&at, *light, [0.5, 0.5]).is_some())
            .all(|light| sampler.pmf(&at, light) > 0.0)
    })
}

#[test]
fn a_tree_that_passes_the_check_covers_its_lights_whichever_byte_of_its_file_was_forged() {
    let mut rng = Rng(29);
    let (mut refused, mut found, mut accepted) = (0, 0, 0);
    for count in [1, 9, 40] {
        let bytes = LightTree::build(any_lights(&mut rng, count)).bake();
        for at in PREFIX_BYTES..bytes.len() - 4 {
            for mask in [1, 0x80, 0x55] {
                let mut forged = bytes.clone();
                forged[at] ^= mask;
                seal(&mut forged);
                match LightTree::from_baked(&forged).map(|tree| (tree.check(), tree)) {
                    Err(_) => refused += 1,
                    Ok((Err(_), _)) => found += 1,
                    Ok((Ok(()), tree)) => {
                        accepted += 1;
                        assert!(is_covered(tree), "{count} lights, byte {at}, {mask}");
                    }
                }
            }
        }
    }
    // Costs, attributes and the colours of lights may be anything.
    assert!(refused > 1000 && found > 1000 && accepted > 100, "{refused} {found} {accepted}");
}

#[test]
fn the_check_finds_a_forged_cluster_of_the_whole_tree() {
    let lights = (0..30).map(|i| Light::point(Vec3::X * i as f32, Vec3::ONE).with_range(20.0)).collect();
    let forge: [fn(&mut LightTree); 4] = [
        |tree| tree.root.range = 1.0,
        |tree| tree.root.aabb.max.x = 3.0,
        |tree| tree.root.cos_half_angle = 0.9,
        |tree| tree.root.mean.y = 1.0,
    ];
    let tree = LightTree::build(lights);
    for forge in forge {
        let mut forged = frozen(&tree);
        forge(&mut forged);
        let loaded = LightTree::from_baked(&forged.bake()).expect("nothing that loading looks at");
        assert_eq!(loaded.check().expect_err("forged").node, loaded.nodes().len());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]

    #[test]
    fn a_forged_file_is_refused_or_holds_a_tree_that_can_be_used(
        seed in any::<u64>(),
        count in 0_usize..120,
        // Bytes of nodes and numbers more often than those of lights, which are most.
        changes in proptest::collection::vec((any::<usize>(), any::<bool>(), any::<u8>(), 0_u8..4), 1..4),
    ) {
        let mut rng = Rng(seed);
        let mut bytes = LightTree::build(any_lights(&mut rng, count)).bake();
        let after_lights = HEADER_BYTES + count * 56;
        for (at, is_anywhere, value, kind) in changes {
            let end = bytes.len() - 4;
            let start = if is_anywhere || after_lights >= end { PREFIX_BYTES } else { after_lights };
            let at = start + at % (end - start);
            match kind {
                0 => bytes[at] = value,
                1 => bytes[at] ^= 1 << (value % 8),
                2 => bytes[at] = bytes[at].wrapping_add(1),
                _ => bytes[at] = [0, 255, 127, 128][usize::from(value) % 4],
            }
        }
        seal(&mut bytes);
        if let Ok(tree) = LightTree::from_baked(&bytes) {
            prop_assert_eq!(tree.bake(), bytes);
            use_tree(tree, &mut rng)?;
        }
    }

    /// Nodes and their lists, changed as numbers.
    #[test]
    fn a_tree_with_forged_links_is_refused_or_can_be_used(
        seed in any::<u64>(),
        count in 9_usize..200,
        changes in proptest::collection::vec((0_u8..6, any::<usize>(), any::<usize>()), 1..4),
    ) {
        let mut rng = Rng(seed);
        let mut tree = LightTree::build(any_lights(&mut rng, count));
        tree.freeze();
        let nodes = tree.nodes.len();
        for (kind, a, b) in changes {
            let (node, slot) = (a % nodes, a / nodes % 8);
            match kind {
                0 => tree.nodes[node].children[slot] = (b % nodes) as u32,
                1 => tree.nodes[node].children[slot] = crate::tree::LEAF | (b % count) as u32,
                2 => tree.nodes[node].parent = (b % (8 * nodes)) as u32,
                3 => tree.leaves.swap(a % count, b % count),
                4 => tree.nodes.swap(node, b % nodes),
                _ => tree.light_counts[node] = (b % count) as u32,
            }
        }
        if let Ok(tree) = LightTree::from_baked(&tree.bake()) {
            use_tree(tree, &mut rng)?;
        }
    }
}
