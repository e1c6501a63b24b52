//! What a frame is drawn into, and how it comes back. Kept per image size.

use crate::pipeline::{DEPTH_FORMAT, TARGET_FORMATS};
use crate::renderer::{RenderError, Rendered};
use std::sync::mpsc;
use wgpu::{BufferUsages, TextureUsages};

/// Every pixel of every target has four bytes.
const PIXEL_BYTES: u32 = 4;

/// Targets and the readback buffer of one image size.
pub(crate) struct Targets {
    width: u32,
    height: u32,
    /// Bytes from one row to the next in the readback buffer: the device wants multiples of 256.
    pitch: u32,
    textures: [wgpu::Texture; 3],
    views: [wgpu::TextureView; 3],
    depth_test: wgpu::TextureView,
    readback: wgpu::Buffer,
}

impl Targets {
    pub(crate) fn new(device: &wgpu::Device, width: u32, height: u32) -> Targets {
        let texture = |format, usage| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: None,
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage,
                view_formats: &[],
            })
        };
        let view = |texture: &wgpu::Texture| texture.create_view(&wgpu::TextureViewDescriptor::default());
        let textures =
            TARGET_FORMATS.map(|format| texture(format, TextureUsages::RENDER_ATTACHMENT | TextureUsages::COPY_SRC));
        let pitch = (width * PIXEL_BYTES).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let readback = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: u64::from(pitch) * u64::from(height) * textures.len() as u64,
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let views = [view(&textures[0]), view(&textures[1]), view(&textures[2])];
        let depth_test = view(&texture(DEPTH_FORMAT, TextureUsages::RENDER_ATTACHMENT));
        Targets { width, height, pitch, textures, views, depth_test, readback }
    }

    pub(crate) fn is_of_size(&self, width: u32, height: u32) -> bool {
        (self.width, self.height) == (width, height)
    }

    /// Starts the pass that draws all targets; where nothing is drawn stay `background` (linear) and zeros.
    pub(crate) fn begin<'e>(
        &self,
        encoder: &'e mut wgpu::CommandEncoder,
        background: [f32; 3],
    ) -> wgpu::RenderPass<'e> {
        let [r, g, b] = background.map(f64::from);
        let clear = [wgpu::Color { r, g, b, a: 1.0 }, wgpu::Color::TRANSPARENT, wgpu::Color::TRANSPARENT];
        let attachment = |index: usize| {
            Some(wgpu::RenderPassColorAttachment {
                view: &self.views[index],
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations { load: wgpu::LoadOp::Clear(clear[index]), store: wgpu::StoreOp::Store },
            })
        };
        encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("main"),
            color_attachments: &[attachment(0), attachment(1), attachment(2)],
            depth_stencil_attachment: Some(depth_attachment(&self.depth_test, wgpu::StoreOp::Discard)),
            ..wgpu::RenderPassDescriptor::default()
        })
    }

    /// Records the copies into the readback buffer.
    pub(crate) fn copy(&self, encoder: &mut wgpu::CommandEncoder) {
        for (index, texture) in self.textures.iter().enumerate() {
            let layout = wgpu::TexelCopyBufferLayout {
                offset: self.plane_bytes() as u64 * index as u64,
                bytes_per_row: Some(self.pitch),
                rows_per_image: Some(self.height),
            };
            let target = wgpu::TexelCopyBufferInfo { buffer: &self.readback, layout };
            let size = wgpu::Extent3d { width: self.width, height: self.height, depth_or_array_layers: 1 };
            encoder.copy_texture_to_buffer(texture.as_image_copy(), target, size);
        }
    }

    /// Waits for the recorded copies and takes the pixels out.
    pub(crate) fn read(&self, device: &wgpu::Device) -> Result<Rendered, RenderError> {
        let (sender, receiver) = mpsc::sync_channel(1);
        self.readback.map_async(wgpu::MapMode::Read, .., move |result| {
            // The receiver lives until the poll below returns; without it nobody waits for the answer.
            drop(sender.send(result));
        });
        let failed = |reason: String| RenderError::Device { reason };
        device
            .poll(wgpu::PollType::Wait { submission_index: None, timeout: None })
            .map_err(|error| failed(format!("waiting for the frame: {error}")))?;
        let mapped = receiver.recv().map_err(|error| failed(format!("mapping the frame: {error}")))?;
        mapped.map_err(|error| failed(format!("mapping the frame: {error}")))?;
        let rendered = {
            let bytes =
                self.readback.get_mapped_range(..).map_err(|error| failed(format!("mapping the frame: {error}")))?;
            self.unpack(&bytes)
        };
        self.readback.unmap();
        Ok(rendered)
    }

    fn plane_bytes(&self) -> usize {
        self.pitch as usize * self.height as usize
    }

    /// Drops the row padding and the alpha channel.
    fn unpack(&self, bytes: &[u8]) -> Rendered {
        let row_bytes = (self.width * PIXEL_BYTES) as usize;
        let rows = |plane: usize| {
            bytes.chunks_exact(self.pitch as usize).skip(plane * self.height as usize).take(self.height as usize)
        };
        let pixels = self.width as usize * self.height as usize;
        let mut color = vec![0; 3 * pixels];
        for (from, to) in rows(0).zip(color.chunks_exact_mut(3 * self.width as usize)) {
            for (rgba, rgb) in from.chunks_exact(4).zip(to.chunks_exact_mut(3)) {
                rgb.copy_from_slice(&rgba[..3]);
            }
        }
        let mut depth = vec![0f32; pixels];
        for (from, to) in rows(1).zip(depth.chunks_exact_mut(self.width as usize)) {
            bytemuck::cast_slice_mut(to).copy_from_slice(&from[..row_bytes]);
        }
        let mut ids = vec![0u32; pixels];
        for (from, to) in rows(2).zip(ids.chunks_exact_mut(self.width as usize)) {
            bytemuck::cast_slice_mut(to).copy_from_slice(&from[..row_bytes]);
        }
        Rendered { width: self.width, height: self.height, color, depth, ids }
    }
}

/// A depth buffer that starts empty.
pub(crate) fn depth_attachment(
    view: &wgpu::TextureView,
    store: wgpu::StoreOp,
) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations { load: wgpu::LoadOp::Clear(1.0), store }),
        stencil_ops: None,
    }
}
