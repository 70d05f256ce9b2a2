//! Photometric profiles.

use girandole::Profile;
use girandole_assets::{AssetError, profile};

use crate::memory::{array, result};
use crate::status::{GirandoleStatus, call};

/// Reads an IES file (LM-63 of 1986 to 2019) and stores its profile: a number that is the same for equal profiles in
/// all processes. The profile is kept as long as the process runs, once for equal files. Baked trees
/// with such lamps are loaded after their profiles.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_profile_from_ies(
    bytes: *const u8,
    size: usize,
    profile: *mut u64,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { read(bytes, size, profile, profile::ies) }
}

/// Reads a EULUMDAT file, as girandole_profile_from_ies does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn girandole_profile_from_eulumdat(
    bytes: *const u8,
    size: usize,
    profile: *mut u64,
) -> GirandoleStatus {
    // SAFETY: see the crate's documentation.
    unsafe { read(bytes, size, profile, profile::eulumdat) }
}

unsafe fn read(
    bytes: *const u8,
    size: usize,
    profile: *mut u64,
    reader: fn(&[u8]) -> Result<Profile, AssetError>,
) -> GirandoleStatus {
    call(|| {
        // SAFETY: see the crate's documentation.
        let (bytes, number) = unsafe { (array(bytes, size, "bytes")?, result(profile, "profile")?) };
        number.set(reader(bytes)?.id());
        Ok(())
    })
}
