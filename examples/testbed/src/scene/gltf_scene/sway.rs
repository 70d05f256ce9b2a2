//! Wind for glTF scenes without animations. Strings of lights swing about the line between their
//! ends, lanterns about their highest point.

use std::collections::BTreeMap;

use girandole::LightWorld;
use girandole::glam::{DAffine3, DQuat, Vec3};
use girandole_assets::gltf::SceneNode;
use girandole_assets::gltf::gltf::Document;

use super::node_map::NodeMap;
use super::{Animation, Scene, SceneError};

/// Groups that are wider than this, in metres, hang by both ends; others hang by their highest
/// point.
const STRING_LENGTH: f32 = 1.5;

/// How nodes swing that swing together.
struct Group {
    pivot: Vec3,
    /// The line between both ends, if it hangs by them.
    axis: Option<Vec3>,
    /// Radians.
    phase: f32,
}

/// The animation of everything that swings.
pub struct Sway {
    groups: Vec<Group>,
    /// The group of each node, and its transform at rest.
    nodes: Vec<Option<(usize, DAffine3)>>,
    node_map: NodeMap,
}

/// The name of the group that a node swings with, if any: the part of the node's name that
/// identifies one string or lantern by a number, else the whole name.
fn group_name(name: &str) -> Option<&str> {
    let is_named = |part: &str| {
        let part = part.to_ascii_lowercase();
        part.contains("stringlight") || part.contains("lantern")
    };
    let ends = name.match_indices('/').map(|(end, _)| end).chain([name.len()]);
    let mut named = name.split('/').zip(ends).filter(|(part, _)| is_named(part));
    let numbered = named.clone().find(|(part, _)| part.bytes().any(|byte| byte.is_ascii_digit()));
    numbered.map(|(_, end)| &name[..end]).or_else(|| named.next().map(|_| name))
}

impl Sway {
    /// Finds the groups by the names of nodes and meshes. `placed` are the nodes of the scene, by index.
    pub fn new(document: &Document, scene: &Scene, placed: &[Option<SceneNode>], node_map: NodeMap) -> Self {
        let mut names: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
        for node in document.nodes() {
            let mesh = node.mesh().and_then(|mesh| mesh.name());
            let own = node.name().and_then(group_name);
            if let Some(group) = own.or_else(|| mesh.and_then(group_name)) {
                names.entry(group).or_default().push(node.index());
            }
        }
        let (mut groups, mut nodes) = (Vec::new(), vec![None; placed.len()]);
        for (index, members) in names.into_values().enumerate() {
            let objects = node_map.objects.iter().filter(|object| members.contains(&object.node));
            let points: Vec<Vec3> = objects.flat_map(|object| scene.vertices(&scene.objects[object.object])).collect();
            let Some((pivot, axis)) = suspension(&points) else { continue };
            members.iter().for_each(|&node| nodes[node] = placed[node].map(|placed| (groups.len(), placed.transform)));
            // Multiples of the golden angle keep neighbours out of step.
            groups.push(Group { pivot, axis, phase: index as f32 * 2.399_963 });
        }
        Self { groups, nodes, node_map }
    }
}

/// The point about which a group of points swings, and the axis if it hangs by both ends.
fn suspension(points: &[Vec3]) -> Option<(Vec3, Option<Vec3>)> {
    let farthest = |from: Vec3| {
        points.iter().copied().max_by(|a, b| a.distance_squared(from).total_cmp(&b.distance_squared(from)))
    };
    let from = farthest(*points.first()?)?;
    let along = farthest(from)? - from;
    if along.with_y(0.0).length() > STRING_LENGTH {
        return Some((from, Some(along.normalize())));
    }
    Some((points.iter().copied().max_by(|a, b| a.y.total_cmp(&b.y))?, None))
}

impl Group {
    /// The motion from rest at a time, in seconds.
    fn swing(&self, time: f32) -> DAffine3 {
        let wave = (1.9 * time + self.phase).sin() + 0.35 * (4.3 * time + 2.0 * self.phase).sin();
        let turn = |axis: Vec3, angle: f32| DQuat::from_axis_angle(axis.as_dvec3().normalize(), f64::from(angle));
        let turn = match self.axis {
            Some(axis) => turn(axis, 0.11 * wave),
            None => turn(Vec3::X, 0.07 * wave) * turn(Vec3::Z, 0.06 * (2.3 * time + 1.7 * self.phase).cos()),
        };
        let pivot = self.pivot.as_dvec3();
        DAffine3::from_translation(pivot) * DAffine3::from_quat(turn) * DAffine3::from_translation(-pivot)
    }
}

impl Animation for Sway {
    fn is_still(&self) -> bool {
        self.groups.is_empty()
    }

    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        let swings: Vec<DAffine3> = self.groups.iter().map(|group| group.swing(time as f32)).collect();
        let moved = |node: usize| self.nodes[node].map(|(group, rest)| swings[group] * rest);
        self.node_map.place(moved, scene, world)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use girandole::glam::vec3;

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
        let (pivot, axis) = suspension(&string).unwrap();
        assert!(axis.is_some_and(|axis| axis.x.abs() > 0.99) && pivot.y == 4.0);
        let lantern = [vec3(0.1, 2.0, 0.0), vec3(0.0, 3.0, 0.0)];
        assert_eq!(suspension(&lantern), Some((vec3(0.0, 3.0, 0.0), None)));
    }
}
