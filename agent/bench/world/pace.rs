//! How fast an episode is whose executor alone works: no perception, no planner, exact geometry.

use super::{
    blocks::{self, EDGE_M, SPOT},
    clock::cpu_s,
    peer::best,
};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
};
use acm_concept::{
    color::{Appearance, Lab},
    embodiment::Embodiment,
    ids::{ObjectId, PartId},
    literal::Place,
    object::{GroundedPart, PoseEstimate},
    pose::Pose,
    skill::{SkillInvocation, SkillReport},
};
use acm_sim::{SharedRenderer, SimOptions, Simulation, TrueObject};
use acm_skills::{Tick, start};
use anyhow::{Context, bail};
use glam::DVec3;
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex},
};

const TURNS: usize = 3;
const SEED: u64 = 1;
const CUBES: usize = 5;
/// Longest that a skill may take, control ticks.
const MAX_TICKS: usize = 3000;
/// A frame every 0.1 s.
const TICKS_A_FRAME: usize = 5;
const CAMERA: &str = "head";

/// Adds how many times faster than real time an episode is, per processor second, without and with frames.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let turns = if args.quick { 1 } else { TURNS };
    let blind: Vec<f64> = (0..turns).map(|_| episode(None)).collect::<anyhow::Result<_>>()?;
    result.rows.push(Row::new("executor alone, no cameras", [("times_real_time", best(&blind))]));
    result.figure("executor_times_real_time", best(&blind));
    let renderer = match acm_render::Renderer::new() {
        Ok(renderer) => renderer,
        Err(error) => {
            result.rows.push(Row::skipped("executor alone, d435 at 10 Hz", error.to_string()));
            return Ok(());
        }
    };
    let shared: SharedRenderer = Arc::new(Mutex::new(renderer));
    let seeing: Vec<f64> = (0..turns).map(|_| episode(Some(&shared))).collect::<anyhow::Result<_>>()?;
    let row = [("times_real_time", best(&seeing)), ("width", 320.0), ("height", 240.0), ("frames_per_s", 10.0)];
    result.rows.push(Row::new("executor alone, d435 at 10 Hz", row));
    result.figure("episode_10hz_times_real_time", best(&seeing));
    Ok(())
}

/// Picks and stacks the cubes; simulated seconds per processor second of the whole process.
fn episode(renderer: Option<&SharedRenderer>) -> anyhow::Result<f64> {
    let options = SimOptions { seed: SEED, camera_size: Some((320, 240)), ..SimOptions::default() };
    let scenario = blocks::scenario()?;
    let simulation = match renderer {
        Some(renderer) => Simulation::new(&scenario, &options, renderer.clone())?,
        None => Simulation::without_renderer(&scenario, &options)?,
    };
    let mut executor = Executor::new(&simulation, renderer.is_some());
    let ((), spent_s) = cpu_s(|| (0..CUBES).try_for_each(|number| executor.stack(&simulation, number)))?;
    let audit = simulation.audit();
    if audit.violations > 0 {
        bail!("the episode is void: {:?}", audit.first);
    }
    Ok(simulation.clock().now().seconds() / spent_s)
}

struct Executor {
    robot: Box<dyn Embodiment>,
    camera: Option<Box<dyn acm_concept::camera::CameraSource>>,
    ticks: usize,
}

impl Executor {
    fn new(simulation: &Simulation, seeing: bool) -> Executor {
        Executor { robot: simulation.embodiment(), camera: seeing.then(|| simulation.camera()), ticks: 0 }
    }

    fn stack(&mut self, simulation: &Simulation, number: usize) -> anyhow::Result<()> {
        let cube = simulation.truth().into_iter().nth(number).context("a cube is missing")?;
        let grasped = self.run(&pick(&cube))?;
        let (_, held) = grasped.held.with_context(|| format!("cube {number} is not held: {:?}", grasped.failure))?;
        let there = Pose::from_translation(SPOT + DVec3::Z * (EDGE_M * number as f64));
        let placed = self.run(&place(held, there))?;
        match placed.failure {
            None => Ok(()),
            Some((_, reason)) => bail!("cube {number} is not placed: {reason}"),
        }
    }

    fn run(&mut self, invocation: &SkillInvocation) -> anyhow::Result<SkillReport> {
        let robot = self.robot.description().clone();
        let mut feedback = self.robot.feedback();
        let mut controller = start(invocation, &robot, &feedback)?;
        for _ in 0..MAX_TICKS {
            match controller.tick(&feedback) {
                Tick::Finished(report) => return Ok(*report),
                Tick::Act(command) => feedback = self.robot.command(&command)?,
            }
            self.ticks += 1;
            if let (Some(camera), true) = (&mut self.camera, self.ticks.is_multiple_of(TICKS_A_FRAME)) {
                std::hint::black_box(camera.capture(CAMERA)?);
            }
        }
        bail!("`{}` did not end", invocation.kind)
    }
}

/// A part of which all is known exactly.
fn part(base: Pose) -> GroundedPart {
    GroundedPart {
        template: "box".into(),
        name: "whole".into(),
        parameters: Vec::new(),
        pose: PoseEstimate { pose: base, position_sigma_m: DVec3::splat(0.001), yaw_sigma_rad: 0.01 },
        affordances: Vec::new(),
        functions: Vec::new(),
        appearance: Appearance::plain(Lab { l: 50.0, a: 0.0, b: 0.0 }, 2.0),
    }
}

fn invocation(kind: &str, base: Pose, frame_height_m: f64, arguments: &[(&str, f64)]) -> SkillInvocation {
    SkillInvocation {
        skill: kind.into(),
        entry: None,
        kind: kind.into(),
        part: PartId { object: ObjectId(1), index: 0 },
        target: part(base),
        frame: base * Pose::from_translation(DVec3::Z * frame_height_m),
        arguments: arguments.iter().map(|(name, value)| (name.to_string(), *value)).collect::<BTreeMap<_, _>>(),
        destination: None,
        obstacles: Vec::new(),
        support_height_m: base.translation.z,
        held: None,
        held_solids: Vec::new(),
        attempt: 0,
    }
}

fn pick(cube: &TrueObject) -> SkillInvocation {
    let arguments = [("grip_width", EDGE_M), ("cross_width", EDGE_M), ("height", EDGE_M)];
    invocation("grasp-from-above", cube.pose, 0.5 * EDGE_M, &arguments)
}

fn place(held: Pose, there: Pose) -> SkillInvocation {
    let arguments = [("grip_width", EDGE_M), ("height", EDGE_M)];
    SkillInvocation {
        destination: Some(Place { support: None, pose: there, tolerance_m: 0.02, heading_tolerance_rad: None }),
        held: Some((ObjectId(1), held, part(there))),
        ..invocation("place-upright", there, 0.0, &arguments)
    }
}
