//! Names of the library as C strings that live as long as the process.

use std::collections::BTreeMap;
use std::ffi::{CString, c_char};
use std::sync::{Mutex, PoisonError};

static NAMES: Mutex<BTreeMap<&'static str, CString>> = Mutex::new(BTreeMap::new());

/// Ends a name with a zero. The same name gives the same pointer; the library has a few dozens.
pub(crate) fn c_name(name: &'static str) -> *const c_char {
    let mut names = NAMES.lock().unwrap_or_else(PoisonError::into_inner);
    names.entry(name).or_insert_with(|| CString::new(name).unwrap_or_default()).as_ptr()
}
