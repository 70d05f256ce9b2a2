//! Plays the animations of a glTF file: translations, rotations and scales of nodes. All animations
//! play at once, each in a loop. Cubic splines are straight between their keys.

use girandole::LightWorld;
use girandole::glam::{DAffine3, Quat, Vec3, Vec4};
use girandole_assets::gltf::gltf::animation::{Interpolation, Property};
use girandole_assets::gltf::{GltfFile, accessor_values, local_transform, scene_nodes};

use super::node_map::NodeMap;
use super::{Animation, Scene, SceneError};

/// A property of a node over time.
struct Channel {
    node: usize,
    property: Property,
    /// Whether it jumps from key to key.
    is_step: bool,
    /// Seconds, ascending.
    times: Vec<f32>,
    /// One for each key. Vectors of three numbers have a fourth that is 0.
    values: Vec<Vec4>,
    /// Length of the whole animation, seconds.
    period: f64,
}

/// The animated properties of a node.
#[derive(Clone, Copy)]
struct Pose {
    translation: Vec3,
    rotation: Quat,
    scale: Vec3,
}

/// A node of the scene. Parents come before their children.
struct PlayedNode {
    node: usize,
    parent: Option<usize>,
    /// The transform to its parent, without animation.
    rest: DAffine3,
    /// Whether it or one of its ancestors is animated.
    is_animated: bool,
}

/// Plays all animations of a file.
pub struct Player {
    channels: Vec<Channel>,
    nodes: Vec<PlayedNode>,
    /// The present pose of each animated node, by its index in the file.
    poses: Vec<Option<Pose>>,
    node_map: NodeMap,
}

impl Player {
    /// `None` if the file has no animations of nodes.
    pub fn new(file: &GltfFile, node_map: &NodeMap) -> Result<Option<Self>, SceneError> {
        let nodes: Vec<_> = file.document.nodes().collect();
        let (mut channels, mut poses) = (Vec::new(), vec![None; nodes.len()]);
        for animation in file.document.animations() {
            let first = channels.len();
            for channel in animation.channels() {
                let (target, sampler) = (channel.target(), channel.sampler());
                let property = target.property();
                let output = sampler.output();
                let mut values: Vec<Vec4> = match property {
                    Property::MorphTargetWeights => continue,
                    Property::Rotation => {
                        let values = accessor_values::<4>(&output, &file.buffers)?;
                        values.into_iter().map(Vec4::from).collect()
                    }
                    _ => {
                        let values = accessor_values::<3>(&output, &file.buffers)?;
                        values.into_iter().map(|value| Vec3::from(value).extend(0.0)).collect()
                    }
                };
                if sampler.interpolation() == Interpolation::CubicSpline {
                    // Each value is between two tangents.
                    values = values.chunks(3).filter_map(|key| key.get(1).copied()).collect();
                }
                let is_step = sampler.interpolation() == Interpolation::Step;
                let times = accessor_values::<1>(&sampler.input(), &file.buffers)?;
                let (node, times) = (target.node().index(), times.into_iter().flatten().collect());
                let channel = Channel { node, property, is_step, times, values, period: 0.0 };
                channel.check().map_err(|what| SceneError(format!("animation {}: {what}", animation.index())))?;
                channels.push(channel);
                let (translation, rotation, scale) = nodes[node].transform().decomposed();
                let rotation = Quat::from_array(rotation).normalize();
                poses[node] = Some(Pose { translation: translation.into(), rotation, scale: scale.into() });
            }
            let last = |channel: &Channel| f64::from(channel.times[channel.times.len() - 1]);
            let period = channels[first..].iter().map(last).fold(0.0, f64::max);
            channels[first..].iter_mut().for_each(|channel| channel.period = period);
        }
        if channels.is_empty() {
            return Ok(None);
        }
        let (mut played, mut is_animated) = (Vec::new(), vec![false; nodes.len()]);
        for placed in scene_nodes(&file.document)? {
            let (node, parent) = (placed.node, placed.parent);
            let rest = local_transform(&nodes[node])?;
            is_animated[node] = poses[node].is_some() || parent.is_some_and(|parent| is_animated[parent]);
            played.push(PlayedNode { node, parent, rest, is_animated: is_animated[node] });
        }
        Ok(Some(Self { channels, nodes: played, poses, node_map: node_map.clone() }))
    }
}
impl Channel {
    /// Checks what the gltf crate's validation does not.
    fn check(&self) -> Result<(), &'static str> {
        if self.times.is_empty() || self.values.len() != self.times.len() {
            return Err("the numbers of its keys and values do not match");
        }
        if !self.times.iter().all(|time| time.is_finite() && *time >= 0.0) || !self.times.is_sorted() {
            return Err("its key times are not ascending");
        }
        if !self.values.iter().all(|value| value.is_finite()) {
            return Err("one of its values is not finite");
        }
        if self.property == Property::Rotation && self.values.iter().any(|key| key.length_squared() < 1e-12) {
            return Err("one of its rotations has no length");
        }
        Ok(())
    }

    /// The value at a time, in seconds.
    fn value(&self, time: f64) -> Vec4 {
        let time = if self.period > 0.0 { time.rem_euclid(self.period) as f32 } else { 0.0 };
        let next = self.times.partition_point(|key| *key <= time);
        if next == 0 || next == self.times.len() || self.is_step {
            return self.values[next.saturating_sub(1)];
        }
        let t = (time - self.times[next - 1]) / (self.times[next] - self.times[next - 1]);
        let [from, to] = [self.values[next - 1], self.values[next]];
        if self.property != Property::Rotation {
            return from.lerp(to, t);
        }
        let [from, to] = [from, to].map(|q| Quat::from_vec4(q).normalize());
        from.slerp(to, t).into()
    }
}

impl Pose {
    /// The transform to the parent.
    fn transform(&self) -> DAffine3 {
        let (scale, rotation) = (self.scale.as_dvec3(), self.rotation.as_dquat().normalize());
        DAffine3::from_scale_rotation_translation(scale, rotation, self.translation.as_dvec3())
    }
}

impl Animation for Player {
    fn advance(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        for channel in &self.channels {
            let value = channel.value(time);
            let Some(pose) = &mut self.poses[channel.node] else { continue };
            match channel.property {
                Property::Translation => pose.translation = value.truncate(),
                Property::Rotation => pose.rotation = Quat::from_vec4(value).normalize(),
                Property::Scale => pose.scale = value.truncate(),
                Property::MorphTargetWeights => {}
            }
        }
        let (mut transforms, mut moved) = (vec![DAffine3::IDENTITY; self.poses.len()], vec![None; self.poses.len()]);
        for &PlayedNode { node, parent, rest, is_animated } in &self.nodes {
            let local = self.poses[node].map_or(rest, |pose| pose.transform());
            transforms[node] = parent.map_or(local, |parent| transforms[parent] * local);
            moved[node] = is_animated.then_some(transforms[node]);
        }
        self.node_map.place(|node| moved[node], scene, world)
    }
}
