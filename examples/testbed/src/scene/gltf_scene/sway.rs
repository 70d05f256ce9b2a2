//! Wind for glTF scenes without animations. Strings of lights swing about the line between their
//! ends, lanterns about their highest point.

use std::collections::BTreeMap;

use girandole::LightWorld;
use girandole::glam::{Affine3A, DAffine3, DMat3, Quat, Vec3, vec3};
use girandole_assets::gltf::LightSource;
use girandole_assets::gltf::gltf::Document;

use super::node_map::NodeMap;
use super::{Animation, Scene, SceneError};

/// Groups that are wider than this, in metres, hang by both ends; others hang by their highest
/// point.
const STRING_LENGTH: f32 = 1.5;

/// Nodes that swing together.
struct Group {
    /// Objects and their transforms at rest.
    objects: Vec<(usize, Affine3A)>,
    nodes: Vec<usize>,
    pivot: Vec3,
    axis: Vec3,
    /// Whether it hangs by both ends.
    is_string: bool,
    /// Radians.
    phase: f32,
}

/// The animation of everything that swings.
pub struct Sway {
    groups: Vec<Group>,
    node_map: NodeMap,
}

/// The name of the group that a node swings with, if any: the part of the node's name that
/// identifies one string or lantern by a number, else the whole name.
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
    /// Finds the groups by the names of nodes and meshes.
    pub fn new(document: &Document, scene: &Scene, node_map: NodeMap) -> Self {
        let mut names: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for node in document.nodes() {
            let mesh = node.mesh().and_then(|mesh| mesh.name());
            let own = node.name().and_then(group_name);
            if let Some(group) = own.or_else(|| mesh.and_then(group_name)) {
                names.entry(group).or_default().push(node.index());
            }
        }
        // Nodes that place their mesh many times stay where they are.
        let mut groups = Vec::new();
        for (index, nodes) in names.into_values().enumerate() {
            let objects: Vec<usize> = nodes.iter().filter_map(|&node| node_map.only_object(node)).collect();
            let points: Vec<Vec3> = objects.iter().flat_map(|&object| vertices(scene, object)).collect();
            let Some((pivot, axis, is_string)) = suspension(&points) else { continue };
            let objects = objects.into_iter().map(|object| (object, scene.objects[object].transform)).collect();
            // Multiples of the golden angle keep neighbours out of step.
            let phase = index as f32 * 2.399_963;
            groups.push(Group { objects, nodes, pivot, axis, is_string, phase });
        }
        Self { groups, node_map }
    }
}

/// The vertices of an object in world space.
fn vertices(scene: &Scene, object: usize) -> impl Iterator<Item = Vec3> {
    let object = scene.objects[object];
    let triangles = &scene.meshes[object.mesh as usize].triangles;
    triangles.iter().flat_map(|t| t.vertices).map(move |vertex| object.transform.transform_point3(vertex))
}

/// The point and the axis about which a group of points swings, and whether it hangs by both ends.
fn suspension(points: &[Vec3]) -> Option<(Vec3, Vec3, bool)> {
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
    /// The motion from rest at a time, in seconds.
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
            for lights in self.node_map.lights.nodes.iter().filter(|lights| group.nodes.contains(&lights.node)) {
                let object = self.node_map.only_object(lights.node);
                let Some(object) = object else { continue };
                let transform = scene.objects[object].transform;
                match lights.source {
                    LightSource::Surfaces => world.move_instance(lights.instance, transform)?,
                    source => {
                        let wide = DAffine3::from_mat3_translation(
                            DMat3::from_cols_array(&transform.matrix3.to_cols_array().map(f64::from)),
                            Vec3::from(transform.translation).as_dvec3(),
                        );
                        if let Some(placement) = source.placement(&wide) {
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
    fn parts_of_one_string_have_the_same_group() {
        let name = "Props/Bistro_StringLights/StringLight_Wind_14/StringLight_Wind_14_0";
        assert_eq!(group_name(name), Some("Props/Bistro_StringLights/StringLight_Wind_14"));
        assert_eq!(group_name("Props/Lanterns/A"), Some("Props/Lanterns/A"));
        assert_eq!(group_name("Props/Chair_3"), None);
    }

    #[test]
    fn wide_groups_hang_by_their_ends_and_small_ones_by_their_top() {
        let string = [vec3(-5.0, 4.0, 0.0), vec3(0.0, 3.0, 0.0), vec3(5.0, 4.0, 0.0)];
        let (pivot, axis, is_string) = suspension(&string).unwrap();
        assert!(is_string && pivot.y == 4.0 && axis.x.abs() > 0.99);
        let lantern = [vec3(0.1, 2.0, 0.0), vec3(0.0, 3.0, 0.0)];
        assert_eq!(suspension(&lantern).map(|(pivot, _, is_string)| (pivot.y, is_string)), Some((3.0, false)));
    }
}
