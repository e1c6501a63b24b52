//! Skills run closed-loop in a small world whose surfaces are not where they were perceived.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::indexing_slicing, reason = "a test stops where it fails")]

mod grasp;
mod place;
mod press;
mod refusals;
mod world;

use acm_concept::{
    color::{Appearance, Lab},
    embodiment::Embodiment,
    ids::{ObjectId, PartId},
    literal::Place,
    object::{GroundedPart, PoseEstimate},
    pose::Pose,
    skill::{PrimitiveReport, SkillInvocation, SkillReport},
    solid::{PlacedSolid, Solid},
};
use acm_skills::{RetreatTick, Tick, retreat, start};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;
use world::{TABLE_M, World};

/// More ticks than any skill may take: 40 s.
const MAX_TICKS: usize = 2000;

fn part(pose: Pose) -> GroundedPart {
    let pose = PoseEstimate { pose, position_sigma_m: DVec3::splat(0.005), yaw_sigma_rad: 0.05 };
    let appearance = Appearance::plain(Lab { l: 50.0, a: 0.0, b: 0.0 }, 2.0);
    let (template, none) = ("box".into(), Vec::new());
    GroundedPart {
        template,
        name: "whole".into(),
        parameters: vec![],
        pose,
        affordances: none.clone(),
        functions: none,
        appearance,
    }
}

fn invocation(kind: &str, base: Pose, frame_height_m: f64, arguments: &[(&str, f64)]) -> SkillInvocation {
    let object = ObjectId(1);
    SkillInvocation {
        skill: kind.into(),
        entry: None,
        kind: kind.into(),
        part: PartId { object, index: 0 },
        target: part(base),
        frame: base * Pose::from_translation(DVec3::Z * frame_height_m),
        arguments: arguments.iter().map(|(name, value)| (name.to_string(), *value)).collect::<BTreeMap<_, _>>(),
        destination: None,
        obstacles: vec![],
        support_height_m: base.translation.z,
        held: None,
        held_solids: vec![],
        attempt: 0,
    }
}

/// A pick of a block of this size perceived with its base there.
fn pick(size: DVec3, base: Pose) -> SkillInvocation {
    let arguments = [("grip_width", size.y), ("cross_width", size.x), ("height", size.z)];
    invocation("grasp-from-above", base, size.z - (size.z / 2.0).min(0.02), &arguments)
}

/// A place of what is held with its base there.
fn place(held: Pose, base: Pose) -> SkillInvocation {
    let mut invocation = invocation("place-upright", base, 0.0, &[("grip_width", 0.04), ("height", 0.04)]);
    invocation.destination = Some(Place { support: None, pose: base, tolerance_m: 0.02, heading_tolerance_rad: None });
    invocation.held = Some((ObjectId(1), held, part(base)));
    invocation
}

fn neighbour(center: DVec2, size: DVec3) -> (ObjectId, PlacedSolid) {
    let pose = Pose::from_translation(center.extend(TABLE_M + 0.5 * size.z));
    (ObjectId(9), PlacedSolid { solid: Solid::Box { size }, pose })
}

fn table_pose(x: f64, y: f64, yaw: f64) -> Pose {
    Pose::from_yaw(DVec3::new(x, y, TABLE_M), yaw)
}

/// Runs a skill to its end; `meddle` is called before each tick with the number of ticks so far.
fn run_with(world: &mut World, invocation: &SkillInvocation, mut meddle: impl FnMut(&mut World, usize)) -> SkillReport {
    let mut controller = start(invocation, &world.description().clone(), &world.feedback()).unwrap();
    for tick in 0..MAX_TICKS {
        meddle(world, tick);
        match controller.tick(&world.feedback()) {
            Tick::Act(command) => {
                world.command(&command).unwrap();
            }
            Tick::Finished(report) => {
                assert_eq!(controller.tick(&world.feedback()), Tick::Finished(report.clone()));
                return *report;
            }
        }
    }
    panic!("the skill did not end");
}

fn run(world: &mut World, invocation: &SkillInvocation) -> SkillReport {
    run_with(world, invocation, |_, _| {})
}

fn go_home(world: &mut World) -> PrimitiveReport {
    let mut retreat = retreat(&world.description().clone(), &world.feedback());
    for _ in 0..MAX_TICKS {
        match retreat.tick(&world.feedback()) {
            RetreatTick::Act(command) => {
                world.command(&command).unwrap();
            }
            RetreatTick::Finished(report) => return report,
        }
    }
    panic!("the retreat did not end");
}

/// Confidence of a felt literal, by its text.
fn felt(report: &SkillReport, text: &str) -> Option<f64> {
    report.felt.iter().find(|(literal, _)| literal.to_string() == text).map(|(_, confidence)| *confidence)
}
