//! Random restore points: a world that is put back must go on exactly as it did.

use super::{blocks, progress};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
};
use acm_concept::{
    camera::{CameraSource, RgbdFrame},
    embodiment::{Command, Embodiment},
    pose::Pose,
};
use acm_sim::{AuditReport, Scenario, SharedRenderer, SimOptions, Simulation, Snapshot};
use glam::{DQuat, DVec3};
use std::sync::{Arc, Mutex};

const POINTS: usize = 1000;
/// Restore points of one episode.
const POINTS_AN_EPISODE: usize = 50;
/// Control ticks of an episode, and those that go on from a restore point.
const TICKS: usize = 1500;
const GO_ON: usize = 50;
/// One restore point in this many is also looked at: frames cost more than the rest.
const SEEN_ONE_IN: usize = 10;

/// Adds how many restore points went on otherwise than the first time.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let renderer = acm_render::Renderer::new().ok().map(|renderer| Arc::new(Mutex::new(renderer)));
    let mut worlds = vec![blocks::scenario()?];
    for name in ["put-back-block-jittered", "return-stapler", "return-stapler-unseen"] {
        worlds.push(Scenario::open(name)?);
    }
    let points = if args.quick { POINTS / 10 } else { POINTS };
    let episodes = points.div_ceil(POINTS_AN_EPISODE);
    let (mut mismatches, mut seen, mut violations) = (0, 0, 0);
    let bar = progress("restore points", points as u64);
    for seed in 0..episodes {
        let world = &worlds[seed % worlds.len()];
        let found = episode(world, seed as u64, renderer.as_ref())?;
        mismatches += found.mismatches;
        seen += found.seen;
        violations += found.audit.violations;
        let label = |told: &str| format!("{} seed {seed}: {told}", world.name());
        result.notes.extend(found.told.iter().map(|told| label(told)));
        result
            .notes
            .extend(found.audit.first.iter().map(|told| format!("audit, {} seed {seed}: {told}", world.name())));
        bar.inc(POINTS_AN_EPISODE as u64);
    }
    bar.finish_and_clear();
    let row = [
        ("restore_points", (episodes * POINTS_AN_EPISODE) as f64),
        ("with_frames", seen as f64),
        ("mismatches", mismatches as f64),
        ("scenarios", worlds.len() as f64),
    ];
    result.rows.push(Row::new("snapshots", row));
    result.figure("snapshot_mismatches", mismatches as f64);
    super::audited(result, violations);
    Ok(())
}

#[derive(Default)]
struct Found {
    mismatches: usize,
    /// What did not come back, of each mismatch.
    told: Vec<String>,
    seen: usize,
    audit: AuditReport,
}

/// A moment to come back to, and how the world went on from there.
struct Point {
    tick: usize,
    snapshot: Snapshot,
    after: Option<Moment>,
}

/// All that can be compared of a moment.
#[derive(PartialEq)]
struct Moment {
    hash: u64,
    everything: Vec<u8>,
    frame: Option<RgbdFrame>,
}

impl Moment {
    /// What of it is not as in another one, the coarsest first.
    fn difference(&self, other: &Moment) -> Option<&'static str> {
        let differs = [
            ("the world's motion", self.hash != other.hash),
            ("what is kept besides", self.everything != other.everything),
            ("the frame", self.frame != other.frame),
        ];
        differs.into_iter().find(|(_, differs)| *differs).map(|(what, _)| what)
    }
}

struct Player {
    simulation: Simulation,
    robot: Box<dyn Embodiment>,
    cameras: Box<dyn CameraSource>,
}

impl Player {
    fn new(scenario: &Scenario, seed: u64, renderer: Option<&SharedRenderer>) -> anyhow::Result<Player> {
        // The mishap, its own random stream included, must come back as well.
        let options = SimOptions { seed, slip_at: Some(1), camera_size: Some((320, 240)), ..SimOptions::default() };
        let simulation = match renderer {
            Some(renderer) => Simulation::new(scenario, &options, renderer.clone())?,
            None => Simulation::without_renderer(scenario, &options)?,
        };
        let (robot, cameras) = (simulation.embodiment(), simulation.camera());
        Ok(Player { simulation, robot, cameras })
    }

    fn moment(&mut self, with_frame: bool) -> anyhow::Result<Moment> {
        let camera = self.cameras.cameras().first().map(|camera| camera.name.clone());
        let frame = match camera.filter(|_| with_frame) {
            Some(camera) => Some(self.cameras.capture(&camera)?),
            None => None,
        };
        let everything = self.simulation.snapshot()?.as_bytes().to_vec();
        Ok(Moment { hash: self.simulation.state_hash(), everything, frame })
    }
}

/// One episode of random motion, and every one of its restore points again in another simulation.
fn episode(scenario: &Scenario, seed: u64, renderer: Option<&SharedRenderer>) -> anyhow::Result<Found> {
    let mut first = Player::new(scenario, seed, renderer)?;
    let mut dice = Dice(seed);
    let commands = motion(&mut dice, &first);
    let mut points: Vec<Point> = Vec::new();
    let mut ticks: Vec<usize> = (0..POINTS_AN_EPISODE).map(|_| dice.below(TICKS - GO_ON - 1)).collect();
    ticks.sort_unstable();
    let looks = |number: usize| renderer.is_some() && number.is_multiple_of(SEEN_ONE_IN);
    for (tick, command) in commands.iter().enumerate() {
        for _ in ticks.iter().filter(|at| **at == tick) {
            points.push(Point { tick, snapshot: first.simulation.snapshot()?, after: None });
        }
        first.robot.command(command)?;
        for (number, point) in points.iter_mut().enumerate().filter(|(_, point)| point.tick + GO_ON == tick + 1) {
            point.after = Some(first.moment(looks(number))?);
        }
    }
    let mut second = Player::new(scenario, seed, renderer)?;
    let mut found = Found { audit: first.simulation.audit(), ..Found::default() };
    // Backwards, so that nothing follows from where the last one ended.
    for number in (0..points.len()).rev() {
        let point = &points[number];
        second.simulation.restore(&Snapshot::from_bytes(point.snapshot.as_bytes().to_vec())?)?;
        for (tick, command) in commands.iter().enumerate().skip(point.tick).take(GO_ON) {
            second.robot.command(command)?;
            // The first time, frames were taken at other points on the way, those of the same moment in their order.
            let before = |other: usize| if tick + 1 == point.tick + GO_ON { other < number } else { other != number };
            let others = points.iter().enumerate().filter(|(other, at)| before(*other) && at.tick + GO_ON == tick + 1);
            for (other, _) in others {
                drop(second.moment(looks(other))?);
            }
        }
        let after = second.moment(looks(number))?;
        if let Some(what) = point.after.as_ref().map_or(Some("all"), |before| before.difference(&after)) {
            found.mismatches += 1;
            found.told.push(format!("{what} went on otherwise from tick {}", point.tick));
        }
        found.seen += usize::from(after.frame.is_some());
    }
    Ok(found)
}

/// Commands of a hand that wanders low over the table and closes and opens now and then.
fn motion(dice: &mut Dice, player: &Player) -> Vec<Command> {
    let robot = player.robot.description();
    let down = |position: DVec3, yaw: f64| {
        Pose::new(position, DQuat::from_rotation_z(yaw) * DQuat::from_rotation_x(std::f64::consts::PI))
    };
    let objects: Vec<DVec3> = player.simulation.truth().iter().map(|object| object.pose.translation).collect();
    let (mut from, mut opening_m, mut commands) = (robot.home, robot.max_opening_m, Vec::with_capacity(TICKS));
    while commands.len() < TICKS {
        // Towards an object, a little off, or up from where the hand is.
        let at = objects.get(dice.below(objects.len().max(1))).copied().unwrap_or(from.translation);
        let near = at + DVec3::new(dice.between(-0.03, 0.03), dice.between(-0.03, 0.03), dice.between(0.01, 0.05));
        let up = from.translation.with_z(dice.between(0.85, 1.0));
        let wanted = if dice.below(3) == 0 { up } else { near };
        let low = robot.workspace_min + DVec3::splat(0.01);
        let to = down(wanted.clamp(low, robot.workspace_max - DVec3::splat(0.01)), dice.between(-1.0, 1.0));
        let way = from.translation.distance(to.translation).max(0.2 * from.angle_to(&to));
        let ticks = (way / (0.8 * robot.max_speed_m_s * robot.tick_s)).ceil().max(10.0) as usize;
        let pose = |tick: usize| from.interpolate(&to, tick as f64 / ticks as f64);
        let command = |tick| Command::hand(pose(tick), opening_m, 20.0);
        commands.extend((1..=ticks).map(command));
        if dice.below(2) == 0 {
            opening_m = if opening_m > 0.0 { 0.0 } else { robot.max_opening_m };
        }
        from = to;
    }
    commands.truncate(TICKS);
    commands
}

/// SplitMix64 (Steele, Lea, Flood 2014): enough for choosing moments.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }
    fn below(&mut self, limit: usize) -> usize {
        (self.next() % limit.max(1) as u64) as usize
    }
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}
