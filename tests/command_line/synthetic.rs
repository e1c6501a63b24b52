//! Small RGB-D frames of boxes and cylinders on a table, as PNG files: exact geometry, no noise.

use acm_concept::{
    camera::Intrinsics,
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use glam::{DMat3, DQuat, DVec3};
use image::{ImageBuffer, Luma, Rgb, RgbImage};
use std::{
    f64::consts::FRAC_PI_2,
    path::{Path, PathBuf},
};

/// The camera of all frames; its numbers as the command line takes them.
pub const INTRINSICS: Intrinsics = Intrinsics { width: 320, height: 240, fx: 290.0, fy: 290.0, cx: 159.5, cy: 119.5 };
pub const INTRINSICS_TEXT: &str = "290,290,159.5,119.5";

/// A thing and its colour.
pub type Thing = (PlacedSolid, [u8; 3]);

pub fn cuboid(size: [f64; 3], x: f64, y: f64, yaw: f64, color: [u8; 3]) -> Thing {
    let pose = Pose::from_yaw(DVec3::new(x, y, size[2] / 2.0), yaw);
    (PlacedSolid { solid: Solid::Box { size: size.into() }, pose }, color)
}

pub fn can(radius: f64, height: f64, x: f64, y: f64, color: [u8; 3]) -> Thing {
    let pose = Pose::from_translation(DVec3::new(x, y, height / 2.0));
    (PlacedSolid { solid: Solid::Cylinder { radius, height }, pose }, color)
}

/// A can that lies on its side, its axis level and at a heading.
pub fn lying_can(radius: f64, height: f64, x: f64, y: f64, heading: f64, color: [u8; 3]) -> Thing {
    let rotation = DQuat::from_rotation_z(heading) * DQuat::from_rotation_y(FRAC_PI_2);
    let pose = Pose::new(DVec3::new(x, y, radius), rotation);
    (PlacedSolid { solid: Solid::Cylinder { radius, height }, pose }, color)
}

/// A camera 0.55 m over the table that looks ahead and down; x to its right.
pub fn camera() -> Pose {
    let ahead = DVec3::new(0.0, 0.75, -0.66).normalize();
    let down = ahead.cross(DVec3::X);
    Pose::new(DVec3::new(0.0, 0.0, 0.55), DQuat::from_mat3(&DMat3::from_cols(DVec3::X, down, ahead)))
}

/// Writes STEM_color.png and STEM_depth.png (millimetres) into a folder.
pub fn write(folder: &Path, stem: &str, things: &[Thing]) -> (PathBuf, PathBuf) {
    let (color, depth) = (folder.join(format!("{stem}_color.png")), folder.join(format!("{stem}_depth.png")));
    let (mut picture, mut range) = planes();
    let eye = camera();
    for (column, row) in (0..INTRINSICS.height).flat_map(|row| (0..INTRINSICS.width).map(move |column| (column, row))) {
        let ray = eye.transform_vector(INTRINSICS.ray(f64::from(column), f64::from(row)));
        let table = (-eye.translation.z / ray.z, [170, 140, 110]);
        let hits =
            things.iter().filter_map(|(solid, color)| Some((solid.intersect_ray(eye.translation, ray)?.0, *color)));
        let (distance, paint) = hits.chain([table]).min_by(|a, b| a.0.total_cmp(&b.0)).unwrap();
        picture.put_pixel(column, row, Rgb(paint));
        range.put_pixel(column, row, Luma([(distance * 1000.0).round() as u16]));
    }
    picture.save(&color).unwrap();
    range.save(&depth).unwrap();
    (color, depth)
}

/// Writes a frame of one colour and one depth.
pub fn write_blank(folder: &Path, stem: &str, color: u8, depth_mm: u16) {
    let (mut picture, mut range) = planes();
    picture.pixels_mut().for_each(|pixel| *pixel = Rgb([color; 3]));
    range.pixels_mut().for_each(|pixel| *pixel = Luma([depth_mm]));
    picture.save(folder.join(format!("{stem}_color.png"))).unwrap();
    range.save(folder.join(format!("{stem}_depth.png"))).unwrap();
}

fn planes() -> (RgbImage, ImageBuffer<Luma<u16>, Vec<u16>>) {
    (RgbImage::new(INTRINSICS.width, INTRINSICS.height), ImageBuffer::new(INTRINSICS.width, INTRINSICS.height))
}
