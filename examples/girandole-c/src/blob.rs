//! Bytes that this interface has made.

use crate::memory::{destroy, object, result};
use crate::status::{GirandoleStatus, call};

/// The bytes of a baked tree, which the interface owns.
#[derive(Debug)]
pub struct GirandoleBlob(pub(crate) Vec<u8>);

/// Stores where the bytes of a blob are, and how many. They are valid until the blob is destroyed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_blob_bytes(
    blob: *const GirandoleBlob,
    bytes: *mut *const u8,
    size: *mut usize,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (blob, bytes, size) = unsafe { (object(blob, "blob")?, result(bytes, "bytes")?, result(size, "size")?) };
        bytes.set(blob.0.as_ptr());
        size.set(blob.0.len());
        Ok(())
    })
}

/// Frees a blob. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_blob_destroy(blob: *mut GirandoleBlob) {
    // SAFETY: made by `Box::into_raw`, and see the crate's documentation.
    unsafe { destroy(blob) }
}
