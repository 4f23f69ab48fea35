//! A Radeon RX 6800 (RDNA 2) that is not there: Mesa's RADV compiles for it without hardware. wgpu
//! does not open such a device, as it has no memory, so Vulkan is called directly.

#![allow(unsafe_code)]

use std::ffi::{CStr, CString};

use ash::{Device, Entry, Instance, ext, khr, vk};
use epsplat::low_level::gpu::ahead::Translated;
use serde::{Deserialize, Serialize};

/// The resources that the driver's compiler allocates for a kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Figures {
    /// Vector registers per lane.
    pub vgprs: u64,
    /// Twice the most subgroups ("waves") of 64 lanes that a SIMD holds at a time.
    pub waves: u64,
    /// Bytes of memory per subgroup for arrays and registers that do not fit.
    pub scratch: u64,
    /// Registers that the compiler moved to memory or to other registers.
    pub spills: u64,
    /// Number of instructions.
    pub instructions: u64,
}

/// The open device.
pub struct Card {
    device: Device,
    statistics: khr::pipeline_executable_properties::Device,
    /// Names of device and driver, and the driver's version.
    pub driver: String,
    /// The library, which must stay loaded.
    _loaded: (Entry, Instance),
}

impl Card {
    /// Opens the device with the features that wgpu enables on such a card.
    ///
    /// # Errors
    /// A message if there is no Vulkan loader, no such device, or a feature is missing.
    pub fn open() -> Result<Self, String> {
        let failed = |e: vk::Result| format!("Vulkan has no such device: {e}");
        // SAFETY: the loader is the system's, and initialises itself when it is loaded.
        let entry = unsafe { Entry::load() }.map_err(|e| format!("there is no Vulkan loader: {e}"))?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
        let create = vk::InstanceCreateInfo::default().application_info(&application);
        // SAFETY: the structures and what they point to live through each call, and all handles
        // are those of this instance.
        unsafe {
            let instance = entry.create_instance(&create, None).map_err(failed)?;
            let physical = instance.enumerate_physical_devices().map_err(failed)?;
            let physical = *physical.first().ok_or("Vulkan has no device")?;
            let mut named = vk::PhysicalDeviceDriverProperties::default();
            let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut named);
            instance.get_physical_device_properties2(physical, &mut properties);
            let text = |name: Result<&CStr, _>| name.map_or_else(|_| String::new(), |n| n.to_string_lossy().into());
            let device = text(properties.properties.device_name_as_c_str());
            let driver = format!("{device}, {}", text(named.driver_info_as_c_str()));
            let device = device_of(&instance, physical).map_err(failed)?;
            let statistics = khr::pipeline_executable_properties::Device::new(&instance, &device);
            Ok(Self { device, statistics, driver, _loaded: (entry, instance) })
        }
    }

    /// Compiles a kernel as wgpu does, and returns the compiler's figures.
    ///
    /// # Errors
    /// An error of the driver.
    pub fn compile(&self, kernel: &Translated) -> Result<Figures, vk::Result> {
        let device = &self.device;
        let bindings: Vec<_> = kernel.entries.iter().map(binding).collect();
        let name = CString::new(kernel.name).unwrap();
        // SAFETY: `naga` wrote the words from a module that it validated, and the layout has the
        // bindings of that module. The structures live through each call. Objects are destroyed
        // after their last use.
        unsafe {
            let layout = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            let set = device.create_descriptor_set_layout(&layout, None)?;
            let sets = [set];
            let layout =
                device.create_pipeline_layout(&vk::PipelineLayoutCreateInfo::default().set_layouts(&sets), None)?;
            let module =
                device.create_shader_module(&vk::ShaderModuleCreateInfo::default().code(&kernel.words), None)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .flags(vk::PipelineShaderStageCreateFlags::ALLOW_VARYING_SUBGROUP_SIZE)
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(&name);
            let pipeline = vk::ComputePipelineCreateInfo::default()
                .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR)
                .layout(layout)
                .stage(stage);
            let made = device.create_compute_pipelines(vk::PipelineCache::null(), &[pipeline], None);
            let pipeline = made.map_err(|(_, e)| e)?[0];
            let of = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
            let all = self.statistics.get_pipeline_executable_statistics(&of)?;
            // RADV's statistics are all of 64 bits.
            let value = |name: &str| {
                let named = |one: &&vk::PipelineExecutableStatisticKHR<'_>| {
                    one.name_as_c_str().is_ok_and(|own| own.to_bytes() == name.as_bytes())
                };
                all.iter().find(named).map_or_else(|| panic!("the driver has no statistic {name}"), |one| one.value.u64)
            };
            let figures = Figures {
                vgprs: value("VGPRs"),
                waves: value("Subgroups per SIMD"),
                scratch: value("Scratch size"),
                spills: value("Spilled VGPRs") + value("Spilled SGPRs"),
                instructions: value("Instructions"),
            };
            device.destroy_pipeline(pipeline, None);
            device.destroy_shader_module(module, None);
            device.destroy_pipeline_layout(layout, None);
            device.destroy_descriptor_set_layout(set, None);
            Ok(figures)
        }
    }
}

/// Opens a device with the features and extensions that change what wgpu's kernels compile to.
///
/// # Safety
/// `physical` must be a device of `instance`.
unsafe fn device_of(instance: &Instance, physical: vk::PhysicalDevice) -> Result<Device, vk::Result> {
    let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
    let extensions = [khr::pipeline_executable_properties::NAME.as_ptr(), ext::robustness2::NAME.as_ptr()];
    let mut statistics =
        vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
    let mut robust =
        vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true).robust_image_access2(true);
    let mut atomics = vk::PhysicalDeviceVulkan12Features::default()
        .shader_buffer_int64_atomics(true)
        .shader_shared_int64_atomics(true);
    let mut subgroups =
        vk::PhysicalDeviceVulkan13Features::default().subgroup_size_control(true).robust_image_access(true);
    let core = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true).shader_int64(true);
    let create = vk::DeviceCreateInfo::default()
        .queue_create_infos(&queues)
        .enabled_extension_names(&extensions)
        .enabled_features(&core)
        .push_next(&mut statistics)
        .push_next(&mut robust)
        .push_next(&mut atomics)
        .push_next(&mut subgroups);
    // SAFETY: the structures live through the call, and the caller answers for the device.
    unsafe { instance.create_device(physical, &create, None) }
}

fn binding(entry: &wgpu::BindGroupLayoutEntry) -> vk::DescriptorSetLayoutBinding<'static> {
    let kind = match entry.ty {
        wgpu::BindingType::Buffer { ty: wgpu::BufferBindingType::Uniform, .. } => vk::DescriptorType::UNIFORM_BUFFER,
        wgpu::BindingType::Buffer { .. } => vk::DescriptorType::STORAGE_BUFFER,
        wgpu::BindingType::Texture { .. } => vk::DescriptorType::SAMPLED_IMAGE,
        _ => panic!("{:?} is neither a buffer nor a texture", entry.ty),
    };
    vk::DescriptorSetLayoutBinding::default()
        .binding(entry.binding)
        .descriptor_type(kind)
        .descriptor_count(1)
        .stage_flags(vk::ShaderStageFlags::COMPUTE)
}
