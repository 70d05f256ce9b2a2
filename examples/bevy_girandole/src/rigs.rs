//! Emissive meshes that joints and morph targets move: their triangles, and the poses of entities.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Weak};
use std::time::Instant;

use bevy::asset::{AssetId, Assets};
use bevy::ecs::system::SystemParam;
use bevy::image::Image;
use bevy::mesh::Mesh;
use bevy::mesh::morph::{MeshMorphWeights, MorphWeights};
use bevy::mesh::skinning::{SkinnedMesh, SkinnedMeshInverseBindposes};
use bevy::prelude::*;
use bytemuck::{Pod, Zeroable};
use girandole::Light;

use crate::gathered::{Changes, Gathered, Shape};
use crate::kinds::KindKey;
use crate::triangles;

/// What moves the triangles of a mesh. An entity whose triangles are moved shares its tree with no other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Rig {
    /// The transform of the entity alone.
    Rigid,
    /// Morph targets, by the weights of an entity, and then its transform.
    Morph(Entity),
    /// Morph targets, if there are any, and then the joints of an entity.
    Skin(Entity),
}

impl Rig {
    /// What moves a mesh of an entity with or without a skin and weights of morph targets.
    pub fn of(entity: Entity, mesh: Option<&Mesh>, has_skin: bool, has_weights: bool) -> Self {
        match mesh {
            Some(mesh) if has_skin && triangles::has_joints(mesh) => Self::Skin(entity),
            Some(mesh) if has_weights && triangles::has_targets(mesh) => Self::Morph(entity),
            _ => Self::Rigid,
        }
    }

    /// The entity whose tree this is; `None` for trees that entities share.
    pub fn entity(self) -> Option<Entity> {
        match self {
            Self::Rigid => None,
            Self::Morph(entity) | Self::Skin(entity) => Some(entity),
        }
    }

    /// The same for all entities.
    pub fn of_all(self) -> Self {
        match self {
            Self::Rigid => Self::Rigid,
            Self::Morph(_) => Self::Morph(Entity::PLACEHOLDER),
            Self::Skin(_) => Self::Skin(Entity::PLACEHOLDER),
        }
    }
}

/// A corner of an emissive triangle, in the space of the mesh. Twin of `GirandoleCorner` in pose.wgsl.
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

/// The triangles of a mesh that is posed.
#[derive(Debug)]
pub struct PosedMesh {
    /// Three for each triangle.
    pub corners: Vec<Corner>,
    /// How far each morph target moves each corner: all corners by the first target, then by the second.
    pub offsets: Vec<[f32; 3]>,
}

/// What poses a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pose {
    /// From the space of the mesh to the world. A mesh without a skin has the transform of its entity as its joint.
    pub joints: Vec<Mat4>,
    /// The weights of morph targets.
    pub weights: Vec<f32>,
}

impl PosedMesh {
    /// The triangles of a mesh, with what each of them emits. `None` if the mesh lacks what the rig needs.
    pub fn new(mesh: &Mesh, rig: Rig, lights: &[Light]) -> Option<Self> {
        let places = triangles::corners(mesh).filter(|places| places.len() == lights.len())?;
        let influences = match rig {
            Rig::Skin(_) => triangles::influences(mesh)?,
            Rig::Rigid | Rig::Morph(_) => vec![[([0; 4], [1.0, 0.0, 0.0, 0.0]); 3]; places.len()],
        };
        let triangles = places.iter().zip(&influences).zip(lights);
        let corners = triangles.flat_map(|((places, influences), light)| {
            std::array::from_fn::<_, 3, _>(|k| {
                let (joints, weights) = influences[k];
                let [a, b, c, d] = joints.map(u32::from);
                let (place, emission) = (places[k].to_array(), light.emission[k]);
                Corner { place, emission, weights, joints: [a | b << 16, c | d << 16], padding: [0; 2] }
            })
        });
        Some(Self { corners: corners.collect(), offsets: triangles::morph_offsets(mesh).unwrap_or_default() })
    }

    /// The number of morph targets.
    pub fn targets(&self) -> usize {
        self.offsets.len().checked_div(self.corners.len()).unwrap_or(0)
    }

    /// Where a corner is in the world. Twin of `girandole_posed` in pose.wgsl.
    fn posed(&self, corner: usize, pose: &Pose) -> Vec3 {
        let Corner { place, weights, joints, .. } = self.corners[corner];
        let targets = self.offsets.chunks_exact(self.corners.len()).zip(&pose.weights);
        let at = targets.fold(Vec3::from(place), |at, (offsets, weight)| at + *weight * Vec3::from(offsets[corner]));
        let joint = |k: usize| pose.joints.get((joints[k / 2] >> (16 * (k % 2)) & 0xffff) as usize);
        let moved = |k: usize| joint(k).map_or(Vec3::ZERO, |joint| joint.transform_point3(at));
        (0..4).map(|k| weights[k] * moved(k)).sum()
    }

    /// The lights that the triangles are in a pose, on one side.
    pub fn lights(&self, pose: &Pose) -> impl Iterator<Item = Light> {
        self.corners.chunks_exact(3).enumerate().map(|(triangle, corners)| {
            let posed = std::array::from_fn(|k| self.posed(3 * triangle + k, pose));
            let is_sound = posed.iter().all(|place| place.is_finite());
            let places = if is_sound { posed } else { std::array::from_fn(|k| corners[k].place.into()) };
            Light::triangle(places, Vec3::from_array(std::array::from_fn(|k| corners[k].emission)))
        })
    }
}

/// The skeletons and the weights of morph targets of the main world.
#[derive(SystemParam)]
pub struct Poses<'w, 's> {
    skins: Query<'w, 's, &'static SkinnedMesh>,
    transforms: Query<'w, 's, &'static GlobalTransform>,
    bind_poses: Option<Res<'w, Assets<SkinnedMeshInverseBindposes>>>,
    weights_of_meshes: Query<'w, 's, &'static MeshMorphWeights>,
    weights: Query<'w, 's, &'static MorphWeights>,
}

impl Poses<'_, '_> {
    /// The pose in which Bevy draws an entity; `None` for one that nothing poses.
    pub fn get(&self, rig: Rig) -> Option<Pose> {
        let entity = rig.entity()?;
        let joints = match rig {
            Rig::Skin(_) => self.joints(entity)?,
            Rig::Rigid | Rig::Morph(_) => vec![self.transforms.get(entity).ok()?.to_matrix()],
        };
        Some(Pose { joints, weights: self.weights(entity).to_vec() })
    }

    fn joints(&self, entity: Entity) -> Option<Vec<Mat4>> {
        let skin = self.skins.get(entity).ok()?;
        let bind_poses = self.bind_poses.as_ref().and_then(|poses| poses.get(&skin.inverse_bindposes));
        let matrix = |(index, joint): (usize, &Entity)| {
            let bind_pose = bind_poses.and_then(|poses| poses.get(index));
            match (bind_pose, self.transforms.get(*joint)) {
                (Some(bind_pose), Ok(transform)) => transform.affine() * *bind_pose,
                _ => Mat4::IDENTITY,
            }
        };
        Some(skin.joints.iter().enumerate().map(matrix).collect())
    }

    fn weights(&self, entity: Entity) -> &[f32] {
        match self.weights_of_meshes.get(entity) {
            Ok(MeshMorphWeights::Value { weights }) => weights,
            Ok(MeshMorphWeights::Reference(of)) => self.weights.get(*of).map_or(&[], MorphWeights::weights),
            Err(_) => &[],
        }
    }
}

/// The meshes in use that are posed. Entities with the same mesh and material share them.
#[derive(Debug, Default)]
pub struct PosedMeshes(HashMap<KindKey, Weak<PosedMesh>>);

impl PosedMeshes {
    /// The mesh of a kind, which `make` makes if there is none.
    pub fn get(&mut self, key: KindKey, make: impl FnOnce() -> Option<PosedMesh>) -> Option<Arc<PosedMesh>> {
        if let Some(present) = self.0.get(&key).and_then(Weak::upgrade) {
            return Some(present);
        }
        self.0.retain(|_, mesh| mesh.strong_count() > 0);
        let mesh = Arc::new(make()?);
        self.0.insert(key, Arc::downgrade(&mesh));
        Some(mesh)
    }

    /// Forgets what was made of meshes and images.
    pub fn forget(&mut self, meshes: &HashSet<AssetId<Mesh>>, images: &HashSet<AssetId<Image>>) {
        self.0.retain(|key, _| !key.is_made_of(meshes, images));
    }
}

type AnyPose = Or<(With<SkinnedMesh>, With<MeshMorphWeights>)>;

/// Sends the poses that have changed of lights that are shown. O(joints and morph targets).
pub fn gather(
    mut changes: ResMut<Changes>,
    poses: Poses,
    lights: Query<(Entity, Ref<Gathered>, &InheritedVisibility), AnyPose>,
    mut sent: Local<HashMap<Entity, Pose>>,
) {
    let started = Instant::now();
    let edits = &mut changes.bypass_change_detection().edits;
    let rig = |gathered: &Gathered| if let Shape::Mesh(rig) = gathered.shape { rig } else { Rig::Rigid };
    let mut count = 0;
    for (entity, gathered, visibility) in &lights {
        if !visibility.get() {
            continue;
        }
        let Some(pose) = poses.get(rig(&gathered)) else { continue };
        count += 1;
        let last = sent.entry(entity).or_default();
        if gathered.is_changed() || *last != pose {
            last.clone_from(&pose);
            edits.poses.push((gathered.kind, pose));
        }
    }
    if sent.len() > count {
        // Those that are shown again are sent again.
        let is_posed = |(_, gathered, shown): (Entity, Ref<Gathered>, &InheritedVisibility)| {
            rig(&gathered) != Rig::Rigid && shown.get()
        };
        sent.retain(|entity, _| lights.get(*entity).is_ok_and(is_posed));
    }
    changes.took(started);
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;
    use bevy::mesh::morph::MorphAttributes;
    use bevy::mesh::{Indices, PrimitiveTopology, VertexAttributeValues};

    use super::*;

    const EMISSION: Vec3 = Vec3::new(1.0, 2.0, 3.0);
    const SKIN: Rig = Rig::Skin(Entity::PLACEHOLDER);
    const MORPH: Rig = Rig::Morph(Entity::PLACEHOLDER);

    /// A triangle whose vertices are stored in another order than its corners.
    fn mesh() -> Mesh {
        let places = [Vec3::Z, Vec3::X, Vec3::Y].map(|place| place.to_array()).to_vec();
        Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all())
            .with_inserted_attribute(Mesh::ATTRIBUTE_POSITION, places)
            .with_inserted_indices(Indices::U16(vec![1, 2, 0]))
    }

    fn skinned(joints: [u16; 4], weights: [f32; 4]) -> Mesh {
        mesh()
            .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_INDEX, VertexAttributeValues::Uint16x4(vec![joints; 3]))
            .with_inserted_attribute(Mesh::ATTRIBUTE_JOINT_WEIGHT, vec![weights; 3])
    }

    /// Two targets: one lifts the vertex at Z, and one moves the vertex at X back to the origin.
    fn with_targets(mesh: Mesh) -> Mesh {
        let offset = |position| MorphAttributes { position, ..default() };
        let lifted = [Vec3::Y, Vec3::ZERO, Vec3::ZERO];
        let back = [Vec3::ZERO, Vec3::NEG_X, Vec3::ZERO];
        mesh.with_morph_targets([lifted, back].concat().into_iter().map(offset).collect())
    }

    fn assert_posed(name: &str, (mesh, rig): (&Mesh, Rig), pose: &Pose, expected: [Vec3; 3]) {
        let light = Light::triangle([Vec3::X, Vec3::Y, Vec3::Z], EMISSION);
        let mesh = PosedMesh::new(mesh, rig, &[light]).expect("it has what the rig needs");
        let lights: Vec<Light> = mesh.lights(pose).collect();
        let posed: Vec<Vec3> = (0..3).map(|corner| mesh.posed(corner, pose)).collect();
        assert!(
            posed.iter().zip(expected).all(|(posed, expected)| posed.distance(expected) < 1e-6),
            "{name}: {posed:?}"
        );
        assert_eq!((lights.len(), lights[0].emission), (1, EMISSION), "{name}");
    }

    #[test]
    fn a_corner_is_where_its_joints_are() {
        let up = Mat4::from_translation(Vec3::Y);
        let turned = Mat4::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let pose = Pose { joints: vec![up, turned], weights: vec![] };
        let check = |name, (joints, weights), expected| {
            assert_posed(name, (&skinned(joints, weights), SKIN), &pose, expected);
        };
        check("one joint", ([7, 1, 0, 0], [0.0, 1.0, 0.0, 0.0]), [Vec3::Y, Vec3::NEG_X, Vec3::Z]);
        let both = [Vec3::new(0.5, 1.0, 0.0), Vec3::new(-0.5, 1.0, 0.0), Vec3::new(0.0, 0.5, 1.0)];
        check("two joints", ([0, 0, 0, 1], [0.5, 0.0, 0.0, 0.5]), both);
        check("a joint that there is not", ([9, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]), [Vec3::ZERO; 3]);
    }

    #[test]
    fn morph_targets_move_corners_before_joints_do() {
        let turned = Mat4::from_rotation_z(std::f32::consts::FRAC_PI_2);
        let morphed = with_targets(mesh());
        let pose = |weights: &[f32]| Pose { joints: vec![turned], weights: weights.to_vec() };
        let check = |name, weights: &[f32], expected| assert_posed(name, (&morphed, MORPH), &pose(weights), expected);
        check("at rest", &[0.0, 0.0], [Vec3::Y, Vec3::NEG_X, Vec3::Z]);
        check("lifted by half", &[0.5], [Vec3::Y, Vec3::NEG_X, Vec3::new(-0.5, 0.0, 1.0)]);
        check("both, and a weight too many", &[1.0, 1.0, 9.0], [Vec3::ZERO, Vec3::NEG_X, Vec3::new(-1.0, 0.0, 1.0)]);
        let with_joints = with_targets(skinned([1, 0, 0, 0], [1.0, 0.0, 0.0, 0.0]));
        let pose = Pose { joints: vec![Mat4::IDENTITY, turned], weights: vec![1.0, 0.0] };
        let expected = [Vec3::Y, Vec3::NEG_X, Vec3::new(-1.0, 0.0, 1.0)];
        assert_posed("with a skin", (&with_joints, SKIN), &pose, expected);
        assert_posed("without its skin", (&with_joints, MORPH), &Pose { joints: vec![turned], ..pose }, expected);
    }

    #[test]
    fn a_mesh_is_moved_by_what_it_and_its_entity_have() {
        let entity = Entity::PLACEHOLDER;
        let (plain, morphed) = (mesh(), with_targets(mesh()));
        let both = with_targets(skinned([0; 4], [1.0, 0.0, 0.0, 0.0]));
        for (mesh, has_skin, has_weights, expected) in [
            (&plain, true, true, Rig::Rigid),
            (&morphed, true, false, Rig::Rigid),
            (&morphed, true, true, MORPH),
            (&both, false, true, MORPH),
            (&both, true, true, SKIN),
            (&both, true, false, SKIN),
            (&both, false, false, Rig::Rigid),
        ] {
            assert_eq!(Rig::of(entity, Some(mesh), has_skin, has_weights), expected);
        }
        assert_eq!(Rig::of(entity, None, true, true), Rig::Rigid);
    }
}
