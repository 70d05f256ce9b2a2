//! Refusals as errors of JavaScript, with the library's message and code.

use girandole::plan::PlanError;
use girandole::{SkyError, ValueError, WorldError};
use js_sys::{Error, Reflect};
use wasm_bindgen::JsValue;

/// Why a call is refused.
pub enum Failure {
    /// By the library, with its stable code.
    Coded(u32, String),
    /// By this package.
    Plain(String),
    /// By the page's own code.
    Thrown(JsValue),
}

macro_rules! coded {
    ($($error:ident)*) => {$(
        impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::Coded(error.code(), error.to_string())
            }
        }
    )*};
}

coded!(PlanError SkyError ValueError WorldError);

impl From<Failure> for JsValue {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::Coded(code, message) => {
                let error = Error::new(&message);
                // Cannot fail: a new error is an ordinary object.
                let _ = Reflect::set(&error, &"code".into(), &code.into());
                error.into()
            }
            Failure::Plain(message) => Error::new(&message).into(),
            Failure::Thrown(value) => value,
        }
    }
}
