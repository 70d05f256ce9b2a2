//! Skinned emissive meshes: their triangles with joints and weights, and the poses of their skeletons.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Weak};
use std::time::Instant;

use bevy::asset::{AssetId, Assets};
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::mesh::Mesh;
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;
use bytemuck::{Pod, Zeroable};
use girandole::Light;

use crate::gathered::{Changes, Gathered, Shape};
use crate::kinds::KindKey;
use crate::triangles::Influences;

/// A corner of an emissive triangle, in the space of the mesh. Twin of `GirandoleCorner` in skin.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Corner {
    place: [f32; 3],
    /// What the triangle emits: red, green and blue are in its three corners.
    emission: f32,
    weights: [f32; 4],
    /// Four joints of 16 bits.
    joints: [u32; 2],
    padding: [u32; 2],
}

/// A triangle of a skinned mesh.
pub type Triangle = [Corner; 3];

/// The triangle of a light of a mesh in its bind pose.
pub fn triangle(corners: [Vec3; 3], influences: [Influences; 3], light: &Light) -> Triangle {
    std::array::from_fn(|k| {
        let (joints, weights) = influences[k];
        let [a, b, c, d] = joints.map(u32::from);
        let (place, emission) = (corners[k].to_array(), light.emission[k]);
        Corner { place, emission, weights, joints: [a | b << 16, c | d << 16], padding: [0; 2] }
    })
}

impl Corner {
    /// Where the corner is in the world. Twin of `girandole_posed` in skin.wgsl.
    fn posed(&self, pose: &[Mat4]) -> Vec3 {
        let joint = |k: usize| pose.get((self.joints[k / 2] >> (16 * (k % 2)) & 0xffff) as usize);
        let moved = |k: usize| joint(k).map_or(Vec3::ZERO, |joint| joint.transform_point3(self.place.into()));
        (0..4).map(|k| self.weights[k] * moved(k)).sum()
    }
}

/// The light that a triangle is in a pose, on one side.
pub fn light(triangle: &Triangle, pose: &[Mat4]) -> Light {
    let posed = triangle.map(|corner| corner.posed(pose));
    let is_sound = posed.iter().all(|place| place.is_finite());
    let corners = if is_sound { posed } else { triangle.map(|corner| corner.place.into()) };
    Light::triangle(corners, triangle.map(|corner| corner.emission).into())
}

/// The skeletons of the main world.
#[derive(SystemParam)]
pub struct Skeletons<'w, 's> {
    skins: Query<'w, 's, &'static SkinnedMesh>,
    joints: Query<'w, 's, &'static GlobalTransform>,
    bind_poses: Option<Res<'w, Assets<SkinnedMeshInverseBindposes>>>,
}

impl Skeletons<'_, '_> {
    /// The matrices of the joints of an entity, as Bevy draws it: from the space of the mesh to the world. `None` for an
    /// entity without a skin.
    pub fn pose(&self, entity: Entity) -> Option<Vec<Mat4>> {
        let skin = self.skins.get(entity).ok()?;
        let bind_poses = self.bind_poses.as_ref().and_then(|poses| poses.get(&skin.inverse_bindposes));
        let matrix = |(index, joint): (usize, &Entity)| {
            let bind_pose = bind_poses.and_then(|poses| poses.get(index));
            match (bind_pose, self.joints.get(*joint)) {
                (Some(bind_pose), Ok(transform)) => transform.affine() * *bind_pose,
                _ => Mat4::IDENTITY,
            }
        };
        Some(skin.joints.iter().enumerate().map(matrix).collect())
    }
}

/// The triangles of skinned meshes in use. Entities with the same mesh and material share them.
#[derive(Debug, Default)]
pub struct SkinCache(HashMap<KindKey, Weak<[Triangle]>>);

impl SkinCache {
    /// The triangles of a kind of mesh, which `make` makes if there are none.
    pub fn get(&mut self, key: KindKey, make: impl FnOnce() -> Option<Vec<Triangle>>) -> Option<Arc<[Triangle]>> {
        if let Some(present) = self.0.get(&key).and_then(Weak::upgrade) {
            return Some(present);
        }
        self.0.retain(|_, triangles| triangles.strong_count() > 0);
        let triangles: Arc<[Triangle]> = make()?.into();
        self.0.insert(key, Arc::downgrade(&triangles));
        Some(triangles)
    }

    /// Forgets what was made of meshes and images.
    pub fn forget(&mut self, meshes: &HashSet<AssetId<Mesh>>, images: &HashSet<AssetId<Image>>) {
        self.0.retain(|key, _| !key.is_made_of(meshes, images));
    }
}

/// Sends the poses that have changed of skinned lights that are shown. O(joints).
pub fn gather(
    mut changes: ResMut<Changes>,
    skeletons: Skeletons,
    lights: Query<(Entity, Ref<Gathered>, &InheritedVisibility), With<SkinnedMesh>>,
    mut sent: Local<HashMap<Entity, Vec<Mat4>>>,
) {
    let started = Instant::now();
    let edits = &mut changes.bypass_change_detection().edits;
    let mut count = 0;
    for (entity, gathered, visibility) in &lights {
        if gathered.shape != Shape::Skinned || !visibility.get() {
            continue;
        }
        let Some(pose) = skeletons.pose(entity) else { continue };
        count += 1;
        let last = sent.entry(entity).or_default();
        if gathered.is_changed() || *last != pose {
            last.clone_from(&pose);
            edits.poses.push((gathered.kind, pose));
        }
    }
    if sent.len() > count {
        // Those that are shown again are sent again.
        sent.retain(|entity, _| {
            lights.get(*entity).is_ok_and(|(_, gathered, shown)| gathered.shape == Shape::Skinned && shown.get())
        });
    }
    changes.took(started);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_corner_is_where_its_joints_are() {
        let up = Mat4::from_translation(Vec3::Y);
        let turned = Mat4::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let corner = |joints, weights| {
            let light = Light::triangle([Vec3::X, Vec3::Y, Vec3::Z], Vec3::new(1.0, 2.0, 3.0));
            triangle([Vec3::X, Vec3::Y, Vec3::Z], [(joints, weights); 3], &light)
        };
        let near = |triangle: &Triangle, expected: [Vec3; 3]| {
            let posed = triangle.map(|corner| corner.posed(&[up, turned]));
            posed.iter().zip(expected).all(|(posed, expected)| posed.distance(expected) < 1e-6)
        };
        let single = corner([7, 1, 0, 0], [0.0, 1.0, 0.0, 0.0]);
        assert!(near(&single, [Vec3::Y, Vec3::NEG_X, Vec3::Z]), "one joint");
        let both = corner([0, 0, 0, 1], [0.5, 0.0, 0.0, 0.5]);
        assert!(near(&both, [Vec3::new(0.5, 1.0, 0.0), Vec3::new(-0.5, 1.0, 0.0), Vec3::new(0.0, 0.5, 1.0)]), "two");
        let none = corner([9, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]);
        assert!(near(&none, [Vec3::ZERO; 3]), "a joint that there is not");
        assert_eq!(light(&single, &[up, turned]).emission, Vec3::new(1.0, 2.0, 3.0));
    }
}
