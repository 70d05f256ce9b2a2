//! Reads accessors after checking them.
//!
//! The readers of the gltf crate panic where a file's offsets and counts point outside its buffers.

use std::cmp::Ordering;

use ::gltf::accessor::sparse::IndexType;
use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::buffer::View;
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Primitive, Semantic};
use glam::{Vec2, Vec3};

use super::error::GltfError;

/// The most elements of a sparse accessor without a buffer view: it could state any number, and has no bytes for them.
/// As many as [`GltfOptions::max_lights`](super::GltfOptions::max_lights) by default.
const MAX_IMPLIED: usize = 1 << 22;

/// The bytes of an element of zeros: of a vector of up to four words.
static ZEROS: [u8; 16] = [0; 16];

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
    fn new<B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &'a [B]) -> Result<Self, GltfError> {
        let refused = |what| Err(GltfError::Accessor { accessor: accessor.index(), what });
        let (count, size) = (accessor.count(), accessor.size());
        let zeros = accessor.sparse().and_then(|_| ZEROS.get(..size));
        match (accessor.view(), zeros) {
            (Some(view), _) => Self::in_view(accessor.index(), &view, accessor.offset(), count, size, buffers),
            (None, None) => refused("it has no buffer view"),
            (None, Some(_)) if count > MAX_IMPLIED => refused("it has no buffer view and over 4,194,304 elements"),
            (None, Some(bytes)) => Ok(Self { bytes, stride: 0, size, count }),
        }
    }

    /// `count` elements of `size` bytes from `offset` on in a view. `index` is that of the accessor,
    /// which errors name.
    fn in_view<B: AsRef<[u8]>>(
        index: usize,
        view: &View<'_>,
        offset: usize,
        count: usize,
        size: usize,
        buffers: &'a [B],
    ) -> Result<Self, GltfError> {
        let given = buffers.len();
        let number = view.buffer().index();
        let buffer = buffers.get(number).ok_or(GltfError::MissingBuffer { buffer: number, given })?.as_ref();
        let stride = view.stride().unwrap_or(size);
        if stride < size {
            return Err(GltfError::Accessor { accessor: index, what: "its stride is less than its element size" });
        }
        // Sums of three 64-bit numbers and one product fit 128 bits.
        let wide = |number: usize| number as u128;
        let end_in_view = wide(offset) + wide(count.saturating_sub(1)) * wide(stride) + wide(size);
        if end_in_view > wide(view.length()) {
            let length = wide(view.length());
            return Err(GltfError::OutOfBounds { accessor: index, what: "buffer view", end: end_in_view, length });
        }
        let start = wide(view.offset()) + wide(offset);
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

/// The bytes of a view; `None` if they are beyond its buffer.
pub(super) fn view_bytes<'a, B: AsRef<[u8]>>(view: &View<'_>, buffers: &'a [B]) -> Option<&'a [u8]> {
    let buffer = buffers.get(view.buffer().index())?.as_ref();
    buffer.get(view.offset()..view.offset().checked_add(view.length())?)
}

/// Elements of an accessor that replace others.
struct Sparse<'a> {
    /// The elements that are replaced, in ascending order. Those of a damaged file may not ascend;
    /// some are then not found.
    indices: Elements<'a>,
    index: fn(&[u8]) -> u32,
    values: Elements<'a>,
}

impl<'a> Sparse<'a> {
    fn new<B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &'a [B]) -> Result<Option<Self>, GltfError> {
        let Some(sparse) = accessor.sparse().filter(|sparse| sparse.count() > 0) else { return Ok(None) };
        let (indices, values, count) = (sparse.indices(), sparse.values(), sparse.count());
        let (index, size): (fn(&[u8]) -> u32, usize) = match indices.index_type() {
            IndexType::U8 => (index_u8, 1),
            IndexType::U16 => (index_u16, 2),
            IndexType::U32 => (index_u32, 4),
        };
        let number = accessor.index();
        let indices = Elements::in_view(number, &indices.view(), indices.offset(), count, size, buffers)?;
        let values = Elements::in_view(number, &values.view(), values.offset(), count, accessor.size(), buffers)?;
        Ok(Some(Self { indices, index, values }))
    }

    /// The bytes that replace an element, if any do.
    fn get(&self, element: usize) -> Option<&'a [u8]> {
        let (mut low, mut high) = (0, self.indices.count);
        while low < high {
            let middle = low + (high - low) / 2;
            let found = (self.index)(self.indices.get(middle)) as usize;
            match found.cmp(&element) {
                Ordering::Less => low = middle + 1,
                Ordering::Equal => return Some(self.values.get(middle)),
                Ordering::Greater => high = middle,
            }
        }
        None
    }
}

fn index_u8(bytes: &[u8]) -> u32 {
    u32::from(bytes[0])
}

fn index_u16(bytes: &[u8]) -> u32 {
    u32::from(u16::from_le_bytes([bytes[0], bytes[1]]))
}

fn index_u32(bytes: &[u8]) -> u32 {
    u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]])
}

/// An accessor of vectors of `N` floats.
pub(super) struct Vectors<'a, const N: usize> {
    elements: Elements<'a>,
    sparse: Option<Sparse<'a>>,
    /// Reads one component.
    component: fn(&[u8]) -> f32,
    /// Bytes of one component.
    component_size: usize,
}

impl<'a, const N: usize> Vectors<'a, N> {
    pub fn new<B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &'a [B]) -> Result<Self, GltfError> {
        let invalid = |what| GltfError::Accessor { accessor: accessor.index(), what };
        if accessor.dimensions().multiplicity() != N || matches!(accessor.dimensions(), Dimensions::Mat2) {
            return Err(invalid("its elements have the wrong number of components"));
        }
        let kind = accessor.data_type();
        let component: fn(&[u8]) -> f32 = match (kind, accessor.normalized()) {
            (DataType::F32, _) => |bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
            (DataType::I8, true) => |bytes| (f32::from(bytes[0] as i8) / 127.0).max(-1.0),
            (DataType::I8, false) => |bytes| f32::from(bytes[0] as i8),
            (DataType::U8, true) => |bytes| f32::from(bytes[0]) / 255.0,
            (DataType::U8, false) => |bytes| f32::from(bytes[0]),
            (DataType::I16, true) => |bytes| (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])) / 32767.0).max(-1.0),
            (DataType::I16, false) => |bytes| f32::from(i16::from_le_bytes([bytes[0], bytes[1]])),
            (DataType::U16, true) => |bytes| f32::from(u16::from_le_bytes([bytes[0], bytes[1]])) / 65535.0,
            (DataType::U16, false) => |bytes| f32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
            (DataType::U32, _) => return Err(invalid("32-bit integers are not vectors")),
        };
        let elements = Elements::new(accessor, buffers)?;
        let sparse = Sparse::new(accessor, buffers)?;
        Ok(Self { elements, sparse, component, component_size: kind.size() })
    }

    pub fn count(&self) -> usize {
        self.elements.count
    }

    /// A vector; `index` is below the number of elements.
    pub fn get(&self, index: usize) -> [f32; N] {
        let replaced = self.sparse.as_ref().and_then(|sparse| sparse.get(index));
        let bytes = replaced.unwrap_or_else(|| self.elements.get(index));
        std::array::from_fn(|axis| (self.component)(&bytes[axis * self.component_size..]))
    }
}

/// All vectors of an accessor, such as positions, rotations or key times.
///
/// Normalized integers are converted to floats as glTF states, and other integers of 8 and 16 bits
/// keep their values, as in KHR_mesh_quantization. Sparse accessors without a buffer view replace zeros, of which
/// there may be 2^22. Floats may be NaN or infinite.
///
/// # Errors
/// [`GltfError::Accessor`], [`GltfError::MissingBuffer`], [`GltfError::OutOfBounds`].
pub fn accessor_values<const N: usize, B: AsRef<[u8]>>(
    accessor: &Accessor<'_>,
    buffers: &[B],
) -> Result<Vec<[f32; N]>, GltfError> {
    let vectors = Vectors::new(accessor, buffers)?;
    Ok((0..vectors.count()).map(|index| vectors.get(index)).collect())
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
        if accessor.sparse().is_some() {
            return invalid("sparse indices are not supported");
        }
        let index: fn(&[u8]) -> u32 = match accessor.data_type() {
            DataType::U8 => index_u8,
            DataType::U16 => index_u16,
            DataType::U32 => index_u32,
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
        let positions: Vectors<'_, 3> = Vectors::new(&positions, buffers)?;
        let order = match primitive.indices() {
            Some(accessor) => VertexOrder::indexed(&accessor, buffers)?,
            None => VertexOrder::Stored(positions.count()),
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
        self.gather(triangle, &self.positions).map(|corners| corners.map(Vec3::from))
    }

    /// The texture coordinates of a triangle.
    pub fn tex_coords(&self, triangle: usize, set: &TexCoords<'_>) -> Result<[Vec2; 3], GltfError> {
        let corners = self.gather(triangle, &set.0)?.map(Vec2::from);
        if corners.iter().all(|corner| corner.is_finite()) {
            return Ok(corners);
        }
        Err(GltfError::Accessor { accessor: set.1, what: "a texture coordinate is not a finite number" })
    }

    /// The vectors of a triangle's corners.
    fn gather<const N: usize>(&self, triangle: usize, vectors: &Vectors<'_, N>) -> Result<[[f32; N]; 3], GltfError> {
        let places = match self.mode {
            Mode::Triangles => [triangle * 3, triangle * 3 + 1, triangle * 3 + 2],
            // The winding of a strip alternates.
            Mode::TriangleStrip => [triangle, triangle + 1 + triangle % 2, triangle + 2 - triangle % 2],
            _ => [triangle + 1, triangle + 2, 0],
        };
        let mut corners = [[0.0; N]; 3];
        for (corner, place) in corners.iter_mut().zip(places) {
            let (index, count) = (self.order.get(place), vectors.count());
            if index >= count {
                return Err(GltfError::NoSuchVertex { mesh: self.mesh, vertex: index as u32, count });
            }
            *corner = vectors.get(index);
        }
        Ok(corners)
    }
}

/// A set of texture coordinates, and the index of its accessor.
pub(super) struct TexCoords<'a>(Vectors<'a, 2>, usize);

impl<'a> TexCoords<'a> {
    /// `None` if the primitive does not have the set.
    pub fn new<B: AsRef<[u8]>>(
        primitive: &Primitive<'_>,
        set: u32,
        buffers: &'a [B],
    ) -> Result<Option<Self>, GltfError> {
        let Some(accessor) = primitive.get(&Semantic::TexCoords(set)) else { return Ok(None) };
        Ok(Some(Self(Vectors::new(&accessor, buffers)?, accessor.index())))
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

/// The texture coordinates of a primitive's triangles, in the order of [`primitive_triangles`];
/// `None` if the primitive has no attribute `TEXCOORD_n`, where n is `set`.
///
/// # Errors
/// Those of [`primitive_triangles`], and [`GltfError::Accessor`] for coordinates that are not finite.
pub fn primitive_tex_coords<B: AsRef<[u8]>>(
    mesh: usize,
    primitive: &Primitive<'_>,
    set: u32,
    buffers: &[B],
) -> Result<Option<Vec<[Vec2; 3]>>, GltfError> {
    let (Some(triangles), Some(set)) =
        (Triangles::new(mesh, primitive, buffers)?, TexCoords::new(primitive, set, buffers)?)
    else {
        return Ok(None);
    };
    (0..triangles.count()).map(|triangle| triangles.tex_coords(triangle, &set)).collect::<Result<_, _>>().map(Some)
}

/// An attribute of the corners of a primitive's triangles, such as normals or colours, in the order of
/// [`primitive_triangles`]; `None` if the primitive does not have it. Components may be NaN or infinite.
///
/// # Errors
/// Those of [`primitive_triangles`], and [`GltfError::Accessor`] if the attribute does not have `N`
/// components.
pub fn primitive_attribute<const N: usize, B: AsRef<[u8]>>(
    mesh: usize,
    primitive: &Primitive<'_>,
    semantic: &Semantic,
    buffers: &[B],
) -> Result<Option<Vec<[[f32; N]; 3]>>, GltfError> {
    let (Some(triangles), Some(accessor)) = (Triangles::new(mesh, primitive, buffers)?, primitive.get(semantic)) else {
        return Ok(None);
    };
    let vectors = Vectors::new(&accessor, buffers)?;
    (0..triangles.count()).map(|triangle| triangles.gather(triangle, &vectors)).collect::<Result<_, _>>().map(Some)
}
