//! The robot's own pixels: nobody's object.

use crate::{config::GrounderConfig, raster, scan::Scan};
use acm_concept::{
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::DVec3;

/// Pixels whose rays meet the robot's grown solids, unless something nearer covers them there.
pub(crate) fn pixels(scan: &Scan, camera_pose: &Pose, robot: &[PlacedSolid], config: &GrounderConfig) -> Vec<bool> {
    let mut mask = vec![false; scan.grid.len()];
    if robot.is_empty() {
        return mask;
    }
    let grown: Vec<PlacedSolid> = robot
        .iter()
        .map(|part| PlacedSolid { solid: grow(part.solid, config.robot_margin_m), pose: part.pose })
        .collect();
    for (pixel, depth) in raster::cast(&scan.intrinsics, scan.grid, camera_pose, &grown).hits {
        let measured = f64::from(scan.depth[pixel]);
        mask[pixel] = measured == 0.0 || measured > depth - 0.01;
    }
    scan.grid.dilate(&mask, config.robot_margin_px)
}

fn grow(solid: Solid, margin_m: f64) -> Solid {
    match solid {
        Solid::Box { size } => Solid::Box { size: size + DVec3::splat(2.0 * margin_m) },
        Solid::Cylinder { radius, height } => {
            Solid::Cylinder { radius: radius + margin_m, height: height + 2.0 * margin_m }
        }
        Solid::Ellipsoid { size } => Solid::Ellipsoid { size: size + DVec3::splat(2.0 * margin_m) },
        Solid::Revolved { profile } => {
            Solid::Cylinder { radius: profile.radius() + margin_m, height: profile.height() + 2.0 * margin_m }
        }
    }
}
