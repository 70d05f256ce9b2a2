//! Bind groups of shaders that use tables: shared cuts, and learnt visibility.

use super::bindings::{READ, WRITE, layout_of};
use crate::plan::{BufferId, ShaderBuffers};

/// What a shader uses besides the lights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Tables {
    /// The cuts alone, which it marks; it chooses no lights.
    Marks,
    Cuts,
    CutsAndVisibility,
}

/// The buffers of lights, cuts and visibility; `None` in place of zeros.
pub(super) type Bound = (Option<ShaderBuffers>, Option<BufferId>, Option<[BufferId; 2]>);

/// The buffers themselves.
pub(super) struct TableBuffers<'a> {
    pub lights: [&'a wgpu::Buffer; 5],
    pub cuts: &'a wgpu::Buffer,
    pub marks: &'a wgpu::Buffer,
    pub visibility: [&'a wgpu::Buffer; 2],
}

/// A bind group with its layout.
pub(super) struct TableGroup {
    tables: Tables,
    pub layout: wgpu::BindGroupLayout,
    pub bind_group: wgpu::BindGroup,
    /// What the bind group was made for.
    bound: Bound,
}

impl Tables {
    /// The bindings with the buffers there, and what the shader does with them.
    fn bindings<'a>(
        self,
        TableBuffers { lights, cuts, marks, visibility: [learnt, records] }: &TableBuffers<'a>,
    ) -> Vec<(u32, &'a wgpu::Buffer, wgpu::BufferBindingType)> {
        if self == Self::Marks {
            return vec![(0, *marks, WRITE)];
        }
        let types = [wgpu::BufferBindingType::Uniform, READ, READ, READ, READ];
        let mut all: Vec<_> = (0..).zip(lights).zip(types).map(|((i, buffer), ty)| (i, *buffer, ty)).collect();
        all.push((5, *cuts, READ));
        if self == Self::CutsAndVisibility {
            all.extend([(6, *learnt, READ), (7, *records, WRITE)]);
        }
        all
    }

    fn bind(
        self,
        device: &wgpu::Device,
        layout: &wgpu::BindGroupLayout,
        buffers: &TableBuffers<'_>,
    ) -> wgpu::BindGroup {
        let entries = self.bindings(buffers).into_iter();
        let entries: Vec<_> = entries
            .map(|(binding, buffer, _)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let label = Some("girandole tables");
        device.create_bind_group(&wgpu::BindGroupDescriptor { label, layout, entries: &entries })
    }
}

impl TableGroup {
    pub fn new(device: &wgpu::Device, tables: Tables, buffers: &TableBuffers<'_>, bound: Bound) -> Self {
        let entries = tables.bindings(buffers).into_iter().map(|(binding, _, ty)| (binding, ty));
        let layout = layout_of(device, "girandole tables", entries);
        let bind_group = tables.bind(device, &layout, buffers);
        Self { tables, layout, bind_group, bound }
    }

    /// Replaces the bind group if a buffer was replaced.
    pub fn rebind(&mut self, device: &wgpu::Device, buffers: &TableBuffers<'_>, bound: Bound) {
        if self.bound != bound {
            self.bind_group = self.tables.bind(device, &self.layout, buffers);
            self.bound = bound;
        }
    }
}
