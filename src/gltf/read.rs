//! Reads accessors after checking them: the gltf crate's own readers panic where a file's numbers point outside its buffers.

use ::gltf::accessor::{DataType, Dimensions};
use ::gltf::mesh::Mode;
use ::gltf::{Accessor, Primitive, Semantic};
use glam::Vec3;

use super::GltfError;

/// The bytes of an accessor's elements: where they begin, how far apart they are, how many there are.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        let (bytes, stride, size) = (self.bytes, self.stride, self.size);
        (0..self.count).map(move |index| &bytes[index * stride..index * stride + size])
    }
}

fn elements<'a, B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &'a [B]) -> Result<Elements<'a>, GltfError> {
    let index = accessor.index();
    let refuse = |what| Err(GltfError::Accessor { accessor: index, what });
    if accessor.sparse().is_some() {
        return refuse("sparse values are not read");
    }
    let Some(view) = accessor.view() else {
        return refuse("it has no buffer view");
    };
    let given = buffers.len();
    let number = view.buffer().index();
    let buffer = buffers.get(number).ok_or(GltfError::MissingBuffer { buffer: number, given })?.as_ref();
    let (count, size) = (accessor.count(), accessor.size());
    let stride = view.stride().unwrap_or(size);
    if stride < size {
        return refuse("its stride is less than its size");
    }
    // Sums of three 64-bit numbers and one product fit 128 bits.
    let wide = |number: usize| number as u128;
    let inside = wide(accessor.offset()) + wide(count.saturating_sub(1)) * wide(stride) + wide(size);
    if inside > wide(view.length()) {
        let length = wide(view.length());
        return Err(GltfError::OutOfBounds { accessor: index, what: "buffer view", end: inside, length });
    }
    let start = wide(view.offset()) + wide(accessor.offset());
    let end = wide(view.offset()) + inside;
    if end > wide(buffer.len()) {
        return Err(GltfError::OutOfBounds { accessor: index, what: "buffer", end, length: wide(buffer.len()) });
    }
    Ok(Elements { bytes: &buffer[start as usize..end as usize], stride, size, count })
}

/// The float vectors of an accessor: positions, rotations, key times. Integers are read as glTF's normalized ones.
///
/// # Errors
/// [`GltfError::Accessor`], [`GltfError::MissingBuffer`], [`GltfError::OutOfBounds`]. Values may be NaN: glTF's bytes can be.
pub fn accessor_values<const N: usize, B: AsRef<[u8]>>(
    accessor: &Accessor<'_>,
    buffers: &[B],
) -> Result<Vec<[f32; N]>, GltfError> {
    let refuse = |what| GltfError::Accessor { accessor: accessor.index(), what };
    if accessor.dimensions().multiplicity() != N || matches!(accessor.dimensions(), Dimensions::Mat2) {
        return Err(refuse("its values have the wrong number of components"));
    }
    let kind = accessor.data_type();
    if kind != DataType::F32 && !accessor.normalized() {
        return Err(refuse("its integers are not normalized"));
    }
    let component: fn(&[u8]) -> f32 = match kind {
        DataType::F32 => |bytes| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        DataType::I8 => |bytes| (f32::from(bytes[0] as i8) / 127.0).max(-1.0),
        DataType::U8 => |bytes| f32::from(bytes[0]) / 255.0,
        DataType::I16 => |bytes| (f32::from(i16::from_le_bytes([bytes[0], bytes[1]])) / 32767.0).max(-1.0),
        DataType::U16 => |bytes| f32::from(u16::from_le_bytes([bytes[0], bytes[1]])) / 65535.0,
        DataType::U32 => return Err(refuse("32-bit integers cannot be normalized")),
    };
    let width = kind.size();
    let value = |bytes: &[u8]| std::array::from_fn(|axis| component(&bytes[axis * width..]));
    Ok(elements(accessor, buffers)?.iter().map(value).collect())
}

fn indices<B: AsRef<[u8]>>(accessor: &Accessor<'_>, buffers: &[B]) -> Result<Vec<u32>, GltfError> {
    let refuse = |what| Err(GltfError::Accessor { accessor: accessor.index(), what });
    if accessor.dimensions() != Dimensions::Scalar {
        return refuse("indices are not scalars");
    }
    let index: fn(&[u8]) -> u32 = match accessor.data_type() {
        DataType::U8 => |bytes| u32::from(bytes[0]),
        DataType::U16 => |bytes| u32::from(u16::from_le_bytes([bytes[0], bytes[1]])),
        DataType::U32 => |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]),
        _ => return refuse("indices are not unsigned integers"),
    };
    Ok(elements(accessor, buffers)?.iter().map(index).collect())
}

/// A primitive's triangles in mesh space, counter-clockwise from the front; none for points and lines.
///
/// # Errors
/// As [`accessor_values`], [`GltfError::NoPositions`], [`GltfError::NoSuchVertex`].
pub fn primitive_triangles<B: AsRef<[u8]>>(
    mesh: usize,
    primitive: &Primitive<'_>,
    buffers: &[B],
) -> Result<Vec<[Vec3; 3]>, GltfError> {
    let mode = primitive.mode();
    if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
        return Ok(Vec::new());
    }
    let positions = primitive.get(&Semantic::Positions).ok_or(GltfError::NoPositions { mesh })?;
    let positions = accessor_values::<3, B>(&positions, buffers)?;
    let order = match primitive.indices() {
        Some(accessor) => indices(&accessor, buffers)?,
        None => (0..u32::try_from(positions.len()).unwrap_or(u32::MAX)).collect(),
    };
    let count = positions.len();
    if let Some(&vertex) = order.iter().find(|&&vertex| vertex as usize >= count) {
        return Err(GltfError::NoSuchVertex { mesh, vertex, count });
    }
    let at = |vertex: u32| Vec3::from(positions[vertex as usize]);
    let triangle = |[a, b, c]: [u32; 3]| [at(a), at(b), at(c)];
    Ok(match mode {
        Mode::Triangles => order.chunks_exact(3).map(|t| triangle([t[0], t[1], t[2]])).collect(),
        Mode::TriangleStrip => {
            // Every other triangle of a strip is wound the other way.
            let wound = |(i, t): (usize, &[u32])| triangle([t[0], t[1 + i % 2], t[2 - i % 2]]);
            order.windows(3).enumerate().map(wound).collect()
        }
        _ => {
            let rim = order.get(1..).unwrap_or_default();
            rim.windows(2).map(|pair| triangle([pair[0], pair[1], order[0]])).collect()
        }
    })
}
