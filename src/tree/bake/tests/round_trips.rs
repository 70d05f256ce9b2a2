//! A loaded tree is the baked one, now and after later edits.

use super::*;

fn loaded(tree: &LightTree) -> LightTree {
    LightTree::from_baked(&tree.bake()).expect("bytes that were just written")
}

#[test]
fn a_loaded_tree_is_the_frozen_tree_bit_for_bit_and_bakes_to_the_same_bytes() {
    for tree in trees() {
        let bytes = tree.bake();
        let loaded = LightTree::from_baked(&bytes).expect("bytes that were just written");
        loaded.check().expect("the loaded tree is sound");
        assert!(whole_state(&loaded) == whole_state(&frozen(&tree)), "{tree:?}");
        assert_eq!(loaded.bake(), bytes);
        assert_eq!(loaded.memory_bytes(), frozen(&tree).memory_bytes());
        let records = size_of::<Record>() * tree.lights().len() + size_of_val(tree.nodes());
        let numbers = 4 * tree.lights().len() + 4 * tree.nodes().len();
        assert_eq!(bytes.len(), HEADER_BYTES + 72 * tree.sides().len() + records + numbers + 4);
    }
}

#[test]
fn a_tree_whose_last_edits_wait_for_a_refit_is_baked_as_if_they_did_not() {
    let mut rng = Rng(12);
    for mut tree in trees().into_iter().filter(|tree| tree.light_count() > 0) {
        let index = present(&tree)[0];
        let emission = Vec3::splat(rng.between(1.0, 9.0));
        tree.apply(&[(index, Light { emission, ..tree.lights()[index as usize] })]);
        let before = whole_state(&tree);
        let loaded = loaded(&tree);
        assert!(whole_state(&tree) == before, "the baked tree has not changed");
        loaded.check().expect("the loaded tree is sound");
        assert!(whole_state(&loaded) == whole_state(&frozen(&tree)));
    }
}

#[test]
fn a_loaded_tree_goes_on_as_the_baked_one() {
    type Step = fn(&mut LightTree, &mut Rng);
    let edit: Step = |tree, rng| {
        let changes: Vec<_> = present(tree).into_iter().step_by(5).map(|i| (i, any_light(rng))).collect();
        tree.apply(&changes);
    };
    let next: [Step; 5] = [
        |tree, _| tree.refit(),
        |tree, _| tree.refit_without_attributes(),
        |tree, _| tree.rebuild(),
        |tree, _| tree.freeze(),
        |tree, _| *tree = LightTree::from_baked(&tree.bake()).expect("bytes that were just written"),
    ];
    for (number, tree) in trees().into_iter().enumerate() {
        for first in 0..next.len() {
            let [mut kept, mut loaded] = [tree.clone(), loaded(&tree)];
            for tree in [&mut kept, &mut loaded] {
                let mut rng = Rng(first as u64);
                for round in 0..3 {
                    edit(tree, &mut rng);
                    next[(first + round * round) % next.len()](tree, &mut rng);
                }
                // Both are equal once the attributes are up to date and neither is frozen.
                edit(tree, &mut rng);
                tree.refit();
                tree.check().expect("the tree is sound");
            }
            assert!(whole_state(&kept) == whole_state(&loaded), "tree {number}, first step {first}");
        }
    }
}

#[test]
fn a_tree_does_not_depend_on_the_number_of_threads_that_load_it() {
    let bytes = LightTree::build(any_lights(&mut Rng(13), 40_000)).bake();
    let load = || LightTree::from_baked(&bytes).expect("bytes that were just written");
    let [one, four] = [1, 4].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        pool.install(load)
    });
    assert!(whole_state(&one) == whole_state(&four));
    assert_eq!(one.bake(), bytes);
}

#[test]
fn a_tree_that_was_baked_when_the_version_was_made_still_loads() {
    // The file is what `bake` returned for `LightTree::new_for` of the lights below and a placement
    // that squashes z by 0.01, when the format was made. Nothing that is compared here depends on the
    // machine's mathematical library.
    let bytes = include_bytes!("../../../../tests/data/version_6.tree");
    let tree = LightTree::from_baked(bytes).expect("a file of this version");
    let lights = any_lights(&mut Rng(14), 60);
    assert_eq!(tree.lights(), lights);
    assert!(!tree.sides().is_empty() && tree.nodes().len() > 8 && tree.reference().is_some());
    assert_eq!(tree.bake(), bytes);
    let mut edited = tree.clone();
    edited.apply(&[(3, lights[4])]);
    edited.refit();
    edited.check().expect("the tree is sound");
}
