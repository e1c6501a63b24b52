//! One suite for every robot: the same skills, over exact geometry, in the same scenario. What a skill asks of a robot,
//! every robot must give.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test stops where it fails")]

use acm_concept::{
    color::{Appearance, Lab},
    embodiment::{Embodiment, EmbodimentError, Feedback},
    ids::{ObjectId, PartId},
    literal::Place,
    object::{GroundedPart, PoseEstimate},
    pose::Pose,
    skill::{SkillInvocation, SkillReport},
    solid::{PlacedSolid, Solid},
    time::Time,
};
use acm_sim::{Scenario, Setting, SimOptions, Simulation, TrueObject};
use acm_skills::{RetreatTick, Tick, retreat, start};
use glam::DVec3;

const MAX_TICKS: usize = 4000;
const CUBE_M: f64 = 0.04;

/// A robot in a world, run by skills alone.
struct Trial {
    name: String,
    simulation: Simulation,
    robot: Box<dyn Embodiment>,
    /// Fastest that a hand was commanded, metres per second, and hardest that one pressed, newtons.
    fastest_m_s: f64,
    hardest_n: f64,
}

impl Trial {
    fn new(robot: &str, seed: u64, motion: bool) -> Trial {
        let setting: Setting = format!("robot.model={robot}").parse().unwrap();
        let scenario = Scenario::open_with("put-back-block-jittered", &[setting]).unwrap();
        let options = SimOptions { seed, motion, ..SimOptions::default() };
        let simulation = Simulation::without_renderer(&scenario, &options).unwrap();
        let robot_handle = simulation.embodiment();
        Trial { name: robot.into(), robot: robot_handle, simulation, fastest_m_s: 0.0, hardest_n: 0.0 }
    }
    fn object(&self, name: &str) -> TrueObject {
        self.simulation.truth().into_iter().find(|object| object.name == name).unwrap()
    }
    fn invocation(&self, kind: &str, object: &str, frame_m: f64, arguments: &[(&str, f64)]) -> SkillInvocation {
        let base = self.object(object).pose;
        let others = self.simulation.truth().into_iter().enumerate().map(|(index, other)| {
            let centre = Pose::from_translation(DVec3::Z * 0.5 * other.size_m.z);
            (
                ObjectId(10 + index as u64),
                PlacedSolid { solid: Solid::Box { size: other.size_m }, pose: other.pose * centre },
            )
        });
        let own = self.simulation.truth().iter().position(|other| other.name == object).unwrap();
        SkillInvocation {
            skill: kind.into(),
            entry: None,
            kind: kind.into(),
            part: PartId { object: ObjectId(10 + own as u64), index: 0 },
            target: part(base),
            frame: base * Pose::from_translation(DVec3::Z * frame_m),
            arguments: arguments.iter().map(|(name, value)| (name.to_string(), *value)).collect(),
            destination: None,
            obstacles: others.collect(),
            support_height_m: base.translation.z,
            held: None,
            held_solids: vec![],
            attempt: 0,
        }
    }
    fn pick(&mut self) -> SkillReport {
        let arguments = [("grip_width", CUBE_M), ("cross_width", CUBE_M), ("height", CUBE_M)];
        self.run(&self.invocation("grasp-from-above", "cube", 0.5 * CUBE_M, &arguments))
    }
    fn place(&mut self, held: (ObjectId, Pose), to: Pose) -> SkillReport {
        let mut invocation =
            self.invocation("place-upright", "cube", 0.0, &[("grip_width", CUBE_M), ("height", CUBE_M)]);
        let solid = Solid::Box { size: DVec3::splat(CUBE_M) };
        invocation.held_solids = vec![PlacedSolid { solid, pose: Pose::from_translation(DVec3::Z * 0.5 * CUBE_M) }];
        invocation.obstacles.retain(|(id, _)| *id != held.0);
        invocation.destination =
            Some(Place { support: None, pose: to, tolerance_m: 0.02, heading_tolerance_rad: None });
        invocation.held = Some((held.0, held.1, part(to)));
        invocation.support_height_m = to.translation.z;
        self.run(&invocation)
    }
    fn press(&mut self) -> SkillReport {
        let top_m = self.object("button").size_m.z;
        self.run(&self.invocation("press-down", "button", top_m, &[("stroke", 0.008), ("force", 12.0)]))
    }
    fn run(&mut self, invocation: &SkillInvocation) -> SkillReport {
        let robot = self.robot.description().clone();
        let mut feedback = self.robot.feedback();
        let mut controller = start(invocation, &robot, &feedback).unwrap();
        for _ in 0..MAX_TICKS {
            match controller.tick(&feedback) {
                Tick::Act(command) => feedback = self.perform(&command),
                Tick::Finished(report) => {
                    self.go_home();
                    return *report;
                }
            }
        }
        panic!("{}: {} did not end", self.name, invocation.kind);
    }
    fn perform(&mut self, command: &acm_concept::embodiment::Command) -> Feedback {
        let before = self.robot.feedback();
        let from = before.of_arm(command.arm).unwrap().tcp.translation;
        let felt = self.robot.command(command).unwrap_or_else(|error| panic!("{}: {error}", self.name));
        let speed = felt.tcp.translation.distance(from) / self.robot.description().tick_s;
        self.fastest_m_s = self.fastest_m_s.max(speed);
        self.hardest_n = self.hardest_n.max(felt.wrist_force_n.length());
        felt
    }
    fn go_home(&mut self) {
        let robot = self.robot.description().clone();
        let mut feedback = self.robot.feedback();
        let mut retreat = retreat(&robot, &feedback);
        for _ in 0..MAX_TICKS {
            match retreat.tick(&feedback) {
                RetreatTick::Act(command) => feedback = self.perform(&command),
                RetreatTick::Finished(report) => {
                    assert_eq!(report.failure, None, "{}", self.name);
                    return;
                }
            }
        }
        panic!("{}: the way home did not end", self.name);
    }
}

fn part(pose: Pose) -> GroundedPart {
    let pose = PoseEstimate { pose, position_sigma_m: DVec3::splat(0.001), yaw_sigma_rad: 0.01 };
    GroundedPart {
        template: "box".into(),
        name: "whole".into(),
        parameters: vec![],
        pose,
        affordances: vec![],
        functions: vec![],
        appearance: Appearance::plain(Lab { l: 50.0, a: 0.0, b: 0.0 }, 2.0),
    }
}

fn done(report: &SkillReport, trial: &Trial) {
    assert_eq!(report.failure, None, "{}: {}", trial.name, report.invocation.kind);
}

/// Middle, button, back: what the scenario asks for, with skills alone.
fn conforms(robot: &str) {
    for seed in 0..3 {
        let mut trial = Trial::new(robot, seed, true);
        let start = trial.object("cube").pose;
        let mats: Vec<DVec3> = (0..6)
            .filter_map(|i| trial.simulation.truth().into_iter().find(|object| object.name == format!("mat_{i}")))
            .map(|mat| mat.pose.translation)
            .collect();
        let middle = mats.iter().sum::<DVec3>() / mats.len() as f64;
        for (to, press) in [(Pose::from_yaw(middle.with_z(0.74), start.yaw()), true), (start, false)] {
            let picked = trial.pick();
            done(&picked, &trial);
            assert!(trial.object("cube").held, "{robot}: it is in the hand at home");
            let placed = trial.place(picked.held.unwrap(), to);
            done(&placed, &trial);
            let off_m = trial.object("cube").pose.translation.distance(to.translation);
            assert!(off_m < 0.005 && !trial.object("cube").held, "{robot} seed {seed}: {off_m} m beside");
            if press {
                let pressed = trial.press();
                done(&pressed, &trial);
            }
        }
        let verdict = trial.simulation.verdict();
        assert!(verdict.strict, "{robot} seed {seed}: {}", verdict.explanation);
        let most_m_s = trial.robot.description().max_speed_m_s;
        // A hand on a yielding wrist swings a little beyond what it is told.
        assert!(trial.fastest_m_s < 1.3 * most_m_s, "{robot}: {} m/s", trial.fastest_m_s);
        assert!(trial.hardest_n < 60.01, "{robot}: {} N", trial.hardest_n);
        println!("{robot} seed {seed}: at most {:.2} m/s, {:.0} N", trial.fastest_m_s, trial.hardest_n);
    }
}

#[test]
fn the_floating_gripper_conforms() {
    conforms("floating-gripper");
}

#[test]
fn the_panda_conforms() {
    conforms("panda");
}

#[test]
fn two_pandas_conform() {
    conforms("dual-panda");
}

#[test]
fn suction_cups_conform_floating_and_on_an_arm() {
    conforms("floating-suction");
    conforms("panda-suction");
}

#[test]
fn every_robot_stops_and_refuses_to_move_when_it_must() {
    for robot in ["floating-gripper", "floating-suction", "panda", "panda-suction", "dual-panda"] {
        let mut trial = Trial::new(robot, 0, false);
        let here = trial.robot.feedback();
        let mut controller = start(
            &trial.invocation("press-down", "button", 0.03, &[("stroke", 0.008), ("force", 12.0)]),
            trial.robot.description(),
            &here,
        )
        .unwrap();
        let Tick::Act(command) = controller.tick(&here) else { panic!("{robot}: no command") };
        assert_eq!(trial.robot.command(&command), Err(EmbodimentError::MotionDisabled), "{robot}");

        let mut trial = Trial::new(robot, 0, true);
        for _ in 0..10 {
            let felt = trial.robot.feedback();
            if let Tick::Act(command) = controller.tick(&felt) {
                trial.perform(&command);
            }
        }
        trial.robot.stop();
        let stopped = trial.robot.feedback();
        let Tick::Act(command) = controller.tick(&stopped) else { panic!("{robot}: no command") };
        assert_eq!(trial.robot.command(&command), Err(EmbodimentError::Stopped), "{robot}");
        trial.simulation.clock().wait_until(Time::from_seconds(1.0)).unwrap();
        let rest = trial.robot.feedback();
        let moved_m = rest.tcp.translation.distance(stopped.tcp.translation);
        assert!(moved_m < 0.02 && rest.joints == stopped.joints, "{robot}: {moved_m} m after the stop");
    }
}
