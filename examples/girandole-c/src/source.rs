//! WGSL texts that were checked, and their resources.

use std::borrow::Cow;

use naga::back::pipeline_constants::process_overrides;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{GlobalVariable, Handle, Module, ResourceBinding};

use crate::bindings::GirandoleBindingKind;
use crate::status::{Failure, GIRANDOLE_ERROR_TRANSLATION, GIRANDOLE_ERROR_WGSL};

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

    /// The module for the writers of other languages, in which overrides have become constants with their
    /// default values. Entry points keep their indices; variables may not.
    pub fn constant(&self) -> Result<Constant<'_>, Failure> {
        if self.module.entry_points.is_empty() {
            return Ok((Cow::Borrowed(&self.module), Cow::Borrowed(&self.info)));
        }
        process_overrides(&self.module, &self.info, None, &Default::default())
            .map_err(|error| Failure::new(GIRANDOLE_ERROR_TRANSLATION, error.to_string()))
    }

    /// The same for a text that writes all variables of workgroups before it reads them. The kernels of the
    /// library do. Drivers may take minutes for the code that sets large ones to zero.
    pub fn without_zeroing(self) -> Self {
        Self { zeroes_workgroups: false, ..self }
    }
}

/// A module without overrides.
pub(crate) type Constant<'a> = (Cow<'a, Module>, Cow<'a, ModuleInfo>);

/// What a resource is for a writer.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sort {
    Buffer,
    Texture,
    Sampler,
    /// An array of any of these.
    Array,
}

/// A resource of a text, and where it goes.
#[derive(Clone)]
pub(crate) struct Bound {
    /// In the text's own module.
    pub variable: Handle<GlobalVariable>,
    pub sort: Sort,
    pub name: String,
    pub from: ResourceBinding,
    pub kind: GirandoleBindingKind,
    /// Of the register in HLSL, where samplers are refused.
    pub letter: u8,
    pub size: u32,
    pub space: u32,
    pub index: u32,
}
