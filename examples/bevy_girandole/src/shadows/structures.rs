//! Acceleration structures for ray queries: one for each mesh, and one over all entities.

use std::collections::HashSet;
use std::sync::Arc;

use bevy::log::warn_once;
use bevy::math::Affine3A;
use bevy::render::render_resource::{
    AccelerationStructureFlags, AccelerationStructureGeometryFlags, AccelerationStructureUpdateMode, BindGroupEntry,
    BindGroupLayoutEntry, BindingType, Blas, BlasBuildEntry, BlasGeometries, BlasGeometrySizeDescriptors,
    BlasTriangleGeometry, BlasTriangleGeometrySizeDescriptor, Buffer, BufferInitDescriptor, BufferUsages,
    CommandEncoderDescriptor, CreateBlasDescriptor, CreateTlasDescriptor, ShaderStages, Tlas, TlasInstance,
    VertexFormat,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};

use super::mesh::{CasterMesh, placed};
use super::scene::{Tracer, Updated, slot};

/// Entities that the structure over them has room for at first.
const FIRST_ROOM: u32 = 64;

/// Corners after which no other mesh is begun in a frame. What the device needs for its builds is freed only after them.
const FRAME_CORNERS: usize = 3 << 20;

/// The bytes of a corner of a triangle.
const CORNER_BYTES: u64 = size_of::<[f32; 3]>() as u64;

/// The bytes that describe an entity to the device: a matrix, and where its mesh is.
const INSTANCE_BYTES: u64 = 64;

/// The structures of meshes, and the one over entities.
#[derive(Default)]
pub struct Structures {
    meshes: Vec<Option<BuiltMesh>>,
    /// Meshes that are new or gone.
    changed: HashSet<u32>,
    /// The meshes and matrices of entities that rays can hit. Rows have three columns and a translation.
    entities: Vec<Option<(u32, [f32; 12])>>,
    /// Those in the structure over them.
    count: usize,
    has_moved: bool,
    /// Meshes that wait for other frames.
    waiting: usize,
    /// The structure over entities, and for how many it has room.
    top: Option<(Tlas, u32)>,
}

/// A mesh with its structure: `None` until it is built, and for a mesh that exceeds the limits of the device.
struct BuiltMesh {
    mesh: Arc<CasterMesh>,
    structure: Option<Blas>,
}

/// A structure that is built in this frame, from the corners in a buffer.
struct Build {
    mesh: u32,
    size: BlasTriangleGeometrySizeDescriptor,
    corners: Buffer,
}

impl Structures {
    /// Creates the structures of meshes that have none, and uploads what they are built from.
    fn create(&mut self, device: &RenderDevice) -> Vec<Build> {
        let limits = device.limits();
        let most = u64::from(limits.max_blas_primitive_count).min(limits.max_buffer_size / CORNER_BYTES);
        let mut builds = Vec::new();
        let mut corners_left = FRAME_CORNERS;
        self.waiting = 0;
        for (mesh, built) in (0..).zip(&mut self.meshes) {
            let Some(built) = built.as_mut().filter(|of| of.structure.is_none() && !of.mesh.corners.is_empty()) else {
                continue;
            };
            // wgpu compares the number of vertices with the limit of primitives.
            let vertices = 3 * built.mesh.corners.len();
            if vertices as u64 > most {
                warn_once!("girandole: meshes that exceed the limits of acceleration structures cast no shadows");
                continue;
            }
            if corners_left == 0 {
                self.waiting += 1;
                continue;
            }
            corners_left = corners_left.saturating_sub(vertices);
            let size = BlasTriangleGeometrySizeDescriptor {
                vertex_format: VertexFormat::Float32x3,
                vertex_count: vertices as u32,
                index_format: None,
                index_count: None,
                flags: AccelerationStructureGeometryFlags::OPAQUE,
            };
            built.structure = Some(device.wgpu_device().create_blas(
                &CreateBlasDescriptor {
                    label: Some("girandole caster mesh"),
                    flags: AccelerationStructureFlags::PREFER_FAST_TRACE,
                    update_mode: AccelerationStructureUpdateMode::Build,
                },
                BlasGeometrySizeDescriptors::Triangles { descriptors: vec![size.clone()] },
            ));
            let corners = device.create_buffer_with_data(&BufferInitDescriptor {
                label: Some("girandole caster corners"),
                contents: bytemuck::cast_slice(&built.mesh.corners),
                usage: BufferUsages::BLAS_INPUT,
            });
            builds.push(Build { mesh, size, corners });
        }
        builds
    }

    fn structure(&self, mesh: u32) -> Option<&Blas> {
        self.meshes.get(mesh as usize)?.as_ref()?.structure.as_ref()
    }

    /// Writes all entities into the structure over them, which grows as needed. O(n).
    fn gather(&mut self, device: &RenderDevice) {
        let most = device.limits().max_tlas_instance_count;
        let entities = self.entities.iter().flatten();
        let mut instances: Vec<_> = entities
            .filter_map(|(mesh, rows)| Some(TlasInstance::new(self.structure(*mesh)?, *rows, 0, u8::MAX)))
            .collect();
        if instances.len() > most as usize {
            warn_once!("girandole: entities beyond the limit of the device cast no shadows");
            instances.truncate(most as usize);
        }
        self.count = instances.len();
        let room = (self.count as u32).checked_next_power_of_two().unwrap_or(most).clamp(FIRST_ROOM.min(most), most);
        if self.top.as_ref().is_none_or(|(_, present)| *present < room) {
            let top = device.wgpu_device().create_tlas(&CreateTlasDescriptor {
                label: Some("girandole casters"),
                max_instances: room,
                flags: AccelerationStructureFlags::PREFER_FAST_TRACE,
                update_mode: AccelerationStructureUpdateMode::Build,
            });
            self.top = Some((top, room));
        }
        if let Some(places) = self.top.as_mut().and_then(|(top, room)| top.get_mut_slice(0..*room as usize)) {
            places.fill(None);
            places.iter_mut().zip(instances).for_each(|(place, instance)| *place = Some(instance));
        }
    }
}

impl Tracer for Structures {
    fn set_mesh(&mut self, mesh: u32, built: Option<Arc<CasterMesh>>) {
        *slot(&mut self.meshes, mesh) = built.map(|mesh| BuiltMesh { mesh, structure: None });
        self.changed.insert(mesh);
    }

    fn place_meshes(&mut self, _: &RenderDevice) -> HashSet<u32> {
        std::mem::take(&mut self.changed)
    }

    fn put(&mut self, caster: u32, mesh: u32, transform: &Affine3A) {
        let built = self.meshes.get(mesh as usize).and_then(Option::as_ref);
        if built.and_then(|built| placed(built.mesh.bounds, transform)).is_none() {
            return self.remove(caster);
        }
        let columns =
            [transform.matrix3.x_axis, transform.matrix3.y_axis, transform.matrix3.z_axis, transform.translation];
        let rows = std::array::from_fn(|i| columns[i % 4][i / 4]);
        *slot(&mut self.entities, caster) = Some((mesh, rows));
        self.has_moved = true;
    }

    fn remove(&mut self, caster: u32) {
        if self.entities.get_mut(caster as usize).and_then(Option::take).is_some() {
            self.has_moved = true;
        }
    }

    fn update(&mut self, device: &RenderDevice, queue: &RenderQueue) -> Updated {
        // Meshes come with the entities that have them.
        if !self.has_moved && self.top.is_some() {
            return Updated::default();
        }
        let builds = self.create(device);
        self.has_moved = self.waiting > 0;
        self.gather(device);
        let entries = builds.iter().filter_map(|build| {
            let geometry = BlasTriangleGeometry {
                size: &build.size,
                vertex_buffer: &build.corners,
                first_vertex: 0,
                vertex_stride: CORNER_BYTES,
                index_buffer: None,
                first_index: None,
                transform_buffer: None,
                transform_buffer_offset: None,
            };
            let blas = self.structure(build.mesh)?;
            Some(BlasBuildEntry { blas, geometry: BlasGeometries::TriangleGeometries(vec![geometry]) })
        });
        let entries: Vec<_> = entries.collect();
        let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor { label: Some("girandole casters") });
        encoder.build_acceleration_structures(&entries, self.top.iter().map(|(top, _)| top));
        queue.submit([encoder.finish()]);
        let corners: u64 = builds.iter().map(|build| build.corners.size()).sum();
        Updated {
            has_changed: true,
            waiting: self.waiting,
            bytes: corners + INSTANCE_BYTES * self.count as u64,
            structures: entries.len() + usize::from(self.top.is_some()),
        }
    }

    fn count(&self) -> usize {
        self.count
    }

    fn layout_entries(&self) -> Vec<BindGroupLayoutEntry> {
        vec![BindGroupLayoutEntry {
            binding: 4,
            visibility: ShaderStages::COMPUTE | ShaderStages::FRAGMENT,
            ty: BindingType::AccelerationStructure { vertex_return: false },
            count: None,
        }]
    }

    fn bindings(&self) -> Option<Vec<BindGroupEntry<'_>>> {
        let (top, _) = self.top.as_ref()?;
        Some(vec![BindGroupEntry { binding: 4, resource: top.as_binding() }])
    }

    fn forget(&mut self) {
        self.meshes.iter_mut().flatten().for_each(|built| built.structure = None);
        self.top = None;
    }
}
