//! The lights of the last frame, for renderers that reuse samples from frame to frame.

use super::GpuLights;
use super::bindings::LIGHTS;

impl GpuLights {
    /// Keeps the lights of the last frame on the GPU, from the next upload on, or drops them. They
    /// take as much memory as those of the present frame, and an upload begins with copies of what
    /// the upload before it changed.
    ///
    /// Shaders with [`LightShader::with_previous`](super::LightShader::with_previous) then
    /// return its samples. Upload once in each frame, also if nothing has changed: a
    /// frame is what lies between two uploads.
    pub fn keep_previous(&mut self, is_kept: bool) {
        self.planner.keep_previous(is_kept);
    }

    /// The layout of [`GpuLights::previous_bind_group`]: one uniform buffer and four read-only storage buffers.
    pub fn previous_bind_group_layout(&self) -> &wgpu::BindGroupLayout {
        &self.previous.1.layout
    }

    /// The bind group with the lights of the last frame. Call this in each frame after [`GpuLights::upload`]. It has no
    /// lights before the first upload after [`GpuLights::keep_previous`].
    pub fn previous_bind_group(&self) -> &wgpu::BindGroup {
        &self.previous.1.bind_group
    }

    /// Replaces the bind group if a buffer of it was replaced.
    pub(super) fn rebind_previous(&mut self) {
        let bound = self.planner.previous_bindings().filter(|_| !self.is_dark);
        if bound == self.previous.0 {
            return;
        }
        let buffers: Vec<_> = match bound {
            Some(bound) => bound.0.map(|id| self.player.buffer(id)).to_vec(),
            None => self.dark.buffers().to_vec(),
        };
        let mut group = self.previous.1.clone();
        group.rebind(&self.device, LIGHTS, &buffers);
        self.previous = (bound, group);
    }
}
