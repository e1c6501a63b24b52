//! A small world of coloured solids, ray-cast into colour and exact depth.

use acm_concept::{
    camera::Intrinsics,
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DMat3, DQuat, DVec3};

pub const TABLE_TOP_M: f64 = 0.74;
pub const CUBE_M: f64 = 0.04;
pub const MAT_M: f64 = 0.08;
pub const MAT_THICKNESS_M: f64 = 0.001;
pub const BUTTON_RADIUS_M: f64 = 0.0375;
pub const BUTTON_HEIGHT_M: f64 = 0.028;

const RED: [f64; 3] = [0.9, 0.05, 0.05];
const BLUE: [f64; 3] = [0.0, 0.5, 1.0];
const GREY: [f64; 3] = [0.35, 0.35, 0.35];

#[derive(Clone)]
pub struct Thing {
    pub solid: PlacedSolid,
    pub color: [f64; 3],
}

#[derive(Clone)]
pub struct World {
    pub things: Vec<Thing>,
}

fn cuboid(size: DVec3, bottom: DVec3, yaw: f64, color: [f64; 3]) -> Thing {
    let pose = Pose::from_yaw(bottom + DVec3::Z * size.z * 0.5, yaw);
    Thing { solid: PlacedSolid { solid: Solid::Box { size }, pose }, color }
}

fn disc(radius: f64, height: f64, bottom: DVec3, color: [f64; 3]) -> Thing {
    let pose = Pose::from_translation(bottom + DVec3::Z * height * 0.5);
    Thing { solid: PlacedSolid { solid: Solid::Cylinder { radius, height }, pose }, color }
}

impl World {
    /// A white table with a wall behind it.
    pub fn table() -> World {
        let table = cuboid(DVec3::new(1.2, 0.7, 0.05), DVec3::new(0.0, 0.0, TABLE_TOP_M - 0.05), 0.0, [0.9; 3]);
        let wall = cuboid(DVec3::new(6.0, 1.2, 3.0), DVec3::new(0.0, 1.0, 0.0), 0.0, [1.0, 0.9, 0.9]);
        World { things: vec![table, wall] }
    }
    pub fn mat(&mut self, x: f64, y: f64, yaw: f64) {
        let size = DVec3::new(MAT_M, MAT_M, MAT_THICKNESS_M);
        self.things.push(cuboid(size, DVec3::new(x, y, TABLE_TOP_M), yaw, BLUE));
    }
    pub fn cube(&mut self, x: f64, y: f64, lift: f64, yaw: f64) {
        self.things.push(cuboid(DVec3::splat(CUBE_M), DVec3::new(x, y, TABLE_TOP_M + lift), yaw, RED));
    }
    pub fn block(&mut self, size: DVec3, x: f64, y: f64, yaw: f64, color: [f64; 3]) {
        self.things.push(cuboid(size, DVec3::new(x, y, TABLE_TOP_M), yaw, color));
    }
    pub fn disc(&mut self, radius: f64, height: f64, x: f64, y: f64, color: [f64; 3]) {
        self.things.push(disc(radius, height, DVec3::new(x, y, TABLE_TOP_M), color));
    }
    pub fn button(&mut self, x: f64, y: f64) {
        self.things.push(disc(BUTTON_RADIUS_M, 0.02, DVec3::new(x, y, TABLE_TOP_M), GREY));
        self.things.push(disc(0.035, 0.008, DVec3::new(x, y, TABLE_TOP_M + 0.02), RED));
    }
    /// Two fingers and a palm round a point; returned as well, as the robot's own description.
    pub fn gripper(&mut self, tip: DVec3) -> Vec<PlacedSolid> {
        let mut own = Vec::new();
        for side in [-1.0, 1.0] {
            own.push(cuboid(DVec3::new(0.012, 0.02, 0.06), tip + DVec3::X * side * 0.045, 0.0, GREY));
        }
        own.push(cuboid(DVec3::new(0.14, 0.06, 0.05), tip + DVec3::Z * 0.06, 0.0, [0.2, 0.2, 0.25]));
        own.push(cuboid(DVec3::new(0.05, 0.05, 0.12), tip + DVec3::Z * 0.11, 0.0, [0.2, 0.2, 0.25]));
        self.things.extend(own.iter().cloned());
        own.into_iter().map(|thing| thing.solid).collect()
    }

    /// The table of the put-back-block task: four mats, the button, and the cube at a place and height.
    pub fn put_back_block(cube: (f64, f64, f64)) -> World {
        let mut world = World::table();
        for (x, y) in MATS {
            world.mat(x, y, 0.0);
        }
        world.button(BUTTON.0, BUTTON.1);
        world.cube(cube.0, cube.1, cube.2, 0.0);
        world
    }

    /// Colours (8-bit) and depths (metres along the optical axis) of all pixels of a camera.
    pub fn render(&self, intrinsics: &Intrinsics, camera: &Pose) -> (Vec<u8>, Vec<f64>) {
        let light = DVec3::new(0.2, -0.5, 1.0).normalize();
        let local: Vec<(Pose, &Thing)> = self.things.iter().map(|t| (t.solid.pose.inverse(), t)).collect();
        let nearest = |origin: DVec3, direction: DVec3| {
            let hit = |(inverse, thing): &(Pose, &Thing)| {
                let (o, d) = (inverse.transform_point(origin), inverse.transform_vector(direction));
                let (enter, _) = thing.solid.solid.intersect_ray(o, d)?;
                (enter > 1e-6).then_some((enter, o + d * enter))
            };
            let hits = local.iter().enumerate().filter_map(|(i, pair)| hit(pair).map(|(t, p)| (t, p, i)));
            hits.min_by(|a, b| a.0.total_cmp(&b.0))
        };
        let (mut color, mut depth) = (Vec::new(), Vec::new());
        for index in 0..intrinsics.pixels() {
            let (column, row) = (index % intrinsics.width as usize, index / intrinsics.width as usize);
            let ray = camera.transform_vector(intrinsics.ray(column as f64, row as f64));
            let Some((t, at, i)) = nearest(camera.translation, ray) else {
                color.extend([20, 20, 20]);
                depth.push(0.0);
                continue;
            };
            let (_, thing) = local[i];
            let normal = thing.solid.pose.transform_vector(normal(&thing.solid.solid, at));
            let point = camera.translation + ray * t + normal * 1e-5;
            let lit = nearest(point, light).is_none();
            let shade = 0.45 + if lit { 0.55 * normal.dot(light).max(0.0) } else { 0.0 };
            color.extend(thing.color.map(|c| (255.0 * (c * shade).clamp(0.0, 1.0).powf(1.0 / 2.2)) as u8));
            depth.push(t);
        }
        (color, depth)
    }
}

pub const MATS: [(f64, f64); 4] = [(0.0, -0.1), (0.2, -0.1), (0.1, -0.2), (0.1, 0.0)];
pub const BUTTON: (f64, f64) = (-0.25, -0.1);

fn normal(solid: &Solid, at: DVec3) -> DVec3 {
    match *solid {
        Solid::Box { size } => {
            let q = (at.abs() - size * 0.5).to_array();
            let axis = (0..3).max_by(|&a, &b| q[a].total_cmp(&q[b])).unwrap_or(2);
            let mut normal = DVec3::ZERO;
            normal[axis] = at[axis].signum();
            normal
        }
        Solid::Cylinder { radius, height } => {
            if at.z.abs() - height * 0.5 > at.truncate().length() - radius {
                DVec3::Z * at.z.signum()
            } else {
                at.with_z(0.0).normalize()
            }
        }
        Solid::Ellipsoid { .. } | Solid::Revolved { .. } => {
            let along = |axis: DVec3| solid.signed_distance(at + axis * 1e-6) - solid.signed_distance(at - axis * 1e-6);
            DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z)).normalize_or_zero()
        }
    }
}

/// The camera over the table: 0.6 m above it, looking ahead and 53 degrees down.
pub fn head_camera() -> Pose {
    let forward = DVec3::new(0.0, 0.6, -0.8);
    let right = DVec3::X;
    let rotation = DQuat::from_mat3(&DMat3::from_cols(right, forward.cross(right), forward));
    Pose::new(DVec3::new(-0.032, -0.45, 1.35), rotation.normalize())
}

/// The same view from farther away: things are 0.9 to 1.1 m off.
pub fn far_camera() -> Pose {
    let pose = head_camera();
    Pose::new(pose.translation - pose.transform_vector(DVec3::Z) * 0.3, pose.rotation)
}
