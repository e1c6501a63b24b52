//! The motions that a search begins with: along and about the directions that the flat faces of what moved give.

use super::{
    change::Changed,
    planes::{Face, faces},
    screw::Screw,
    view::View,
};
use glam::DVec3;

/// Directions nearer than this are one, radians.
const SAME_RAD: f64 = 0.1;
/// Farthest slide, and the step, metres.
const FARTHEST_M: f64 = 0.75;
const SLIDE_STEP_M: f64 = 0.015;
/// Greatest turn, and the step, radians.
const GREATEST_RAD: f64 = 2.8;
const TURN_STEP_RAD: f64 = 0.09;
/// How far an axis may lie before or behind a face or its edge, metres.
const OFFSETS_M: [f64; 5] = [-0.06, -0.03, -0.01, 0.01, 0.03];
/// Faces of parts that turned by less than this are parallel.
const PARALLEL_RAD: f64 = 0.1;

/// Starts of slides and of turns.
pub(super) fn starts(views: &[View; 2], changed: &Changed) -> Vec<Screw> {
    let faces = [0, 1].map(|frame| faces(&views[frame], &changed.pixels(frame), 3));
    let mut directions: Vec<DVec3> = Vec::new();
    let mut add = |direction: DVec3| {
        if let Some(direction) = direction.try_normalize()
            && directions.iter().all(|known| known.dot(direction).abs() < SAME_RAD.cos())
        {
            directions.push(direction);
        }
    };
    for face in faces.iter().flatten() {
        add(face.normal);
    }
    add(DVec3::Z);
    for face in faces.iter().flatten() {
        add(DVec3::Z.cross(face.normal));
    }
    for face in faces.iter().flatten() {
        add(face.normal.cross(DVec3::Z.cross(face.normal)));
    }
    directions.truncate(8);
    let mut found = Vec::new();
    let steps = (FARTHEST_M / SLIDE_STEP_M) as i32;
    for direction in &directions {
        found.extend(
            (-steps..=steps)
                .filter(|step| *step != 0)
                .map(|step| Screw::slide(*direction, f64::from(step) * SLIDE_STEP_M)),
        );
    }
    for before in &faces[0] {
        for after in &faces[1] {
            found.extend(turns_between(before, after));
        }
    }
    for (frame, own) in faces.iter().enumerate() {
        for face in own.iter().take(2) {
            found.extend(turns_at_edges(face, frame, &directions));
        }
    }
    found
}

/// Turns that bring one face onto another: their axis lies where both meet, or beside it on the bisector.
fn turns_between(before: &Face, after: &Face) -> Vec<Screw> {
    let mut found = Vec::new();
    for side in [1.0, -1.0] {
        let to = after.normal * side;
        let Some(axis) = before.normal.cross(to).try_normalize() else { continue };
        let angle = before.normal.angle_between(to);
        if !(PARALLEL_RAD..=GREATEST_RAD + 0.3).contains(&angle) {
            continue;
        }
        // The point nearest to the origin of the line where `n . p = offset + h` for both faces.
        let dot = before.normal.dot(to);
        let middle = after.points.iter().chain(&before.points).sum::<DVec3>()
            / (after.points.len() + before.points.len()).max(1) as f64;
        for step in -10..=10 {
            let h = 0.01 * f64::from(step);
            let (a, b) = (before.offset + h, after.offset * side + h);
            let point = (before.normal * (a - b * dot) + to * (b - a * dot)) / (1.0 - dot * dot);
            found.push(Screw::turn(axis, point, angle).anchored(middle));
        }
    }
    found
}

/// Turns about axes along the edges of one face.
fn turns_at_edges(face: &Face, frame: usize, directions: &[DVec3]) -> Vec<Screw> {
    let mut found = Vec::new();
    let middle = face.points.iter().sum::<DVec3>() / face.points.len().max(1) as f64;
    // From the first frame to the second; a face of the second is turned back.
    let sign = if frame == 0 { 1.0 } else { -1.0 };
    let steps = (GREATEST_RAD / TURN_STEP_RAD) as i32;
    for axis in directions {
        let mut points = Vec::new();
        if let Some(across) = axis.cross(face.normal).try_normalize().filter(|_| axis.dot(face.normal).abs() < 0.5) {
            let places = face.points.iter().map(|p| (*p - middle).dot(across));
            let (low, high) = places.fold((f64::MAX, f64::MIN), |(low, high), at| (low.min(at), high.max(at)));
            for edge in [low, high] {
                points.extend(OFFSETS_M.iter().map(|offset| middle + across * edge + face.normal * *offset));
            }
        } else {
            points.push(middle);
        }
        for point in points {
            let turns = (-steps..=steps).filter(|step| *step != 0);
            found.extend(turns.map(|step| Screw::turn(*axis, point, sign * f64::from(step) * TURN_STEP_RAD)));
        }
    }
    found
}
