//! Dashed outlines of what is remembered and not seen.

use super::text;
use acm_concept::{camera::FrameHeader, pose::Pose, solid::Solid, template::TemplateLibrary};
use acm_memory::entry::ObjectEntry;
use glam::{DVec2, DVec3};
use image::{Rgb, RgbImage};
use std::f64::consts::TAU;

/// Pixels of a dash and of the gap after it.
const DASH: usize = 4;
/// Corners of a round rim.
const RIM: usize = 24;
const COLOR: Rgb<u8> = Rgb([255, 255, 255]);

/// Draws an object's solids dashed where memory believes it, with a label. What lies outside of the frame is left out.
pub fn draw(image: &mut RgbImage, header: &FrameHeader, object: &ObjectEntry, library: &TemplateLibrary, label: &str) {
    let to_camera = header.camera_pose.inverse();
    let mut top: Option<DVec2> = None;
    for part in &object.parts {
        let solids = library.solids_of(part);
        for placed in solids.unwrap_or_default() {
            let pose: Pose = to_camera * part.pose.pose * placed.pose;
            for [from, to] in edges(&placed.solid) {
                let project = |point: DVec3| header.intrinsics.project(pose.transform_point(point));
                let (Some(from), Some(to)) = (project(from), project(to)) else { continue };
                dashed(image, header, from, to);
                top = [top, Some(from), Some(to)].into_iter().flatten().min_by(|a, b| a.y.total_cmp(&b.y));
            }
        }
    }
    if let Some(at) = top.filter(|at| header.intrinsics.contains(*at)) {
        let left = at.x - f64::from(text::ADVANCE) * label.chars().count() as f64 * 0.5;
        text::write(image, left.max(0.0) as i64, (at.y as i64 - 10).max(0), label, COLOR);
    }
}

/// The edges of a solid, or of the box round an ellipsoid, in its own frame.
fn edges(solid: &Solid) -> Vec<[DVec3; 2]> {
    let point = |index: usize, radius: f64, z: f64| {
        let (sin, cos) = (TAU * index as f64 / RIM as f64).sin_cos();
        DVec3::new(radius * cos, radius * sin, z)
    };
    let rim = |radius: f64, z: f64| (0..RIM).map(move |i| [point(i, radius, z), point(i + 1, radius, z)]);
    match *solid {
        Solid::Box { size } | Solid::Ellipsoid { size } => {
            let corner = |bits: usize| {
                let side = |bit: usize, length: f64| if bits & bit == 0 { -0.5 * length } else { 0.5 * length };
                DVec3::new(side(1, size.x), side(2, size.y), side(4, size.z))
            };
            let of = |bits: usize| {
                [1, 2, 4].into_iter().filter(move |bit| bits & bit == 0).map(move |bit| (bits, bits | bit))
            };
            (0..8).flat_map(of).map(|(a, b)| [corner(a), corner(b)]).collect()
        }
        Solid::Cylinder { radius, height } => {
            let half = 0.5 * height;
            let uprights = (0..RIM).step_by(6).map(|i| [point(i, radius, -half), point(i, radius, half)]);
            rim(radius, -half).chain(rim(radius, half)).chain(uprights).collect()
        }
        Solid::Revolved { profile } => {
            let rims =
                profile.corners().iter().filter(|corner| corner.x > 0.0).flat_map(|corner| rim(corner.x, corner.y));
            let outer = profile.edges().filter(|[a, b]| b.y > a.y);
            let uprights =
                outer.flat_map(|[a, b]| (0..RIM).step_by(6).map(move |i| [point(i, a.x, a.y), point(i, b.x, b.y)]));
            rims.chain(uprights).collect()
        }
    }
}

fn dashed(image: &mut RgbImage, header: &FrameHeader, from: DVec2, to: DVec2) {
    let steps = from.distance(to).clamp(1.0, 4000.0) as usize;
    for step in (0..=steps).filter(|step| step % (2 * DASH) < DASH) {
        let at = from.lerp(to, step as f64 / steps as f64);
        if header.intrinsics.contains(at) {
            text::dot(image, at.x.round() as i64, at.y.round() as i64, COLOR);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_twelve_edges_of_its_own_sizes() {
        let edges = edges(&Solid::Box { size: DVec3::new(0.1, 0.2, 0.3) });
        assert_eq!(edges.len(), 12);
        let mut lengths: Vec<f64> = edges.iter().map(|[a, b]| a.distance(*b)).collect();
        lengths.sort_by(f64::total_cmp);
        assert!(lengths.chunks(4).zip([0.1, 0.2, 0.3]).all(|(four, is)| four.iter().all(|l| (l - is).abs() < 1e-12)));
    }
}
