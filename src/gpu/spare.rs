//! Small resources that frames of a device share, so that a frame creates none.

use std::sync::atomic::AtomicBool;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, PoisonError};

use super::device::Gpu;

/// Passes per query set.
pub(super) const PASSES: usize = 256;

/// The resources that no frame uses at the moment.
#[derive(Default)]
pub(crate) struct Spare {
    stamps: Mutex<Vec<Stamps>>,
    trays: Mutex<Vec<wgpu::Buffer>>,
    draws: AtomicBool,
}

/// Queries of timestamps, and the buffer that they are resolved to.
pub(super) struct Stamps {
    pub queries: wgpu::QuerySet,
    pub resolved: wgpu::Buffer,
}

impl Spare {
    /// Returns a buffer that the host maps to read `bytes`.
    pub(super) fn tray(&self, gpu: &Gpu, bytes: u64) -> wgpu::Buffer {
        // A poisoned lock means that another thread panicked; the list is intact.
        let mut trays = self.trays.lock().unwrap_or_else(PoisonError::into_inner);
        let known = trays.iter().position(|tray| tray.size() >= bytes);
        known.map(|known| trays.swap_remove(known)).unwrap_or_else(|| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("tray"),
                size: bytes.next_power_of_two().max(1 << 10),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        })
    }

    /// Takes back a buffer that [`tray`](Self::tray) returned.
    pub(super) fn keep(&self, tray: wgpu::Buffer) {
        self.trays.lock().unwrap_or_else(PoisonError::into_inner).push(tray);
    }

    /// Returns queries for [`PASSES`] passes.
    pub(super) fn stamps(&self, gpu: &Gpu) -> Stamps {
        let known = self.stamps.lock().unwrap_or_else(PoisonError::into_inner).pop();
        known.unwrap_or_else(|| Stamps {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * PASSES as u32,
            }),
            resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("timestamps"),
                size: 16 * PASSES as u64,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
        })
    }

    /// Takes back queries that [`stamps`](Self::stamps) returned.
    pub(super) fn keep_stamps(&self, stamps: Vec<Stamps>) {
        self.stamps.lock().unwrap_or_else(PoisonError::into_inner).extend(stamps);
    }

    /// Notes that the device has a pipeline that draws.
    pub(super) fn will_draw(&self) {
        self.draws.store(true, Relaxed);
    }

    /// Whether the device has a pipeline that draws.
    pub(super) fn draws(&self) -> bool {
        self.draws.load(Relaxed)
    }
}
