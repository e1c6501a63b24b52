//! Every template of the library that ships: what its file claims is true of its solids.
#![allow(clippy::unwrap_used, clippy::expect_used)] // A failed unwrap is a failed test.

use acm_concept::{
    pose::Pose,
    solid::PlacedSolid,
    template::{Template, TemplateLibrary, YawSymmetry},
};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::TAU;

/// Rounding of expressions and of the middle of a range that meets a constraint, metres.
const TOUCHES_M: f64 = 5e-4;

fn library() -> TemplateLibrary {
    acm_memory::library_of(&acm_memory::library_groups()).unwrap()
}

/// A template with its typical values and solids.
fn made(template: &Template) -> (Vec<(&str, f64)>, Vec<PlacedSolid>) {
    let values = template.typical().unwrap_or_else(|| panic!("{}: no values meet its constraints", template.name));
    let named = template.named(&values);
    let solids = template.solids(&named).unwrap();
    (named, solids)
}

fn bounds(solids: &[PlacedSolid]) -> (DVec3, DVec3) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    solids.iter().map(PlacedSolid::bounds).fold(start, |a, b| (a.0.min(b.0), a.1.max(b.1)))
}

fn turned(solids: &[PlacedSolid], turn: DQuat) -> Vec<PlacedSolid> {
    let turn = Pose::new(DVec3::ZERO, turn);
    solids.iter().map(|s| PlacedSolid { solid: s.solid, pose: turn * s.pose }).collect()
}

fn distance(solids: &[PlacedSolid], point: DVec3) -> f64 {
    solids.iter().map(|s| s.signed_distance(point)).fold(f64::INFINITY, f64::min)
}

/// Points of a grid of about 40 steps a side over a box, those in the solids.
fn filled(solids: &[PlacedSolid]) -> Vec<DVec3> {
    let (low, high) = bounds(solids);
    let count = 40;
    let at = |i: usize, a: f64, b: f64| a + (b - a) * (i as f64 + 0.5) / count as f64;
    let mut points = Vec::new();
    for i in 0..count * count * count {
        let (x, y, z) = (i % count, i / count % count, i / count / count);
        let point = DVec3::new(at(x, low.x, high.x), at(y, low.y, high.y), at(z, low.z, high.z));
        if distance(solids, point) <= 0.0 {
            points.push(point);
        }
    }
    points
}

/// Whether a body stands on the plane of its lowest points: what touches it lies round its centre of volume.
fn stands(solids: &[PlacedSolid], slack: f64) -> bool {
    let (low, high) = bounds(solids);
    let points = filled(solids);
    let centre = points.iter().sum::<DVec3>().truncate() / points.len() as f64;
    let count = 160;
    let step = (high - low).truncate() / f64::from(count);
    let mut reach = [f64::NEG_INFINITY; 16];
    for i in 0..=count {
        for j in 0..=count {
            let at = low.truncate() + step * DVec2::new(f64::from(i), f64::from(j));
            if distance(solids, at.extend(low.z)) < TOUCHES_M {
                for (side, reach) in reach.iter_mut().enumerate() {
                    *reach = reach.max(DVec2::from_angle(side as f64 * TAU / 16.0).dot(at - centre));
                }
            }
        }
    }
    // A body that touches along a line or at a point is held up there and may roll.
    reach.iter().all(|reach| *reach >= -slack * step.length())
}

/// Runs a check over all templates, and names all that fail.
fn each(check: impl Fn(&Template) -> Result<(), String>) {
    let library = library();
    let wrong = library.iter().filter_map(|t| check(t).err().map(|what| format!("{}: {what}", t.name)));
    assert_eq!(wrong.collect::<Vec<_>>(), Vec::<String>::new());
}

/// An error unless a condition holds.
fn ensure(holds: bool, what: impl FnOnce() -> String) -> Result<(), String> {
    if holds { Ok(()) } else { Err(what()) }
}

#[test]
fn solids_are_whole_and_stand_on_their_base() {
    each(|template| {
        let (_, solids) = made(template);
        let (low, high) = bounds(&solids);
        ensure(low.is_finite() && high.is_finite(), || "it has no bounds".into())?;
        ensure(low.z.abs() < TOUCHES_M, || format!("its lowest point lies at {} m", low.z))?;
        for solid in &solids {
            let size = solid.solid.half_extents().min_element();
            ensure(size > 1e-4 && solid.solid.volume() > 1e-11, || format!("{solid:?}"))?;
        }
        if template.stands_alone {
            ensure(stands(&solids, 2.0), || "it falls over".into())?;
            let off = (0.5 * (low + high)).truncate().length() / (high - low).truncate().max_element();
            ensure(off < 0.3, || format!("its base lies off its middle by {off} of its size"))?;
        }
        Ok(())
    });
}

#[test]
fn a_thing_is_in_one_piece() {
    /// Points in a solid, of a grid of 25 a side.
    fn inside(placed: &PlacedSolid) -> impl Iterator<Item = DVec3> + '_ {
        let half = placed.solid.half_extents();
        let at = |i: i32| f64::from(i % 25) / 12.0 - 1.0;
        let local = move |i: i32| half * DVec3::new(at(i), at(i / 25), at(i / 625));
        let points = (0..25 * 25 * 25).map(local).filter(|point| placed.solid.signed_distance(*point) < 1e-6);
        points.map(|point| placed.pose.transform_point(point))
    }
    each(|template| {
        let (_, solids) = made(template);
        let touch = |a: &PlacedSolid, b: &PlacedSolid| inside(a).any(|point| b.signed_distance(point) < 1e-3);
        let mut joined = vec![false; solids.len()];
        joined[0] = true;
        let reached = |joined: &[bool], i: usize| {
            (0..solids.len()).any(|j| joined[j] && (touch(&solids[i], &solids[j]) || touch(&solids[j], &solids[i])))
        };
        while let Some(next) = (0..solids.len()).find(|&i| !joined[i] && reached(&joined, i)) {
            joined[next] = true;
        }
        ensure(joined.iter().all(|joined| *joined), || format!("solids that hang on the first: {joined:?}"))
    });
}

#[test]
fn frames_lie_on_the_thing_and_functions_act_at_them() {
    each(|template| {
        let (values, solids) = made(template);
        let (low, high) = bounds(&solids);
        let margin = DVec3::splat(0.05);
        for name in template.frame_names() {
            let at = template.frame(name, &values).unwrap().unwrap().translation;
            let inside = at.cmpge(low - margin).all() && at.cmple(high + margin).all();
            ensure(inside, || format!("the frame `{name}` lies at {at}, the thing from {low} to {high}"))?;
        }
        for function in &template.functions {
            let argument = |name: &str| function.arguments.get(name).map(|value| value.evaluate(&values).unwrap());
            for name in function.arguments.keys() {
                let signed = name.starts_with("axis_") || name.starts_with("hinge_");
                let value = argument(name).unwrap();
                let fits = value.is_finite() && (signed || value > 0.0);
                ensure(fits, || format!("`{name}` of `{}` is {value}", function.name))?;
            }
            // Fingers go to a surface, round a rim or across a mouth, not past the thing.
            let at = template.frame(&function.frame, &values).unwrap().unwrap().translation;
            let (off, reach) = (distance(&solids, at), 0.5 * argument("grip_width").unwrap_or(0.0) + 0.01);
            let placed = function.kind == "place-upright";
            ensure(off < reach.max(0.02) || placed, || format!("`{}` acts {off} m off", function.name))?;
        }
        ensure(template.frame_names().count() > 0, || "it has no frames".into())
    });
}

/// How far the surfaces of a body that rays from all sides meet are from another body, metres.
fn differing(a: &[PlacedSolid], b: &[PlacedSolid]) -> f64 {
    let (low, high) = bounds(a);
    let (middle, radius) = (0.5 * (low + high), 0.5 * low.distance(high));
    let mut worst = 0.0f64;
    for side in 0..40 {
        // From all round and above, towards the body's bounds.
        let turn = f64::from(side) * 2.399963;
        let rise = (f64::from(side) + 0.5) / 40.0;
        let from = (DVec2::from_angle(turn) * (1.0 - rise * rise).sqrt()).extend(rise);
        let right = from.any_orthonormal_vector();
        let up = from.cross(right);
        for (i, j) in (-20..=20).flat_map(|i| (-20..=20).map(move |j| (f64::from(i), f64::from(j)))) {
            let origin = middle + from * (2.0 * radius) + (right * i + up * j) * (radius / 20.0);
            let enters = a.iter().filter_map(|s| s.intersect_ray(origin, -from)).map(|(enter, _)| enter);
            let enter = enters.fold(f64::INFINITY, f64::min);
            if enter.is_finite() {
                worst = worst.max(distance(b, origin - from * enter).abs());
            }
        }
    }
    worst
}

/// What may differ, of the longest side, where a symmetry is claimed: sides that differ by an eighth count as equal.
const ALIKE: f64 = 0.065;
/// What must differ where none is claimed.
const UNLIKE: f64 = 0.015;

#[test]
fn symmetries_are_true_and_none_is_left_out() {
    each(|template| {
        let (values, solids) = made(template);
        let (low, high) = bounds(&solids);
        let off = |turn: f64| {
            let far = differing(&solids, &turned(&solids, DQuat::from_rotation_z(turn)));
            far / (high - low).truncate().max_element()
        };
        match template.yaw_symmetry(&values).unwrap() {
            YawSymmetry::Continuous => {
                let far = off(0.7).max(off(2.0));
                ensure(far < 1e-6, || format!("it is not round: {far} of its size is elsewhere after a turn"))
            }
            YawSymmetry::Fold(fold) => {
                let far = off(TAU / f64::from(fold));
                ensure(far < ALIKE, || format!("it has no fold {fold}: {far} of its size is elsewhere"))?;
                let more = [2, 4].into_iter().filter(|more| *more > fold && template.stands_alone);
                for more in more {
                    ensure(off(TAU / f64::from(more)) > UNLIKE, || format!("it has fold {more} as well"))?;
                }
                Ok(())
            }
        }
    });
}

#[test]
fn things_rest_as_their_files_say() {
    each(|template| {
        let (_, solids) = made(template);
        for rest in &template.rests {
            let lying = turned(&solids, rest.turn());
            ensure(stands(&lying, 2.0), || format!("it does not rest with {} up", rest.up))?;
            let turn = match rest.symmetry {
                YawSymmetry::Continuous => 0.9,
                YawSymmetry::Fold(fold) => TAU / f64::from(fold),
            };
            // Round its own middle: the base frame of what lies is not there.
            let (low, high) = bounds(&lying);
            let centre = Pose::from_translation(-(0.5 * (low + high)).with_z(0.0));
            let centred: Vec<_> = lying.iter().map(|s| PlacedSolid { solid: s.solid, pose: centre * s.pose }).collect();
            let far = differing(&centred, &turned(&centred, DQuat::from_rotation_z(turn)));
            let far = far / (high - low).truncate().max_element();
            ensure(far < ALIKE, || format!("with {} up {far} of it is elsewhere after a turn", rest.up))?;
        }
        Ok(())
    });
}
