//! Readings of faces that are painted pixel by pixel.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use crate::{config::GrounderConfig, scan::Scan, scene::Scene, support};
use acm_concept::{
    camera::{FrameHeader, Intrinsics, RgbdFrame},
    ids::FrameId,
    pose::Pose,
    reading::Hue,
    time::Time,
};
use glam::{DMat3, DQuat, DVec3};

const WIDTH: usize = 320;
const HEIGHT: usize = 240;
/// The face: a rectangle in the picture, 0.6 m ahead of a camera that looks level.
const FACE: [usize; 4] = [100, 60, 219, 159];
const BODY: [u8; 3] = [200, 200, 195];

/// What is read on an upright face whose pixels, from its upper left one, have these colours.
fn read_face(paint: impl Fn(usize, usize) -> [u8; 3]) -> Vec<Reading> {
    let mut color = Vec::new();
    let mut depth = Vec::new();
    let inside = |x: usize, y: usize| x >= FACE[0] && y >= FACE[1] && x <= FACE[2] && y <= FACE[3];
    let intrinsics = Intrinsics::from_vertical_fov(WIDTH as u32, HEIGHT as u32, 0.8);
    for y in 0..HEIGHT {
        for x in 0..WIDTH {
            color.extend(if inside(x, y) { paint(x - FACE[0], y - FACE[1]) } else { [90, 120, 90] });
            // A floor 0.12 m below the camera, and a wall far away.
            let ray = intrinsics.ray(x as f64, y as f64);
            let floor = if ray.y > 0.0 { 0.12 / ray.y } else { f64::INFINITY };
            depth.push(if inside(x, y) { 0.6 } else { floor.min(1.5) as f32 });
        }
    }
    // Looks along the world's y.
    let axes = DMat3::from_cols(DVec3::X, -DVec3::Z, DVec3::Y);
    let pose = Pose::new(DVec3::Z, DQuat::from_mat3(&axes));
    let header = FrameHeader { id: FrameId(0), camera: "head".into(), time: Time::ZERO, intrinsics, camera_pose: pose };
    let frame = RgbdFrame::new(header, color.into(), depth.into()).unwrap();
    let config = GrounderConfig::default();
    let scan = Scan::read(&frame, &config).unwrap();
    let own = vec![false; WIDTH * HEIGHT];
    let plane = support::Plane { normal: -DVec3::Y, offset: -0.12, residual_m: 0.001, noise_ratio: 1.0 };
    let scene = Scene::new(&scan, &plane, &pose, own, &config);
    let mask: Vec<bool> = (0..WIDTH * HEIGHT).map(|at| inside(at % WIDTH, at / WIDTH)).collect();
    read(&scene, white(&scene), &PixelSupport::from_mask(&mask, WIDTH).unwrap())
}

/// Paints rows of `#` in squares of so many pixels, from a corner on.
fn picture(rows: &[&str], corner: (usize, usize), square: usize, ink: [u8; 3]) -> impl Fn(usize, usize) -> [u8; 3] {
    let rows: Vec<Vec<bool>> = rows.iter().map(|row| row.chars().map(|c| c == '#').collect()).collect();
    move |x, y| {
        let cell = |at: usize, from: usize| at.checked_sub(from).map(|d| d / square);
        let row = cell(y, corner.1).and_then(|row| rows.get(row));
        let set = row.and_then(|row| row.get(cell(x, corner.0)?)).copied().unwrap_or(false);
        if set { ink } else { BODY }
    }
}

fn texts(readings: &[Reading]) -> Vec<&str> {
    let text = |reading: &'_ Reading| matches!(reading.content, Content::Text { .. });
    let read = readings.iter().filter(|reading| text(reading));
    read.filter_map(
        |reading| if let Content::Text { text, .. } = &reading.content { Some(text.as_str()) } else { None },
    )
    .collect()
}

const FOUR_SEVEN: [&str; 7] =
    ["#...#.#####", "#...#.....#", "#...#....#.", "#####...#..", "....#..#...", "....#..#...", "....#..#..."];

#[test]
fn a_line_of_digits_is_read_where_it_stands() {
    let readings = read_face(picture(&FOUR_SEVEN, (30, 30), 4, [20, 20, 30]));
    let [reading] = &readings[..] else { panic!("{readings:?}") };
    assert_eq!(texts(&readings), ["47"]);
    assert!(reading.confidence > 0.8, "{reading:?}");
    assert_eq!(reading.bounds, [130, 90, 173, 117]);
    assert!((reading.height_px - 28.0).abs() < 1.5, "{reading:?}");
    // 0.6 m ahead, where the middle of the line is seen.
    assert!((reading.position.y - 0.6).abs() < 0.005 && reading.position.x.abs() < 0.03, "{reading:?}");
    let Content::Text { upright, .. } = &reading.content else { unreachable!() };
    assert!(upright.up.z > 0.99 && !upright.assumed, "{upright:?}");
}

#[test]
fn light_digits_on_a_dark_display_are_read() {
    let digits = picture(&FOUR_SEVEN, (30, 30), 3, [255, 60, 50]);
    let display = |x: usize, y: usize| (15..95).contains(&x) && (15..75).contains(&y);
    let readings = read_face(|x, y| match digits(x, y) {
        BODY if display(x, y) => [15, 15, 15],
        color => color,
    });
    assert_eq!(texts(&readings), ["47"], "{readings:?}");
}

#[test]
fn a_plus_is_read_and_a_plain_square_is_not() {
    let plus = ["..##..", "..##..", "######", "######", "..##..", "..##.."];
    assert_eq!(texts(&read_face(picture(&plus, (40, 30), 4, [180, 20, 20]))), ["+"]);
    let square = ["######", "######", "######", "######", "######", "######"];
    assert_eq!(read_face(picture(&square, (40, 30), 4, [20, 60, 20])), []);
}

#[test]
fn a_lamp_has_a_colour_and_is_lit_or_dark() {
    let disc = |x: usize, y: usize| (x as f64 - 60.0).hypot(y as f64 - 50.0) < 10.0;
    for (color, hue, lit) in
        [([255, 40, 30], Hue::Red, true), ([85, 16, 14], Hue::Red, false), ([40, 230, 80], Hue::Green, true)]
    {
        let readings = read_face(|x, y| if disc(x, y) { color } else { BODY });
        let [Reading { content: Content::Lamp { hue: seen, lit: bright, .. }, confidence, .. }] = &readings[..] else {
            panic!("{readings:?}")
        };
        assert_eq!((*seen, *bright), (hue, lit));
        assert!(*confidence > 0.85, "{readings:?}");
    }
}

#[test]
fn a_needle_points_where_it_points() {
    for degrees in [0.0, 40.0, 135.0, 270.0f64] {
        let angle = degrees.to_radians();
        let readings = read_face(|x, y| {
            let (right, up) = (x as f64 - 60.0, 50.0 - y as f64);
            let along = right * angle.sin() + up * angle.cos();
            let across = right * angle.cos() - up * angle.sin();
            match right.hypot(up) {
                far if far > 32.0 => [60, 60, 65],
                _ if across.abs() < 2.0 && (-4.0..26.0).contains(&along) => [200, 30, 30],
                _ => [240, 240, 235],
            }
        });
        let [Reading { content: Content::Needle { angle_deg, .. }, .. }] = &readings[..] else {
            panic!("{degrees}: {readings:?}")
        };
        let error = (angle_deg - degrees + 180.0).rem_euclid(360.0) - 180.0;
        assert!(error.abs() < 4.0, "{degrees}: {angle_deg}");
    }
}

#[test]
fn a_needle_that_ends_at_a_mark_of_the_scale_is_read() {
    // The mark runs out of the dial, so that the needle is not surrounded by its ground.
    let readings = read_face(|x, y| {
        let (right, up) = (x as f64 - 60.0, 50.0 - y as f64);
        match right.hypot(up) {
            far if far > 32.0 => [60, 60, 65],
            _ if right.abs() < 2.0 && up > 25.0 => [60, 60, 65],
            _ if right.abs() < 2.0 && up > -4.0 => [200, 30, 30],
            _ => [240, 240, 235],
        }
    });
    let [Reading { content: Content::Needle { angle_deg, .. }, .. }] = &readings[..] else { panic!("{readings:?}") };
    let error = (angle_deg + 180.0).rem_euclid(360.0) - 180.0;
    assert!(error.abs() < 4.0, "{angle_deg}");
}

#[test]
fn what_is_no_writing_gives_no_reading() {
    assert_eq!(read_face(|_, _| BODY), []);
    assert_eq!(read_face(|x, _| if x / 7 % 2 == 0 { BODY } else { [30, 30, 90] }), []);
    let noise = |x: usize, y: usize| (x.wrapping_mul(2_654_435_761) ^ y.wrapping_mul(40_503) ^ (x * y * 7919)) >> 3;
    assert_eq!(read_face(|x, y| BODY.map(|channel| channel - (noise(x, y) % 12) as u8)), []);
    assert_eq!(read_face(|x, y| [(noise(x, y) % 256) as u8; 3]), []);
    // Two pixels of ink.
    assert_eq!(read_face(|x, y| if (x, y) == (50, 50) || (x, y) == (51, 50) { [0; 3] } else { BODY }), []);
}

#[test]
fn small_digits_are_said_to_be_too_small() {
    let rows = [
        "#...#...#...#",
        "#...#...#...#",
        "#...#...#...#",
        "#####...#####",
        "....#.......#",
        "....#.......#",
        "....#.......#",
    ];
    let readings = read_face(picture(&rows, (30, 30), 1, [20, 20, 30]));
    assert_eq!(texts(&readings), Vec::<&str>::new());
    let small = |reading: &Reading| reading.content == Content::Unreadable { reason: Unreadable::TooSmall };
    assert!(readings.iter().any(small), "{readings:?}");
}
