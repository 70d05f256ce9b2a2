//! Plays the animations of a glTF file: translations, rotations and scales of nodes. All animations
//! play at once, each in a loop.

use girandole::glam::{DAffine3, DVec3, Quat, Vec3, Vec4};
use girandole::{DirectionalLight, LightWorld};
use girandole_assets::AssetError;
use girandole_assets::gltf::gltf::animation::{Interpolation, Property};
use girandole_assets::gltf::gltf::scene::Transform;
use girandole_assets::gltf::{GltfFile, accessor_values, local_transform, scene_nodes};

use super::node_map::{NodeMap, to_single};
use super::{Animation, Scene, SceneError};

/// A property of a node over time.
struct Channel {
    node: usize,
    property: Property,
    interpolation: Interpolation,
    /// Seconds, ascending.
    times: Vec<f32>,
    /// One for each key, or three (in-tangent, value, out-tangent) for cubic splines. Vectors of
    /// three numbers have a fourth that is 0.
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

/// Plays all animations of a file.
pub struct Player {
    channels: Vec<Channel>,
    /// Nodes with their parents, parents before children.
    order: Vec<(usize, Option<usize>)>,
    /// The transform of each node to its parent, without animation.
    rest: Vec<DAffine3>,
    /// The present pose of each animated node.
    poses: Vec<Option<Pose>>,
    /// Whether a node or one of its ancestors is animated.
    is_animated: Vec<bool>,
    node_map: NodeMap,
}

impl Player {
    /// `None` if the file has no animations of nodes.
    pub fn new(file: &GltfFile, node_map: NodeMap) -> Result<Option<Self>, SceneError> {
        let document = &file.document;
        let error = |error: AssetError| SceneError(error.to_string());
        let mut channels = Vec::new();
        for animation in document.animations() {
            let first = channels.len();
            for channel in animation.channels() {
                let (target, sampler) = (channel.target(), channel.sampler());
                let property = target.property();
                if property == Property::MorphTargetWeights {
                    continue;
                }
                let times = accessor_values::<1>(&sampler.input(), &file.buffers).map_err(error)?;
                let times: Vec<f32> = times.into_iter().map(|[time]| time).collect();
                let output = sampler.output();
                let values: Vec<Vec4> = if property == Property::Rotation {
                    accessor_values::<4>(&output, &file.buffers).map_err(error)?.into_iter().map(Vec4::from).collect()
                } else {
                    let values = accessor_values::<3>(&output, &file.buffers).map_err(error)?;
                    values.into_iter().map(|value| Vec3::from(value).extend(0.0)).collect()
                };
                let node = target.node().index();
                let channel =
                    Channel { node, property, interpolation: sampler.interpolation(), times, values, period: 0.0 };
                channel.check().map_err(|what| SceneError(format!("animation {}: {what}", animation.index())))?;
                channels.push(channel);
            }
            let last = |channel: &Channel| f64::from(channel.times[channel.times.len() - 1]);
            let period = channels[first..].iter().map(last).fold(0.0, f64::max);
            channels[first..].iter_mut().for_each(|channel| channel.period = period);
        }
        if channels.is_empty() {
            return Ok(None);
        }
        let order =
            scene_nodes(document).map_err(error)?.iter().map(|node| (node.node, node.parent)).collect::<Vec<_>>();
        let nodes: Vec<_> = document.nodes().collect();
        let rest: Vec<DAffine3> = nodes.iter().map(local_transform).collect::<Result<_, _>>().map_err(error)?;
        let mut poses = vec![None; nodes.len()];
        for channel in &channels {
            let (translation, rotation, scale) = match nodes[channel.node].transform() {
                matrix @ Transform::Matrix { .. } => matrix.decomposed(),
                Transform::Decomposed { translation, rotation, scale } => (translation, rotation, scale),
            };
            poses[channel.node] = Some(Pose {
                translation: translation.into(),
                rotation: Quat::from_array(rotation).normalize(),
                scale: scale.into(),
            });
        }
        let mut is_animated = vec![false; nodes.len()];
        for &(node, parent) in &order {
            is_animated[node] = poses[node].is_some() || parent.is_some_and(|parent| is_animated[parent]);
        }
        Ok(Some(Self { channels, order, rest, poses, is_animated, node_map }))
    }
}

impl Channel {
    /// Checks what the gltf crate's validation does not.
    fn check(&self) -> Result<(), &'static str> {
        let per_key = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        if self.times.is_empty() || self.values.len() != self.times.len() * per_key {
            return Err("the numbers of its keys and values do not match");
        }
        if !self.times.iter().all(|time| time.is_finite() && *time >= 0.0) || !self.times.is_sorted() {
            return Err("its key times are not ascending");
        }
        if !self.values.iter().all(|value| value.is_finite()) {
            return Err("one of its values is not finite");
        }
        let is_zero = |key: &Vec4| key.length_squared() < 1e-12;
        let keys = || self.values.chunks_exact(per_key).map(|key| key[per_key / 2]);
        if self.property == Property::Rotation && keys().any(|key| is_zero(&key)) {
            return Err("one of its rotations has no length");
        }
        Ok(())
    }

    /// The value of a key.
    fn key(&self, index: usize) -> Vec4 {
        if self.interpolation == Interpolation::CubicSpline { self.values[index * 3 + 1] } else { self.values[index] }
    }

    /// The value at a time, in seconds.
    fn value(&self, time: f64) -> Vec4 {
        let time = if self.period > 0.0 { time.rem_euclid(self.period) as f32 } else { 0.0 };
        let next = self.times.partition_point(|key| *key <= time);
        if next == 0 {
            return self.key(0);
        }
        let last = next - 1;
        if next == self.times.len() {
            return self.key(last);
        }
        let span = self.times[next] - self.times[last];
        let t = (time - self.times[last]) / span;
        let (from, to) = (self.key(last), self.key(next));
        match self.interpolation {
            Interpolation::Step => from,
            Interpolation::Linear if self.property == Property::Rotation => {
                let [from, to] = [from, to].map(|q| Quat::from_vec4(q).normalize());
                from.slerp(to, t).into()
            }
            Interpolation::Linear => from.lerp(to, t),
            Interpolation::CubicSpline => {
                let (out, into) = (self.values[last * 3 + 2] * span, self.values[next * 3] * span);
                let (t2, t3) = (t * t, t * t * t);
                from * (2.0 * t3 - 3.0 * t2 + 1.0)
                    + out * (t3 - 2.0 * t2 + t)
                    + to * (3.0 * t2 - 2.0 * t3)
                    + into * (t3 - t2)
            }
        }
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
        let mut transforms = vec![DAffine3::IDENTITY; self.rest.len()];
        for &(node, parent) in &self.order {
            let local = self.poses[node].map_or(self.rest[node], |pose| pose.transform());
            transforms[node] = parent.map_or(local, |parent| transforms[parent] * local);
            if !self.is_animated[node] {
                continue;
            }
            for object in &self.node_map.objects[node] {
                scene.objects[object.object].transform = to_single(transforms[node] * object.local);
            }
        }
        for lights in self.node_map.lights.nodes.iter().filter(|lights| self.is_animated[lights.node]) {
            let transform = transforms[lights.node];
            if let Some(placement) = lights.source.placement(&(transform * lights.local)) {
                world.move_instance(lights.instance, placement)?;
            }
        }
        for (node, key) in self.node_map.lights.directional.iter().filter(|(node, _)| self.is_animated[*node]) {
            let direction = (transforms[*node].matrix3 * DVec3::NEG_Z).try_normalize();
            if let (Some(direction), Some(light)) = (direction, world.directional(*key).copied()) {
                world.set_directional(*key, DirectionalLight { direction: direction.as_vec3(), ..light })?;
            }
        }
        Ok(())
    }
}
