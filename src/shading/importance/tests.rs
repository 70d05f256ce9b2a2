use super::*;
use crate::light::{Light, Shape};
use crate::math::simd::{VectorJob, with_vectors};
use crate::shading::gloss::Gloss;
use crate::tree::LightTree;

struct Importances<'a>(&'a Node, &'a LocalShadingPoint<'a>);

impl VectorJob for Importances<'_> {
    type Output = ChildImportances;

    #[inline(always)]
    fn run(self) -> ChildImportances {
        child_importances(self.0, self.1)
    }
}

fn place(i: usize) -> Vec3 {
    let turn = |speed: f32| (i as f32 * speed).sin();
    Vec3::new(turn(0.7), turn(1.3), turn(2.1)) * 30.0
}

fn tree_of_all_kinds() -> LightTree {
    let turn = |i: usize, speed: f32| (i as f32 * speed).sin();
    let light = |i: usize| {
        let direction = place(i + 1).normalize();
        let emission = Vec3::splat(1.0 + turn(i, 3.7));
        match i % 3 {
            0 => Light::rectangle(place(i), direction, place(i + 2) * 0.01, emission),
            1 => Light::spot(place(i), direction, 0.1, 0.1 + turn(i, 0.3).abs(), emission).with_range(20.0),
            _ => Light::point(place(i), emission),
        }
    };
    LightTree::new((0..2000).map(light).collect()).expect("valid lights")
}

#[test]
fn importances_are_the_same_bits_with_vectors_and_without() {
    let tree = tree_of_all_kinds();
    let bits = |children: ChildImportances| [children.importance, children.doubt].map(|lanes| lanes.map(f32::to_bits));
    for (i, node) in tree.nodes().iter().enumerate() {
        // The third point is on a lamp, or near one.
        for shading_point in [
            ShadingPoint::surface(place(i + 7), place(i + 9)),
            ShadingPoint::volume(place(i + 7)),
            ShadingPoint::volume(node.cluster(0).mean),
        ] {
            let local = LocalShadingPoint::of(&shading_point);
            assert_eq!(bits(with_vectors(Importances(node, &local))), bits(Importances(node, &local).run()));
        }
    }
}

/// A child of one point and of the lights of a cap about an axis, as the shading point sees it.
fn beam(center: Vec3, axis: Vec3, cos_half_angle: f32) -> Unpacked {
    Unpacked {
        toward: center.to_array(),
        center: center.to_array(),
        half: [0.0; 3],
        radius_sq: 0.0,
        variance: 0.0,
        deviation_sq: 0.0,
        axis: axis.to_array(),
        length: 1.0,
        cos_half_angle,
        flux: 1.0,
        range: UNLIMITED_RANGE,
    }
}

#[test]
fn darkness_is_proven_only_beyond_the_rounding_of_positions() {
    const MARGIN: f32 = 0.1;
    let in_volume = LocalShadingPoint::of(&ShadingPoint::volume(Vec3::ZERO));
    let along_y = |half| LocalSegment { unit: Vec3::Y, half };
    for (axis, across) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)] {
        for (share, is_dark) in [(0.5, false), (2.0, true)] {
            let inside = share * MARGIN;
            // Below the horizon.
            let surface = LocalShadingPoint::of(&ShadingPoint::surface(Vec3::ZERO, axis));
            let lamp = beam(across - inside * axis, axis, -1.0);
            let view = ClusterView::new(&lamp, &surface, lamp.gap_sq(MARGIN));
            assert_eq!(is_provably_dark(&lamp, &view, &surface, MARGIN), is_dark, "{axis} {share}");
            // Behind the edge of half a sphere.
            let lamp = beam(across + inside * axis, axis, 0.0);
            let view = ClusterView::new(&lamp, &in_volume, lamp.gap_sq(MARGIN));
            assert_eq!(is_provably_dark(&lamp, &view, &in_volume, MARGIN), is_dark, "{axis} {share}");
            // The same from a short segment across the axis.
            let segment = LocalSegment { unit: across, half: 1.0e-3 };
            let dark = segment_is_provably_dark(&lamp, &segment, (1.0, 1.0), MARGIN);
            assert_eq!(dark, is_dark, "{axis} {share}");
        }
    }
    // Squares of longer distances may be infinite, and then prove nothing.
    let farthest = MAX_DIST_SQ.sqrt();
    let is_dark = |center: Vec3, half: f32| {
        let lamp = beam(farthest * center, Vec3::X, 0.5);
        let beyond = farthest * farthest * center.length_squared();
        segment_is_provably_dark(&lamp, &along_y(farthest * half), (beyond, beyond), 0.0)
    };
    assert!(is_dark(Vec3::new(0.3, 0.0, 0.3), 0.3));
    for (center, half) in [
        (Vec3::new(1.1, 0.0, 0.0), 0.0),
        (Vec3::new(0.0, 0.0, 1.1), 0.0),
        (Vec3::new(0.6, 0.0, 0.6), 0.0),
        (Vec3::new(0.0, 0.0, 0.6), 0.6),
    ] {
        assert!(!is_dark(center, half), "{center} {half}");
    }
}

#[test]
fn the_error_of_a_position_is_that_of_its_coordinates_and_of_the_least_distance() {
    for (reach, expected) in [(0.0, 2.4e-21), (1.0e-4, 1.5e-20), (1.0e4, 5.4e-5)] {
        let error_sq = position_error_sq(reach);
        assert!((error_sq / expected - 1.0).abs() < 1.0e-5, "{reach}: {error_sq}");
    }
}

#[test]
fn gloss_adds_to_the_doubt_about_a_cluster() {
    let tree = tree_of_all_kinds();
    let (normal, view) = (Vec3::Y, Vec3::new(0.6, 0.8, 0.0));
    let mut compared = 0;
    for i in 0..20 {
        let plain = ShadingPoint::surface(place(10 * i + 3) + 0.4, normal);
        let glossy = plain.with_gloss(Gloss { view, roughness: 0.3, specular: 0.04, diffuse: 0.5 });
        for node in tree.nodes() {
            let [plain, glossy] = [&plain, &glossy].map(|at| child_importances(node, &LocalShadingPoint::of(at)));
            for slot in (0..node.count()).filter(|slot| node.children[*slot] & LEAF == 0) {
                assert!(glossy.doubt[slot] >= plain.doubt[slot]);
                compared += usize::from(glossy.doubt[slot] > plain.doubt[slot]);
            }
        }
    }
    assert!(compared > 1000, "{compared}");
}

#[test]
fn a_lamp_at_the_shading_point_is_unresolved_and_one_two_millimetres_away_is_not() {
    let tree = tree_of_all_kinds();
    for (light, leaf) in tree.lights().iter().zip(tree.leaves()) {
        let (Shape::Point { position } | Shape::Spot { position, .. }) = light.shape else { continue };
        let (node, slot) = (&tree.nodes()[*leaf as usize / WIDTH], *leaf as usize % WIDTH);
        let importances = |away: f32| {
            let local = LocalShadingPoint::of(&ShadingPoint::volume(position + away));
            child_importances(node, &local)
        };
        assert!(importances(0.0).importance[slot] < 0.0 && importances(0.0).has_unresolved(), "{position}");
        // Nodes of 60 m have steps of a quarter of a metre, and means steps of a millimetre.
        assert!(importances(2.0e-3).importance[slot] >= 0.0, "{position}");
    }
}

#[test]
fn ordinary_shading_points_resolve_every_child_and_weights_are_importances() {
    let tree = tree_of_all_kinds();
    for node in tree.nodes() {
        for i in 0..20 {
            let local = LocalShadingPoint::of(&ShadingPoint::surface(place(10 * i + 3) + 0.4, place(i)));
            let children = child_importances(node, &local);
            assert!(!children.has_unresolved());
            assert_eq!(children.weights(), children.importance);
        }
    }
}

#[test]
fn any_number_of_unresolved_children_is_seen() {
    for count in 0..=WIDTH {
        let mut importance = [0.5; WIDTH];
        importance[..count].fill(-2.0);
        let children = ChildImportances { importance, doubt: [0.0; WIDTH] };
        assert_eq!(children.has_unresolved(), count > 0, "{count}");
    }
}

#[test]
fn unresolved_children_get_half_at_most_and_stay_above_zero() {
    // Two of the unresolved children hold nearly everything; the others keep their importances.
    let importance = [1.0, -3.0e30, 2.0, -1.0e30, 0.0, -1.0e-30, 4.0, 0.0];
    let limited = limited_weights(&importance);
    for i in [0, 2, 4, 6, 7] {
        assert_eq!(limited[i], importance[i]);
    }
    assert!((limited[1] + limited[3] - 7.0).abs() < 1.0e-5 && limited[5] > 0.0, "{limited:?}");
    assert!((limited[1] / limited[3] - 3.0).abs() < 1.0e-5);
    // Within the limit, and without others, all keep their importances.
    let modest = [1.0, -3.0, 2.0, -1.0, 0.0, -1.0e-30, 4.0, 0.0];
    assert_eq!(limited_weights(&modest), modest.map(f32::abs));
    let alone = [0.0, -3.0e30, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(limited_weights(&alone), alone.map(f32::abs));
    // The product of the scale and a weak importance would round to 0.
    let extremes = [1.0e-30, -1.0e36, 0.0, -1.0e-30, 0.0, 0.0, 0.0, 0.0];
    assert_eq!(limited_weights(&extremes)[3], MIN_IMPORTANCE);
}
