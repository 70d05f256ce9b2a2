//! WGSL texts that were checked, and their resources.

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{Module, ResourceBinding};

use crate::bindings::GirandoleBindingKind;
use crate::status::{Failure, GIRANDOLE_ERROR_WGSL};

/// A WGSL text that was checked.
pub(crate) struct Source {
    pub text: String,
    pub module: Module,
    pub info: ModuleInfo,
    /// Whether variables of workgroups start at zero, as WGSL promises.
    pub zeroes_workgroups: bool,
}

impl Source {
    /// Checks a text. Any feature of WGSL is allowed: whether a device has it is the engine's concern.
    pub fn checked(text: String) -> Result<Self, Failure> {
        let refused = |message| Failure::new(GIRANDOLE_ERROR_WGSL, message);
        let module = naga::front::wgsl::parse_str(&text).map_err(|error| refused(error.emit_to_string(&text)))?;
        let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module);
        let info = info.map_err(|error| refused(error.emit_to_string(&text)))?;
        Ok(Self { text, module, info, zeroes_workgroups: true })
    }

    /// The same for a text that writes all variables of workgroups before it reads them. The kernels of the
    /// library do. Drivers may take minutes for the code that sets large ones to zero.
    pub fn without_zeroing(self) -> Self {
        Self { zeroes_workgroups: false, ..self }
    }
}

/// A resource of a text, and where it goes.
#[derive(Clone)]
pub(crate) struct Bound {
    pub name: String,
    pub from: ResourceBinding,
    pub kind: GirandoleBindingKind,
    pub letter: u8,
    pub size: u32,
    pub space: u32,
    pub index: u32,
}
