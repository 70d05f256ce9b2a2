//! Kinds of light: lights that share a tree, because they differ by place, colour and brightness
//! alone.

use std::collections::HashMap;
use std::hash::Hash;

use bevy::asset::{AssetId, Assets};
use bevy::camera::Exposure;
use bevy::log::warn_once;
use bevy::math::Vec3;
use bevy::mesh::{Mesh, PrimitiveTopology};
use bytemuck::{Pod, Zeroable};
use girandole::Light;

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
    Point { range: u32, radius: u32 },
    Spot { range: u32, radius: u32, inner: u32, outer: u32 },
    Mesh { mesh: AssetId<Mesh>, two_sided: bool, weight: u32, ev100: u32 },
}

impl KindKey {
    /// The lights of the tree, and what the shader knows of them; `None` for a mesh without triangles
    /// that the main world can read.
    pub fn tree(self, meshes: &Assets<Mesh>) -> Option<(Vec<Light>, KindRecord)> {
        let punctual = |range, radius| KindRecord { range, radius, lights: 1, ..KindRecord::default() };
        match self {
            Self::Point { range, radius } => {
                let record = punctual(f32::from_bits(range), f32::from_bits(radius));
                let light = Light::point(Vec3::ZERO, Vec3::splat(UNIT)).with_range(record.range);
                Some((vec![light], record))
            }
            Self::Spot { range, radius, inner, outer } => {
                let record = punctual(f32::from_bits(range), f32::from_bits(radius));
                let [inner, outer] = [inner, outer].map(f32::from_bits);
                let light = Light::spot(Vec3::ZERO, Vec3::NEG_Z, inner, outer, Vec3::splat(UNIT));
                Some((vec![light.with_range(record.range)], record))
            }
            Self::Mesh { mesh, two_sided, weight, ev100 } => {
                let lights = triangles(meshes.get(mesh)?, two_sided)?;
                let weight = f32::from_bits(weight);
                let nits = units::nits(Exposure { ev100: f32::from_bits(ev100) }, weight);
                let record = KindRecord { weight, nits, lights: lights.len() as u32, ..KindRecord::default() };
                Some((lights, record))
            }
        }
    }
}

fn triangles(mesh: &Mesh, two_sided: bool) -> Option<Vec<Light>> {
    let light = |vertices| {
        let light = Light::triangle(vertices, Vec3::splat(UNIT));
        if two_sided { light.two_sided() } else { light }
    };
    let lights: Option<Vec<Light>> = match mesh.triangles() {
        Ok(triangles) => Some(triangles.map(|triangle| light(triangle.vertices)).collect()),
        // Bevy's iterator needs indices.
        Err(_) => unindexed(mesh).map(|triangles| triangles.map(light).collect()),
    };
    if lights.is_none() {
        warn_once!("girandole: a mesh without readable triangles is not sampled as a light");
    }
    lights.filter(|lights| !lights.is_empty())
}

/// The triangles of a mesh without indices, of which each three vertices are one.
fn unindexed(mesh: &Mesh) -> Option<impl Iterator<Item = [Vec3; 3]>> {
    if mesh.primitive_topology() != PrimitiveTopology::TriangleList || mesh.try_indices_option().ok()?.is_some() {
        return None;
    }
    let positions = mesh.try_attribute(Mesh::ATTRIBUTE_POSITION).ok()?.as_float3()?;
    Some(positions.chunks_exact(3).map(|corners| [0, 1, 2].map(|i| Vec3::from(corners[i]))))
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

    /// The kinds of a mesh, with their keys.
    pub fn of_mesh(&self, mesh: AssetId<Mesh>) -> impl Iterator<Item = (u32, KindKey)> {
        self.by_key
            .iter()
            .filter(move |(key, _)| matches!(key, KindKey::Mesh { mesh: of, .. } if *of == mesh))
            .map(|(&key, &number)| (number, key))
    }
}

#[cfg(test)]
mod tests {
    use bevy::asset::RenderAssetUsages;
    use bevy::prelude::{Cuboid, Meshable};

    use super::*;

    #[test]
    fn a_mesh_has_the_same_triangles_with_and_without_indices() {
        let indexed = Mesh::from(Cuboid::new(1.0, 2.0, 3.0).mesh());
        let plain = indexed.clone().with_duplicated_vertices();
        assert!(plain.indices().is_none());
        let lights = triangles(&plain, false).expect("a cuboid has triangles");
        assert_eq!(lights.len(), 12);
        assert_eq!(Some(lights), triangles(&indexed, false));
        assert_eq!(triangles(&Mesh::new(PrimitiveTopology::TriangleList, RenderAssetUsages::all()), false), None);
    }

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
