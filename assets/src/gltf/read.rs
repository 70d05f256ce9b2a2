//! Reads accessors after checking them.
//!
//! The readers of the gltf crate panic where a file's offsets and counts point outside its buffers.

use std::cmp::Ordering;
use std::fmt::Display;

use ::gltf::accessor::sparse::IndexType;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::View;
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Primitive, Semantic};

use crate::error::{AssetError, invalid};

/// The most elements of a sparse accessor without a buffer view: it could state any number, and has no bytes for them.
/// As many as [`GltfOptions::max_lights`](super::GltfOptions::max_lights) by default.
const MAX_IMPLIED: usize = 1 << 22;

/// The bytes of an element of zeros: of a vector of up to four words.
static ZEROS: [u8; 16] = [0; 16];

/// An error that names the accessor.
fn accessor_error(accessor: usize, what: impl Display) -> AssetError {
    invalid(format!("accessor {accessor}: {what}"))
}

/// The elements of an accessor, checked to be within its buffer.
#[derive(Clone, Copy)]
struct Elements<'a> {
    /// From the first element's first byte to the last element's last.
    bytes: &'a [u8],
    /// Bytes from one element to the next, at least `size`; 0 if all are the same bytes.
    stride: usize,
    /// Bytes of one element.
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    /// The elements of an accessor without its sparse ones, which replace zeros if there is no view.
    fn new(accessor: &Accessor<'_>, buffers: &'a [Vec<u8>]) -> Result<Self, AssetError> {
        let refused = |what| Err(accessor_error(accessor.index(), what));
        let elements = Self { bytes: &ZEROS, stride: 0, size: accessor.size(), count: accessor.count() };
        match accessor.view() {
            Some(view) => elements.in_view(accessor.index(), &view, accessor.offset(), buffers),
            None if accessor.sparse().is_none() || elements.size > ZEROS.len() => refused("it has no buffer view"),
            None if elements.count > MAX_IMPLIED => refused("it has no buffer view and over 4,194,304 elements"),
            None => Ok(elements),
        }
    }

    /// As many elements of the same size from `offset` on in a view. `index` is that of the accessor, which errors name.
    fn in_view(self, index: usize, view: &View<'_>, offset: usize, buffers: &'a [Vec<u8>]) -> Result<Self, AssetError> {
        let (number, given) = (view.buffer().index(), buffers.len());
        let missing = || invalid(format!("buffer {number} is missing: {given} buffers were given"));
        let buffer = buffers.get(number).ok_or_else(missing)?;
        let stride = view.stride().unwrap_or(self.size);
        if stride < self.size {
            return Err(accessor_error(index, "its stride is less than its element size"));
        }
        // Sums of three 64-bit numbers and one product fit 128 bits.
        let wide = |number: usize| number as u128;
        let end_in_view = wide(offset) + wide(self.count.saturating_sub(1)) * wide(stride) + wide(self.size);
        let (start, end) = (wide(view.offset()) + wide(offset), wide(view.offset()) + end_in_view);
        for (end, what, length) in [(end_in_view, "buffer view", view.length()), (end, "buffer", buffer.len())] {
            if end > wide(length) {
                let fault = format!("accessor {index} reads up to byte {end}, but its {what} has {length} bytes");
                return Err(invalid(fault));
            }
        }
        Ok(Self { bytes: &buffer[start as usize..end as usize], stride, ..self })
    }

    /// The bytes of an element; `index` is below `count`.
    fn get(&self, index: usize) -> &'a [u8] {
        &self.bytes[index * self.stride..index * self.stride + self.size]
    }

    /// An element that is an unsigned integer of up to four bytes.
    fn integer(&self, index: usize) -> u32 {
        self.get(index).iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
    }
}

/// Elements of an accessor that replace others.
struct Sparse<'a> {
    /// The elements that are replaced, in ascending order. Those of a damaged file may not ascend;
    /// some are then not found.
    indices: Elements<'a>,
    values: Elements<'a>,
}

impl<'a> Sparse<'a> {
    fn new(accessor: &Accessor<'_>, buffers: &'a [Vec<u8>]) -> Result<Option<Self>, AssetError> {
        let Some(sparse) = accessor.sparse().filter(|sparse| sparse.count() > 0) else { return Ok(None) };
        let (number, indices, values) = (accessor.index(), sparse.indices(), sparse.values());
        let elements = |size: usize| Elements { bytes: &ZEROS, stride: 0, size, count: sparse.count() };
        let index_size = match indices.index_type() {
            IndexType::U8 => 1,
            IndexType::U16 => 2,
            IndexType::U32 => 4,
        };
        Ok(Some(Self {
            indices: elements(index_size).in_view(number, &indices.view(), indices.offset(), buffers)?,
            values: elements(accessor.size()).in_view(number, &values.view(), values.offset(), buffers)?,
        }))
    }

    /// The bytes that replace an element, if any do.
    fn get(&self, element: usize) -> Option<&'a [u8]> {
        let (mut low, mut high) = (0, self.indices.count);
        while low < high {
            let middle = low + (high - low) / 2;
            match (self.indices.integer(middle) as usize).cmp(&element) {
                Ordering::Less => low = middle + 1,
                Ordering::Equal => return Some(self.values.get(middle)),
                Ordering::Greater => high = middle,
            }
        }
        None
    }
}

/// An accessor of vectors of `N` floats.
pub(super) struct Vectors<'a, const N: usize> {
    /// The index of the accessor.
    pub accessor: usize,
    elements: Elements<'a>,
    sparse: Option<Sparse<'a>>,
    kind: DataType,
    /// By how much components are divided that are normalized; none is below -1 then.
    greatest: Option<f32>,
}

impl<'a, const N: usize> Vectors<'a, N> {
    pub fn new(accessor: &Accessor<'_>, buffers: &'a [Vec<u8>]) -> Result<Self, AssetError> {
        let refused = |what| Err(accessor_error(accessor.index(), what));
        if accessor.dimensions().multiplicity() != N || matches!(accessor.dimensions(), Dimensions::Mat2) {
            return refused("its elements have the wrong number of components");
        }
        let kind = accessor.data_type();
        let greatest = match kind {
            DataType::F32 => None,
            DataType::I8 => Some(127.0),
            DataType::U8 => Some(255.0),
            DataType::I16 => Some(32767.0),
            DataType::U16 => Some(65535.0),
            DataType::U32 => return refused("32-bit integers are not vectors"),
        };
        Ok(Self {
            accessor: accessor.index(),
            elements: Elements::new(accessor, buffers)?,
            sparse: Sparse::new(accessor, buffers)?,
            kind,
            greatest: greatest.filter(|_| accessor.normalized()),
        })
    }

    pub fn count(&self) -> usize {
        self.elements.count
    }

    /// A vector; `index` is below the number of elements.
    pub fn get(&self, index: usize) -> [f32; N] {
        let replaced = self.sparse.as_ref().and_then(|sparse| sparse.get(index));
        let bytes = replaced.unwrap_or_else(|| self.elements.get(index));
        std::array::from_fn(|axis| {
            let bytes = &bytes[axis * self.kind.size()..];
            let component = match self.kind {
                DataType::I8 => f32::from(bytes[0] as i8),
                DataType::U8 => f32::from(bytes[0]),
                DataType::I16 => f32::from(i16::from_le_bytes([bytes[0], bytes[1]])),
                DataType::U16 => f32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
                DataType::F32 | DataType::U32 => f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            };
            self.greatest.map_or(component, |greatest| (component / greatest).max(-1.0))
        })
    }
}

/// All vectors of an accessor, such as positions, rotations or key times.
///
/// Normalized integers are converted to floats as glTF states, and other integers of 8 and 16 bits
/// keep their values, as in KHR_mesh_quantization. Sparse accessors without a buffer view replace zeros, of which
/// there may be 2^22. Floats may be NaN or infinite.
///
/// # Errors
/// [`AssetError::Invalid`] if the elements do not have `N` components or a form that is read, and if they or their buffer
/// are not there.
pub fn accessor_values<const N: usize>(
    accessor: &Accessor<'_>,
    buffers: &[Vec<u8>],
) -> Result<Vec<[f32; N]>, AssetError> {
    let vectors = Vectors::new(accessor, buffers)?;
    Ok((0..vectors.count()).map(|index| vectors.get(index)).collect())
}

/// The indices of a primitive's vertices.
fn vertex_indices<'a>(accessor: &Accessor<'_>, buffers: &'a [Vec<u8>]) -> Result<Elements<'a>, AssetError> {
    let refused = |what| Err(accessor_error(accessor.index(), what));
    if accessor.dimensions() != Dimensions::Scalar {
        return refused("indices are not scalars");
    }
    if accessor.sparse().is_some() {
        return refused("sparse indices are not supported");
    }
    if !matches!(accessor.data_type(), DataType::U8 | DataType::U16 | DataType::U32) {
        return refused("indices are not unsigned integers");
    }
    Elements::new(accessor, buffers)
}

/// The triangles of a primitive. Each triangle is read on demand, so that the cost depends on the
/// triangles that are read and not on the vertices that the accessor holds.
pub(super) struct Triangles<'a> {
    pub mesh: usize,
    mode: Mode,
    pub positions: Vectors<'a, 3>,
    /// `None` if the vertices are used in the order in which they are stored.
    indices: Option<Elements<'a>>,
}

impl<'a> Triangles<'a> {
    /// Checks a primitive's accessors. `None` for points and lines.
    pub fn new(mesh: usize, primitive: &Primitive<'_>, buffers: &'a [Vec<u8>]) -> Result<Option<Self>, AssetError> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            return Ok(None);
        }
        let missing = || invalid(format!("mesh {mesh}: a primitive has no positions"));
        let positions = Vectors::new(&primitive.get(&Semantic::Positions).ok_or_else(missing)?, buffers)?;
        let indices = primitive.indices().map(|accessor| vertex_indices(&accessor, buffers)).transpose()?;
        Ok(Some(Self { mesh, mode, positions, indices }))
    }

    pub fn count(&self) -> usize {
        let vertices = self.indices.map_or(self.positions.count(), |indices| indices.count);
        if self.mode == Mode::Triangles { vertices / 3 } else { vertices.saturating_sub(2) }
    }

    /// The vectors of each triangle's corners.
    pub fn corners<const N: usize>(
        &self,
        vectors: &Vectors<'_, N>,
    ) -> impl Iterator<Item = Result<[[f32; N]; 3], AssetError>> {
        (0..self.count()).map(move |triangle| {
            let places = match self.mode {
                Mode::Triangles => [triangle * 3, triangle * 3 + 1, triangle * 3 + 2],
                // The winding of a strip alternates.
                Mode::TriangleStrip => [triangle, triangle + 1 + triangle % 2, triangle + 2 - triangle % 2],
                _ => [triangle + 1, triangle + 2, 0],
            };
            let mut corners = [[0.0; N]; 3];
            for (corner, place) in corners.iter_mut().zip(places) {
                let vertex = self.indices.map_or(place, |indices| indices.integer(place) as usize);
                let (mesh, count) = (self.mesh, vectors.count());
                if vertex >= count {
                    let fault = format!("a triangle uses vertex {vertex}, but there are {count} vertices");
                    return Err(invalid(format!("mesh {mesh}: {fault}")));
                }
                *corner = vectors.get(vertex);
            }
            Ok(corners)
        })
    }
}

/// An attribute of the corners of a primitive's triangles, such as positions, normals or texture coordinates.
///
/// Triangles are counter-clockwise from the front; points and lines have none. `None` if the primitive does not have the
/// attribute. Components may be NaN or infinite. `mesh` is the mesh's index, which errors name.
///
/// # Errors
/// [`AssetError::Invalid`] if triangles have no positions or use a vertex that is not there, and as for
/// [`accessor_values`].
pub fn primitive_attribute<const N: usize>(
    mesh: usize,
    primitive: &Primitive<'_>,
    semantic: &Semantic,
    buffers: &[Vec<u8>],
) -> Result<Option<Vec<[[f32; N]; 3]>>, AssetError> {
    let (Some(triangles), Some(accessor)) = (Triangles::new(mesh, primitive, buffers)?, primitive.get(semantic)) else {
        return Ok(None);
    };
    triangles.corners(&Vectors::new(&accessor, buffers)?).collect::<Result<_, _>>().map(Some)
}
