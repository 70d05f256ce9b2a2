//! The lights of the last frame, for renderers that reuse samples from frame to frame.

use super::GpuLights;
use super::bindings::bind_lights;

impl GpuLights {
    /// Keeps the lights of the last frame on the GPU, from the next upload on, or drops them. They
    /// take as much memory as those of the present frame, and an upload begins with copies of what
    /// the upload before it changed.
    ///
    /// Shaders with [`LightShader::with_previous`](super::LightShader::with_previous) then return the
    /// probabilities of the last frame. Upload once in each frame, also if nothing has changed: a
    /// frame is what lies between two uploads.
    pub fn keep_previous(&mut self, is_kept: bool) {
        self.planner.keep_previous(is_kept);
    }

    /// The bind group with the lights of the last frame, which has the layout of
    /// [`GpuLights::bind_group_layout`]. Call this in each frame after [`GpuLights::upload`]. It has no
    /// lights before the first upload after [`GpuLights::keep_previous`].
    pub fn previous_bind_group(&self) -> &wgpu::BindGroup {
        &self.previous.1
    }

    /// Replaces the bind group if a buffer of it was replaced.
    pub(super) fn rebind_previous(&mut self) {
        let bound = self.planner.previous_bindings().filter(|_| !self.is_dark);
        if bound == self.previous.0 {
            return;
        }
        let dark = &self.dark;
        let buffers = match bound {
            Some(bound) => bound.0.map(|id| self.player.buffer(id)),
            None => [&dark.params, &dark.storage, &dark.storage, &dark.storage, &dark.storage],
        };
        self.previous = (bound, bind_lights(&self.device, &self.layout, &buffers));
    }
}
