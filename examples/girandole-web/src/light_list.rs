//! The names of all lights, for the shaders of `light_list.wgsl`.

use girandole::wgpu;
use girandole::{LightId, LightWorld};

/// Texels of a row, within the limits that WebGPU guarantees.
const ROW: usize = 2048;
/// The slot that shaders take for lights at infinity.
const DIRECTIONAL: u32 = u32::MAX;

/// A texture with all lights of a world.
pub struct LightList {
    pub layout: wgpu::BindGroupLayout,
    pub group: wgpu::BindGroup,
    /// The number of lights.
    pub count: u32,
    /// The numbers of instances and lights of the world that it was made for.
    of: [usize; 2],
    texture: wgpu::Texture,
}

/// A browser frees a texture when it collects garbage, which may be late.
impl Drop for LightList {
    fn drop(&mut self) {
        self.texture.destroy();
    }
}

fn counts(world: &LightWorld) -> [usize; 2] {
    [world.instances().len(), world.light_count()]
}

impl LightList {
    /// The present lights of a world. The list is out of date once instances are added or removed, or
    /// trees get other numbers of lights.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, world: &LightWorld) -> Self {
        let directional = |key| world.directionals().position(|other| other == key).map_or(0, |i| i as u32);
        let names = world.sampler().all_lights().map(|light| match light {
            LightId::Local { instance, light } => [world.slot(instance).unwrap_or_default(), light],
            LightId::Directional(key) => [DIRECTIONAL, directional(key)],
            _ => unreachable!("this version has no others"),
        });
        let mut texels: Vec<[u32; 2]> = std::iter::once([0, 0]).chain(names).collect();
        let count = texels.len() as u32 - 1;
        texels[0][0] = count;
        texels.resize(texels.len().next_multiple_of(ROW), [0, 0]);
        let size = wgpu::Extent3d { width: ROW as u32, height: (texels.len() / ROW) as u32, depth_or_array_layers: 1 };
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("light list"),
            size,
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rg32Uint,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let bytes_per_row = Some((ROW * size_of::<[u32; 2]>()) as u32);
        queue.write_texture(
            texture.as_image_copy(),
            bytemuck::cast_slice(&texels),
            wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row, rows_per_image: None },
            size,
        );
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("light list"),
            entries: &[wgpu::BindGroupLayoutEntry {
                binding: 0,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Texture {
                    sample_type: wgpu::TextureSampleType::Uint,
                    view_dimension: wgpu::TextureViewDimension::D2,
                    multisampled: false,
                },
                count: None,
            }],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("light list"),
            layout: &layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) }],
        });
        Self { layout, group, count, of: counts(world), texture }
    }

    /// Whether it names the lights of a world. The city only changes its lights together with their
    /// number.
    pub fn is_of(&self, world: &LightWorld) -> bool {
        self.of == counts(world)
    }
}
