//! What the city and this page share with other programs.

#[path = "../../common/hash.rs"]
pub mod hash;
#[path = "../../common/pcg.rs"]
pub mod pcg;
