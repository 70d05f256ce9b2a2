//! What calls return: a status, and a message for each thread.

use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The result of a call: 0 (`GIRANDOLE_OK`), a code below 100 of this interface, or a code from 100 on of
/// the library.
///
/// A code keeps its meaning in all later versions, and later versions may add codes. A call that returns
/// anything but 0 has changed nothing, unless its documentation says otherwise.
/// girandole_last_error_message returns a sentence about it.
///
/// Codes of the library:
///   100         a number is not allowed; the message says what is
///   200 to 299  the world refuses a call, for example because of a stale key
///   600 to 699  plans for the GPU
///   700         a file is not valid, or an image or its place on a surface; the message names the line of a profile
///   1100 to 1199  bytes are no baked tree, or not a sound one
///   1300 to 1399  the pixels of a sky are refused, there is none, or portals are refused
pub type GirandoleStatus = i32;

/// The call has succeeded.
pub const GIRANDOLE_OK: GirandoleStatus = 0;
/// A pointer that must not be NULL is NULL.
pub const GIRANDOLE_ERROR_NULL: GirandoleStatus = 1;
/// A number is not a valid kind, flag or index for the call.
pub const GIRANDOLE_ERROR_BAD_VALUE: GirandoleStatus = 2;
/// A number of elements is larger than memory can hold.
pub const GIRANDOLE_ERROR_BAD_LENGTH: GirandoleStatus = 3;
/// A pointer is not aligned for its type.
pub const GIRANDOLE_ERROR_MISALIGNED: GirandoleStatus = 4;
/// The caller's array is too short. The call has stored the number of elements that it needs.
pub const GIRANDOLE_ERROR_NO_SPACE: GirandoleStatus = 5;
/// A text is not UTF-8.
pub const GIRANDOLE_ERROR_BAD_TEXT: GirandoleStatus = 6;
/// The library has panicked: this is a bug in it. The call has not finished. If it was given a world or a
/// planner that it may change, later calls refuse that object with GIRANDOLE_ERROR_BROKEN.
pub const GIRANDOLE_ERROR_PANIC: GirandoleStatus = 10;
/// An earlier call on this object has panicked: the object can only be destroyed. Also returned while another
/// thread is in a call that changes the object, which the rules for threads forbid.
pub const GIRANDOLE_ERROR_BROKEN: GirandoleStatus = 11;
/// The planner has a reservation: end it with girandole_planner_plan or
/// girandole_planner_cancel first.
pub const GIRANDOLE_ERROR_RESERVED: GirandoleStatus = 12;
/// The planner has no reservation: call girandole_planner_reserve first.
pub const GIRANDOLE_ERROR_NOT_RESERVED: GirandoleStatus = 13;
/// The planner or the reader follows another world.
pub const GIRANDOLE_ERROR_OTHER_WORLD: GirandoleStatus = 14;
/// A shader text is not valid WGSL. The message contains the line.
pub const GIRANDOLE_ERROR_WGSL: GirandoleStatus = 20;
/// A valid shader cannot be written in the language that was asked for.
pub const GIRANDOLE_ERROR_TRANSLATION: GirandoleStatus = 21;

/// The tree has no light with this index.
pub const GIRANDOLE_ERROR_NO_SUCH_LIGHT: GirandoleStatus = 201;
/// No tree has this key: it was removed, or never existed.
pub const GIRANDOLE_ERROR_NO_SUCH_TREE: GirandoleStatus = 202;
/// No instance has this key.
pub const GIRANDOLE_ERROR_NO_SUCH_INSTANCE: GirandoleStatus = 203;
/// No directional light has this key.
pub const GIRANDOLE_ERROR_NO_SUCH_DIRECTIONAL: GirandoleStatus = 204;
/// The tree still has instances.
pub const GIRANDOLE_ERROR_TREE_IN_USE: GirandoleStatus = 205;
/// All instances of the tree have the policy STATIC, so its lights cannot change.
pub const GIRANDOLE_ERROR_STATIC_TREE: GirandoleStatus = 206;
/// The light with this index was removed.
pub const GIRANDOLE_ERROR_REMOVED_LIGHT: GirandoleStatus = 210;
/// No region has this key.
pub const GIRANDOLE_ERROR_NO_SUCH_REGION: GirandoleStatus = 211;
/// A tree of the region has instances outside of it.
pub const GIRANDOLE_ERROR_REGION_IN_USE: GirandoleStatus = 213;
/// A light of the tree has a profile, so no kernel can write its lights.
pub const GIRANDOLE_ERROR_PROFILE_ON_GPU: GirandoleStatus = 216;
/// A buffer would outgrow the limits of the planner. The changes are kept for the next call.
pub const GIRANDOLE_ERROR_FULL: GirandoleStatus = 600;
/// A plan was played twice, or an earlier plan was skipped.
pub const GIRANDOLE_ERROR_OUT_OF_ORDER: GirandoleStatus = 604;

/// Why a call is refused.
#[derive(Debug)]
pub(crate) struct Failure {
    pub code: GirandoleStatus,
    pub message: String,
}

impl Failure {
    pub fn new(code: GirandoleStatus, message: impl Into<String>) -> Self {
        Self { code, message: message.into() }
    }

    /// A number that stands for nothing.
    pub fn bad_value(what: &str, given: impl std::fmt::Display) -> Self {
        Self::new(GIRANDOLE_ERROR_BAD_VALUE, format!("{given} is no {what}"))
    }
}

macro_rules! from_errors_of_the_library {
    ($($error:ty),* $(,)?) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::new(error.code() as GirandoleStatus, error.to_string())
            }
        }
    )*};
}

from_errors_of_the_library!(
    girandole::WorldError,
    girandole::ValueError,
    girandole::SkyError,
    girandole_assets::AssetError,
    girandole::plan::PlanError,
    girandole::LoadError,
);

thread_local! {
    static MESSAGE: RefCell<CString> = RefCell::new(CString::default());
}

/// Runs the body of a call. No panic leaves it.
pub(crate) fn call(body: impl FnOnce() -> Result<(), Failure>) -> GirandoleStatus {
    let failure = match catch_unwind(AssertUnwindSafe(body)) {
        Ok(Ok(())) => return GIRANDOLE_OK,
        Ok(Err(failure)) => failure,
        Err(payload) => {
            let what = match (payload.downcast_ref::<&str>(), payload.downcast_ref::<String>()) {
                (Some(text), _) => (*text).to_owned(),
                (_, Some(text)) => text.clone(),
                _ => "no message".to_owned(),
            };
            // Dropping a payload could panic again.
            std::mem::forget(payload);
            Failure::new(GIRANDOLE_ERROR_PANIC, format!("a bug in the library: {what}"))
        }
    };
    let text = CString::new(failure.message.replace('\0', " ")).unwrap_or_default();
    // During the end of a thread there is no message any more.
    let _ = MESSAGE.try_with(|message| message.replace(text));
    failure.code
}

/// Returns a sentence about the last call of this thread that returned anything but 0: what was given, and
/// what is allowed. Empty if there was none.
///
/// The text is UTF-8, and is valid until the next call of this thread that returns anything but 0, or until
/// the thread ends. Calls that succeed leave it as it is.
#[unsafe(no_mangle)]
pub extern "C" fn girandole_last_error_message() -> *const c_char {
    MESSAGE.try_with(|message| message.borrow().as_ptr()).unwrap_or(c"".as_ptr())
}

#[cfg(test)]
mod tests {
    use std::ffi::CStr;

    use super::*;

    fn message() -> String {
        // SAFETY: the text is that of this thread, which makes no call meanwhile.
        unsafe { CStr::from_ptr(girandole_last_error_message()) }.to_string_lossy().into_owned()
    }

    #[test]
    fn a_panic_becomes_a_status_and_a_message() {
        assert_eq!(call(|| panic!("broken {}", 7)), GIRANDOLE_ERROR_PANIC);
        assert_eq!(message(), "a bug in the library: broken 7");
        assert_eq!(call(|| panic!("static")), GIRANDOLE_ERROR_PANIC);
        assert_eq!(message(), "a bug in the library: static");
        assert_eq!(call(|| std::panic::panic_any(7_u8)), GIRANDOLE_ERROR_PANIC);
        assert_eq!(message(), "a bug in the library: no message");
        assert_eq!(call(|| Ok(())), GIRANDOLE_OK);
        assert_eq!(message(), "a bug in the library: no message", "kept by a call that succeeds");
    }

    #[test]
    fn messages_belong_to_threads_and_end_at_no_inner_zero() {
        assert_eq!(call(|| Err(Failure::new(2, "a\0b"))), 2);
        assert_eq!(message(), "a b");
        std::thread::spawn(|| assert_eq!(message(), "")).join().expect("the other thread has no message");
        assert_eq!(message(), "a b");
    }

    #[test]
    fn constants_are_the_codes_of_the_library() {
        use girandole::plan::PlanError;
        use girandole::{DirectionalKey, InstanceKey, RegionKey, TreeKey, WorldError};
        let (tree, region) = (TreeKey::from(0), RegionKey::from(0));
        for (error, code) in [
            (WorldError::NoSuchLight { index: 0, count: 0 }, GIRANDOLE_ERROR_NO_SUCH_LIGHT),
            (WorldError::NoSuchTree(tree), GIRANDOLE_ERROR_NO_SUCH_TREE),
            (WorldError::NoSuchInstance(InstanceKey::from(0)), GIRANDOLE_ERROR_NO_SUCH_INSTANCE),
            (WorldError::NoSuchDirectional(DirectionalKey::from(0)), GIRANDOLE_ERROR_NO_SUCH_DIRECTIONAL),
            (WorldError::TreeInUse { tree, instances: 1 }, GIRANDOLE_ERROR_TREE_IN_USE),
            (WorldError::StaticTree(tree), GIRANDOLE_ERROR_STATIC_TREE),
            (WorldError::NoSuchRegion(region), GIRANDOLE_ERROR_NO_SUCH_REGION),
            (WorldError::RegionInUse { region, tree, instances: 1 }, GIRANDOLE_ERROR_REGION_IN_USE),
            (WorldError::RemovedLight { index: 0 }, GIRANDOLE_ERROR_REMOVED_LIGHT),
            (WorldError::ProfileOnGpu, GIRANDOLE_ERROR_PROFILE_ON_GPU),
        ] {
            assert_eq!(error.code() as GirandoleStatus, code, "{error}");
        }
        assert_eq!(Failure::from(PlanError::Full { what: "", needed: 1, limit: 0 }).code, GIRANDOLE_ERROR_FULL);
        let out_of_order = PlanError::OutOfOrder { expected: 1, given: 2 };
        assert_eq!(Failure::from(out_of_order).code, GIRANDOLE_ERROR_OUT_OF_ORDER);
    }
}
