//! RADV on a chip that is not there, and what it says of a pipeline.

#![allow(unsafe_code, reason = "Vulkan is an unsafe interface")]

use super::translate::Translated;
use ash::{ext, khr, vk};
use std::collections::BTreeMap;
use std::error::Error;
use std::ffi::CString;
use std::fs;
use std::path::PathBuf;

/// The variable that names the chip, and the one that names the driver's manifest.
pub const CHIP_VARIABLE: &str = "RADV_FORCE_FAMILY";
/// See [`CHIP_VARIABLE`].
pub const MANIFEST_VARIABLE: &str = "VK_DRIVER_FILES";

/// Where drivers leave their manifests.
const FOLDERS: [&str; 3] = ["/usr/share/vulkan/icd.d", "/usr/local/share/vulkan/icd.d", "/etc/vulkan/icd.d"];

/// The manifest of RADV; `None` where it is not installed.
pub fn manifest() -> Option<PathBuf> {
    let files = FOLDERS.iter().filter_map(|folder| fs::read_dir(folder).ok()).flatten();
    let mut found: Vec<PathBuf> = files
        .filter_map(|file| Some(file.ok()?.path()))
        .filter(|path| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with("radeon_icd") && name.contains(std::env::consts::ARCH)
        })
        .collect();
    found.sort();
    found.pop()
}

/// What the compiler says of a pipeline, by the names that RADV gives.
pub type Statistics = BTreeMap<String, f64>;

/// A device that compiles and runs nothing.
pub struct NullDevice {
    device: ash::Device,
    executables: khr::pipeline_executable_properties::Device,
    // Holds the loader's library open.
    _entry: ash::Entry,
}

impl NullDevice {
    /// Opens the device that the environment names.
    pub fn open() -> Result<Self, Box<dyn Error>> {
        // SAFETY: the calls follow the specification, on handles that were made just before. Nothing
        // is destroyed: the process ends soon.
        unsafe {
            let entry = ash::Entry::load()?;
            let app = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let instance = entry.create_instance(&vk::InstanceCreateInfo::default().application_info(&app), None)?;
            let physical = *instance.enumerate_physical_devices()?.first().ok_or("RADV shows no device")?;
            let queue = [vk::DeviceQueueCreateInfo::default().queue_family_index(0).queue_priorities(&[1.0])];
            let extensions = [khr::pipeline_executable_properties::NAME.as_ptr(), ext::robustness2::NAME.as_ptr()];
            let features = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
            let mut robustness = vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true);
            let mut memory_model = vk::PhysicalDeviceVulkanMemoryModelFeatures::default().vulkan_memory_model(true);
            let mut zero = vk::PhysicalDeviceZeroInitializeWorkgroupMemoryFeatures::default()
                .shader_zero_initialize_workgroup_memory(true);
            let mut info =
                vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
            let create = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queue)
                .enabled_extension_names(&extensions)
                .enabled_features(&features)
                .push_next(&mut robustness)
                .push_next(&mut memory_model)
                .push_next(&mut zero)
                .push_next(&mut info);
            let device = instance.create_device(physical, &create, None)?;
            let executables = khr::pipeline_executable_properties::Device::new(&instance, &device);
            Ok(Self { device, executables, _entry: entry })
        }
    }

    /// Compiles a pipeline.
    pub fn statistics(&self, shader: &Translated, entry: &str) -> Result<Statistics, Box<dyn Error>> {
        let mut groups: BTreeMap<u32, Vec<vk::DescriptorSetLayoutBinding<'_>>> = BTreeMap::new();
        for buffer in &shader.buffers {
            let kind = match buffer.is_uniform {
                true => vk::DescriptorType::UNIFORM_BUFFER,
                false => vk::DescriptorType::STORAGE_BUFFER,
            };
            let binding = vk::DescriptorSetLayoutBinding::default()
                .binding(buffer.binding)
                .descriptor_type(kind)
                .descriptor_count(1)
                .stage_flags(vk::ShaderStageFlags::COMPUTE);
            groups.entry(buffer.group).or_default().push(binding);
        }
        let last = groups.keys().max().copied().unwrap_or(0);
        let name = CString::new(entry)?;
        // SAFETY: as above; the words are a valid module, which naga has written.
        unsafe {
            let module =
                self.device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&shader.words), None)?;
            let set = |group: u32| {
                let bindings = groups.get(&group).map_or(&[][..], Vec::as_slice);
                let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(bindings);
                self.device.create_descriptor_set_layout(&info, None)
            };
            let sets = (0..=last).map(set).collect::<Result<Vec<_>, _>>()?;
            let layout = self
                .device
                .create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().set_layouts(&sets), None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(&name);
            let info = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .stage(stage)
                .layout(layout);
            let pipelines = self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            self.read(*pipelines.map_err(|(_, error)| error)?.first().ok_or("no pipeline was made")?)
        }
    }

    fn read(&self, pipeline: vk::Pipeline) -> Result<Statistics, Box<dyn Error>> {
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(0);
        // SAFETY: the pipeline was made with statistics, and the format tells which field is set.
        unsafe {
            let mut found = Statistics::new();
            for statistic in self.executables.get_pipeline_executable_statistics(&info)? {
                let value = match statistic.format {
                    vk::PipelineExecutableStatisticFormatKHR::UINT64 => statistic.value.u64 as f64,
                    vk::PipelineExecutableStatisticFormatKHR::INT64 => statistic.value.i64 as f64,
                    vk::PipelineExecutableStatisticFormatKHR::BOOL32 => f64::from(statistic.value.b32),
                    _ => statistic.value.f64,
                };
                found.insert(statistic.name_as_c_str()?.to_string_lossy().into_owned(), value);
            }
            Ok(found)
        }
    }
}
