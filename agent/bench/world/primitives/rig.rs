//! A small world for one try of a skill: scenario text in, skills run on its robot, truth read off.

use acm_concept::{
    color::{Appearance, Lab},
    embodiment::{Embodiment, Feedback},
    ids::{ObjectId, PartId},
    literal::Place,
    object::{GroundedPart, PoseEstimate},
    pose::Pose,
    skill::{SkillInvocation, SkillReport},
    solid::PlacedSolid,
};
use acm_sim::{Scenario, SimOptions, Simulation, TrueObject};
use acm_skills::{RetreatTick, Tick, retreat, start};
use anyhow::{Context, Result, bail};
use glam::DVec3;
use std::collections::BTreeMap;

/// Height of the table's top, metres.
pub const TABLE_M: f64 = 0.74;
/// More ticks than any skill may take: two minutes.
const MAX_TICKS: usize = 6000;

/// A world with a robot in it.
pub struct Rig {
    /// The simulation.
    pub simulation: Simulation,
    robot: Box<dyn Embodiment>,
    /// Greatest force at the wrist so far, newtons.
    pub most_n: f64,
}

/// The text of a scenario whose world is a table, the given models and objects, and a robot with a roomy workspace.
pub fn scenario(models: &str, objects: &str, friction: f64) -> String {
    let low = DVec3::new(-1.4, -1.4, TABLE_M + 0.003);
    scenario_on(models, objects, friction, TABLE_M, DVec3::new(0.0, 0.0, 1.3), [low, DVec3::new(1.4, 1.4, 2.2)])
}

/// As [`scenario`], with another robot, where and as it stands in its file.
pub fn scenario_with(robot: &str, models: &str, objects: &str, friction: f64) -> String {
    text(models, objects, friction, TABLE_M, &format!("model = \"{robot}\""))
}

/// As [`scenario`], on a ground of another height, with the hand's home and the corners of its workspace.
pub fn scenario_on(
    models: &str,
    objects: &str,
    friction: f64,
    ground_m: f64,
    home: DVec3,
    [low, high]: [DVec3; 2],
) -> String {
    text(models, objects, friction, ground_m, &format!("home = {home}\nworkspace = [{low}, {high}]"))
}

fn text(models: &str, objects: &str, friction: f64, ground_m: f64, robot: &str) -> String {
    format!(
        r##"scenario = "rig"
summary = "a world for one try of a skill"
[task]
instruction = "nothing is asked"
[task.budgets]
seconds = 1000.0
skills = 100
frames = 1
[[surface]]
name = "ground"
size = [6.0, 6.0, 0.05]
position = [0.0, 0.0, {}]
color = "#ffffff"
friction = {friction}
support = true
[[camera]]
name = "none"
position = [0.0, -1.0, 1.5]
forward = [0.0, 0.6, -0.8]
left = [-1.0, 0.0, 0.0]
fov_y_deg = 50.0
[robot]
{robot}
[[judge.strict.stage]]
name = "never"
when = "time > 1000000"
{models}
{objects}
"##,
        ground_m - 0.025,
    )
}

impl Rig {
    /// Builds a world and lets it settle.
    pub fn new(text: &str, seed: u64) -> Result<Rig> {
        let scenario = Scenario::parse("rig.toml", text)?;
        let options = SimOptions { seed, ..SimOptions::default() };
        let simulation = Simulation::without_renderer(&scenario, &options)?;
        let robot = simulation.embodiment();
        Ok(Rig { simulation, robot, most_n: 0.0 })
    }
    /// An object as it truly is.
    pub fn object(&self, name: &str) -> Result<TrueObject> {
        let found = self.simulation.truth().into_iter().find(|object| object.name == name);
        found.with_context(|| format!("the rig has no object `{name}`"))
    }
    /// What the robot measures.
    pub fn feedback(&self) -> Feedback {
        self.robot.feedback()
    }
    /// Runs a skill to its end; what refuses to start is a report too.
    pub fn run(&mut self, invocation: &SkillInvocation) -> Result<SkillReport, String> {
        let started = start(invocation, self.robot.description(), &self.robot.feedback());
        let mut controller = started.map_err(|error| format!("refused: {error}"))?;
        for _ in 0..MAX_TICKS {
            match controller.tick(&self.robot.feedback()) {
                Tick::Act(command) => {
                    let felt = self.robot.command(&command).map_err(|error| format!("the robot: {error}"))?;
                    self.most_n = self.most_n.max(felt.wrist_force_n.length());
                }
                Tick::Finished(report) => return Ok(*report),
            }
        }
        Err("the skill did not end".into())
    }
    /// As [`Rig::run`]; a skill that failed is an error with its reason.
    pub fn done(&mut self, invocation: &SkillInvocation) -> Result<SkillReport, String> {
        let report = self.run(invocation)?;
        match &report.failure {
            None => Ok(report),
            Some((cause, reason)) => Err(format!("{}: {reason}", cause.word())),
        }
    }
    /// Sends the hand home.
    pub fn go_home(&mut self) -> Result<()> {
        let mut retreat = retreat(self.robot.description(), &self.robot.feedback());
        for _ in 0..MAX_TICKS {
            match retreat.tick(&self.robot.feedback()) {
                RetreatTick::Act(command) => {
                    self.robot.command(&command)?;
                }
                RetreatTick::Finished(_) => return Ok(()),
            }
        }
        bail!("the retreat did not end")
    }
    /// Lets the world go on for a while.
    pub fn wait(&mut self, seconds: f64) -> Result<()> {
        let mut clock = self.simulation.clock();
        let now = clock.now();
        let until = acm_concept::time::Time(now.0 + (seconds * 1e9) as u64);
        clock.wait_until(until)?;
        Ok(())
    }
}

/// A skill at a frame, with everything else empty.
pub fn invocation(kind: &str, object: ObjectId, base: Pose, frame: Pose, arguments: &[(&str, f64)]) -> SkillInvocation {
    SkillInvocation {
        skill: kind.into(),
        entry: None,
        kind: kind.into(),
        part: PartId { object, index: 0 },
        target: part(base),
        frame,
        arguments: arguments.iter().map(|(name, value)| ((*name).to_string(), *value)).collect::<BTreeMap<_, _>>(),
        destination: None,
        obstacles: Vec::<(ObjectId, PlacedSolid)>::new(),
        support_height_m: TABLE_M,
        held: None,
        held_solids: vec![],
        attempt: 0,
    }
}

/// A place for the base of what is held.
pub fn place(pose: Pose) -> Option<Place> {
    Some(Place { support: None, pose, tolerance_m: 0.01, heading_tolerance_rad: None })
}

/// A part of which nothing but the pose is known.
pub fn part(pose: Pose) -> GroundedPart {
    GroundedPart {
        template: "box".into(),
        name: "whole".into(),
        parameters: vec![],
        pose: PoseEstimate { pose, position_sigma_m: DVec3::splat(0.001), yaw_sigma_rad: 0.01 },
        affordances: vec![],
        functions: vec![],
        appearance: Appearance::plain(Lab { l: 50.0, a: 0.0, b: 0.0 }, 2.0),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    const LOAF_M: f64 = 0.05;

    /// A blade that stands on its edge, a loaf, and a rule that slices the loaf when the blade's edge comes onto it.
    fn kitchen() -> String {
        let models = r##"
[[model]]
model = "blade"
summary = ""
density_kg_m3 = 1000
[[model.solid]]
shape = "box"
size = [0.12, 0.012, 0.06]
position = [0, 0, 0.03]
color = "#a0a0a0"
[[model]]
model = "loaf"
summary = ""
density_kg_m3 = 700
[[model.solid]]
shape = "box"
size = [0.1, 0.07, 0.05]
position = [0, 0, 0.025]
color = "#a06020"
"##;
        let objects = format!(
            r#"
[[object]]
name = "blade"
model = "blade"
position = [0.0, -0.15, {TABLE_M}]
[[object]]
name = "loaf"
model = "loaf"
position = [0.1, 0.15, {TABLE_M}]
[[fluent]]
name = "sliced"
[[rule]]
name = "an edge on the loaf slices it"
when = "abs(blade_x - loaf_x) < 0.05 && abs(blade_y - loaf_y) < 0.03 && blade_z < loaf_z + {} && blade_touched > 1"
set = {{ sliced = 1 }}
"#,
            LOAF_M + 0.001
        );
        scenario(models, &objects, 0.6).replace("time > 1000000", "sliced > 0")
    }

    #[test]
    fn a_loaf_is_sliced_once_the_edge_is_pressed_onto_it() {
        let mut rig = Rig::new(&kitchen(), 0).unwrap();
        let (blade, loaf) = (rig.object("blade").unwrap().pose, rig.object("loaf").unwrap().pose);
        let grip = blade * Pose::from_yaw(DVec3::Z * 0.06, 0.0);
        let pick = invocation("grasp-from-above", ObjectId(1), blade, grip, &[("grip_width", 0.012), ("height", 0.06)]);
        let (object, base_in_tcp) = rig.done(&pick).unwrap().held.unwrap();
        let top = loaf * Pose::from_yaw(DVec3::Z * LOAF_M, 0.0);
        let mut slice = invocation("slice", ObjectId(2), loaf, top, &[("force", 8.0)]);
        slice.held = Some((object, base_in_tcp, part(blade)));
        assert!(!rig.simulation.verdict().strict);
        let report = rig.done(&slice).unwrap();
        assert!(report.measured["slice_force_n"] >= 8.0 && report.held.is_some(), "{report:?}");
        assert!(rig.simulation.verdict().strict, "{:?}", rig.simulation.verdict());
        assert_eq!(rig.simulation.audit().violations, 0);
        // Over the bare table there is nothing to slice, and it is said.
        slice.frame = Pose::from_yaw(DVec3::new(-0.2, 0.15, TABLE_M + LOAF_M), 0.0);
        slice.held = report.held.map(|(object, base)| (object, base, part(blade)));
        assert!(rig.done(&slice).unwrap_err().contains("touched nothing"));
    }
}
