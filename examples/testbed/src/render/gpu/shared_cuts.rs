//! The shaders for cuts that neighbours share, compiled when a frame first asks for them.

use super::pipeline::{LIGHT_GROUP, Needs, TARGET, TARGET_ARGUMENT, Work, pipeline};
use super::scene::SceneError;
use girandole::Effects;
use girandole::gpu::{GpuLights, TargetHook};
use girandole::wgpu;

/// The storage buffers of the shader that renders: four of the scene, four of the lights, and the cuts.
const STORAGE_BUFFERS: u32 = 9;

/// Pipelines for one set of effects.
pub struct SharedPipelines {
    pub mark: wgpu::ComputePipeline,
    pub render: wgpu::ComputePipeline,
    effects: Effects,
    needs: Needs,
}

impl SharedPipelines {
    /// Whether the pipelines serve frames with these effects and needs.
    pub fn serve(&self, effects: Effects, needs: Needs) -> bool {
        (self.effects, self.needs) == (effects, needs)
    }

    /// Compiles both. `layout` is that of the scene's bind group.
    pub fn new(
        device: &wgpu::Device,
        layout: &wgpu::BindGroupLayout,
        lights: &GpuLights,
        effects: Effects,
        needs: Needs,
    ) -> Result<Self, SceneError> {
        let offered = device.limits().max_storage_buffers_per_shader_stage;
        if offered < STORAGE_BUFFERS {
            let error =
                format!("shared cuts need {STORAGE_BUFFERS} storage buffers in a shader; this GPU has {offered}");
            return Err(SceneError(error));
        }
        let target = TargetHook::new(TARGET, TARGET_ARGUMENT).map_err(|e| SceneError(e.to_string()))?;
        let render = lights.cut_shader(LIGHT_GROUP, effects).with_target(target);
        let mark = lights.mark_shader(LIGHT_GROUP, effects);
        Ok(Self {
            mark: pipeline(device, layout, &mark, needs, Work::Mark),
            render: pipeline(device, layout, &render, needs, Work::Render),
            effects,
            needs,
        })
    }
}
