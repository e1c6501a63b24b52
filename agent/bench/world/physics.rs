//! The cost of a physics step beside MuJoCo's, both playing the same commands in the same scene.

use super::{
    blocks::{self, EDGE_M, SPOT, TRAVEL_Z},
    expert::GRIP_N,
    peer::{self, Peer, number},
};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
};
use acm_sim::PhysicsProfile;
use glam::DVec3;
use serde_json::{Value, json};

const TURNS: usize = 5;
const SEED: u64 = 0;

/// Adds steps and simulated seconds per processor second, and their ratios to the peer's.
///
/// Ours are whole steps of the world: engine, events, mechanisms, what is felt, audit and judge. The peer's are
/// `mj_step` and what it needs to follow the commands.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let (_, commands) = blocks::play(SEED)?;
    let commands: Vec<[f64; 8]> = commands
        .iter()
        .map(|command| {
            let ([x, y, z], [qx, qy, qz, qw]) = (command.tcp.translation.to_array(), command.tcp.rotation.to_array());
            [x, y, z, qx, qy, qz, qw, command.opening_m]
        })
        .collect();
    let mut mujoco = Peer::start(&task(&commands)?);
    let (mut ours, mut theirs, mut last) = (Vec::new(), Vec::new(), None);
    for _ in 0..if args.quick { 2 } else { TURNS } {
        let (outcome, _) = blocks::play(SEED)?;
        ours.push(outcome.simulated_s / outcome.physics_cpu_s);
        if let Ok(peer) = &mut mujoco {
            let answer = peer.turn()?;
            theirs.push(number(&answer, "simulated_s")? / number(&answer, "cpu_s")?);
            last = Some(answer);
        }
    }
    let hz = f64::from(PhysicsProfile::DEFAULT.steps_per_second);
    let our_pace = peer::best(&ours);
    let row = |name: &str, pace: f64, hz: f64| {
        Row::new(name, [("times_real_time", pace), ("steps_per_cpu_s", pace * hz), ("steps_per_s", hz)])
    };
    result.rows.push(row("physics: ours, whole steps", our_pace, hz));
    let (peer, answer) = match (mujoco, last) {
        (Ok(peer), Some(answer)) => (peer, answer),
        (Err(reason), _) => {
            result.rows.push(Row::skipped("physics: MuJoCo", reason.to_string()));
            return Ok(());
        }
        (Ok(_), None) => return Ok(()),
    };
    let their_pace = peer::best(&theirs);
    let their_hz = number(&answer, "steps")? / number(&answer, "simulated_s")?;
    let mut theirs = row(&format!("physics: MuJoCo {}", peer.version), their_pace, their_hz);
    for (name, field) in [("slip_mm", "slip_m"), ("tower_error_mm", "tower_error_m")] {
        theirs.values.insert(name.into(), number(&answer, field)? * 1e3);
    }
    result.rows.push(theirs);
    result.figure("physics_steps_over_mujoco", our_pace * hz / (their_pace * their_hz));
    result.figure("physics_simtime_over_mujoco", our_pace / their_pace);
    Ok(())
}

/// The scene and the commands as the peer takes them. Its cubes all weigh what ours weigh on average.
fn task(commands: &[[f64; 8]]) -> anyhow::Result<Value> {
    let middle = DVec3::Z * (0.5 * EDGE_M);
    let cubes: Vec<Value> = blocks::start(SEED)?
        .iter()
        .map(|cube| {
            let position = (cube.pose.translation + middle).to_array();
            let rotation = cube.pose.rotation.to_array();
            json!({"position": position, "rotation": rotation, "size": [EDGE_M, EDGE_M, EDGE_M], "mass_kg": 0.0576, "friction": 0.6})
        })
        .collect();
    Ok(json!({
        "task": "physics",
        "table": {"size": [1.2, 0.7, 0.05], "position": [0.0, 0.0, 0.715], "friction": 0.5},
        "robot": {
            "finger": {"size": [0.022, 0.012, 0.048], "tip_m": 0.011},
            "max_opening_m": 0.08, "grip_n": GRIP_N, "tick_s": 0.02,
        },
        "cubes": cubes, "commands": commands, "spot": (SPOT + middle).to_array(), "edge_m": EDGE_M,
        "carried_above_m": 0.5 * (TRAVEL_Z + SPOT.z + 5.0 * EDGE_M),
    }))
}
