//! The sensor model against the figures it promises, on frames made by hand: no device is needed.

#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use super::*;
use acm_concept::camera::Intrinsics;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 240;
/// Focal length of the imagers times baseline at this width, pixel metres.
const FOCAL_BASELINE: f64 = 384.0 * 0.05;

fn camera() -> CameraModel {
    let intrinsics = Intrinsics { width: WIDTH, height: HEIGHT, fx: 600.0, fy: 600.0, cx: 319.5, cy: 119.5 };
    let mount = Default::default();
    CameraModel { name: "head".into(), intrinsics, pose: Pose::IDENTITY, mount, depth_min_m: 0.2, depth_max_m: 5.0 }
}

/// A frame whose depth is a function of column and row.
fn frame(depth: impl Fn(u32, u32) -> f64) -> Rendered {
    let depth: Vec<f32> = (0..WIDTH * HEIGHT).map(|index| depth(index % WIDTH, index / WIDTH) as f32).collect();
    let ids = depth.iter().map(|z| u32::from(*z > 0.0)).collect();
    Rendered { width: WIDTH, height: HEIGHT, color: vec![100; 3 * depth.len()], depth, ids }
}

/// A frame of a plane whose normal makes `angle` radians with the optical axis, turned about the image's vertical.
fn plane(distance: f64, angle: f64) -> Rendered {
    let intrinsics = camera().intrinsics;
    frame(|column, row| {
        let ray = intrinsics.ray(f64::from(column), f64::from(row));
        let facing = angle.cos() - ray.x * angle.sin();
        if facing > 0.0 { distance * angle.cos() / facing } else { 0.0 }
    })
}

fn measure(profile: &str, rendered: &Rendered, seed: u64) -> (Measured, f64) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let episode = SensorProfile::named(profile).unwrap().episode(&mut rng);
    (episode.measure(rendered, &camera(), &mut rng), episode.depth_scale("head"))
}

fn at(measured: &Measured, column: u32, row: u32) -> f64 {
    f64::from(measured.depth[(row * WIDTH + column) as usize])
}

fn hole_share(measured: &Measured, columns: std::ops::Range<u32>) -> f64 {
    let all = (0..HEIGHT).flat_map(|row| columns.clone().map(move |column| (column, row)));
    let holes = all.clone().filter(|(column, row)| at(measured, *column, *row) == 0.0).count();
    holes as f64 / all.count() as f64
}

#[test]
fn noise_grows_with_the_square_of_the_distance() {
    // z^2 * 0.08 / (f B), and a little from the steps of 1/32 pixel.
    for (distance, expected_mm) in [(0.5, 1.05), (1.0, 4.2), (2.0, 16.8)] {
        let (measured, scale) = measure("d435", &plane(distance, 0.0), 5);
        let values: Vec<f64> = measured.depth.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z) / scale).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let sigma = (values.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        assert!((sigma * 1e3 / expected_mm - 1.0).abs() < 0.06, "{distance} m: {} mm", sigma * 1e3);
        assert!((mean - distance).abs() < 0.1 * sigma, "{distance} m: mean {mean}");
        let share = hole_share(&measured, 0..WIDTH);
        assert!((share - 0.01).abs() < 0.001, "{share}");
    }
}

#[test]
fn neighbours_err_alike_and_disparity_comes_in_steps() {
    let (measured, scale) = measure("d435", &plane(1.0, 0.0), 6);
    let error = |column, row| (at(&measured, column, row) > 0.0).then(|| at(&measured, column, row) / scale - 1.0);
    let correlation = |lag: u32| {
        let pairs = (0..HEIGHT).flat_map(|row| (0..WIDTH - lag).map(move |column| (column, row)));
        let pairs = pairs.filter_map(|(column, row)| Some((error(column, row)?, error(column + lag, row)?)));
        let (ab, aa) = pairs.fold((0.0, 0.0), |(ab, aa), (a, b)| (ab + a * b, aa + a * a));
        ab / aa
    };
    assert!(correlation(1) > 0.7 && correlation(6).abs() < 0.1, "{} {}", correlation(1), correlation(6));
    for z in measured.depth.iter().filter(|z| **z > 0.0) {
        let steps = 32.0 * FOCAL_BASELINE * scale / f64::from(*z);
        assert!((steps - steps.round()).abs() < 1e-3, "{z}");
    }
}

#[test]
fn a_smaller_image_measures_worse() {
    let small = Rendered { width: 320, height: 480, ..plane(1.0, 0.0) };
    let mut camera = camera();
    (camera.intrinsics.width, camera.intrinsics.height) = (320, 480);
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let episode = SensorProfile::named("d435").unwrap().episode(&mut rng);
    let depth = episode.measure(&small, &camera, &mut rng).depth;
    let errors = depth.iter().filter(|z| **z > 0.0).map(|z| f64::from(*z) / episode.depth_scale("head") - 1.0);
    let (count, squares) = errors.fold((0.0, 0.0f64), |(count, squares), e| (count + 1.0, squares + e * e));
    let sigma = (squares / count).sqrt();
    assert!((sigma - 0.0084).abs() < 0.0006, "{sigma}");
}

#[test]
fn the_second_imager_leaves_a_shadow_on_the_left() {
    // A block at 0.5 m before a wall at 1.0 m: 600 px * 0.05 m * (1 / 0.5 - 1 / 1.0) = 30 pixels.
    let block = |column: u32, row: u32| (300..400).contains(&column) && (60..180).contains(&row);
    let (measured, _) = measure("d435", &frame(|column, row| if block(column, row) { 0.5 } else { 1.0 }), 7);
    for row in 70..170 {
        assert!((271..300).all(|column| at(&measured, column, row) == 0.0), "row {row}");
    }
    let share = |columns: std::ops::Range<u32>| {
        let holes = (70..170).flat_map(|row| columns.clone().map(move |column| (column, row)));
        let holes = holes.filter(|(column, row)| at(&measured, *column, *row) == 0.0).count();
        holes as f64 / (100 * columns.len()) as f64
    };
    assert!(share(240..266) < 0.03 && share(405..440) < 0.03, "{} {}", share(240..266), share(405..440));
    // At the right edge about half the pixels next to it are lost, the others carry the block's depth outwards.
    assert!((share(400..401) - 0.5).abs() < 0.2, "{}", share(400..401));
    let fattened = |column| (70..170).filter(|row| (0.4..0.6).contains(&at(&measured, column, *row))).count();
    assert!(fattened(400) > 25 && fattened(402) > 3 && fattened(404) == 0);
    assert!(fattened(400) > fattened(402), "{} {}", fattened(400), fattened(402));
}

#[test]
fn surfaces_seen_at_a_grazing_angle_are_lost() {
    let near_axis = 310..330;
    for (degrees, lost) in [(60.0f64, false), (75.0, false), (81.0, true)] {
        let share = hole_share(&measure("d435", &plane(0.8, degrees.to_radians()), 8).0, near_axis.clone());
        assert_eq!(share > 0.95, lost, "{degrees} degrees: {share}");
        assert_eq!(share < 0.05, !lost, "{degrees} degrees: {share}");
    }
    let hard = hole_share(&measure("d435-hard", &plane(0.8, 75f64.to_radians()), 8).0, near_axis);
    assert!(hard > 0.95, "{hard}");
}

#[test]
fn nothing_is_measured_outside_the_camera_range_or_where_nothing_is() {
    for profile in SensorProfile::NAMES {
        for distance in [0.15, 8.0, 0.0] {
            let (measured, _) = measure(profile, &frame(|_, _| distance), 9);
            assert!(measured.depth.iter().all(|z| *z == 0.0), "{profile} at {distance} m");
        }
    }
}

#[test]
fn the_exact_sensor_changes_nothing() {
    let rendered = plane(1.0, 0.5);
    let (measured, scale) = measure("none", &rendered, 10);
    assert!(measured.depth == rendered.depth && measured.color == rendered.color && scale == 1.0);
    let episode = SensorProfile::named("none").unwrap().episode(&mut ChaCha8Rng::seed_from_u64(1));
    assert_eq!(episode.true_camera(&camera()), camera());
}

#[test]
fn a_seed_repeats_its_frames_and_the_next_frame_differs() {
    let rendered = plane(1.0, 0.4);
    assert_eq!(measure("d435", &rendered, 11), measure("d435", &rendered, 11));
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let episode = SensorProfile::named("d435").unwrap().episode(&mut rng);
    let [first, second] = [0, 1].map(|_| episode.measure(&rendered, &camera(), &mut rng));
    assert!(first.depth != second.depth && first.color != second.color);
}

#[test]
fn calibration_errors_have_their_spread_and_belong_to_a_camera() {
    let profile = SensorProfile::named("d435").unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(12);
    let (mut scale, mut distance, mut angle) = (0.0, 0.0, 0.0);
    let count = 2000;
    for _ in 0..count {
        let episode = profile.episode(&mut rng);
        let truth = episode.true_camera(&camera());
        assert_eq!(truth, episode.true_camera(&camera()));
        let wrist = CameraModel { name: "wrist".into(), ..camera() };
        assert!(episode.true_camera(&wrist).pose != truth.pose);
        assert!(episode.depth_scale("wrist") != episode.depth_scale("head"));
        assert!(truth.pose.is_valid() && truth.intrinsics == camera().intrinsics);
        scale += (episode.depth_scale("head") - 1.0).powi(2);
        distance += truth.pose.translation.length_squared();
        angle += truth.pose.angle_to(&Pose::IDENTITY).powi(2);
    }
    let root = |squares: f64| (squares / f64::from(count)).sqrt();
    assert!((root(scale) / 0.0075 - 1.0).abs() < 0.06, "{}", root(scale));
    assert!((root(distance) / 0.002 - 1.0).abs() < 0.06, "{}", root(distance));
    assert!((root(angle).to_degrees() / 0.3 - 1.0).abs() < 0.06, "{}", root(angle).to_degrees());
}

#[test]
fn an_unknown_profile_is_answered_with_the_known_ones() {
    let message = SensorProfile::named("kinect").unwrap_err().to_string();
    assert_eq!(message, "there is no sensor profile `kinect`; the profiles are: none, d435, d435-hard");
}
