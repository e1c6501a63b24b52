#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use super::{
    score::{Tally, score},
    trial::{Trial, Truth},
    *,
};
use acm_concept::{
    camera::{FrameHeader, Intrinsics, RgbdFrame},
    ids::FrameId,
    pose::Pose,
    time::Time,
};
use acm_perception::articulation::{JointModel, MovedPart, NotTold};
use glam::DVec3;

/// A hinge along z through (1, 0, 0) whose part shows in the first half of the second frame alone.
fn trial() -> Trial {
    let intrinsics = Intrinsics::from_vertical_fov(20, 20, 1.0);
    let header = FrameHeader {
        id: FrameId(0),
        camera: "camera".into(),
        time: Time::ZERO,
        intrinsics,
        camera_pose: Pose::IDENTITY,
    };
    let frame = RgbdFrame::new(header, vec![0; 1200].into(), vec![1.0; 400].into()).unwrap();
    let part = [vec![false; 400], (0..400).map(|pixel| pixel < 200).collect()];
    let truth = Truth {
        name: "door".into(),
        is_hinge: true,
        origin: DVec3::X,
        axis: DVec3::Z,
        moved: 0.5,
        seen: (DVec3::X * 1.01, DVec3::Z),
    };
    Trial { frames: [frame.clone(), frame], part, shows: true, truth }
}

fn answer(joint: JointModel, pixels: usize) -> Result<Vec<MovedPart>, NotTold> {
    Ok(vec![MovedPart { before: Vec::new(), after: (0..pixels).collect(), joint, confidence: 1.0 }])
}

fn hinge(x: f64, tilt: f64) -> JointModel {
    let axis = -DVec3::new(tilt, 0.0, 1.0).normalize();
    JointModel::Revolute { axis, point: DVec3::new(x, 0.0, 0.3), angle_rad: 0.5, sigma: [0.1, 0.01, 0.1] }
}

fn figures(answer: &Result<Vec<MovedPart>, NotTold>) -> [f64; 2] {
    let mut tally = Tally::default();
    tally.add(&score(&trial(), answer));
    let figures = tally.figures();
    ["articulation_part_and_joint", "articulation_axis"]
        .map(|name| figures.iter().find(|(figure, _)| *figure == name).unwrap().1)
}

#[test]
fn answers_are_scored_against_the_truth() {
    assert_eq!(figures(&answer(hinge(1.01, 0.0), 200)), [1.0, 1.0], "an axis has no sign");
    assert_eq!(figures(&answer(hinge(1.03, 0.0), 200)), [1.0, 0.0], "3 cm off");
    assert_eq!(figures(&answer(hinge(1.0, 0.12), 200)), [1.0, 0.0], "7 degrees off");
    assert_eq!(figures(&answer(hinge(1.0, 0.0), 400)), [1.0, 1.0], "half of it is enough");
    assert_eq!(figures(&answer(hinge(1.0, 0.0), 90)), [0.0, 1.0], "most of the part is missed");
    let slide = JointModel::Prismatic { axis: DVec3::Z, distance_m: 0.1, sigma: [0.1, 0.01] };
    assert_eq!(figures(&answer(slide, 200)), [0.0, 0.0], "it turns");
    assert_eq!(figures(&Err(NotTold::NothingMoved)), [0.0, 0.0], "what is not told counts");
    assert!(Tally::default().figures().is_empty());
}

#[test]
fn a_part_that_hardly_shows_counts_for_its_joint_and_not_for_its_axis() {
    let mut tally = Tally::default();
    tally.add(&score(&trial(), &answer(hinge(1.0, 0.0), 200)));
    tally.add(&score(&Trial { shows: false, ..trial() }, &Err(NotTold::NothingMoved)));
    let figures = tally.figures();
    assert_eq!(figures, [("articulation_part_and_joint", 0.5), ("articulation_axis", 1.0)]);
    assert_eq!((tally.asked(), tally.hidden()), (2, 1));
}

#[test]
fn a_perfect_reading_has_the_cameras_errors() {
    let scored = score(&trial(), &Err(NotTold::NothingMoved));
    assert!(scored.bias.0 < 1e-6 && (scored.bias.1 - 0.01).abs() < 1e-9, "{:?}", scored.bias);
}

#[test]
fn a_thing_of_the_shared_data_is_drawn_with_its_truth() {
    let Some(data) = std::env::var_os("ACM_DATA") else {
        return println!("skipped: the variable ACM_DATA does not name the shared data");
    };
    let Ok(mut renderer) = Renderer::new() else { return println!("skipped: there is no renderer") };
    let families = families(Path::new(&data));
    assert_eq!(families.iter().map(|family| family.name).collect::<Vec<_>>(), ["infinigen", "franka", "libero"]);
    let family = families.iter().find(|family| family.name == "libero").unwrap();
    let thing = Mechanism::load(&family.things[0]).unwrap();
    let mut drawn = || match draw(&mut renderer, family, &thing, 7).unwrap() {
        Drawn::Trial(trial, _) => *trial,
        Drawn::ShutIn(joints) => panic!("all of {joints} joints are shut in"),
    };
    let (one, same) = (drawn(), drawn());
    assert_eq!((&one.frames, &one.part, &one.truth), (&same.frames, &same.part, &same.truth), "a seed is a trial");
    let shown = one.part.iter().map(|pixels| pixels.iter().filter(|shown| **shown).count()).max().unwrap();
    assert!((shown >= LEAST_PIXELS) == one.shows && one.truth.moved.abs() > 0.03);
    // What the camera's errors do to the axis is little beside the thing.
    assert!(one.truth.seen.0.distance(one.truth.origin) < 0.08);
}
