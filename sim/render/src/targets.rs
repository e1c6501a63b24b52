//! What a frame is drawn into, and how it comes back. Kept per image size.

use crate::pipeline::{DEPTH_FORMAT, PIXEL_BYTES, TARGET_FORMATS};
use crate::renderer::{RenderError, Rendered};
use std::sync::mpsc;
use wgpu::{BufferUsages, TextureUsages};

/// Targets and the readback buffer of one image size.
pub(crate) struct Targets {
    width: u32,
    height: u32,
    /// Bytes from one row of each target to its next in the readback buffer: the device wants multiples of 256.
    pitches: [u32; 2],
    textures: [wgpu::Texture; 2],
    views: [wgpu::TextureView; 2],
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
        let pitches = PIXEL_BYTES.map(|bytes| (width * bytes).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT));
        let readback = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("readback"),
            size: pitches.iter().map(|pitch| u64::from(*pitch) * u64::from(height)).sum(),
            usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        let views = [view(&textures[0]), view(&textures[1])];
        let depth_test = view(&texture(DEPTH_FORMAT, TextureUsages::RENDER_ATTACHMENT));
        Targets { width, height, pitches, textures, views, depth_test, readback }
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
        let clear = [wgpu::Color { r, g, b, a: 1.0 }, wgpu::Color::TRANSPARENT];
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
            color_attachments: &[attachment(0), attachment(1)],
            depth_stencil_attachment: Some(depth_attachment(&self.depth_test, wgpu::StoreOp::Discard)),
            ..wgpu::RenderPassDescriptor::default()
        })
    }

    /// Records the copies into the readback buffer.
    pub(crate) fn copy(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut offset = 0;
        for (texture, pitch) in self.textures.iter().zip(self.pitches) {
            let layout =
                wgpu::TexelCopyBufferLayout { offset, bytes_per_row: Some(pitch), rows_per_image: Some(self.height) };
            offset += u64::from(pitch) * u64::from(self.height);
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

    /// Drops the row padding and the alpha channel, and parts depth from ids.
    fn unpack(&self, bytes: &[u8]) -> Rendered {
        let (width, height) = (self.width as usize, self.height as usize);
        let [color_pitch, depth_pitch] = self.pitches.map(|pitch| pitch as usize);
        let (colors, depths) = bytes.split_at(color_pitch * height);
        let mut color = vec![0; 3 * width * height];
        for (from, to) in colors.chunks_exact(color_pitch).zip(color.chunks_exact_mut(3 * width)) {
            for ([r, g, b, _], to) in from.as_chunks().0.iter().zip(to.as_chunks_mut().0) {
                *to = [*r, *g, *b];
            }
        }
        let (mut depth, mut ids) = (Vec::with_capacity(width * height), Vec::with_capacity(width * height));
        for row in depths.chunks_exact(depth_pitch) {
            let pixels: &[[u32; 2]] = bytemuck::cast_slice(&row[..8 * width]);
            depth.extend(pixels.iter().map(|[bits, _]| f32::from_bits(*bits)));
            ids.extend(pixels.iter().map(|[_, id]| *id));
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
