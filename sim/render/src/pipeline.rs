//! The device-side programs and the layouts of what they read.

use bytemuck::{Pod, Zeroable};
use std::collections::BTreeMap;
use wgpu::{BindingType, ShaderStages, TextureFormat};

/// Colour as 8-bit sRGB; depth as the bits of a float, because float targets cannot be drawn to on GL, and the id beside
/// it, because every further target costs a processor that draws time.
pub(crate) const TARGET_FORMATS: [TextureFormat; 2] = [TextureFormat::Rgba8UnormSrgb, TextureFormat::Rg32Uint];
/// Bytes of a pixel of each.
pub(crate) const PIXEL_BYTES: [u32; 2] = [4, 8];
pub(crate) const DEPTH_FORMAT: TextureFormat = TextureFormat::Depth32Float;

/// A vertex as the shader reads it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct VertexRaw {
    pub position: [f32; 3],
    pub normal: [f32; 3],
}

/// An instance as the shader reads it; see `shader.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct InstanceRaw {
    pub rows: [[f32; 4]; 3],
    pub scale: [f32; 4],
    pub color: [f32; 4],
    pub pattern: [f32; 4],
    pub id: u32,
}

/// What holds for a whole frame; see `shader.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(crate) struct FrameRaw {
    pub clip_from_camera: [[f32; 4]; 4],
    pub shadow_from_camera: [[f32; 4]; 4],
    pub sun: [f32; 4],
    pub points: [[f32; 4]; crate::scene::MAX_POINT_LIGHTS],
    pub misc: [f32; 4],
}

/// How a group of instances is drawn. Patterns and back faces cost time, so only those pay that have them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Style {
    pub closed: bool,
    pub patterned: bool,
}

/// How a frame is lit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Light {
    /// Number of point lights.
    pub points: u32,
    pub shadows: bool,
}

/// All programs.
pub(crate) struct Pipelines {
    pub frame_layout: wgpu::BindGroupLayout,
    pub shadow_layout: wgpu::BindGroupLayout,
    shader: wgpu::ShaderModule,
    main_layout: wgpu::PipelineLayout,
    /// Made when they are first needed: at most 4 styles by 10 ways of being lit.
    main: BTreeMap<(Style, Light), wgpu::RenderPipeline>,
    shadow: [wgpu::RenderPipeline; 2],
}

impl Pipelines {
    pub(crate) fn new(device: &wgpu::Device) -> Pipelines {
        let shader = device.create_shader_module(wgpu::include_wgsl!("shader.wgsl"));
        let frame_layout = frame_layout(device);
        let shadow_layout = shadow_layout(device);
        let layout = |groups: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: None,
                bind_group_layouts: groups,
                immediate_size: 0,
            })
        };
        let main_layout = layout(&[Some(&frame_layout), Some(&shadow_layout)]);
        let cast_layout = layout(&[Some(&frame_layout)]);
        let shadow = [false, true].map(|closed| pipeline(device, &cast_layout, &shader, "vertex_shadow", None, closed));
        Pipelines { frame_layout, shadow_layout, shader, main_layout, main: BTreeMap::new(), shadow }
    }

    /// Makes the program for a style and light, if there is none yet.
    pub(crate) fn prepare(&mut self, device: &wgpu::Device, style: Style, light: Light) {
        self.main.entry((style, light)).or_insert_with(|| {
            let entry_point = if style.patterned { "fragment_pattern" } else { "fragment_plain" };
            let fragment = Some((entry_point, light));
            pipeline(device, &self.main_layout, &self.shader, "vertex_main", fragment, style.closed)
        });
    }

    /// The program for a style and light that it was prepared for.
    pub(crate) fn main(&self, style: Style, light: Light) -> Option<&wgpu::RenderPipeline> {
        self.main.get(&(style, light))
    }

    pub(crate) fn shadow(&self, style: Style) -> &wgpu::RenderPipeline {
        if style.closed { &self.shadow[1] } else { &self.shadow[0] }
    }
}

fn frame_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let ty = BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: wgpu::BufferSize::new(size_of::<FrameRaw>() as u64),
    };
    let visibility = ShaderStages::VERTEX_FRAGMENT;
    let entries = [wgpu::BindGroupLayoutEntry { binding: 0, visibility, ty, count: None }];
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("frame"), entries: &entries })
}

fn shadow_layout(device: &wgpu::Device) -> wgpu::BindGroupLayout {
    let entry =
        |binding, ty| wgpu::BindGroupLayoutEntry { binding, visibility: ShaderStages::FRAGMENT, ty, count: None };
    let map = BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Depth,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let sampler = BindingType::Sampler(wgpu::SamplerBindingType::Comparison);
    let entries = [entry(0, map), entry(1, sampler)];
    device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some("shadow"), entries: &entries })
}

/// One program; without a fragment entry point it draws into a shadow map.
fn pipeline(
    device: &wgpu::Device,
    layout: &wgpu::PipelineLayout,
    shader: &wgpu::ShaderModule,
    vertex: &str,
    fragment: Option<(&str, Light)>,
    closed: bool,
) -> wgpu::RenderPipeline {
    let vertex_attributes = wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3];
    let instance_attributes = wgpu::vertex_attr_array![
        2 => Float32x4, 3 => Float32x4, 4 => Float32x4, 5 => Float32x4, 6 => Float32x4, 7 => Float32x4, 8 => Uint32
    ];
    let buffer = |size: usize, step_mode, attributes| {
        Some(wgpu::VertexBufferLayout { array_stride: size as u64, step_mode, attributes })
    };
    let buffers = [
        buffer(size_of::<VertexRaw>(), wgpu::VertexStepMode::Vertex, &vertex_attributes[..]),
        buffer(size_of::<InstanceRaw>(), wgpu::VertexStepMode::Instance, &instance_attributes[..]),
    ];
    let targets = TARGET_FORMATS
        .map(|format| Some(wgpu::ColorTargetState { format, blend: None, write_mask: wgpu::ColorWrites::ALL }));
    let light = fragment.map_or(Light { points: 0, shadows: false }, |(_, light)| light);
    let constants = [("POINTS", f64::from(light.points)), ("SHADOWS", f64::from(u8::from(light.shadows)))];
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: fragment.map(|(entry_point, _)| entry_point).or(Some(vertex)),
        layout: Some(layout),
        vertex: wgpu::VertexState {
            module: shader,
            entry_point: Some(vertex),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &buffers,
        },
        primitive: wgpu::PrimitiveState {
            cull_mode: closed.then_some(wgpu::Face::Back),
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: Some(wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(true),
            depth_compare: Some(wgpu::CompareFunction::Less),
            stencil: wgpu::StencilState::default(),
            bias: wgpu::DepthBiasState::default(),
        }),
        multisample: wgpu::MultisampleState::default(),
        fragment: fragment.map(|(entry_point, _)| wgpu::FragmentState {
            module: shader,
            entry_point: Some(entry_point),
            compilation_options: wgpu::PipelineCompilationOptions {
                constants: &constants,
                ..wgpu::PipelineCompilationOptions::default()
            },
            targets: &targets,
        }),
        multiview_mask: None,
        cache: None,
    })
}
