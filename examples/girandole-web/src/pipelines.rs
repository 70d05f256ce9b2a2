//! The pipelines that render: a variant for the effects of the lights, and those that know no tree.

use std::collections::HashMap;

use girandole::gpu::{GpuLights, LightShader};
use girandole::{Effects, wgpu};

use crate::light_list::LightList;
use testbed::render::geometry::Geometry;
use testbed::render::gpu::pipeline::{LIGHT_GROUP, Needs, Work, pipeline, shader_source};
use testbed::scene::Scene;

/// Places of the traversal stack that the first hierarchy does not need. As objects move, its depth changes
/// by a few nodes, and a deeper one would compile all pipelines anew.
const SPARE_STACK: usize = 16;

/// The entry points of `light_list.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Listed {
    /// One light for each sample, each with the same probability.
    Uniform,
    /// All lights.
    All,
}

impl Listed {
    fn entry_point(self) -> &'static str {
        match self {
            Self::Uniform => "render_uniform",
            Self::All => "add_all_lights",
        }
    }
}

/// The pipelines that serve lights with some effects.
pub struct Variant {
    /// Marks the cells of the surfaces in view.
    pub mark: wgpu::ComputePipeline,
    pub render: wgpu::ComputePipeline,
}

/// The pipelines of a scene.
pub struct Pipelines {
    device: wgpu::Device,
    /// Of group 0.
    layout: wgpu::BindGroupLayout,
    /// For all effects.
    shader: LightShader,
    /// What the pipelines are compiled for.
    needs: Needs,
    /// By the effects that they serve. Each is compiled when a frame asks for it: on a page, another
    /// thread would gain nothing.
    variants: HashMap<Effects, Variant>,
    listed: Option<(Listed, Effects, wgpu::ComputePipeline)>,
}

impl Pipelines {
    /// Compiles nothing yet. `layout` is that of group 0.
    pub fn new(
        device: &wgpu::Device,
        layout: &wgpu::BindGroupLayout,
        lights: &GpuLights,
        (scene, geometry): (&Scene, &Geometry),
    ) -> Self {
        let shader = lights.shader(LIGHT_GROUP, Effects::all());
        let mut needs = Needs::new(scene, geometry);
        needs.stack_size += SPARE_STACK;
        let (device, layout, variants) = (device.clone(), layout.clone(), HashMap::new());
        Self { device, layout, shader, needs, variants, listed: None }
    }

    /// Drops all pipelines if the hierarchies have become too deep for them.
    pub fn fit(&mut self, geometry: &Geometry) {
        if self.needs.grow(geometry) {
            self.variants.clear();
            self.listed = None;
        }
    }

    /// The pipelines for lights with these effects.
    pub fn get(&mut self, effects: Effects) -> &Variant {
        let Self { device, layout, shader, needs, variants, .. } = self;
        let shader = shader.with_effects(effects);
        let compile = |work| pipeline(device, layout, &shader, *needs, work);
        variants.entry(effects).or_insert_with(|| Variant { mark: compile(Work::Mark), render: compile(Work::Render) })
    }

    /// The number of variants that were compiled.
    pub fn variant_count(&self) -> usize {
        self.variants.len()
    }

    /// Whether a variant for just these effects is ready.
    pub fn has(&self, effects: Effects) -> bool {
        self.variants.contains_key(&effects)
    }

    /// A pipeline that knows no tree. It is compiled when it is asked for first, and when the effects of
    /// the lights have changed.
    pub fn get_listed(&mut self, listed: Listed, effects: Effects, list: &LightList) -> &wgpu::ComputePipeline {
        if self.listed.as_ref().is_none_or(|(other, of, _)| *other != listed || *of != effects) {
            self.listed = Some((listed, effects, self.make_listed(listed, effects, list)));
        }
        let (.., pipeline) = self.listed.as_ref().expect("it was just made");
        pipeline
    }

    fn make_listed(&self, listed: Listed, effects: Effects, list: &LightList) -> wgpu::ComputePipeline {
        let shader = self.shader.with_effects(effects);
        let text = shader_source(&shader.wgsl, self.needs, Work::Render);
        let text = format!("{text}\n{}", include_str!("light_list.wgsl"));
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("light list"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("light list"),
            bind_group_layouts: &[Some(&self.layout), Some(&shader.layout), Some(&list.layout)],
            ..Default::default()
        });
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(listed.entry_point()),
            layout: Some(&layout),
            module: &module,
            entry_point: Some(listed.entry_point()),
            compilation_options: Default::default(),
            cache: None,
        })
    }
}
