//! The renderer: one device, its programs, and caches of meshes and targets.

use crate::{
    adapter::{self, AdapterReport},
    batch::{Batches, MeshCache, linear},
    pipeline::{DEPTH_FORMAT, FrameRaw, InstanceRaw, Light, Pipelines},
    projection::clip_from_camera,
    scene::{Lighting, MAX_INSTANCES, MAX_POINT_LIGHTS, MAX_SHADOW_MAP, MAX_TRIANGLES, Scene},
    shadow::{self, ShadowView},
    targets::{Targets, depth_attachment},
};
use acm_concept::{
    camera::{CameraModel, MAX_PIXELS},
    pose::Pose,
};
use glam::DMat4;
use std::{
    f32::consts::PI,
    sync::{Arc, Mutex, PoisonError},
};
use thiserror::Error;
use wgpu::{BufferUsages, TextureUsages};

/// Most image sizes whose targets are kept.
const MAX_KEPT_SIZES: usize = 8;
/// Shadow look-ups move this many texels off the surface: enough that a surface does not shadow itself.
const SHADOW_OFFSET_TEXELS: f64 = 1.5;

/// Draws scenes as RGB-D images with instance ids. Expensive to make (tens of milliseconds, and the first frame
/// compiles the programs), cheap to use: share one. [`Renderer::render`] blocks while the device works.
pub struct Renderer {
    report: AdapterReport,
    device: wgpu::Device,
    queue: wgpu::Queue,
    pipelines: Pipelines,
    meshes: MeshCache,
    targets: Vec<Targets>,
    instances: wgpu::Buffer,
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    shadow: ShadowMap,
    /// What the device complained about since the last look. Its default is to panic.
    complaint: Arc<Mutex<Option<String>>>,
}

/// A frame as an ideal camera would see it. Row by row from the top left.
#[derive(Debug, Clone, PartialEq)]
pub struct Rendered {
    /// Image width, pixels.
    pub width: u32,
    /// Image height, pixels.
    pub height: u32,
    /// 8-bit sRGB, `3 * width * height` values.
    pub color: Vec<u8>,
    /// Metres along the optical axis, `width * height` values; 0 where nothing is seen.
    pub depth: Vec<f32>,
    /// [`crate::Instance::id`] of what is seen, `width * height` values; 0 where nothing is seen.
    pub ids: Vec<u32>,
}

/// Why there is no renderer.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RendererError {
    /// No driver, or none that works.
    #[error(
        "no graphics adapter can render here ({tried}). A software driver is enough: on Debian or Ubuntu install \
         either `libegl1 libegl-mesa0 libgl1-mesa-dri` (OpenGL) or `mesa-vulkan-drivers` (Vulkan)"
    )]
    NoAdapter {
        /// The adapters that were tried, and what each answered.
        tried: String,
    },
}

/// Why a frame could not be drawn.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum RenderError {
    /// The camera model makes no image.
    #[error("camera `{camera}` cannot be rendered: {reason}")]
    Camera {
        /// The camera's name.
        camera: String,
        /// What is wrong with it.
        reason: String,
    },
    /// An instance cannot be drawn.
    #[error("instance {index} (mesh `{mesh}`, id {id}) cannot be drawn: {reason}")]
    Instance {
        /// Its place in the scene.
        index: usize,
        /// Its mesh.
        mesh: String,
        /// Its id.
        id: u32,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// The lights are not finite, or the sun has no direction.
    #[error("the scene's lights cannot be used: {reason}")]
    Lights {
        /// What is wrong with them.
        reason: &'static str,
    },
    /// The scene has too much of something.
    #[error("the scene has {count} {what}, the limit is {limit}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// The device or its driver failed.
    #[error("the graphics device failed: {reason}")]
    Device {
        /// What it said.
        reason: String,
    },
}

struct ShadowMap {
    size: u32,
    view: wgpu::TextureView,
    group: wgpu::BindGroup,
}

impl Renderer {
    /// Takes the best adapter that works; see [`crate::adapters`] for the order.
    ///
    /// # Errors
    /// No adapter works: the error says what to install.
    pub fn new() -> Result<Renderer, RendererError> {
        Renderer::on_first(|_| true)
    }

    /// The best adapter of one backend, `vulkan` or `gl`: to compare drivers.
    ///
    /// # Errors
    /// As [`Renderer::new`].
    pub fn by(backend: &str) -> Result<Renderer, RendererError> {
        Renderer::on_first(|report| report.backend == backend)
    }

    fn on_first(wanted: impl Fn(&AdapterReport) -> bool) -> Result<Renderer, RendererError> {
        let mut tried = Vec::new();
        for adapter in adapter::candidates() {
            let report = adapter::report(&adapter.get_info());
            if !wanted(&report) {
                continue;
            }
            let limits = wgpu::Limits::downlevel_defaults().using_resolution(adapter.limits());
            let descriptor = wgpu::DeviceDescriptor { required_limits: limits, ..wgpu::DeviceDescriptor::default() };
            match pollster::block_on(adapter.request_device(&descriptor)) {
                Ok((device, queue)) => return Ok(Renderer::on(report, device, queue)),
                Err(error) => tried.push(format!("{} on {}: {error}", report.name, report.backend)),
            }
        }
        if tried.is_empty() {
            tried.push("neither Vulkan nor OpenGL through EGL offers one".into());
        }
        Err(RendererError::NoAdapter { tried: tried.join("; ") })
    }

    fn on(report: AdapterReport, device: wgpu::Device, queue: wgpu::Queue) -> Renderer {
        let complaint = Arc::new(Mutex::new(None));
        let sink = complaint.clone();
        device.on_uncaptured_error(Arc::new(move |error| {
            sink.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        let pipelines = Pipelines::new(&device);
        let frame = buffer(&device, "frame", size_of::<FrameRaw>() as u64, BufferUsages::UNIFORM);
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &pipelines.frame_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() }],
        });
        let instances = buffer(&device, "instances", 64 * size_of::<InstanceRaw>() as u64, BufferUsages::VERTEX);
        let shadow = ShadowMap::new(&device, &pipelines, 1);
        let (meshes, targets) = (MeshCache::default(), Vec::new());
        Renderer { report, device, queue, pipelines, meshes, targets, instances, frame, frame_group, shadow, complaint }
    }

    /// The device that draws.
    pub fn adapter(&self) -> &AdapterReport {
        &self.report
    }

    /// Draws the scene as `camera` sees it: its pose and intrinsics are taken as the *true* ones. Surfaces between
    /// 0.01 m and 30 m are drawn; the model's own depth limits are the sensor's business and ignored here.
    ///
    /// # Errors
    /// A camera, instance or light that makes no sense; a scene over its limits; a failure of the device.
    pub fn render(&mut self, scene: &Scene, camera: &CameraModel) -> Result<Rendered, RenderError> {
        self.check_camera(camera)?;
        check_instances(scene)?;
        check_lights(&scene.lights)?;
        self.meshes.sweep();
        let camera_from_world = camera.pose.inverse();
        let batches = Batches::new(&mut self.meshes, &self.device, scene, &camera_from_world);
        let sun = &scene.lights.sun;
        let casts = sun.shadow_map > 0 && sun.intensity > 0.0;
        let view = if casts { shadow::fit(&batches.boxes, camera, sun) } else { None };
        if view.is_some() && self.shadow.size != sun.shadow_map {
            self.shadow = ShadowMap::new(&self.device, &self.pipelines, sun.shadow_map);
        }
        let frame = frame_raw(&scene.lights, camera, &camera_from_world, view.as_ref());
        self.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        self.upload_instances(&batches.instances);

        let target = self.target(camera.intrinsics.width, camera.intrinsics.height);
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        if view.is_some() {
            self.draw_shadow(&mut encoder, &batches);
        }
        let light = Light { points: scene.lights.points.len() as u32, shadows: view.is_some() };
        for draw in &batches.draws {
            self.pipelines.prepare(&self.device, draw.style, light);
        }
        self.draw_main(&mut encoder, &batches, &self.targets[target], linear(scene.background), light);
        self.targets[target].copy(&mut encoder);
        self.queue.submit([encoder.finish()]);
        let rendered = self.targets[target].read(&self.device);
        match self.complaint.lock().unwrap_or_else(PoisonError::into_inner).take() {
            Some(reason) => Err(RenderError::Device { reason }),
            None => rendered,
        }
    }

    fn check_camera(&self, camera: &CameraModel) -> Result<(), RenderError> {
        let i = &camera.intrinsics;
        let limit = self.device.limits().max_texture_dimension_2d;
        let refuse = |reason: String| Err(RenderError::Camera { camera: camera.name.clone(), reason });
        if i.width == 0 || i.height == 0 || i.width > limit || i.height > limit || i.pixels() > MAX_PIXELS {
            return refuse(format!("{} x {} pixels; each edge may have 1 to {limit}", i.width, i.height));
        }
        if !(i.fx > 0.0 && i.fy > 0.0 && [i.fx, i.fy, i.cx, i.cy].iter().all(|value| value.is_finite())) {
            return refuse(format!(
                "fx {}, fy {}, cx {}, cy {}; focal lengths must be positive",
                i.fx, i.fy, i.cx, i.cy
            ));
        }
        if !camera.pose.is_valid() {
            return refuse("its pose is not a rigid motion".into());
        }
        Ok(())
    }

    fn upload_instances(&mut self, instances: &[InstanceRaw]) {
        let bytes: &[u8] = bytemuck::cast_slice(instances);
        if self.instances.size() < bytes.len() as u64 {
            let size = (bytes.len() as u64).next_power_of_two();
            self.instances = buffer(&self.device, "instances", size, BufferUsages::VERTEX);
        }
        self.queue.write_buffer(&self.instances, 0, bytes);
    }

    /// Index of the targets for an image size. The oldest size goes when there are too many.
    fn target(&mut self, width: u32, height: u32) -> usize {
        if let Some(index) = self.targets.iter().position(|target| target.is_of_size(width, height)) {
            return index;
        }
        if self.targets.len() == MAX_KEPT_SIZES {
            self.targets.remove(0);
        }
        self.targets.push(Targets::new(&self.device, width, height));
        self.targets.len() - 1
    }

    fn draw_shadow(&self, encoder: &mut wgpu::CommandEncoder, batches: &Batches) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow"),
            depth_stencil_attachment: Some(depth_attachment(&self.shadow.view, wgpu::StoreOp::Store)),
            ..wgpu::RenderPassDescriptor::default()
        });
        pass.set_bind_group(0, &self.frame_group, &[]);
        for draw in &batches.draws {
            pass.set_pipeline(self.pipelines.shadow(draw.style));
            self.draw(&mut pass, draw);
        }
    }

    fn draw_main(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        batches: &Batches,
        target: &Targets,
        background: [f32; 3],
        light: Light,
    ) {
        let mut pass = target.begin(encoder, background);
        pass.set_bind_group(0, &self.frame_group, &[]);
        pass.set_bind_group(1, &self.shadow.group, &[]);
        for draw in &batches.draws {
            if let Some(pipeline) = self.pipelines.main(draw.style, light) {
                pass.set_pipeline(pipeline);
                self.draw(&mut pass, draw);
            }
        }
    }

    fn draw(&self, pass: &mut wgpu::RenderPass<'_>, draw: &crate::batch::Draw) {
        let Some(mesh) = self.meshes.get(draw.mesh) else { return };
        pass.set_vertex_buffer(0, mesh.vertices.slice(..));
        pass.set_vertex_buffer(1, self.instances.slice(..));
        pass.set_index_buffer(mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..mesh.index_count, 0, draw.instances.clone());
    }
}

impl ShadowMap {
    fn new(device: &wgpu::Device, pipelines: &Pipelines, size: u32) -> ShadowMap {
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: Some("shadow"),
            size: wgpu::Extent3d { width: size, height: size, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: DEPTH_FORMAT,
            usage: TextureUsages::RENDER_ATTACHMENT | TextureUsages::TEXTURE_BINDING,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        let sampler = device.create_sampler(&wgpu::SamplerDescriptor {
            compare: Some(wgpu::CompareFunction::LessEqual),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..wgpu::SamplerDescriptor::default()
        });
        let group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shadow"),
            layout: &pipelines.shadow_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&sampler) },
            ],
        });
        ShadowMap { size, view, group }
    }
}

fn buffer(device: &wgpu::Device, label: &str, size: u64, usage: BufferUsages) -> wgpu::Buffer {
    let usage = usage | BufferUsages::COPY_DST;
    device.create_buffer(&wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false })
}

fn check_instances(scene: &Scene) -> Result<(), RenderError> {
    let triangles = scene.instances.iter().map(|instance| instance.mesh.triangle_count()).sum();
    let counts = [
        ("instances", scene.instances.len(), MAX_INSTANCES),
        ("triangles", triangles, MAX_TRIANGLES),
        ("point lights", scene.lights.points.len(), MAX_POINT_LIGHTS),
    ];
    for (what, count, limit) in counts {
        if count > limit {
            return Err(RenderError::TooMany { what, count, limit });
        }
    }
    for (index, instance) in scene.instances.iter().enumerate() {
        let cell = instance.material.pattern.map_or(1.0, |pattern| pattern.cell_m);
        let reason = if instance.id == 0 {
            "id 0 is reserved for pixels that show nothing"
        } else if !instance.pose.is_valid() {
            "its pose is not a rigid motion"
        } else if !(instance.scale.is_finite() && instance.scale.min_element() > 0.0) {
            "its scale must be positive and finite"
        } else if !(cell.is_finite() && cell > 0.0) {
            "its pattern's cells must have a positive size"
        } else {
            continue;
        };
        let (mesh, id) = (instance.mesh.name().to_owned(), instance.id);
        return Err(RenderError::Instance { index, mesh, id, reason });
    }
    Ok(())
}

fn check_lights(lights: &Lighting) -> Result<(), RenderError> {
    let strengths = [lights.ambient, lights.sun.intensity];
    let mut strengths = strengths.into_iter().chain(lights.points.iter().map(|point| point.intensity));
    let reason = if !strengths.all(|strength| strength.is_finite() && strength >= 0.0) {
        "a strength is negative or not finite"
    } else if lights.sun.direction.try_normalize().is_none() {
        "the sun's direction has no length"
    } else if !lights.points.iter().all(|point| point.position.is_finite()) {
        "the position of a point light is not finite"
    } else if lights.sun.shadow_map > MAX_SHADOW_MAP {
        let (count, limit) = (lights.sun.shadow_map as usize, MAX_SHADOW_MAP as usize);
        return Err(RenderError::TooMany { what: "shadow map texels along an edge", count, limit });
    } else {
        return Ok(());
    };
    Err(RenderError::Lights { reason })
}

fn frame_raw(lights: &Lighting, camera: &CameraModel, camera_from_world: &Pose, view: Option<&ShadowView>) -> FrameRaw {
    let to_sun = -camera_from_world.transform_vector(lights.sun.direction).normalize();
    let mut points = [[0.0; 4]; MAX_POINT_LIGHTS];
    for (slot, point) in points.iter_mut().zip(&lights.points) {
        let position = camera_from_world.transform_point(point.position).as_vec3();
        *slot = position.extend(point.intensity / PI).to_array();
    }
    let shadow_from_camera = view.map_or(DMat4::IDENTITY, |view| view.clip_from_camera);
    let offset = view.map_or(0.0, |view| SHADOW_OFFSET_TEXELS * view.texel_m) as f32;
    FrameRaw {
        clip_from_camera: clip_from_camera(&camera.intrinsics).as_mat4().to_cols_array_2d(),
        shadow_from_camera: shadow_from_camera.as_mat4().to_cols_array_2d(),
        sun: to_sun.as_vec3().extend(lights.sun.intensity / PI).to_array(),
        points,
        misc: [lights.ambient, offset, 0.0, 0.0],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_without_drivers_learns_what_to_install() {
        let message = RendererError::NoAdapter { tried: "nothing found".into() }.to_string();
        for package in ["libegl1", "libegl-mesa0", "libgl1-mesa-dri", "mesa-vulkan-drivers"] {
            assert!(message.contains(package), "{message}");
        }
    }

    #[test]
    fn a_renderer_can_move_to_another_thread() {
        fn assert_send<T: Send>() {}
        assert_send::<Renderer>();
    }
}
