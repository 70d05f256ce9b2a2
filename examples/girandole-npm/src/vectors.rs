//! Vectors and matrices in arrays of numbers.

use girandole::Placement;
use girandole::glam::{DAffine3, DMat4, Vec3};

use crate::failure::Failure;

fn numbers<T: Copy, const N: usize>(what: &str, given: &[T]) -> Result<[T; N], Failure> {
    given.try_into().map_err(|_| Failure::Plain(format!("{what}: {} numbers instead of {N}", given.len())))
}

/// A vector of three numbers.
pub fn vector(what: &str, given: &[f32]) -> Result<Vec3, Failure> {
    numbers(what, given).map(Vec3::from_array)
}

/// Vectors of three numbers each.
pub fn vectors(what: &str, given: &[f32]) -> Result<Vec<Vec3>, Failure> {
    let (vectors, rest) = given.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(Failure::Plain(format!("{what}: {} numbers, which is no multiple of 3", given.len())));
    }
    Ok(vectors.iter().copied().map(Vec3::from_array).collect())
}

/// The affine map of a matrix of four columns with four numbers each. The last row is ignored.
pub fn placement(matrix: &[f64]) -> Result<Placement, Failure> {
    let matrix = DMat4::from_cols_array(&numbers("matrix", matrix)?);
    Ok(DAffine3::from_mat4(matrix).into())
}
