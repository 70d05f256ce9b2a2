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
pub const NITS: f32 = 260.0;
/// The colours of the lamps of the trunk, of arms and of legs. The brightest channel of each is 1.
pub const COLORS: [Vec3; 3] = [palette::NEON[0], palette::NEON[1], palette::NEON[2]];

/// A bone along +Y of its own space.
struct Bone {
    /// Unless it is the first.
    parent: usize,
    /// Where it begins, in the space of its parent.
    joint: Vec3,
    length: f32,
    /// At its beginning and at its end.
    radius: [f32; 2],
    /// Angles about X, Y and Z: in the mean, and how far they swing in two beats.
    rest: Vec3,
    swing: Vec3,
    /// Of the swing, in turns.
    phase: f32,
}

const fn bone(
    parent: usize,
    joint: [f32; 3],
    [length, first, last]: [f32; 3],
    rest: [f32; 3],
    swing: [f32; 3],
    phase: f32,
) -> Bone {
    let [joint, rest, swing] = [Vec3::from_array(joint), Vec3::from_array(rest), Vec3::from_array(swing)];
    Bone { parent, joint, length, radius: [first, last], rest, swing, phase }
}

/// Each after its parent: the trunk and the head, arms, legs.
const SKELETON: [Bone; BONES] = [
    bone(0, [0.0, 0.95, 0.0], [0.2, 0.13, 0.12], [0.0; 3], [0.0, 0.5, 0.12], 0.0),
    bone(0, [0.0, 0.2, 0.0], [0.3, 0.12, 0.17], [0.06, 0.0, 0.0], [0.08, -0.4, -0.2], 0.0),
    bone(1, [0.0, 0.3, 0.0], [0.1, 0.06, 0.06], [0.0; 3], [0.1, 0.0, 0.1], 0.2),
    bone(2, [0.0, 0.1, 0.0], [0.18, 0.1, 0.1], [0.0; 3], [0.12, 0.3, 0.0], 0.3),
    bone(1, [0.19, 0.26, 0.0], [0.29, 0.055, 0.045], [0.0, 0.0, -1.2], [0.5, 0.2, 0.7], 0.0),
    bone(4, [0.0, 0.29, 0.0], [0.27, 0.045, 0.035], [0.2, 0.0, 0.7], [0.3, 0.0, 0.6], 0.15),
    bone(1, [-0.19, 0.26, 0.0], [0.29, 0.055, 0.045], [0.0, 0.0, 1.2], [0.5, 0.2, 0.7], 0.5),
    bone(6, [0.0, 0.29, 0.0], [0.27, 0.045, 0.035], [0.2, 0.0, -0.7], [0.3, 0.0, 0.6], 0.65),
    bone(0, [0.1, 0.0, 0.0], [0.45, 0.085, 0.06], [PI, 0.0, 0.12], [0.5, 0.0, 0.1], 0.0),
    bone(8, [0.0, 0.45, 0.0], [0.44, 0.06, 0.04], [-0.45, 0.0, 0.0], [0.45, 0.0, 0.0], 0.75),
    bone(9, [0.0, 0.44, 0.0], [0.2, 0.04, 0.03], [1.4, 0.0, 0.0], [0.0; 3], 0.0),
    bone(0, [-0.1, 0.0, 0.0], [0.45, 0.085, 0.06], [PI, 0.0, -0.12], [0.5, 0.0, 0.1], 0.5),
    bone(11, [0.0, 0.45, 0.0], [0.44, 0.06, 0.04], [-0.45, 0.0, 0.0], [0.45, 0.0, 0.0], 0.25),
    bone(12, [0.0, 0.44, 0.0], [0.2, 0.04, 0.03], [1.4, 0.0, 0.0], [0.0; 3], 0.0),
];

/// The colour of the lamps of a bone: its index in [`COLORS`].
fn color(bone: usize) -> usize {
    usize::from(bone >= 4) + usize::from(bone >= 8)
}

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
        let angles = bone.rest + bone.swing * (TAU * (0.5 * beat + bone.phase)).sin();
        let turn = Quat::from_euler(EulerRot::YXZ, angles.y, angles.x, angles.z);
        let own = Affine3A::from_rotation_translation(turn, bone.joint);
        let root = vec3(0.25 * (0.5 * PI * beat).sin(), 0.05 * (TAU * beat).sin().abs() - 0.05, 0.0);
        let parent = if index == 0 { Affine3A::from_translation(root) } else { pose.bones[bone.parent] };
        pose.bones[index] = parent * own;
        // A wave of light runs from the trunk to hands and feet.
        pose.glow[index] = 0.55 + 0.45 * (TAU * (0.5 * beat - 0.11 * index as f32)).sin();
    }
    pose
}

/// The lamps of all bones.
pub fn lamps() -> Vec<Lamp> {
    let of_bone = |(index, bone): (usize, &Bone)| {
        let Bone { length, radius: [first, last], .. } = *bone;
        let place = move |i: usize| {
            let along = ((i / SIDES) as f32 + 0.5) / RINGS as f32;
            let (sin, cos) = (((i % SIDES) as f32 + 0.5) * TAU / SIDES as f32).sin_cos();
            let radius = first + (last - first) * along;
            let (outward, side) = (vec3(cos, 0.0, -sin), vec3(-sin, 0.0, -cos));
            let (center, half) = (outward * (0.93 * radius + 0.004) + Vec3::Y * (along * length), 0.33 * radius);
            let (a, b) = (center - side * half - Vec3::Y * half, center + side * half - Vec3::Y * half);
            Lamp {
                vertices: [a, b, center + Vec3::Y * half],
                bone: index as u32,
                radiance: COLORS[color(index)] * NITS,
            }
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
    let Bone { length, radius, .. } = SKELETON[index];
    let mut part = Part::default();
    part.column(Vec3::ZERO, length, radius, SIDES, cloth);
    part.ball(Vec3::ZERO, Vec3::splat(radius[0]), SIDES, cloth);
    part.ball(Vec3::Y * length, Vec3::splat(radius[1]), SIDES, cloth);
    let own = lamps.iter().filter(|lamp| lamp.bone == index as u32);
    part.mesh.triangles.extend(own.map(|lamp| Triangle { vertices: lamp.vertices, material: glows[color(index)] }));
    part
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bones_stay_together_and_no_foot_is_far_below_the_ground() {
        for step in 0..400 {
            let Pose { bones, glow } = pose(0.01 * f64::from(step));
            for (index, (bone, placed)) in SKELETON.iter().zip(&bones).enumerate() {
                assert!((placed.matrix3.determinant() - 1.0).abs() < 1e-3);
                let joint = bones[bone.parent].transform_point3(bone.joint);
                assert!(index == 0 || (joint - Vec3::from(placed.translation)).length() < 1e-5);
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
