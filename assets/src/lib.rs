//! Lights for [`girandole`] from files and images.
//!
//! | module | what it reads | feature |
//! |---|---|---|
//! | [`texture`] | images that surfaces emit, cut into lights | |
//! | [`profile`] | lamps of makers: IES and EULUMDAT files | |
//! | `sky` | Radiance HDR files | `hdr`, by default |
//! | `gltf` | scenes: emissive surfaces, punctual lights, lamps with profiles, skies | `gltf`, by default |
//!
//! Files may be of unknown origin: no bytes make a function panic, and memory is bounded. What is refused is an
//! [`AssetError`].

mod error;
pub mod texture;
pub mod profile;
#[cfg(feature = "hdr")]
pub mod sky;
#[cfg(feature = "gltf")]
pub mod gltf;

pub use error::AssetError;
pub use girandole;

/// The programs of the README and of the pages about files, compiled and run as documentation tests.
#[cfg(all(doctest, feature = "gltf"))]
mod pages {
    #[doc = include_str!("../README.md")]
    struct Readme;
    #[doc = include_str!("../../docs/gltf.md")]
    struct Gltf;
    #[doc = include_str!("../../docs/profiles.md")]
    struct Profiles;
    #[doc = include_str!("../../docs/textures.md")]
    struct Textures;
}
