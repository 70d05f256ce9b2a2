//! The shaders, joined with the library's text, and their pipelines.

use super::geometry::Geometry;
use super::scene::Scene;
use super::sequence::DIRECTIONS;
use super::texels::TEXEL_ROW;
use girandole::gpu::LightShader;
use girandole::wgpu;

/// The bind group of the library's text.
pub const LIGHT_GROUP: u32 = 1;
/// Invocations along each side of a workgroup.
pub const WORKGROUP: u32 = 8;

/// `sample_texture` for scenes without textures, in which nothing calls it.
const NO_TEXELS: &str = "fn sample_texture(record: u32, coordinates: vec4<f32>) -> vec4<f32> {
    return vec4<f32>(1.0);
}
";

/// What the shader's text depends on, beside the library's text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Needs {
    /// The size of the traversal stack.
    pub stack_size: usize,
    /// Whether any surface has a texture.
    pub textures: bool,
    /// Whether pixels keep lights from frame to frame.
    pub reuse: bool,
}

impl Needs {
    /// The needs of a scene. The stack is rounded up so that a slightly deeper upper hierarchy needs no
    /// other shader.
    pub fn new(scene: &Scene, geometry: &Geometry) -> Self {
        let mut needs = Self { stack_size: 0, textures: !scene.textures.is_empty(), reuse: false };
        needs.grow(geometry);
        needs
    }

    /// Makes the stack larger if the hierarchies are too deep for it. Returns whether they were.
    pub fn grow(&mut self, geometry: &Geometry) -> bool {
        let is_small = self.stack_size < geometry.stack_size() + 4;
        if is_small {
            self.stack_size = (geometry.stack_size() + 4).next_multiple_of(16);
        }
        is_small
    }
}

/// The text of shaders whose pixels keep nothing.
const NO_REUSE: &str = "const REUSES = false;
fn keep_nothing(pixel: u32) {}
fn reused(pixel: u32, at: MetSurface, place: LightShadingPoint, fresh: LightReservoir) -> LightReservoir {
    return fresh;
}
";

/// What a shader does for each pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Work {
    /// It renders.
    Render,
    /// It marks the cell of what the pixel shows.
    Mark,
}

impl Work {
    /// The entry point, and the text that has it.
    fn text(self) -> (&'static str, &'static str) {
        match self {
            Self::Render => ("render", include_str!("render.wgsl")),
            Self::Mark => ("mark", include_str!("mark.wgsl")),
        }
    }
}

/// The text of a shader. `light` is the library's text.
pub fn shader_source(light: &str, needs: Needs, work: Work) -> String {
    let stack_size = needs.stack_size;
    format!(
        "{light}\nconst STACK_SIZE: u32 = {stack_size}u;\nconst TEXEL_ROW: u32 = {TEXEL_ROW}u;\n{}\n{}\n{}\n{}\n{}\n{}\n{}",
        sobol_text(),
        include_str!("sequence.wgsl"),
        if needs.textures { include_str!("texels.wgsl") } else { NO_TEXELS },
        include_str!("textures.wgsl"),
        include_str!("surface.wgsl"),
        work.text().1,
        match work {
            Work::Render if needs.reuse => include_str!("reuse.wgsl"),
            Work::Render => NO_REUSE,
            Work::Mark => "",
        }
    )
}

/// The function `sobol`: the coordinates of a point, as fractions of 2^32. Compilers keep constants
/// in the instructions of an unrolled loop, but copy a table into the memory of each invocation.
fn sobol_text() -> String {
    let line = |(bit, [a, b, c, d]): (usize, &[u32; 4])| {
        format!("    x ^= vec4<u32>({a:#x}u, {b:#x}u, {c:#x}u, {d:#x}u) * ((index >> {bit}u) & 1u);\n")
    };
    let lines: String = DIRECTIONS.iter().enumerate().map(line).collect();
    format!("fn sobol(index: u32) -> vec4<u32> {{\n    var x = vec4<u32>(0u);\n{lines}    return x;\n}}\n")
}

/// Compiles the pipeline.
pub fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    shader: &LightShader,
    needs: Needs,
    work: Work,
) -> wgpu::ComputePipeline {
    let (entry, _) = work.text();
    let label = Some(entry);
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label,
        source: wgpu::ShaderSource::Wgsl(shader_source(&shader.wgsl, needs, work).into()),
    });
    let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
        label,
        bind_group_layouts: &[Some(layout), Some(&shader.layout)],
        ..Default::default()
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label,
        layout: Some(&layout),
        module: &module,
        entry_point: Some(entry),
        compilation_options: Default::default(),
        cache: None,
    })
}
