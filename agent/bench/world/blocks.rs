//! Five cubes are grasped, shaken, held and stacked, over many seeds.

use super::{
    audited,
    expert::{Expert, down},
    progress,
};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
    statistics::median_and,
};
use acm_concept::embodiment::{Command, EmbodimentError};
use acm_sim::{AuditReport, Scenario, SimOptions, Simulation, TrueObject};
use anyhow::Context;
use glam::DVec3;

/// The scene; see its own comments for what is drawn.
const SCENE: &str = include_str!("blocks.toml");
/// Cubes in it.
const CUBES: usize = 5;
/// Edge of a cube, metres.
pub const EDGE_M: f64 = 0.04;
/// Where the tower is built, on the table.
pub const SPOT: DVec3 = DVec3::new(0.0, 0.12, 0.74);
/// Height at which cubes are carried, metres.
pub const TRAVEL_Z: f64 = 1.05;
const HELD_S: f64 = 10.0;
/// Strokes of the shaking, their length and duration: 1.2 g at most, at up to 0.47 m/s.
const STROKES: u32 = 8;
const STROKE_M: f64 = 0.05;
const STROKE_S: f64 = 0.16;
/// Farther than this from its place in the tower a cube has been dropped, metres.
const DROPPED_M: f64 = 0.02;

/// Most violations of the audit that are told.
const MAX_TOLD: usize = 8;

/// The scene as a scenario.
pub fn scenario() -> anyhow::Result<Scenario> {
    Scenario::parse("blocks.toml", SCENE).context("the bench's own scene cannot be used")
}

/// What one seed came to.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    /// Cubes that were lost in the air or fell off the tower.
    pub drops: usize,
    /// Most that a carried cube moved in the hand between lift and tower, metres.
    pub slip_m: f64,
    /// Farthest that a cube stands from its place in the tower one second after the last was set down, metres.
    pub tower_error_m: f64,
    /// Processor time of the physics, judge and all, seconds.
    pub physics_cpu_s: f64,
    /// Seconds simulated.
    pub simulated_s: f64,
    /// What the physics audit found.
    pub audit: AuditReport,
}

/// Where the cubes stand before anything has moved.
pub fn start(seed: u64) -> anyhow::Result<Vec<TrueObject>> {
    Ok(cubes(&world(seed)?))
}

/// Plays one seed; the commands beside the outcome.
pub fn play(seed: u64) -> anyhow::Result<(Outcome, Vec<Command>)> {
    let simulation = world(seed)?;
    let mut expert = Expert::new(&simulation);
    let mut outcome = Outcome::default();
    for number in 0..CUBES {
        stack(&simulation, &mut expert, number, &mut outcome).with_context(|| format!("seed {seed}"))?;
    }
    expert.wait(1.0)?;
    for (number, cube) in cubes(&simulation).iter().enumerate() {
        let error = cube.pose.translation.distance(SPOT + DVec3::Z * (EDGE_M * number as f64));
        // A cube that lies elsewhere is a drop, and would say nothing about how well the others stand.
        if error > DROPPED_M {
            outcome.drops += 1;
        } else {
            outcome.tower_error_m = outcome.tower_error_m.max(error);
        }
    }
    outcome.audit = simulation.audit();
    outcome.physics_cpu_s = simulation.timings().physics_s;
    outcome.simulated_s = simulation.clock().now().seconds();
    Ok((outcome, expert.commands))
}

fn world(seed: u64) -> anyhow::Result<Simulation> {
    let options = SimOptions { seed, ..SimOptions::default() };
    Ok(Simulation::without_renderer(&scenario()?, &options)?)
}

fn cubes(simulation: &Simulation) -> Vec<TrueObject> {
    let mut cubes = simulation.truth();
    cubes.truncate(CUBES);
    cubes
}

/// Grasps a cube, shakes it, holds it and sets it down on the tower.
fn stack(
    simulation: &Simulation,
    expert: &mut Expert,
    number: usize,
    outcome: &mut Outcome,
) -> Result<(), EmbodimentError> {
    let cube = || cubes(simulation).swap_remove(number);
    let (at, yaw) = (cube().pose.translation, cube().pose.yaw());
    let middle = DVec3::Z * (0.5 * EDGE_M);
    expert.above(at.with_z(TRAVEL_Z), yaw, 0.45)?;
    expert.go(down(at + middle, yaw), 0.4)?;
    expert.fingers(0.0)?;
    expert.go(down(at.with_z(TRAVEL_Z), yaw), 0.4)?;
    let taken = expert.in_hand(&cube());
    for stroke in 0..STROKES {
        let side = if stroke % 2 == 0 { 0.5 * STROKE_M } else { -0.5 * STROKE_M };
        expert.over(down(at.with_z(TRAVEL_Z) + DVec3::X * side, yaw), STROKE_S)?;
    }
    expert.above(SPOT.with_z(TRAVEL_Z), 0.0, 0.45)?;
    expert.wait(HELD_S)?;
    outcome.slip_m = outcome.slip_m.max(expert.in_hand(&cube()).translation.distance(taken.translation));
    let place = SPOT + DVec3::Z * (EDGE_M * number as f64);
    // Two millimetres above where it will stand: the fall shows what the tower bears.
    expert.go(down(place + middle + DVec3::Z * 0.002, 0.0), 0.2)?;
    expert.fingers(0.08)?;
    expert.go(down(SPOT.with_z(TRAVEL_Z), 0.0), 0.3)
}

/// Plays the seeds and adds drops, slip and tower error.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let seeds = args.episodes.unwrap_or(if args.quick { 20 } else { 1000 }).clamp(1, 1000);
    let bar = progress("cubes", seeds as u64);
    let mut outcomes = Vec::with_capacity(seeds);
    for seed in 0..seeds as u64 {
        outcomes.push(play(seed)?.0);
        bar.inc(1);
    }
    bar.finish_and_clear();
    let dropped = outcomes.iter().filter(|outcome| outcome.drops > 0).count() as f64;
    let sum = |value: fn(&Outcome) -> f64| outcomes.iter().map(value).sum::<f64>();
    let (simulated_s, cpu_s) = (sum(|outcome| outcome.simulated_s), sum(|outcome| outcome.physics_cpu_s));
    let row = [
        ("seeds", seeds as f64),
        ("with_a_drop", dropped),
        ("simulated_s", simulated_s),
        ("times_real_time", simulated_s / cpu_s),
    ];
    result.rows.push(Row::new("cubes", row));
    let mut spread = |name: &str, of: fn(&Outcome) -> f64| {
        let values: Vec<f64> = outcomes.iter().map(|outcome| 1e3 * of(outcome)).collect();
        let ((p50, p99), (_, most)) = (median_and(0.99, &values), median_and(1.0, &values));
        let worst = values.iter().position(|value| *value >= most).unwrap_or_default() as f64;
        let row = [("p50_mm", p50), ("p99_mm", p99), ("max_mm", most), ("max_at_seed", worst)];
        result.rows.push(Row::new(name, row));
        most
    };
    let slip = spread("cubes: slip in the hand", |outcome| outcome.slip_m);
    let tower = spread("cubes: error of the tower", |outcome| outcome.tower_error_m);
    result.figure("seeds_with_a_drop_per_1000", 1000.0 * dropped / seeds as f64);
    // The worst of all seeds.
    result.figure("grasp_slip_mm", slip);
    result.figure("tower_error_mm", tower);
    for told in outcomes.iter().flat_map(|outcome| &outcome.audit.first).take(MAX_TOLD) {
        result.notes.push(format!("audit: {told}"));
    }
    audited(result, outcomes.iter().map(|outcome| outcome.audit.violations).sum());
    result.seeds = vec![0, seeds as u64 - 1];
    Ok(())
}
