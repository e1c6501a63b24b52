#![allow(clippy::unwrap_used)] // a failed step is a failed test
use super::{
    scene::TABLE_M,
    score::{Fate, Scored, score},
    *,
};
use acm_concept::{
    camera::CameraModel,
    color::{Appearance, Lab},
    object::{GroundedObject, GroundedPart, Observability, ParameterEstimate, Percepts, PixelSupport, PoseEstimate},
    pose::Pose,
    solid::PlacedSolid,
};
use glam::{DVec2, DVec3};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// One renderer for all tests, made by the first; `None` where nothing can render.
static EYE: Mutex<Option<Eye>> = Mutex::new(None);

fn eye() -> Option<MutexGuard<'static, Option<Eye>>> {
    let mut eye = EYE.lock().unwrap_or_else(PoisonError::into_inner);
    if eye.is_none() {
        match Renderer::new() {
            Ok(renderer) => *eye = Some(Eye::new(renderer)),
            Err(error) => {
                println!("skipped: {error}");
                return None;
            }
        }
    }
    Some(eye)
}

struct Case {
    plan: Plan,
    library: TemplateLibrary,
    scene: Scene,
    view: View,
}

fn case(kind: RowKind, touching: bool, seed: u64) -> Option<Case> {
    let library = acm_memory::default_library().unwrap();
    let plan = Plan::own(&library).unwrap();
    let mut guard = eye()?;
    let wanted = Wanted { kind, touching };
    let (scene, view) =
        draw(&plan, &library, &mut thing::Foreign::default(), guard.as_mut().unwrap(), wanted, seed).unwrap();
    drop(guard);
    Some(Case { plan, library, scene, view })
}

impl Case {
    fn true_camera(&self, seed: u64) -> CameraModel {
        view::sensor(&self.plan, seed).unwrap().0.true_camera(&self.scene.camera)
    }
    fn mask(&self, at: usize) -> Vec<bool> {
        self.view.labels.iter().map(|label| usize::from(*label) == at + 1).collect()
    }
    fn solids(&self, at: usize) -> Vec<PlacedSolid> {
        let thing = &self.scene.things[at];
        let truth = thing.template.as_ref().unwrap();
        let template = self.library.get(&truth.template).unwrap();
        let solids = template.solids(&template.named(&truth.values)).unwrap();
        solids.into_iter().map(|own| PlacedSolid { pose: thing.pose * own.pose, ..own }).collect()
    }
    fn score(&self, objects: Vec<GroundedObject>) -> Scored {
        let frame = &self.view.frames[0];
        let percepts = Percepts {
            frame: frame.header.clone(),
            support: None,
            objects,
            expected: Vec::new(),
            blindness: None,
            depth_fraction: 1.0,
        };
        score(&self.scene, &self.view.labels, &percepts, &self.library)
    }
    /// What perception would say if it knew the truth.
    fn perfect(&self) -> Vec<GroundedObject> {
        (0..self.scene.things.len()).map(|at| self.perfect_object(at)).collect()
    }
    fn perfect_object(&self, at: usize) -> GroundedObject {
        let thing = &self.scene.things[at];
        let truth = thing.template.as_ref().unwrap();
        let template = self.library.get(&truth.template).unwrap();
        let named = template.named(&truth.values);
        let estimate = |(name, value): &(&str, f64)| ParameterEstimate {
            name: (*name).into(),
            value: *value,
            sigma: 0.001,
            observability: Observability::Observed,
        };
        let parameters: Vec<ParameterEstimate> = named.iter().map(estimate).collect();
        let grey = Appearance::plain(Lab::from_srgb([128; 3]), 0.0);
        let part = |(spec, frame): (&acm_concept::template::PartSpec, Pose)| GroundedPart {
            template: template.name.clone(),
            name: spec.name.clone(),
            parameters: parameters.clone(),
            pose: PoseEstimate { pose: thing.pose * frame, position_sigma_m: DVec3::splat(0.001), yaw_sigma_rad: 0.01 },
            affordances: Vec::new(),
            functions: Vec::new(),
            appearance: grey,
        };
        let frames = template.part_frames(&named).unwrap();
        let width = self.scene.camera.intrinsics.width as usize;
        GroundedObject {
            category: template.name.clone(),
            categories: Vec::new(),
            parts: template.parts.iter().zip(frames).map(part).collect(),
            appearance: grey,
            support: PixelSupport::from_mask(&self.mask(at), width).unwrap(),
            confidence: 1.0,
            truncated: false,
            expected: None,
            readings: Vec::new(),
        }
    }
}

/// Seeds of scenes of the exact row, half of them with things that touch.
const CASES: [(RowKind, bool, u64); 4] = [
    (RowKind::Exact, false, 0),
    (RowKind::Exact, true, 1),
    (RowKind::Perturbed, false, 4),
    (RowKind::Perturbed, true, 5),
];

#[test]
fn a_seed_gives_the_same_scene_and_the_same_noise() {
    for (kind, touching, seed) in CASES {
        let (Some(first), Some(again)) = (case(kind, touching, seed), case(kind, touching, seed)) else { return };
        assert_eq!(first.view.labels, again.view.labels);
        assert_eq!(first.view.frames, again.view.frames);
        let truth = |case: &Case| -> Vec<_> {
            case.scene.things.iter().map(|thing| (thing.template.clone(), thing.pose, thing.touches)).collect()
        };
        assert_eq!(truth(&first), truth(&again));
        let (one, two) = (&first.view.frames[0], &first.view.frames[1]);
        assert_ne!(one.depth, two.depth, "the two frames differ in their noise");
        assert_eq!(one.header.camera_pose, first.scene.camera.pose, "perception is told the nominal pose");
        let Some(other) = case(kind, touching, seed + 10) else { return };
        assert_ne!(truth(&first), truth(&other));
    }
}

#[test]
fn masks_lie_where_the_geometry_says() {
    for (kind, touching, seed) in CASES {
        let Some(case) = case(kind, touching, seed) else { return };
        let camera = case.true_camera(seed);
        let (inverse, width) = (camera.pose.inverse(), camera.intrinsics.width as usize);
        for (at, _) in case.scene.things.iter().enumerate() {
            let solids = case.solids(at);
            let mask = case.mask(at);
            // A ray through a pixel of the mask meets the thing; perturbed ones are off by a few millimetres.
            let pixels: Vec<usize> = (0..mask.len()).filter(|index| mask[*index]).collect();
            let hits = pixels.iter().filter(|index| {
                let ray = camera.intrinsics.ray((*index % width) as f64, (*index / width) as f64);
                let direction = camera.pose.transform_vector(ray);
                solids.iter().any(|solid| solid.intersect_ray(camera.pose.translation, direction).is_some())
            });
            let share = hits.count() as f64 / pixels.len() as f64;
            let least = if kind == RowKind::Exact { 0.99 } else { 0.93 };
            assert!(share > least, "{kind:?} seed {seed} thing {at}: {share}");
            // And its middle lies near the middle of what is seen.
            let middle = solids.iter().map(|solid| solid.pose.translation).sum::<DVec3>() / solids.len() as f64;
            let seen = camera.intrinsics.project(inverse.transform_point(middle)).unwrap();
            let mean = |of: fn(usize, usize) -> usize| {
                pixels.iter().map(|index| of(*index, width) as f64).sum::<f64>() / pixels.len() as f64
            };
            let centroid = DVec2::new(mean(|index, width| index % width), mean(|index, width| index / width));
            let reach = (pixels.len() as f64).sqrt();
            assert!(seen.distance(centroid) < 0.7 * reach, "{kind:?} seed {seed} thing {at}: {seen} {centroid}");
        }
    }
}

/// Smallest distance of points on a thing's surface from another one's solids, metres.
fn distance(case: &Case, a: usize, b: usize) -> f64 {
    let thing = &case.scene.things[a];
    let solids = case.solids(b);
    let mut least = f64::INFINITY;
    for [p, q, r] in thing.pieces.iter().flat_map(thing::triangles) {
        for i in 0..=40 {
            for j in 0..=40 - i {
                let (u, v) = (f64::from(i) / 40.0, f64::from(j) / 40.0);
                let point = thing.pose.transform_point(p + (q - p) * u + (r - p) * v);
                least = solids.iter().map(|solid| solid.signed_distance(point)).fold(least, f64::min);
            }
        }
    }
    least
}

#[test]
fn what_touches_touches_and_what_is_spaced_is_apart() {
    let (mut pairs, mut apart) = (0, 0);
    for seed in [1, 3, 11, 13] {
        let Some(case) = case(RowKind::Exact, true, seed) else { return };
        for (at, thing) in case.scene.things.iter().enumerate() {
            for other in (0..case.scene.things.len()).filter(|other| *other != at) {
                let gap = distance(&case, at, other);
                if thing.touches == Some(other) {
                    assert!((-0.0005..0.003).contains(&gap), "seed {seed}, {at} and {other}: {gap}");
                    assert_eq!(case.scene.things[other].touches, Some(at));
                    pairs += 1;
                } else if thing.touches.is_none() && case.scene.things[other].touches.is_none() {
                    assert!(gap > 0.0295, "seed {seed}, {at} and {other}: {gap}");
                    apart += 1;
                }
            }
        }
    }
    let Some(spaced) = case(RowKind::Exact, false, 0) else { return };
    for at in 1..spaced.scene.things.len() {
        assert!(distance(&spaced, 0, at) > 0.0295);
        apart += 1;
    }
    assert!(pairs >= 8 && apart >= 1, "{pairs} {apart}");
}

#[test]
fn a_perfect_answer_is_right_in_every_figure_and_none_in_none() {
    let (mut perfect, mut empty) = (Tally::default(), Tally::default());
    for (kind, touching, seed) in CASES.into_iter().chain([(RowKind::Exact, false, 2), (RowKind::Exact, true, 3)]) {
        let Some(case) = case(kind, touching, seed) else { return };
        let scored = case.score(case.perfect());
        assert!(scored.fates.iter().all(|fate| *fate == Fate::Right), "{:?}", scored.fates);
        perfect.add(&scored.tally);
        let nothing = case.score(Vec::new());
        assert!(nothing.fates.iter().all(|fate| *fate == Fate::Missed));
        empty.add(&nothing.tally);
    }
    let figures: BTreeMap<&str, f64> = perfect.figures().into_iter().collect();
    let best = ["found_spaced", "found_touching", "template_accuracy", "part_iou", "interval90_coverage"];
    for name in best.into_iter().chain(["opening_angle_within_5deg"]) {
        assert!(figures[name] > 1.0 - 1e-9, "{name} {}", figures[name]);
        let none = empty.figures().into_iter().find(|(known, _)| *known == name);
        assert_eq!(none, Some((name, 0.0)));
    }
    for (name, value) in &figures {
        if name.contains("error") || *name == "false_objects" {
            assert!(value.abs() < 1e-6, "{name} {value}");
        }
    }
    assert!(!empty.figures().iter().any(|(name, _)| name.contains("error")), "what was not found has no error");
}

#[test]
fn wrong_answers_are_told_apart() {
    let Some(case) = case(RowKind::Exact, true, 1) else { return };
    let width = case.scene.camera.intrinsics.width as usize;
    let pair: Vec<usize> = (0..case.scene.things.len()).filter(|at| case.scene.things[*at].touches.is_some()).collect();
    let (a, b) = (pair[0], case.scene.things[pair[0]].touches.unwrap());
    // Both as one.
    let mut merged = case.perfect();
    let both: Vec<bool> = case.mask(a).iter().zip(case.mask(b)).map(|(a, b)| *a || b).collect();
    merged[a].support = PixelSupport::from_mask(&both, width).unwrap();
    merged.remove(b);
    let scored = case.score(merged);
    assert!([a, b].iter().any(|at| scored.fates[*at] == Fate::Merged), "{:?}", scored.fates);
    assert_eq!(scored.tally.false_objects, 0);
    // One in two pieces, cut by columns at the middle of its pixels.
    let mut split = case.perfect();
    let pixels = split[a].support.indices();
    let mut columns: Vec<usize> = pixels.iter().map(|index| index % width).collect();
    columns.sort_unstable();
    let middle = columns[columns.len() / 2];
    let half = |left: bool| -> Vec<bool> {
        case.mask(a).iter().enumerate().map(|(index, own)| *own && (index % width < middle) == left).collect()
    };
    let piece = GroundedObject { support: PixelSupport::from_mask(&half(false), width).unwrap(), ..split[a].clone() };
    split[a].support = PixelSupport::from_mask(&half(true), width).unwrap();
    split.push(piece);
    let scored = case.score(split);
    assert_eq!((scored.fates[a], scored.tally.false_objects), (Fate::Split, 1));
    // Turned, grown, and off its place.
    let mut off = case.perfect();
    for part in &mut off[a].parts {
        part.pose.pose.translation += DVec3::X * 0.012;
        part.parameters[0].value += 0.02;
    }
    let scored = case.score(off);
    assert_eq!(scored.fates[a], Fate::WrongSize);
    assert!(scored.tally.dimension_mm.iter().any(|error| (error - 20.0).abs() < 1e-6));
    assert!(scored.tally.absolute_mm.iter().any(|error| (error - 12.0).abs() < 1e-6));
    assert_eq!(scored.tally.interval.of - scored.tally.interval.held, 1);
}

#[test]
fn volumes_are_compared_by_their_common_part() {
    let cube = |x: f64| {
        let pose = Pose::from_translation(DVec3::new(x, 0.0, TABLE_M));
        vec![PlacedSolid { solid: acm_concept::solid::Solid::Box { size: DVec3::splat(0.1) }, pose }]
    };
    assert!((score::iou(&cube(0.0), &cube(0.05)) - 1.0 / 3.0).abs() < 0.02);
    assert_eq!((score::iou(&cube(0.0), &cube(0.0)), score::iou(&cube(0.0), &cube(0.3))), (1.0, 0.0));
}

#[test]
fn a_bad_suite_file_names_its_field() {
    let library = acm_memory::default_library().unwrap();
    let own = include_str!("../suite.toml");
    let error = |from: &str, to: &str| {
        let text = own.replacen(from, to, 1);
        assert_ne!(text, own, "{from}");
        format!("{:#}", Plan::parse("s.toml", &text, &library).unwrap_err())
    };
    assert!(error("distance_m = [0.5, 1.0]", "distance_m = [1.5, 1.0]").contains("camera.distance_m"));
    assert!(error("name = \"cylinder\"", "name = \"cilinder\"").contains("cilinder"));
    assert!(error("attempts = 2000", "atempts = 2000").contains("atempts"));
    assert!(error("#ffffff", "white").contains("white"));
    assert!(error("profile = \"d435\"", "profile = \"d436\"").contains("profile"));
}

#[test]
fn the_rows_have_their_shares_and_half_of_each_touches() {
    let plan = Plan::own(&acm_memory::default_library().unwrap()).unwrap();
    let count = |kind: RowKind, touching: bool| {
        plan.scenes().filter(|(own, _, touches)| *own == kind && *touches == touching).count()
    };
    let counts = [RowKind::Exact, RowKind::Perturbed, RowKind::Foreign].map(|k| [count(k, false), count(k, true)]);
    assert_eq!(counts, [[40, 40], [30, 30], [30, 30]]);
}

#[test]
fn foreign_things_stand_on_the_table() {
    if std::env::var_os("ACM_DATA").is_none() {
        return println!("skipped: the variable ACM_DATA does not name the shared data");
    }
    let Some(case) = case(RowKind::Foreign, true, 7) else { return };
    for thing in &case.scene.things {
        let (low, _) = thing.outlines.bounds();
        assert!(low.z.abs() < 1e-6 && (thing.pose.translation.z - TABLE_M).abs() < 0.3);
        assert!((0.0799..=0.2201).contains(&thing.extents().max_element()), "{}", thing.extents());
    }
}
