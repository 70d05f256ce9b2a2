//! Reads accessors after checking them.
//!
//! The readers of the gltf crate panic where a file's offsets and counts point outside its buffers.

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Primitive, Semantic};
use glam::Vec3;

use super::error::GltfError;

/// The elements of an accessor, checked to be within its buffer.
#[derive(Clone, Copy)]
struct Elements<'a> {
    /// From the first element's first byte to the last element's last.
    bytes: &'a [u8],
    /// Bytes from one element to the next, at least `size`.
    stride: usize,
    /// Bytes of one element.
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    fn new<B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &'a [B]) -> Result<Self, GltfError> {
        let index = accessor.index();
        let invalid = |what| Err(GltfError::Accessor { accessor: index, what });
        if accessor.sparse().is_some() {
            return invalid("sparse accessors are not supported");
        }
        let Some(view) = accessor.view() else {
            return invalid("it has no buffer view");
        };
        let given = buffers.len();
        let number = view.buffer().index();
        let buffer = buffers.get(number).ok_or(GltfError::MissingBuffer { buffer: number, given })?.as_ref();
        let (count, size) = (accessor.count(), accessor.size());
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return invalid("its stride is less than its element size");
        }
        // Sums of three 64-bit numbers and one product fit 128 bits.
        let wide = |number: usize| number as u128;
        let end_in_view = wide(accessor.offset()) + wide(count.saturating_sub(1)) * wide(stride) + wide(size);
        if end_in_view > wide(view.length()) {
            let length = wide(view.length());
            return Err(GltfError::OutOfBounds { accessor: index, what: "buffer view", end: end_in_view, length });
        }
        let start = wide(view.offset()) + wide(accessor.offset());
        let end = wide(view.offset()) + end_in_view;
        if end > wide(buffer.len()) {
            return Err(GltfError::OutOfBounds { accessor: index, what: "buffer", end, length: wide(buffer.len()) });
        }
        Ok(Self { bytes: &buffer[start as usize..end as usize], stride, size, count })
    }

    /// The bytes of an element; `index` is below `count`.
    fn get(&self, index: usize) -> &'a [u8] {
        &self.bytes[index * self.stride..index * self.stride + self.size]
    }
}

/// An accessor of vectors of `N` floats.
struct Vectors<'a, const N: usize> {
    elements: Elements<'a>,
    /// Reads one component.
    component: fn(&[u8]) -> f32,
    /// Bytes of one component.
    component_size: usize,
}

impl<'a, const N: usize> Vectors<'a, N> {
    fn new<B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &'a [B]) -> Result<Self, GltfError> {
        let invalid = |what| GltfError::Accessor { accessor: accessor.index(), what };
        if accessor.dimensions().multiplicity() != N || matches!(accessor.dimensions(), Dimensions::Mat2) {
            return Err(invalid("its elements have the wrong number of components"));
        }
        let kind = accessor.data_type();
        if kind != DataType::F32 && !accessor.normalized() {
            return Err(invalid("its integers are not normalized"));
        }
        let component: fn(&[u8]) -> f32 = match kind {
            DataType::F32 => |bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            DataType::I8 => |bytes| (f32::from(bytes[0] as i8) / 127.0).max(-1.0),
            DataType::U8 => |bytes| f32::from(bytes[0]) / 255.0,
            DataType::I16 => |bytes| (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])) / 32767.0).max(-1.0),
            DataType::U16 => |bytes| f32::from(u16::from_le_bytes([bytes[0], bytes[1]])) / 65535.0,
            DataType::U32 => return Err(invalid("32-bit integers cannot be normalized")),
        };
        Ok(Self { elements: Elements::new(accessor, buffers)?, component, component_size: kind.size() })
    }

    /// A vector; `index` is below the number of elements.
    fn get(&self, index: usize) -> [f32; N] {
        let bytes = self.elements.get(index);
        std::array::from_fn(|axis| (self.component)(&bytes[axis * self.component_size..]))
    }
}

/// All vectors of an accessor, such as positions, rotations or key times.
///
/// Normalized integers are converted to floats as glTF states. Floats may be NaN or infinite.
///
/// # Errors
/// [`GltfError::Accessor`], [`GltfError::MissingBuffer`], [`GltfError::OutOfBounds`].
pub fn accessor_values<const N: usize, B: AsRef<[u8]>>(
    accessor: &Accessor<'_>,
    buffers: &[B],
) -> Result<Vec<[f32; N]>, GltfError> {
    let vectors = Vectors::new(accessor, buffers)?;
    Ok((0..vectors.elements.count).map(|index| vectors.get(index)).collect())
}

/// The order in which a primitive uses its vertices.
enum VertexOrder<'a> {
    /// As they are stored: this many.
    Stored(usize),
    /// By an accessor of indices.
    Indexed(Elements<'a>, fn(&[u8]) -> u32),
}

impl<'a> VertexOrder<'a> {
    fn indexed<B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &'a [B]) -> Result<Self, GltfError> {
        let invalid = |what| Err(GltfError::Accessor { accessor: accessor.index(), what });
        if accessor.dimensions() != Dimensions::Scalar {
            return invalid("indices are not scalars");
        }
        let index: fn(&[u8]) -> u32 = match accessor.data_type() {
            DataType::U8 => |bytes| u32::from(bytes[0]),
            DataType::U16 => |bytes| u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            DataType::U32 => |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            _ => return invalid("indices are not unsigned integers"),
        };
        Ok(Self::Indexed(Elements::new(accessor, buffers)?, index))
    }

    fn count(&self) -> usize {
        match self {
            Self::Stored(count) => *count,
            Self::Indexed(elements, _) => elements.count,
        }
    }

    /// The vertex at a place of the order; `place` is below `count`.
    fn get(&self, place: usize) -> usize {
        match self {
            Self::Stored(_) => place,
            Self::Indexed(elements, index) => index(elements.get(place)) as usize,
        }
    }
}

/// The triangles of a primitive. Each triangle is read on demand, so that the cost depends on the
/// triangles that are read and not on the vertices that the accessor holds.
pub(super) struct Triangles<'a> {
    mesh: usize,
    mode: Mode,
    positions: Vectors<'a, 3>,
    order: VertexOrder<'a>,
}

impl<'a> Triangles<'a> {
    /// Checks a primitive's accessors. `None` for points and lines.
    pub fn new<B: AsRef<[u8]>>(
        mesh: usize,
        primitive: &Primitive<'_>,
        buffers: &'a [B],
    ) -> Result<Option<Self>, GltfError> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(None);
        }
        let positions = primitive.get(&Semantic::Positions).ok_or(GltfError::NoPositions { mesh })?;
        let positions = Vectors::new(&positions, buffers)?;
        let order = match primitive.indices() {
            Some(accessor) => VertexOrder::indexed(&accessor, buffers)?,
            None => VertexOrder::Stored(positions.elements.count),
        };
        Ok(Some(Self { mesh, mode, positions, order }))
    }

    pub fn count(&self) -> usize {
        match self.mode {
            Mode::Triangles => self.order.count() / 3,
            _ => self.order.count().saturating_sub(2),
        }
    }

    pub fn iter(&self) -> impl Iterator<Item = Result<[Vec3; 3], GltfError>> {
        (0..self.count()).map(|triangle| self.get(triangle))
    }

    fn get(&self, triangle: usize) -> Result<[Vec3; 3], GltfError> {
        let places = match self.mode {
            Mode::Triangles => [triangle * 3, triangle * 3 + 1, triangle * 3 + 2],
            // The winding of a strip alternates.
            Mode::TriangleStrip => [triangle, triangle + 1 + triangle % 2, triangle + 2 - triangle % 2],
            _ => [triangle + 1, triangle + 2, 0],
        };
        let mut vertices = [Vec3::ZERO; 3];
        for (vertex, place) in vertices.iter_mut().zip(places) {
            let (index, count) = (self.order.get(place), self.positions.elements.count);
            if index >= count {
                return Err(GltfError::NoSuchVertex { mesh: self.mesh, vertex: index as u32, count });
            }
            *vertex = self.positions.get(index).into();
        }
        Ok(vertices)
    }
}

/// A primitive's triangles in the space of its mesh, counter-clockwise from the front; none for
/// points and lines.
///
/// `mesh` is the mesh's index, which errors name. Positions may be NaN or infinite.
///
/// # Errors
/// [`GltfError::NoPositions`], [`GltfError::NoSuchVertex`], and those of [`accessor_values`].
pub fn primitive_triangles<B: AsRef<[u8]>>(
    mesh: usize,
    primitive: &Primitive<'_>,
    buffers: &[B],
) -> Result<Vec<[Vec3; 3]>, GltfError> {
    match Triangles::new(mesh, primitive, buffers)? {
        Some(triangles) => triangles.iter().collect(),
        None => Ok(Vec::new()),
    }
}
