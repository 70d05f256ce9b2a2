//! Kinds of light: lights that share a tree, because they differ by place, colour and brightness
//! alone.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;

use bevy::asset::{AssetId, Assets};
use bevy::camera::Exposure;
use bevy::ecs::entity::Entity;
use bevy::ecs::system::{Query, Res, SystemParam};
use bevy::image::Image;
use bevy::log::warn_once;
use bevy::math::Vec3;
use bevy::mesh::Mesh;
use bytemuck::{Pod, Zeroable};
use girandole::Light;

use crate::components::GirandoleSource;
use crate::edits::{Tree, Written};
use crate::rigs::{PosedMesh, PosedMeshes, Poses, Rig};
use crate::settings::RayTraced;
use crate::textures::{DefaultWrap, TextureKey};
use crate::triangles;
use crate::units::{self, UNIT};

/// What the shader knows of a kind. Twin of `GirandoleKind` in shade.wgsl.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct KindRecord {
    /// Metres, for lights without size.
    pub range: f32,
    /// Radius of the highlight in metres, for lights without size.
    pub radius: f32,
    /// `emissive_exposure_weight` of the material, for meshes.
    pub weight: f32,
    /// Nits of the tree's emission for an emissive colour of 1, for meshes.
    pub nits: f32,
    /// Number of lights in the tree.
    pub lights: u32,
    pub padding: [u32; 3],
}

/// The parameters in which kinds differ. Floats are compared by their bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum KindKey {
    Point {
        range: u32,
        radius: u32,
    },
    Spot {
        range: u32,
        radius: u32,
        inner: u32,
        outer: u32,
    },
    Mesh {
        mesh: AssetId<Mesh>,
        texture: Option<TextureKey>,
        two_sided: bool,
        weight: u32,
        ev100: u32,
        rig: Rig,
    },
    /// The lights of an entity, which a pass of the application writes.
    Source(Entity),
    Sky,
}

/// The assets that kinds are made of.
#[derive(SystemParam)]
pub struct Sources<'w, 's> {
    pub meshes: Res<'w, Assets<Mesh>>,
    pub images: Res<'w, Assets<Image>>,
    pub default_wrap: Res<'w, DefaultWrap>,
    pub poses: Poses<'w, 's>,
    pub ray_traced: Res<'w, RayTraced>,
    written: Query<'w, 's, &'static GirandoleSource>,
}

/// A range that dims nothing: the squared distance by its square is 0.
const NO_RANGE: f32 = 1.0e15;

impl KindRecord {
    /// What the shader knows of lights that a pass of the application writes: they are in candela and nits, whatever
    /// the exposure.
    fn written(lights: usize) -> Self {
        Self { range: NO_RANGE, weight: 1.0, nits: 1.0, lights: lights as u32, ..Self::default() }
    }

    /// What the shader knows of a sky of so many patches: its radiance is in nits, whatever the exposure.
    pub fn sky(patches: usize) -> Self {
        Self { weight: 1.0, nits: 1.0, lights: patches as u32, ..Self::default() }
    }
}

impl KindKey {
    /// Whether the kind is made of one of these meshes or images.
    pub fn is_made_of(&self, meshes: &HashSet<AssetId<Mesh>>, images: &HashSet<AssetId<Image>>) -> bool {
        let has_mesh = matches!(self, Self::Mesh { mesh, .. } if meshes.contains(mesh));
        has_mesh || self.images().any(|image| images.contains(&image))
    }

    /// The same kind for all entities with the mesh.
    fn of_all(self) -> Self {
        match self {
            Self::Mesh { mesh, texture, two_sided, weight, ev100, rig } => {
                Self::Mesh { mesh, texture, two_sided, weight, ev100, rig: rig.of_all() }
            }
            other => other,
        }
    }

    /// The images that the kind is made of.
    pub fn images(self) -> impl Iterator<Item = AssetId<Image>> {
        let texture = if let Self::Mesh { texture, .. } = self { texture } else { None };
        texture.into_iter().flat_map(TextureKey::images)
    }

    /// The lights of the tree, and what the shader knows of them; `None` for a mesh without triangles
    /// or with a texture that the main world cannot read, and for the sky, whose tree the light world makes.
    pub fn tree(self, sources: &Sources, posed: &mut PosedMeshes) -> Option<Tree> {
        let punctual = |range, radius| KindRecord { range, radius, lights: 1, ..KindRecord::default() };
        match self {
            Self::Point { range, radius } => {
                let record = punctual(f32::from_bits(range), f32::from_bits(radius));
                let light = Light::point(Vec3::ZERO, Vec3::splat(UNIT)).with_range(record.range);
                Some(Tree { lights: vec![light], record, written: None })
            }
            Self::Spot { range, radius, inner, outer } => {
                let record = punctual(f32::from_bits(range), f32::from_bits(radius));
                let [inner, outer] = [inner, outer].map(f32::from_bits);
                let light = Light::spot(Vec3::ZERO, Vec3::NEG_Z, inner, outer, Vec3::splat(UNIT));
                Some(Tree { lights: vec![light.with_range(record.range)], record, written: None })
            }
            Self::Mesh { mesh, texture, two_sided, weight, ev100, rig } => {
                let mesh = sources.meshes.get(mesh)?;
                let (lights, written) = match sources.poses.get(rig) {
                    Some(pose) => {
                        // Each triangle emits the average of its texels.
                        let lights = || mesh_lights(mesh, texture, (false, false), sources);
                        let mesh = posed.get(self.of_all(), || PosedMesh::new(mesh, rig, &lights()?))?;
                        let side = |light: Light| if two_sided { light.two_sided() } else { light };
                        (mesh.lights(&pose).map(side).collect(), Some(Written::Posed(mesh)))
                    }
                    None => (mesh_lights(mesh, texture, (two_sided, !sources.ray_traced.0), sources)?, None),
                };
                let weight = f32::from_bits(weight);
                let nits = units::nits(Exposure { ev100: f32::from_bits(ev100) }, weight);
                let record = KindRecord { weight, nits, lights: lights.len() as u32, ..KindRecord::default() };
                Some(Tree { lights, record, written })
            }
            Self::Source(entity) => {
                let GirandoleSource { lights, source } = sources.written.get(entity).ok()?.clone();
                let record = KindRecord::written(lights.len());
                Some(Tree { lights, record, written: Some(Written::Pass(entity, source)) })
            }
            Self::Sky => None,
        }
    }
}

/// The triangles of a mesh or, with `is_cut`, the parts into which its texture cuts them.
fn mesh_lights(
    mesh: &Mesh,
    texture: Option<TextureKey>,
    (two_sided, is_cut): (bool, bool),
    sources: &Sources,
) -> Option<Vec<Light>> {
    let Some(corners) = triangles::corners(mesh) else {
        warn_once!("girandole: a mesh without readable triangles is not sampled as a light");
        return None;
    };
    let light = |vertices| {
        let light = Light::triangle(vertices, Vec3::splat(UNIT));
        if two_sided { light.two_sided() } else { light }
    };
    let lights: Vec<Light> = match texture.filter(|texture| texture.is_shown_on(mesh)) {
        Some(texture) => texture.lights(mesh, &corners, (two_sided, is_cut), sources)?,
        None => corners.into_iter().map(light).collect(),
    };
    (!lights.is_empty()).then_some(lights)
}

#[derive(Debug)]
struct Kind {
    key: KindKey,
    users: u32,
}

/// The kinds in use, by number. Number 0 is none.
#[derive(Debug, Default)]
pub struct Kinds {
    by_key: HashMap<KindKey, u32>,
    kinds: Vec<Option<Kind>>,
    free: Vec<u32>,
}

impl Kinds {
    /// Whether lights of a kind exist.
    pub fn contains(&self, key: KindKey) -> bool {
        self.by_key.contains_key(&key)
    }

    /// Counts one more user of a kind. Returns its number, and whether it is new.
    pub fn acquire(&mut self, key: KindKey) -> (u32, bool) {
        if let Some(&number) = self.by_key.get(&key) {
            if let Some(kind) = &mut self.kinds[number as usize] {
                kind.users += 1;
            }
            return (number, false);
        }
        let number = self.free.pop().unwrap_or_else(|| {
            if self.kinds.is_empty() {
                self.kinds.push(None);
            }
            self.kinds.push(None);
            self.kinds.len() as u32 - 1
        });
        self.kinds[number as usize] = Some(Kind { key, users: 1 });
        self.by_key.insert(key, number);
        (number, true)
    }

    /// Removes one user of a kind. Returns whether it was the last one.
    pub fn release(&mut self, number: u32) -> bool {
        let Some(kind) = &mut self.kinds[number as usize] else { return false };
        kind.users -= 1;
        if kind.users > 0 {
            return false;
        }
        self.by_key.remove(&kind.key);
        self.kinds[number as usize] = None;
        self.free.push(number);
        true
    }

    /// The kinds that are made of one of these meshes or images, with their keys.
    pub fn made_of(
        &self,
        meshes: &HashSet<AssetId<Mesh>>,
        images: &HashSet<AssetId<Image>>,
    ) -> impl Iterator<Item = (u32, KindKey)> {
        let used = self.by_key.iter().filter(|(key, _)| key.is_made_of(meshes, images));
        used.map(|(&key, &number)| (number, key))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_lives_as_long_as_a_light_of_it() {
        let mut kinds = Kinds::default();
        let lamp = KindKey::Point { range: 1, radius: 0 };
        let other = KindKey::Point { range: 2, radius: 0 };
        assert_eq!(kinds.acquire(lamp), (1, true), "0 stays free: it means none");
        assert_eq!(kinds.acquire(lamp), (1, false));
        assert_eq!(kinds.acquire(other), (2, true));
        assert!(!kinds.release(1));
        assert!(kinds.release(1));
        assert_eq!(kinds.acquire(other), (2, false));
        assert_eq!(kinds.acquire(lamp), (1, true), "the number is used again");
    }
}
