//! The rasteriser that the twin lacks. Passes fail when they begin, so nothing that they record
//! takes place.

use std::ops::Range;

use wgpu::custom as api;

/// A render pass, or an encoder of bundles, that draws nothing.
#[derive(Debug)]
pub(super) struct NoRaster;

/// A bundle that draws nothing.
#[derive(Debug)]
struct NoBundle;

impl api::RenderBundleInterface for NoBundle {}

impl Drop for NoRaster {
    fn drop(&mut self) {}
}

impl api::RenderPassInterface for NoRaster {
    fn set_pipeline(&mut self, _: &api::DispatchRenderPipeline) {}

    fn set_bind_group(&mut self, _: u32, _: Option<&api::DispatchBindGroup>, _: &[wgpu::DynamicOffset]) {}

    fn set_index_buffer(&mut self, _: &api::DispatchBuffer, _: wgpu::IndexFormat, _: u64, _: Option<wgpu::BufferSize>) {
    }

    fn set_vertex_buffer(&mut self, _: u32, _: Option<&api::DispatchBuffer>, _: u64, _: Option<wgpu::BufferSize>) {}

    fn set_immediates(&mut self, _: u32, _: &[u8]) {}

    fn set_blend_constant(&mut self, _: wgpu::Color) {}

    fn set_scissor_rect(&mut self, _: u32, _: u32, _: u32, _: u32) {}

    fn set_viewport(&mut self, _: f32, _: f32, _: f32, _: f32, _: f32, _: f32) {}

    fn set_stencil_reference(&mut self, _: u32) {}

    fn draw(&mut self, _: Range<u32>, _: Range<u32>) {}

    fn draw_indexed(&mut self, _: Range<u32>, _: i32, _: Range<u32>) {}

    fn draw_mesh_tasks(&mut self, _: u32, _: u32, _: u32) {}

    fn draw_indirect(&mut self, _: &api::DispatchBuffer, _: u64) {}

    fn draw_indexed_indirect(&mut self, _: &api::DispatchBuffer, _: u64) {}

    fn draw_mesh_tasks_indirect(&mut self, _: &api::DispatchBuffer, _: u64) {}

    fn multi_draw_indirect(&mut self, _: &api::DispatchBuffer, _: u64, _: u32) {}

    fn multi_draw_indexed_indirect(&mut self, _: &api::DispatchBuffer, _: u64, _: u32) {}

    fn multi_draw_indirect_count(&mut self, _: &api::DispatchBuffer, _: u64, _: &api::DispatchBuffer, _: u64, _: u32) {}

    fn multi_draw_mesh_tasks_indirect(&mut self, _: &api::DispatchBuffer, _: u64, _: u32) {}

    fn multi_draw_indexed_indirect_count(
        &mut self,
        _: &api::DispatchBuffer,
        _: u64,
        _: &api::DispatchBuffer,
        _: u64,
        _: u32,
    ) {
    }

    fn multi_draw_mesh_tasks_indirect_count(
        &mut self,
        _: &api::DispatchBuffer,
        _: u64,
        _: &api::DispatchBuffer,
        _: u64,
        _: u32,
    ) {
    }

    fn insert_debug_marker(&mut self, _: &str) {}

    fn push_debug_group(&mut self, _: &str) {}

    fn pop_debug_group(&mut self) {}

    fn write_timestamp(&mut self, _: &api::DispatchQuerySet, _: u32) {}

    fn begin_occlusion_query(&mut self, _: u32) {}

    fn end_occlusion_query(&mut self) {}

    fn begin_pipeline_statistics_query(&mut self, _: &api::DispatchQuerySet, _: u32) {}

    fn end_pipeline_statistics_query(&mut self) {}

    fn execute_bundles(&mut self, _: &mut dyn Iterator<Item = &api::DispatchRenderBundle>) {}
}

impl api::RenderBundleEncoderInterface for NoRaster {
    fn set_pipeline(&mut self, _: &api::DispatchRenderPipeline) {}

    fn set_bind_group(&mut self, _: u32, _: Option<&api::DispatchBindGroup>, _: &[wgpu::DynamicOffset]) {}

    fn set_index_buffer(&mut self, _: &api::DispatchBuffer, _: wgpu::IndexFormat, _: u64, _: Option<wgpu::BufferSize>) {
    }

    fn set_vertex_buffer(&mut self, _: u32, _: Option<&api::DispatchBuffer>, _: u64, _: Option<wgpu::BufferSize>) {}

    fn set_immediates(&mut self, _: u32, _: &[u8]) {}

    fn draw(&mut self, _: Range<u32>, _: Range<u32>) {}

    fn draw_indexed(&mut self, _: Range<u32>, _: i32, _: Range<u32>) {}

    fn draw_indirect(&mut self, _: &api::DispatchBuffer, _: u64) {}

    fn draw_indexed_indirect(&mut self, _: &api::DispatchBuffer, _: u64) {}

    fn finish(self, _: &wgpu::RenderBundleDescriptor<'_>) -> api::DispatchRenderBundle {
        api::DispatchRenderBundle::custom(NoBundle)
    }

    fn finish_boxed(self: Box<Self>, _: &wgpu::RenderBundleDescriptor<'_>) -> api::DispatchRenderBundle {
        api::DispatchRenderBundle::custom(NoBundle)
    }
}
