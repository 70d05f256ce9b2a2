//! A dancer in a suit of lamps: bones that move to a beat, and lamps of which each sits on a bone.

use std::f32::consts::{PI, TAU};

use girandole::Light;
use girandole::glam::{Affine3A, EulerRot, Quat, Vec3, vec3};

use super::super::part::Part;
use super::super::{Triangle, palette};

/// Bones of the dancer.
pub const BONES: usize = 14;
/// Sides of a limb, and rings of lamps on it.
const SIDES: usize = 8;
const RINGS: usize = 4;
/// Beats in a second.
const TEMPO: f64 = 2.0;
/// Nits of the brightest channel of a lamp.
const NITS: f32 = 260.0;
/// The lamps: those of the trunk, of arms and of legs.
pub const COLORS: [Vec3; 3] = [scaled(palette::NEON[0]), scaled(palette::NEON[1]), scaled(palette::NEON[2])];

const fn scaled(color: Vec3) -> Vec3 {
    vec3(color.x * NITS, color.y * NITS, color.z * NITS)
}

/// A bone along +Y of its own space.
struct Bone {
    parent: Option<usize>,
    /// Where it begins, in the space of its parent.
    joint: Vec3,
    length: f32,
    /// At its beginning and at its end.
    radius: [f32; 2],
    /// Angles about X, Y and Z: in the mean, and how far they swing.
    rest: Vec3,
    swing: Vec3,
    /// Swings in a beat, and the phase of the swing in turns.
    rate: f32,
    phase: f32,
    color: usize,
}

const fn bone(parent: usize, joint: Vec3, length: f32, radius: [f32; 2], color: usize) -> Bone {
    let (rest, swing) = (Vec3::ZERO, Vec3::ZERO);
    Bone { parent: Some(parent), joint, length, radius, rest, swing, rate: 0.5, phase: 0.0, color }
}

const fn above(height: f32) -> Vec3 {
    vec3(0.0, height, 0.0)
}

impl Bone {
    const fn moves(self, rest: Vec3, swing: Vec3, rate: f32, phase: f32) -> Self {
        Self { rest, swing, rate, phase, ..self }
    }
}

/// Each after its parent: the trunk and the head, arms, legs.
const SKELETON: [Bone; BONES] = [
    Bone { parent: None, ..bone(0, above(0.95), 0.2, [0.13, 0.12], 0) }.moves(
        Vec3::ZERO,
        vec3(0.0, 0.5, 0.12),
        0.5,
        0.0,
    ),
    bone(0, above(0.2), 0.3, [0.12, 0.17], 0).moves(vec3(0.06, 0.0, 0.0), vec3(0.08, -0.4, -0.2), 0.5, 0.0),
    bone(1, above(0.3), 0.1, [0.06, 0.06], 0).moves(Vec3::ZERO, vec3(0.1, 0.0, 0.1), 1.0, 0.2),
    bone(2, above(0.1), 0.18, [0.1, 0.1], 0).moves(Vec3::ZERO, vec3(0.12, 0.3, 0.0), 0.5, 0.3),
    bone(1, vec3(0.19, 0.26, 0.0), 0.29, [0.055, 0.045], 1).moves(vec3(0.0, 0.0, -1.2), vec3(0.5, 0.2, 0.7), 0.5, 0.0),
    bone(4, above(0.29), 0.27, [0.045, 0.035], 1).moves(vec3(0.2, 0.0, 0.7), vec3(0.3, 0.0, 0.6), 0.5, 0.15),
    bone(1, vec3(-0.19, 0.26, 0.0), 0.29, [0.055, 0.045], 1).moves(vec3(0.0, 0.0, 1.2), vec3(0.5, 0.2, 0.7), 0.5, 0.5),
    bone(6, above(0.29), 0.27, [0.045, 0.035], 1).moves(vec3(0.2, 0.0, -0.7), vec3(0.3, 0.0, 0.6), 0.5, 0.65),
    bone(0, vec3(0.1, 0.0, 0.0), 0.45, [0.085, 0.06], 2).moves(vec3(PI, 0.0, 0.12), vec3(0.5, 0.0, 0.1), 0.5, 0.0),
    bone(8, above(0.45), 0.44, [0.06, 0.04], 2).moves(vec3(-0.45, 0.0, 0.0), vec3(0.45, 0.0, 0.0), 0.5, 0.75),
    bone(9, above(0.44), 0.2, [0.04, 0.03], 2).moves(vec3(1.4, 0.0, 0.0), Vec3::ZERO, 0.5, 0.0),
    bone(0, vec3(-0.1, 0.0, 0.0), 0.45, [0.085, 0.06], 2).moves(vec3(PI, 0.0, -0.12), vec3(0.5, 0.0, 0.1), 0.5, 0.5),
    bone(11, above(0.45), 0.44, [0.06, 0.04], 2).moves(vec3(-0.45, 0.0, 0.0), vec3(0.45, 0.0, 0.0), 0.5, 0.25),
    bone(12, above(0.44), 0.2, [0.04, 0.03], 2).moves(vec3(1.4, 0.0, 0.0), Vec3::ZERO, 0.5, 0.0),
];

/// A lamp: a triangle in the space of its bone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lamp {
    /// Counter-clockwise from the front.
    pub vertices: [Vec3; 3],
    /// The bone that it sits on.
    pub bone: u32,
    /// Nits.
    pub radiance: Vec3,
}

/// The bones at a time, in the space of the dancer.
#[derive(Clone, Debug)]
pub struct Pose {
    /// From the space of each bone.
    pub bones: [Affine3A; BONES],
    /// The factor on the radiance of the lamps of each bone.
    pub glow: [f32; BONES],
}

/// How the dancer stands at `time`, in seconds.
pub fn pose(time: f64) -> Pose {
    // The dance repeats after a thousand beats, so that angles stay exact.
    let beat = (time * TEMPO).rem_euclid(1000.0) as f32;
    let mut pose = Pose { bones: [Affine3A::IDENTITY; BONES], glow: [1.0; BONES] };
    for (index, bone) in SKELETON.iter().enumerate() {
        let angles = bone.rest + bone.swing * (TAU * (bone.rate * beat + bone.phase)).sin();
        let turn = Quat::from_euler(EulerRot::YXZ, angles.y, angles.x, angles.z);
        let own = Affine3A::from_rotation_translation(turn, bone.joint);
        let root = vec3(0.25 * (0.5 * PI * beat).sin(), 0.05 * (TAU * beat).sin().abs() - 0.05, 0.0);
        let parent = bone.parent.map_or(Affine3A::from_translation(root), |parent| pose.bones[parent]);
        pose.bones[index] = parent * own;
        // A wave of light runs from the trunk to hands and feet.
        pose.glow[index] = 0.55 + 0.45 * (TAU * (0.5 * beat - 0.11 * index as f32)).sin();
    }
    pose
}

/// The lamps of all bones.
pub fn lamps() -> Vec<Lamp> {
    let of_bone = |(index, bone): (usize, &Bone)| {
        let Bone { length, radius: [first, last], color, .. } = *bone;
        let place = move |i: usize| {
            let along = ((i / SIDES) as f32 + 0.5) / RINGS as f32;
            let (sin, cos) = (((i % SIDES) as f32 + 0.5) * TAU / SIDES as f32).sin_cos();
            let radius = first + (last - first) * along;
            let (outward, side) = (vec3(cos, 0.0, -sin), vec3(-sin, 0.0, -cos));
            let (center, half) = (outward * (0.93 * radius + 0.004) + Vec3::Y * (along * length), 0.33 * radius);
            let (a, b) = (center - side * half - Vec3::Y * half, center + side * half - Vec3::Y * half);
            Lamp { vertices: [a, b, center + Vec3::Y * half], bone: index as u32, radiance: COLORS[color] }
        };
        (0..SIDES * RINGS).map(place).collect::<Vec<_>>()
    };
    SKELETON.iter().enumerate().flat_map(of_bone).collect()
}

/// The lights of lamps in a pose, in the space of the dancer.
pub fn lights(lamps: &[Lamp], pose: &Pose) -> Vec<Light> {
    let light = |lamp: &Lamp| {
        let bone = pose.bones[lamp.bone as usize];
        let vertices = lamp.vertices.map(|vertex| bone.transform_point3(vertex));
        Light::triangle(vertices, lamp.radiance * pose.glow[lamp.bone as usize])
    };
    lamps.iter().map(light).collect()
}

/// What is drawn of a bone, in its own space: a limb of `cloth`, and its lamps in the materials `glows`.
pub fn limb(index: usize, lamps: &[Lamp], cloth: u32, glows: [u32; COLORS.len()]) -> Part {
    let Bone { length, radius, color, .. } = SKELETON[index];
    let mut part = Part::default();
    part.column(Vec3::ZERO, length, radius, SIDES, cloth);
    part.ball(Vec3::ZERO, Vec3::splat(radius[0]), SIDES, cloth);
    part.ball(Vec3::Y * length, Vec3::splat(radius[1]), SIDES, cloth);
    let own = lamps.iter().filter(|lamp| lamp.bone == index as u32);
    part.mesh.triangles.extend(own.map(|lamp| Triangle { vertices: lamp.vertices, material: glows[color] }));
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_stay_together_and_no_foot_is_far_below_the_ground() {
        for step in 0..400 {
            let Pose { bones, glow } = pose(0.01 * f64::from(step));
            for (bone, placed) in SKELETON.iter().zip(&bones) {
                assert!((placed.matrix3.determinant() - 1.0).abs() < 1e-3);
                let Some(parent) = bone.parent else { continue };
                let joint = bones[parent].transform_point3(bone.joint);
                assert!((joint - Vec3::from(placed.translation)).length() < 1e-5);
                let end = placed.transform_point3(Vec3::Y * bone.length);
                assert!(end.y > -0.1 && end.y < 2.4, "{end}");
            }
            assert!(glow.iter().all(|glow| (0.0..=1.0).contains(glow)));
        }
    }

    #[test]
    fn lamps_face_outward_on_their_bones() {
        let lamps = lamps();
        assert_eq!(lamps.len(), BONES * SIDES * RINGS);
        for lamp in &lamps {
            let [a, b, c] = lamp.vertices;
            let outward = ((a + b + c) / 3.0 * vec3(1.0, 0.0, 1.0)).normalize();
            assert!((b - a).cross(c - a).normalize().dot(outward) > 0.99, "{lamp:?}");
        }
    }
}
