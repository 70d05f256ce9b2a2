//! A tree after a million refits.

use girandole::glam::{Mat3, Quat, Vec3};
use girandole::{Light, ShadingPoint};

use super::{changed, checked, mapped};
use testbed::testing::support::Rng;

/// The light after a move, a turn about its place, and a change of its brightness; dark at times.
fn edited(light: &Light, first: &Light, rng: &mut Rng) -> Light {
    let place = light.aabb().center();
    let turn = Mat3::from_quat(Quat::from_axis_angle(rng.direction(), rng.between(0.0, 6.0)));
    // Light stays near its first place, so that a million steps do not lead out of the world.
    let back = (first.aabb().center() - place) * 0.01;
    let step = back + rng.position(0.05);
    let emission = match rng.bits() % 16 {
        0 => Vec3::ZERO,
        _ => first.emission * 10.0_f32.powf(rng.between(-12.0, 12.0)),
    };
    // The shape of the first light, so that edges that turn a million times keep their lengths.
    let here = place + step;
    let middle = first.aabb().center();
    let light = mapped(first, |p| here + turn * (p - middle), |v| turn * v);
    light.with_emission(emission)
}

#[test]
fn a_million_refits_of_one_tree_end_at_the_bits_of_a_single_refit() {
    let mut rng = Rng(80);
    for count in [7_u32, 60] {
        let first = rng.lights(count as usize, 5.0);
        let fresh = checked(first.clone());
        let mut tree = fresh.clone();
        for round in 0..500_000 {
            let index = (rng.bits() % u64::from(count)) as u32;
            let light = edited(&tree.lights()[index as usize], &first[index as usize], &mut rng);
            tree.set_lights(&[(index, light)]).expect("the light is valid");
            // Attributes that are left out are computed by the next refit that measures.
            if round % 4 == 0 { tree.refit_without_attributes() } else { tree.refit() }
        }
        tree.refit();
        tree.check().expect("the tree is sound");

        let mut once = fresh;
        once.set_lights(&changed(&tree, |light| *light)).expect("the lights are valid");
        once.refit();
        assert!(tree.nodes() == once.nodes(), "{count} lights");
        assert_eq!((tree.cluster(), tree.attributes()), (once.cluster(), once.attributes()));
        assert_eq!(tree.flux(), once.flux());
        for _ in 0..20 {
            let (at, splits) = (rng.shading_point(8.0), 6);
            let pmfs = |tree: &girandole::LightTree| (0..count).map(|i| tree.pmf(&at, i, splits)).collect::<Vec<f32>>();
            assert_eq!(pmfs(&tree), pmfs(&once), "{at:?}");
        }
        let moved = ShadingPoint::volume(tree.lights()[0].aabb().center());
        assert!((0..count).any(|i| tree.pmf(&moved, i, 0) > 0.0));
    }
}
