//! A can, drawn.
#![allow(clippy::unwrap_used)] // A failed unwrap is a failed test.

use super::*;
use acm_concept::{
    camera::{FrameHeader, Intrinsics},
    color::{Appearance, Lab},
    ids::FrameId,
    object::{GroundedPart, ParameterEstimate, PixelSupport, PoseEstimate},
    pose::Pose,
    time::Time,
};
use glam::{DQuat, DVec3};

const CYLINDER: &str = include_str!("../../../memory/library/cylinder.toml");

fn grey() -> Appearance {
    Appearance::plain(Lab { l: 50.0, a: 0.0, b: 0.0 }, 1.0)
}

/// A can before a camera that looks down on it, in a white picture of the given width.
fn picture(width: u32) -> (RgbImage, [i64; 2], [i64; 2]) {
    let height = width * 3 / 4;
    let intrinsics = Intrinsics::from_vertical_fov(width, height, 0.8);
    let camera_pose = Pose::new(DVec3::new(0.0, -0.5, 0.5), DQuat::from_rotation_x(-2.356));
    let header = FrameHeader { id: FrameId(0), camera: "test".into(), time: Time::ZERO, intrinsics, camera_pose };
    let pixels = intrinsics.pixels();
    let frame = RgbdFrame::new(header.clone(), vec![255; 3 * pixels].into(), vec![1.0; pixels].into()).unwrap();
    let known = |name: &str, value| ParameterEstimate {
        name: name.into(),
        value,
        sigma: 0.001,
        observability: Observability::Observed,
    };
    let part = GroundedPart {
        name: acm_concept::template::WHOLE.into(),
        template: "cylinder".into(),
        parameters: vec![known("radius", 0.05), known("height", 0.1)],
        pose: PoseEstimate { pose: Pose::IDENTITY, position_sigma_m: DVec3::ZERO, yaw_sigma_rad: 0.0 },
        affordances: Vec::new(),
        functions: Vec::new(),
        appearance: grey(),
    };
    let mut mask = vec![false; pixels];
    mask[pixels / 2 + width as usize / 2] = true;
    let object = GroundedObject {
        category: "can".into(),
        categories: Vec::new(),
        parts: vec![part],
        appearance: grey(),
        support: PixelSupport::from_mask(&mask, width as usize).unwrap(),
        confidence: 1.0,
        truncated: false,
        expected: None,
        readings: Vec::new(),
    };
    let percepts = Percepts {
        frame: header,
        support: None,
        objects: vec![object],
        expected: Vec::new(),
        blindness: None,
        depth_fraction: 1.0,
    };
    let library = TemplateLibrary::parse([("cylinder.toml", CYLINDER)]).unwrap();
    let at = |y: f64| {
        let pixel = intrinsics.project(camera_pose.inverse().transform_point(DVec3::new(0.0, y, 0.0))).unwrap();
        [pixel.x.round() as i64, pixel.y.round() as i64]
    };
    (draw(&frame, &percepts, &[Some("O7".into())], &library), at(-0.05), at(0.05))
}

/// Pixels in the object's colour round a point.
fn colored(image: &RgbImage, [x, y]: [i64; 2]) -> usize {
    let near = (-4..=4).flat_map(|dy| (-4..=4).map(move |dx| (x + dx, y + dy)));
    let is_colored = |(x, y): &(i64, i64)| {
        let pixel = image.get_pixel(*x as u32, *y as u32).0;
        i16::from(pixel[0]) - i16::from(pixel[2]) > 80
    };
    near.filter(is_colored).count()
}

#[test]
fn the_near_foot_is_drawn_and_the_hidden_one_is_dotted() {
    let (image, near, far) = picture(640);
    assert!(colored(&image, near) >= 9, "{}", colored(&image, near));
    let dots = colored(&image, far);
    assert!((1..=5).contains(&dots), "{dots}");
}

#[test]
fn letters_and_lines_grow_with_the_picture() {
    let dark = |image: &RgbImage| image.pixels().filter(|pixel| pixel.0.iter().all(|c| *c < 60)).count();
    let (small, large) = (picture(640).0, picture(1920).0);
    assert!(dark(&small) > 500 && dark(&large) > 6 * dark(&small), "{} {}", dark(&small), dark(&large));
}
