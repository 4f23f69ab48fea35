//! The device of a user's own program.

use super::adapter::{AdapterDescription, lacking};
use super::device::{Gpu, wanted_by_kernels};
use super::twin::{self, Tally};
use crate::error::{Error, Result};

impl Gpu {
    /// The features of `adapter` that make rendering faster: 64-bit integers and atomics, f32
    /// atomics, subgroups, kernels in SPIR-V and, on software adapters, buffers that the host maps.
    /// A program that opens its own device for [`from_wgpu`](Self::from_wgpu) requests them beside
    /// its own.
    ///
    /// No feature is required. Two more are used if the device has them: `TIMESTAMP_QUERY` for the
    /// times of passes, and `FLOAT32_BLENDABLE` for the rasteriser's `rgba32float`.
    pub fn features(adapter: &wgpu::Adapter) -> wgpu::Features {
        adapter.features() & wanted_by_kernels(&AdapterDescription::of(adapter))
    }

    /// The limits that a program requests for a device that renders, as far as `adapter` grants
    /// them: those of core WebGPU, and the adapter's own sizes of buffers, dispatches and workgroup
    /// memory. Smaller buffers cut large scenes and images into more pieces.
    pub fn limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
        let granted = adapter.limits();
        wgpu::Limits {
            max_storage_buffer_binding_size: granted.max_storage_buffer_binding_size,
            max_buffer_size: granted.max_buffer_size,
            max_compute_workgroups_per_dimension: granted.max_compute_workgroups_per_dimension,
            max_compute_workgroup_storage_size: granted.max_compute_workgroup_storage_size,
            max_uniform_buffer_binding_size: granted.max_uniform_buffer_binding_size,
            max_texture_dimension_2d: granted.max_texture_dimension_2d,
            max_color_attachment_bytes_per_sample: granted.max_color_attachment_bytes_per_sample,
            ..wgpu::Limits::default().or_worse_values_from(&granted)
        }
    }

    /// Renders on the `device` of a user's own program, which `adapter` gave.
    ///
    /// Everything optional is used only if the device, not just the adapter, has it: request
    /// [`features`](Self::features) and [`limits`](Self::limits). The handlers of errors and of the
    /// device's loss stay those of the program.
    ///
    /// ```no_run
    /// use epsplat::{Gpu, wgpu};
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// let descriptor = wgpu::InstanceDescriptor::new_without_display_handle_from_env();
    /// let instance = wgpu::Instance::new(descriptor);
    /// let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
    /// let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
    ///     required_features: Gpu::features(&adapter),
    ///     required_limits: Gpu::limits(&adapter),
    ///     ..Default::default()
    /// }))?;
    /// let gpu = Gpu::from_wgpu(&adapter, device.clone(), queue.clone())?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`Error::Gpu`] if the device lacks what rendering cannot do without; the sentence names it.
    pub fn from_wgpu(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self> {
        let (able, limits) = (adapter.get_downlevel_capabilities().flags, device.limits());
        let described = AdapterDescription::with(adapter, device.features(), &limits);
        if let Some(what) = lacking(able, &limits) {
            let what = format!("the device has {what}: request the limits that Gpu::limits gives");
            return Err(Error::Gpu { adapter: described.name, what });
        }
        let software = described.is_software();
        let gpu = Self::unwatched(described, device, queue);
        if software {
            // The program may draw triangles, after which Mesa's timestamps are wrong.
            gpu.spare.will_draw();
        }
        Ok(gpu)
    }

    /// Returns what the kernels have done since the last call, if this is the f32 twin; other
    /// devices do not count.
    pub fn tally(&self) -> Option<Tally> {
        twin::tally(&self.device)
    }

    /// The device, which clones share.
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// The queue of the device.
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }
}
