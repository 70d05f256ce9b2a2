//! Frequencies at the bottom of deep trees, below the resolution of one random number.

use super::*;
use girandole::tree::{ChildRef, NO_PARENT, WIDTH};

/// A row of lamps at falling distances from the origin, to one side of it. There, each of the first
/// is half as bright as the one before it, and all others are as bright as the last of these.
fn row(count: i32, side: f32) -> Vec<Light> {
    let lamp = |k: i32| {
        let distance = 0.8_f32.powi(k);
        Light::point(Vec3::X * (side * distance), Vec3::splat(1.0e15 * 0.5_f32.powi(k.min(37)) * distance * distance))
    };
    (0..count).map(lamp).collect()
}

/// The probabilities of the lights below a child, in sum.
fn below(tree: &LightTree, child: ChildRef, pmfs: &[f32]) -> f64 {
    match child {
        ChildRef::Leaf(light) => f64::from(pmfs[light as usize]),
        ChildRef::Node(node) => {
            let record = &tree.nodes()[node as usize];
            (0..WIDTH).filter_map(|slot| record.child(slot)).map(|child| below(tree, child, pmfs)).sum()
        }
        _ => unreachable!("this version has no others"),
    }
}

fn lights_below(tree: &LightTree, child: ChildRef) -> Vec<u32> {
    match child {
        ChildRef::Leaf(light) => vec![light],
        ChildRef::Node(node) => {
            let record = &tree.nodes()[node as usize];
            (0..WIDTH).filter_map(|slot| record.child(slot)).flat_map(|child| lights_below(tree, child)).collect()
        }
        _ => unreachable!("this version has no others"),
    }
}

/// The nodes from a light to the root.
fn depth(tree: &LightTree, light: u32) -> usize {
    let parent = |place: &u32| Some(tree.nodes()[*place as usize / WIDTH].parent).filter(|place| *place != NO_PARENT);
    std::iter::successors(Some(tree.leaves()[light as usize]), parent).count()
}

#[test]
fn lights_below_the_resolution_of_a_random_number_are_chosen_as_often_as_they_are_probable() {
    // The numbers that lead to the deepest lights are the least on one side and the greatest on the
    // other.
    let sides = [(1.0, 150), (-1.0, 151)];
    let fine = sides.map(|(side, seed)| check_deepest(&LightTree::new(row(100, side)).expect("allowed"), seed));
    assert_eq!(fine, [true, false]);
}

/// Compares frequencies with probabilities in the subtree of the deepest light. Returns whether the
/// numbers that lead there are so small that their products have all digits.
fn check_deepest(tree: &LightTree, seed: u64) -> bool {
    let at = ShadingPoint::volume(Vec3::ZERO);
    let mut pmfs = Vec::new();
    tree.distribution(&at, 0, &mut pmfs);
    let deepest = (0..100).max_by_key(|light| depth(tree, *light)).expect("a hundred");
    // Nodes have eight children, so these are forty choices between two.
    assert!(depth(tree, deepest) >= 13, "{}", depth(tree, deepest));

    // The interval of random numbers that lead to a subtree: that of each child follows from the
    // probabilities of the children before it.
    let (mut node, mut low, mut length) = (0, 0.0, 1.0);
    while length > 2.0_f64.powi(-12) {
        let record = &tree.nodes()[node as usize];
        let children: Vec<ChildRef> = (0..WIDTH).filter_map(|slot| record.child(slot)).collect();
        let on_the_way = children.iter().position(|child| lights_below(tree, *child).contains(&deepest));
        let slot = on_the_way.expect("one child holds it");
        low += children[..slot].iter().map(|child| below(tree, *child, &pmfs)).sum::<f64>();
        length = below(tree, children[slot], &pmfs);
        let ChildRef::Node(child) = children[slot] else { panic!("the subtree is too small") };
        node = child;
    }
    // Few of the 2^24 numbers lie in it. The sums of f32 may be off by two of them at its ends.
    let step = 2.0_f64.powi(-24);
    let first = (low / step).ceil() as u64 + 2;
    let numbers = ((low + length) / step).floor() as u64 - 2 - first;
    assert!((50..5000).contains(&numbers), "{numbers}");
    let (mut rng, draws) = (Rng(seed), 400_000);
    let mut counts = vec![0_u32; pmfs.len()];
    for _ in 0..draws {
        let u = (first + rng.bits() % numbers) as f64 * step;
        let (light, _) = tree.pick(&at, [u as f32, rng.unit()], 0).expect("a light");
        counts[light as usize] += 1;
    }

    // Over the lights whose intervals lie inside of the numbers that were drawn. Fresh bits and
    // roundings move a number by up to two steps.
    let inside = (first + 2) as f64 * step..=(first + numbers) as f64 * step;
    let per_step = f64::from(draws) / numbers as f64;
    let (mut from, mut chi_sq, mut cells, mut rare) = (low, 0.0, 0.0, 0);
    let (mut observed, mut expected) = (0.0, 0.0);
    for light in lights_below(tree, ChildRef::Node(node)) {
        let pmf = f64::from(pmfs[light as usize]);
        let to = from + pmf;
        if inside.contains(&from) && inside.contains(&to) {
            let (count, mean) = (f64::from(counts[light as usize]), pmf / step * per_step);
            assert!(mean > 5.0, "{light}: {mean}");
            // Measured: 0.4 and more. Without fresh bits, 383 numbers choose few of these lights.
            assert!(count > 0.2 * mean, "{light}: {count} of {mean}");
            chi_sq += (count - mean).powi(2) / mean;
            cells += 1.0;
            rare += u32::from(pmf < step);
            (observed, expected) = (observed + count, expected + mean);
            // Five standard deviations: a false alarm in one of 10^6 checks, of which there are 150.
            let slack = 2.0 * per_step + 5.0 * f64::from(draws).sqrt();
            assert!((observed - expected).abs() < slack, "up to {light}: {observed} and not {expected}");
        }
        from = to;
    }
    assert!(rare > 50 && cells > 60.0, "{rare} {cells}");
    // Above mean + 5 sqrt(2 cells) + 15 with a probability below 1e-6. Products with numbers near 1
    // round to steps of up to 2^-23, so there single lights below that have no promise.
    let is_fine = low + length < 2.0_f64.powi(-7);
    assert!(!is_fine || chi_sq < cells + 5.0 * (2.0_f64 * cells).sqrt() + 15.0, "{chi_sq} over {cells}");
    is_fine
}
