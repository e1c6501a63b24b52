//! Meshes on the device, and a scene sorted into as few draw calls as possible.

use crate::{
    mesh::Mesh,
    pipeline::{InstanceRaw, Style, VertexRaw},
    scene::{Instance, PatternKind, Scene},
    shadow::Corners,
};
use acm_concept::pose::Pose;
use glam::{DMat3, DVec3};
use std::{
    collections::BTreeMap,
    ops::Range,
    sync::{Arc, Weak},
};
use wgpu::util::DeviceExt;

/// A mesh on the device.
pub(crate) struct DeviceMesh {
    pub vertices: wgpu::Buffer,
    pub indices: wgpu::Buffer,
    pub index_count: u32,
    bounds: (DVec3, DVec3),
    /// Keeps the address from being given to another mesh while this entry exists.
    owner: Weak<Mesh>,
}

/// Uploaded meshes, by the address of their `Arc`.
#[derive(Default)]
pub(crate) struct MeshCache {
    meshes: BTreeMap<usize, DeviceMesh>,
}

impl MeshCache {
    /// Forgets meshes that nobody holds any more.
    pub(crate) fn sweep(&mut self) {
        self.meshes.retain(|_, mesh| mesh.owner.strong_count() > 0);
    }

    pub(crate) fn get(&self, key: usize) -> Option<&DeviceMesh> {
        self.meshes.get(&key)
    }

    fn upload(&mut self, device: &wgpu::Device, mesh: &Arc<Mesh>) -> (usize, &DeviceMesh) {
        let key = Arc::as_ptr(mesh).addr();
        let entry = self.meshes.entry(key).or_insert_with(|| {
            let buffer = |contents: &[u8], usage| {
                device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                    label: Some(mesh.name()),
                    contents,
                    usage,
                })
            };
            let corner = |(position, normal): (&glam::Vec3, &glam::Vec3)| VertexRaw {
                position: position.to_array(),
                normal: normal.to_array(),
            };
            let vertices: Vec<VertexRaw> = mesh.positions().iter().zip(mesh.normals()).map(corner).collect();
            let (low, high) = mesh.bounds();
            DeviceMesh {
                vertices: buffer(bytemuck::cast_slice(&vertices), wgpu::BufferUsages::VERTEX),
                indices: buffer(bytemuck::cast_slice(mesh.indices()), wgpu::BufferUsages::INDEX),
                index_count: mesh.indices().len() as u32,
                bounds: (low.as_dvec3(), high.as_dvec3()),
                owner: Arc::downgrade(mesh),
            }
        });
        (key, entry)
    }
}

/// One draw call: a mesh and a range of the instance buffer.
pub(crate) struct Draw {
    pub mesh: usize,
    pub style: Style,
    pub instances: Range<u32>,
}

/// A scene as the device takes it.
pub(crate) struct Batches {
    pub draws: Vec<Draw>,
    pub instances: Vec<InstanceRaw>,
    /// Boxes round the instances, in the camera frame.
    pub boxes: Vec<Corners>,
}

impl Batches {
    /// Groups the instances by mesh and style. The order of the groups, and so of ties in depth, is that of their
    /// first instances in the scene: addresses must not decide anything.
    pub(crate) fn new(
        cache: &mut MeshCache,
        device: &wgpu::Device,
        scene: &Scene,
        camera_from_world: &Pose,
    ) -> Batches {
        let mut group_of = BTreeMap::<(usize, Style), usize>::new();
        let mut groups = Vec::<(usize, Style, Vec<InstanceRaw>)>::new();
        let mut boxes = Vec::with_capacity(scene.instances.len());
        for instance in &scene.instances {
            let (mesh, uploaded) = cache.upload(device, &instance.mesh);
            let pose = *camera_from_world * instance.pose;
            boxes.push(corners(uploaded.bounds, instance.scale, &pose));
            let style = Style { closed: instance.mesh.is_closed(), patterned: instance.material.pattern.is_some() };
            let group = *group_of.entry((mesh, style)).or_insert_with(|| {
                groups.push((mesh, style, Vec::new()));
                groups.len() - 1
            });
            groups[group].2.push(raw(instance, &pose));
        }
        let mut batches = Batches { draws: Vec::with_capacity(groups.len()), instances: Vec::new(), boxes };
        for (mesh, style, members) in groups {
            let first = batches.instances.len() as u32;
            batches.instances.extend(members);
            batches.draws.push(Draw { mesh, style, instances: first..batches.instances.len() as u32 });
        }
        batches
    }
}

fn corners((low, high): (DVec3, DVec3), scale: DVec3, pose: &Pose) -> Corners {
    std::array::from_fn(|index| {
        let end = |axis: usize| if index >> axis & 1 == 1 { high[axis] } else { low[axis] };
        pose.transform_point(DVec3::new(end(0), end(1), end(2)) * scale)
    })
}

fn raw(instance: &Instance, pose: &Pose) -> InstanceRaw {
    let rotation = DMat3::from_quat(pose.rotation);
    let row = |axis: usize| (rotation.row(axis) * instance.scale).extend(pose.translation[axis]).as_vec4().to_array();
    let pattern = instance.material.pattern;
    let kind = match pattern.map(|pattern| pattern.kind) {
        None => 0.0,
        Some(PatternKind::Checker) => 1.0,
        Some(PatternKind::Stripes) => 2.0,
        Some(PatternKind::Speckle) => 3.0,
    };
    let [r, g, b] = linear(instance.material.color);
    let [pr, pg, pb] = linear(pattern.map_or([0; 3], |pattern| pattern.color));
    let cell = pattern.map_or(1.0, |pattern| pattern.cell_m);
    InstanceRaw {
        rows: [row(0), row(1), row(2)],
        scale: instance.scale.extend(cell).as_vec4().to_array(),
        color: [r, g, b, kind],
        pattern: [pr, pg, pb, 0.0],
        id: instance.id,
    }
}

/// Amounts of light from 8-bit sRGB (IEC 61966-2-1).
pub(crate) fn linear(color: [u8; 3]) -> [f32; 3] {
    color.map(|channel| {
        let c = f32::from(channel) / 255.0;
        if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
    })
}
