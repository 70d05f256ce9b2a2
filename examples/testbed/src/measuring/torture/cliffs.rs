//! Scenes in which two levels were far worse than one tree, beside others of their kind: more trees
//! than a search for neighbours looked at, instances beyond a power of two of cells, many instances of
//! one large tree, an instance far away, small scales, and emitters at the shading point.
//!
//! They have few shading points and many lights, so they are measured against one tree alone.

use super::TortureScene;
use super::emitters::ball;
use super::instances::{scaled, shared_scales};
use super::scene::{Parts, direction, in_box, lamp};
use crate::common::pcg::Rng;
use girandole::glam::{DVec3, Mat3, Vec3, vec3};
use girandole::{LightTree, Placement, Policy, ShadingPoint, WorldError};
use std::f32::consts::PI;

/// Shading points of each scene.
const SHADING_POINTS: usize = 32;

/// Makes a scene from random numbers of its own.
type Make = Box<dyn Fn(&mut Parts, &mut Rng) -> Result<(), WorldError>>;

/// All scenes. They are the same in every run.
pub fn scenes() -> Result<Vec<TortureScene>, WorldError> {
    let mut makers: Vec<(String, Make)> = Vec::new();
    for trees in [64, 65, 80, 128, 256] {
        makers.push((format!("{trees} trees over one kilometre"), Box::new(move |parts, _| trees_over(parts, trees))));
    }
    for side in [256, 257, 300] {
        makers.push((format!("{side} x {side} lamps"), Box::new(move |parts, _| grid(parts, side))));
    }
    for instances in [8, 30, 60, 200] {
        let make = move |parts: &mut Parts, rng: &mut Rng| turned(parts, rng, instances);
        makers.push((format!("{instances} instances of 400 lamps over one kilometre"), Box::new(make)));
    }
    for power in [3, 5, 6, 7, 9] {
        let make = move |parts: &mut Parts, rng: &mut Rng| far(parts, rng, 10.0_f64.powi(power));
        makers.push((format!("a town, and a lamp 1e{power} m away"), Box::new(make)));
    }
    let scales = [
        ("scaled by 0.1", Vec3::splat(0.1)),
        ("scaled by 0.001", Vec3::splat(0.001)),
        ("squashed along z by 0.01", vec3(1.0, 1.0, 0.01)),
    ];
    for (name, scale) in scales {
        makers.push((name.to_owned(), Box::new(move |parts, rng| scaled(parts, rng, scale))));
    }
    makers.push(("one tree at scales from 0.01 to 1".to_owned(), Box::new(shared_scales)));
    makers.push(("on a ball of triangles".to_owned(), Box::new(on_ball)));
    let scene = |(name, make): &(String, Make)| TortureScene::new_of(name.clone(), make, SHADING_POINTS);
    makers.iter().map(scene).collect()
}

/// A term of Kronecker's sequence, in [0, 1).
fn kronecker(n: usize, k: usize) -> f64 {
    (0.5 + n as f64 * [0.819_172_5, 0.671_043_6][k]).fract()
}

/// Trees of 129 lamps, each over the same square kilometre.
fn trees_over(parts: &mut Parts, trees: usize) -> Result<(), WorldError> {
    let at = |n: usize| {
        (DVec3::new(kronecker(n, 0), 0.005, kronecker(n, 1)) * 1000.0 - DVec3::new(500.0, 0.0, 500.0)).as_vec3()
    };
    for tree in 0..trees {
        parts.add_here((0..129).map(|i| lamp(at(129 * tree + i), 100.0)).collect())?;
    }
    parts.shading_points = (0..SHADING_POINTS)
        .map(|i| {
            let at = vec3(kronecker(i, 0) as f32 - 0.5, 0.0, kronecker(i, 1) as f32 - 0.5) * 800.0;
            ShadingPoint::surface(at, Vec3::Y)
        })
        .collect();
    Ok(())
}

/// A square of instances of one lamp, a metre apart. The shading points are along its last rows.
fn grid(parts: &mut Parts, side: usize) -> Result<(), WorldError> {
    let tree = parts.world.add_tree(LightTree::new(vec![lamp(Vec3::ZERO, 1.0)])?);
    for i in 0..side * side {
        let at = DVec3::new((i % side) as f64, 1.0, (i / side) as f64);
        parts.world.add_instance(tree, Placement::at(at), Policy::Static)?;
    }
    parts.shading_points = (0..SHADING_POINTS)
        .map(|i| {
            let x = side as f64 - 3.0 + 4.0 * kronecker(i, 0);
            let z = (side as f64 - 1.0) * kronecker(i, 1);
            ShadingPoint::surface(DVec3::new(x, 0.0, z).as_vec3(), Vec3::Y)
        })
        .collect();
    Ok(())
}

/// Instances of one tree of 400 lamps over a square kilometre, each turned.
fn turned(parts: &mut Parts, rng: &mut Rng, instances: usize) -> Result<(), WorldError> {
    let lamps = (0..400).map(|_| lamp(in_box(rng, vec3(500.0, 1.0, 500.0)) + Vec3::Y * 5.0, 100.0)).collect();
    let tree = parts.world.add_tree(LightTree::new(lamps)?);
    for _ in 0..instances {
        let linear = Mat3::from_rotation_y(rng.range(0.0, 2.0 * PI));
        parts.world.add_instance(tree, Placement { linear, translation: DVec3::ZERO }, Policy::Static)?;
    }
    parts.receive(|| (in_box(rng, vec3(350.0, 0.0, 350.0)), Vec3::Y));
    Ok(())
}

/// 4,096 instances of a lamp in one kilometre, and one more.
fn far(parts: &mut Parts, rng: &mut Rng, distance: f64) -> Result<(), WorldError> {
    let tree = parts.world.add_tree(LightTree::new(vec![lamp(Vec3::ZERO, 100.0)])?);
    for _ in 0..4096 {
        let at = in_box(rng, vec3(500.0, 1.0, 500.0)) + Vec3::Y * 5.0;
        parts.world.add_instance(tree, Placement::at(at.as_dvec3()), Policy::Static)?;
    }
    parts.world.add_instance(tree, Placement::at(DVec3::X * distance), Policy::Static)?;
    parts.receive(|| (in_box(rng, vec3(500.0, 0.0, 500.0)), Vec3::Y));
    Ok(())
}

/// Shading points a millimetre above a ball of triangles, with any normal.
fn on_ball(parts: &mut Parts, rng: &mut Rng) -> Result<(), WorldError> {
    parts.add_here(ball(Vec3::ZERO, 2.0, 50.0))?;
    parts.receive(|| (direction(rng) * 2.001, direction(rng)));
    Ok(())
}
