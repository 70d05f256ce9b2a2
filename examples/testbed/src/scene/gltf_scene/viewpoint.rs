//! Finds a camera for scenes that have none.

use std::f32::consts::{PI, TAU};

use girandole::glam::{Vec2, Vec3, vec2, vec3};
use girandole::{LightWorld, Shape};

use super::extent::{Extent, vertices};
use super::occupancy::Occupancy;
use super::{Camera, Scene};

/// Vertical field of view, radians.
pub const FIELD_OF_VIEW: f32 = PI / 3.0;
/// Height of the camera above the ground, metres.
const EYE_HEIGHT: f32 = 2.0;
/// Share of the width or the height of the picture that a scene seen from outside fills.
const FILLED: f32 = 0.9;
/// Distance within which a view is examined, metres.
const REACH: f32 = 40.0;
/// Scenes with a smaller diagonal, in metres, are no place for an eye of this height.
const MIN_STREET_SIZE: f32 = 15.0;
/// Slope of the viewing direction: it rises a little, since lamps hang above the camera.
const SLOPE: f32 = 0.06;

/// Centres and fluxes of the 4,000 brightest lights, in world space.
fn bright_lights(world: &LightWorld) -> Vec<(Vec3, f32)> {
    let mut lights = Vec::new();
    for instance in world.instances() {
        let (Some(tree), Some(placement)) =
            (world.instance(instance).map(|i| i.tree), world.instance(instance).map(|i| i.placement))
        else {
            continue;
        };
        let Some(tree) = world.tree(tree) else { continue };
        for light in tree.lights() {
            let middle = match light.shape {
                Shape::Point { position } | Shape::Spot { position, .. } | Shape::Profile { position, .. } => position,
                Shape::Rectangle { center, .. } | Shape::Sphere { center, .. } => center,
                Shape::Triangle { vertices, .. } => (vertices[0] + vertices[1] + vertices[2]) / 3.0,
                _ => unreachable!("this version has no others"),
            };
            lights.push((placement.linear * middle + placement.translation.as_vec3(), light.flux()));
        }
    }
    lights.sort_by(|a, b| b.1.total_cmp(&a.1));
    lights.truncate(4000);
    lights
}

/// The triangles of all visible objects, in world space.
fn triangles(scene: &Scene) -> Vec<[Vec3; 3]> {
    let placed = |object: &super::Object| {
        let transform = object.transform;
        let mesh = &scene.meshes[object.mesh as usize];
        mesh.triangles.iter().map(move |t| t.vertices.map(|vertex| transform.transform_point3(vertex)))
    };
    scene.objects.iter().filter(|object| object.visible).flat_map(placed).collect()
}

/// A camera among the lights if the scene is large enough to stand in and shows lights from there, and
/// else one that sees all of it from outside, in a picture that is `aspect` times as wide as high.
pub fn camera(scene: &Scene, world: &LightWorld, extent: &Extent, aspect: f32) -> Camera {
    let inside = (extent.size() >= MIN_STREET_SIZE).then(|| among_lights(scene, world)).flatten();
    inside.unwrap_or_else(|| outside(scene, extent, aspect))
}

/// A camera two metres above the ground, near the brightest lights, in the direction with the best
/// mix of a clear view and lights in it; `None` if no light is in any clear view.
fn among_lights(scene: &Scene, world: &LightWorld) -> Option<Camera> {
    let all = triangles(scene);
    let lights = bright_lights(world);
    if lights.is_empty() {
        return None;
    }
    let total: f32 = lights.iter().map(|light| light.1.max(1e-6)).sum();
    // The light with the least flux-weighted distance to the others: a median, which ignores
    // outliers.
    let cost = |at: Vec3| lights.iter().map(|light| light.0.distance(at) * light.1.max(1e-6)).sum::<f32>() / total;
    let candidates: Vec<Vec3> = lights.iter().step_by(lights.len().div_ceil(200)).map(|light| light.0).collect();
    let middle = candidates.iter().copied().min_by(|a, b| cost(*a).total_cmp(&cost(*b))).unwrap_or(Vec3::ZERO);
    let spread = cost(middle).clamp(1.0, 25.0);
    let within = |t: &[Vec3; 3], reach: f32| t.iter().any(|v| vec2(v.x - middle.x, v.z - middle.z).length() < reach);
    let near: Vec<[Vec3; 3]> = all.into_iter().filter(|t| within(t, REACH + 2.0 * spread)).collect();
    let eyes = (0..25).map(|i| vec2((i % 5) as f32 - 2.0, (i / 5) as f32 - 2.0) * (spread * 0.4));
    let eyes: Vec<Vec3> = eyes
        .filter_map(|step| {
            let at = vec2(middle.x, middle.z) + step;
            let ground = ground(&near, at, middle.y)?;
            Some(vec3(at.x, ground + EYE_HEIGHT, at.y))
        })
        .collect();
    let heights = eyes.iter().fold((f32::MAX, f32::MIN), |(low, high), eye| (low.min(eye.y), high.max(eye.y)));
    let around = Vec3::splat(REACH + spread);
    let mut solid = Occupancy::new(
        (middle - around).with_y(heights.0 - 0.5),
        (middle + around).with_y(heights.1 + 0.5 + REACH * SLOPE),
    );
    near.into_iter().for_each(|triangle| solid.add(triangle));
    let views = eyes.iter().flat_map(|&eye| {
        (0..12).map(move |turn| {
            let (sin, cos) = (turn as f32 / 12.0 * TAU).sin_cos();
            (eye, vec3(cos, SLOPE, sin).normalize())
        })
    });
    let views: Vec<(Vec3, Vec3)> = views.collect();
    let score = |&(eye, direction): &(Vec3, Vec3)| {
        let clear = solid.clear_distance(eye, direction, REACH);
        let aside = vec3(-direction.z, 0.0, direction.x) * 0.35;
        let clear_aside =
            [aside, -aside].map(|aside| solid.clear_distance(eye, (direction + aside).normalize(), REACH));
        let visible_flux = |(at, flux): &(Vec3, f32)| {
            let to = *at - eye;
            let distance = to.length().max(3.0);
            let inside = to.dot(direction) > 0.8 * to.length() && distance < 1.5 * clear;
            if inside { flux.sqrt() / distance } else { 0.0 }
        };
        let lit: f32 = lights.iter().map(visible_flux).sum();
        let clear_width = clear.min(clear_aside[0] * 2.0).min(clear_aside[1] * 2.0);
        if clear_width < 3.0 { 0.0 } else { lit * clear_width.sqrt() }
    };
    let scores: Vec<f32> = views.iter().map(score).collect();
    let best = (0..views.len()).max_by(|a, b| scores[*a].total_cmp(&scores[*b])).filter(|&best| scores[best] > 0.0);
    let (eye, direction) = views[best?];
    Some(Camera { eye, target: eye + direction * 10.0, vertical_fov: FIELD_OF_VIEW, up: Vec3::Y })
}

/// The height of the highest surface at (x, z) that is at least 0.5 m below `top`.
fn ground(triangles: &[[Vec3; 3]], at: Vec2, top: f32) -> Option<f32> {
    let height = |[a, b, c]: &[Vec3; 3]| {
        let flat = |v: Vec3| vec2(v.x, v.z) - at;
        let (p, q, r) = (flat(*a), flat(*b), flat(*c));
        let area = (q - p).perp_dot(r - p);
        let (u, v, w) = (q.perp_dot(r) / area, r.perp_dot(p) / area, p.perp_dot(q) / area);
        let y = u * a.y + v * b.y + w * c.y;
        (u >= 0.0 && v >= 0.0 && w >= 0.0 && y < top - 0.5).then_some(y)
    };
    triangles.iter().filter_map(height).max_by(f32::total_cmp)
}

/// A camera that sees the whole scene from outside and above, from the side that shows most of its
/// emissive surfaces.
fn outside(scene: &Scene, extent: &Extent, aspect: f32) -> Camera {
    let sides = [(0.37, 0.64), (-0.64, 0.37), (0.64, -0.37), (-0.37, -0.64)];
    let directions = sides.map(|(x, z)| vec3(x, 0.32, z));
    let mut shown = [0.0f32; 4];
    for object in scene.objects.iter().filter(|object| object.visible) {
        for triangle in &scene.meshes[object.mesh as usize].triangles {
            let material = &scene.materials[triangle.material as usize];
            let [a, b, c] = triangle.vertices.map(|vertex| object.transform.transform_point3(vertex));
            let front = (b - a).cross(c - a);
            // Of surfaces that do not emit, a tenth of the area counts.
            let weight = if material.emission == Vec3::ZERO { 0.1 } else { 1.0 };
            for (shown, direction) in shown.iter_mut().zip(directions) {
                let facing = front.dot(direction);
                *shown += weight * if material.two_sided_emission { facing.abs() } else { facing.max(0.0) };
            }
        }
    }
    // The first side unless another shows clearly more.
    shown[0] *= 1.1;
    let best =
        (0..4).max_by(|a, b| shown[*a].total_cmp(&shown[*b])).filter(|&best| shown[best] > shown[0]).unwrap_or(0);
    let forward = -directions[best].normalize();
    let eye = fitting_eye(vertices(scene), extent, forward, aspect);
    Camera { eye, target: eye + forward * eye.distance(extent.middle()), vertical_fov: FIELD_OF_VIEW, up: Vec3::Y }
}

/// Where a camera that looks along a unit vector shows all points as large as fits into the `FILLED` part of
/// a picture, in its middle. `aspect` is the width of the picture by its height.
fn fitting_eye(points: impl Iterator<Item = Vec3>, extent: &Extent, forward: Vec3, aspect: f32) -> Vec3 {
    let right = forward.cross(Vec3::Y).normalize();
    let axes = [right, right.cross(forward), forward];
    let mut points: Vec<[f32; 3]> = points.map(|point| axes.map(|axis| axis.dot(point - extent.middle()))).collect();
    if points.is_empty() {
        // All is hidden.
        points.push([0.0; 3]);
    }
    // Where the sides of a view of this slope touch points on both sides: across and in depth.
    let touching = |axis: usize, slope: f32| {
        let (mut high, mut low) = (f32::NEG_INFINITY, f32::NEG_INFINITY);
        for point in &points {
            (high, low) = (high.max(point[axis] - slope * point[2]), low.max(-point[axis] - slope * point[2]));
        }
        ((high - low) * 0.5, (high + low) / (-2.0 * slope))
    };
    let slope = (FIELD_OF_VIEW * 0.5).tan() * FILLED;
    let slopes = [slope * aspect, slope];
    // The eye is not within flat scenes either.
    let nearest = points.iter().map(|point| point[2]).fold(extent.size(), f32::min);
    let depth = touching(0, slopes[0]).1.min(touching(1, slopes[1]).1).min(nearest - extent.size() * 0.1);
    let middle = [0, 1].map(|axis| {
        // The view touches with a smaller slope on the axis that has room: bisection.
        let (mut low, mut high) = (0.0, slopes[axis]);
        for _ in 0..24 {
            let slope = (low + high) * 0.5;
            if touching(axis, slope).1 < depth { low = slope } else { high = slope }
        }
        touching(axis, high).0
    });
    extent.middle() + axes[0] * middle[0] + axes[1] * middle[1] + forward * depth
}
