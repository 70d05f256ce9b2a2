//! Wind for glTF scenes without animations: strings of lights swing about the line between their ends, lanterns about
//! their hooks.

use std::collections::BTreeMap;

use girandole::LightWorld;
use girandole::glam::{Affine3A, DAffine3, DMat3, Quat, Vec3, vec3};
use girandole::gltf::gltf::Document;
use girandole::gltf::{LightSource, punctual_placement};

use super::gltf_scene::Moves;
use super::{Animation, Scene, SceneError};

/// Wider things hang by both ends, smaller ones by their top.
const STRING_LENGTH: f32 = 1.5;

/// What swings as one.
struct Group {
    /// Object, or instance of lights, and its transform at rest.
    objects: Vec<(usize, Affine3A)>,
    nodes: Vec<usize>,
    pivot: Vec3,
    axis: Vec3,
    is_string: bool,
    phase: f32,
}

/// Everything that swings.
pub struct Sway {
    groups: Vec<Group>,
    moved: Moves,
}

/// What a node swings with: the part of its path that names one string or lantern, by number; else itself alone.
fn group_name(name: &str) -> Option<&str> {
    let is_named = |part: &str| {
        let part = part.to_ascii_lowercase();
        part.contains("stringlight") || part.contains("lantern")
    };
    let mut end = 0;
    let mut found = None;
    for part in name.split('/') {
        end += part.len();
        if is_named(part) {
            found = Some(&name[..end]);
            if part.bytes().any(|byte| byte.is_ascii_digit()) {
                return found;
            }
        }
        end += 1;
    }
    found.map(|_| name)
}

impl Sway {
    /// Finds what hangs.
    pub fn new(document: &Document, scene: &Scene, moved: Moves) -> Self {
        let mut names: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for node in document.nodes() {
            let mesh = node.mesh().and_then(|mesh| mesh.name());
            let own = node.name().and_then(group_name);
            if let Some(group) = own.or_else(|| mesh.and_then(group_name)) {
                names.entry(group).or_default().push(node.index());
            }
        }
        let mut groups = Vec::new();
        for (index, nodes) in names.into_values().enumerate() {
            let objects: Vec<usize> = nodes.iter().filter_map(|&node| moved.objects[node]).collect();
            let points: Vec<Vec3> = objects.iter().flat_map(|&object| vertices(scene, object)).collect();
            let Some((pivot, axis, is_string)) = hang(&points) else { continue };
            let objects = objects.into_iter().map(|object| (object, scene.objects[object].transform)).collect();
            // Golden angle: neighbours are out of step.
            let phase = index as f32 * 2.399_963;
            groups.push(Group { objects, nodes, pivot, axis, is_string, phase });
        }
        Self { groups, moved }
    }
}

fn vertices(scene: &Scene, object: usize) -> impl Iterator<Item = Vec3> {
    let object = scene.objects[object];
    let triangles = &scene.meshes[object.mesh as usize].triangles;
    triangles.iter().flat_map(|t| t.vertices).map(move |vertex| object.transform.transform_point3(vertex))
}

/// The point and the axis about which points swing, and whether they hang by two ends.
fn hang(points: &[Vec3]) -> Option<(Vec3, Vec3, bool)> {
    let first = *points.first()?;
    let farthest = |from: Vec3| {
        points.iter().copied().max_by(|a, b| a.distance_squared(from).total_cmp(&b.distance_squared(from)))
    };
    let from = farthest(first)?;
    let to = farthest(from)?;
    let along = to - from;
    if along.with_y(0.0).length() > STRING_LENGTH {
        return Some((from, along.normalize(), true));
    }
    let top = points.iter().copied().max_by(|a, b| a.y.total_cmp(&b.y))?;
    Some((top, Vec3::X, false))
}

impl Group {
    fn swing(&self, time: f32) -> Affine3A {
        let wave = (1.9 * time + self.phase).sin() + 0.35 * (4.3 * time + 2.0 * self.phase).sin();
        let turn = if self.is_string {
            Quat::from_axis_angle(self.axis, 0.11 * wave)
        } else {
            let other = (2.3 * time + 1.7 * self.phase).cos();
            Quat::from_axis_angle(vec3(self.axis.x, 0.0, self.axis.z), 0.07 * wave)
                * Quat::from_rotation_z(0.06 * other)
        };
        Affine3A::from_translation(self.pivot) * Affine3A::from_quat(turn) * Affine3A::from_translation(-self.pivot)
    }
}

impl Animation for Sway {
    fn is_still(&self) -> bool {
        self.groups.is_empty()
    }

    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for group in &self.groups {
            let swing = group.swing(time as f32);
            for &(object, rest) in &group.objects {
                scene.objects[object].transform = swing * rest;
            }
            for lights in self.moved.lights.nodes.iter().filter(|lights| group.nodes.contains(&lights.node)) {
                let object = self.moved.objects[lights.node];
                let Some(object) = object else { continue };
                let transform = scene.objects[object].transform;
                match lights.source {
                    LightSource::Surfaces => world.move_instance(lights.instance, transform)?,
                    LightSource::Punctual => {
                        let wide = DAffine3::from_mat3_translation(
                            DMat3::from_cols_array(&transform.matrix3.to_cols_array().map(f64::from)),
                            Vec3::from(transform.translation).as_dvec3(),
                        );
                        if let Some(placement) = punctual_placement(&wide) {
                            world.move_instance(lights.instance, placement)?;
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_one_string_swing_together() {
        let name = "Props/Bistro_StringLights/StringLight_Wind_14/StringLight_Wind_14_0";
        assert_eq!(group_name(name), Some("Props/Bistro_StringLights/StringLight_Wind_14"));
        assert_eq!(group_name("Props/Lanterns/A"), Some("Props/Lanterns/A"));
        assert_eq!(group_name("Props/Chair_3"), None);
    }

    #[test]
    fn long_things_hang_by_their_ends() {
        let string = [vec3(-5.0, 4.0, 0.0), vec3(0.0, 3.0, 0.0), vec3(5.0, 4.0, 0.0)];
        let (pivot, axis, is_string) = hang(&string).unwrap();
        assert!(is_string && pivot.y == 4.0 && axis.x.abs() > 0.99);
        let lantern = [vec3(0.1, 2.0, 0.0), vec3(0.0, 3.0, 0.0)];
        assert_eq!(hang(&lantern).map(|hung| (hung.0.y, hung.2)), Some((3.0, false)));
    }
}
