//! Doors and drawers opened to three quarters of their way and shut again: the executor alone, with exact geometry.
//!
//! What a person would see of a closed door is taken from the truth: the box of its handle, the flat of its front, the
//! axis of its hinge. Everything else is the function kinds' own.

mod front;

use super::{
    audited,
    primitives::rig::{self, Rig, invocation},
    progress,
};
use crate::{
    bench::{BenchResult, Row},
    cli::BenchArgs,
};
use acm_concept::{
    ids::ObjectId,
    pose::Pose,
    solid::{PlacedSolid, Solid},
};
use acm_sim::{AuditReport, TrueJoint, TrueLink, TrueObject, TruePiece};
use anyhow::{Context, Result};
use front::Front;
use glam::DVec3;
use std::path::{Path, PathBuf};

const THING: ObjectId = ObjectId(1);
/// The share of its way that counts as open; and how much farther the hand is told to go.
pub const OPEN_SHARE: f64 = 0.75;
const FARTHER_SHARE: f64 = 0.04;
/// Most force at the wrist, newtons.
pub const CAP_N: f64 = 60.0;
/// Open by no more than this share counts as shut.
pub const SHUT_SHARE: f64 = 0.05;
/// A front that looks down by more than this share is drawn up rather than pushed.
const BELOW: f64 = 0.25;
/// A part of which others cover this share is no outer one.
const MOSTLY: f64 = 0.5;
/// The height of things that are not tall, or have a door that drops, metres: the hand must get under their handles.
const RAISED_M: f64 = 0.7;
/// The hand waits at this height, or so much over the thing: it goes home over doors that stand open; metres.
const HOME_M: f64 = 1.3;
const OVER_M: f64 = 0.4;
/// What is higher than this stands near the ground, metres: some doors reach below their foot.
const TALL_M: f64 = 0.75;
const GROUND_M: f64 = 0.05;

/// The models whose doors and drawers are tried.
const OWN: [&str; 7] = [
    "bar-microwave",
    "drawer-cabinet",
    "drop-door-oven",
    "knob-cupboard",
    "sliding-cabinet",
    "two-door-refrigerator",
    "washing-machine",
];
/// How the names of the shared data's models begin; and their categories.
const SHARED_PREFIX: &str = "data:infinigen_articulated/";
const SHARED: [&str; 5] = ["microwave", "refrigerator", "cabinet", "drawer", "oven"];

/// The variable that names the folder of the shared data.
const DATA: &str = "ACM_DATA";

/// Opens and shuts every outer door and drawer of our models and of the shared data, and lists them.
///
/// # Errors
/// A world cannot be built.
pub fn measure(args: &BenchArgs, result: &mut BenchResult) -> Result<()> {
    let data = std::env::var_os(DATA).map(PathBuf::from);
    let (mut tried, mut good) = (0usize, 0usize);
    let mut models = models(data.as_deref());
    models.truncate(args.episodes.unwrap_or(usize::MAX));
    let bar = progress("doors and drawers", models.len() as u64);
    for model in &models {
        bar.inc(1);
        let shared = model.starts_with(SHARED_PREFIX);
        for swing in run_model(model)? {
            tried += usize::from(shared);
            good += usize::from(shared && swing.good());
            let values = [
                ("opened", swing.opened),
                ("left", swing.left),
                ("most_n", swing.most_n),
                ("good", f64::from(u8::from(swing.good()))),
            ];
            let group = if shared { "articulated" } else { "articulated, own" };
            result.rows.push(Row { group: Some(group.into()), ..Row::new(swing.name.as_str(), values) });
            result.notes.extend(swing.failure.map(|why| format!("{}: {why}", swing.name)));
            result.notes.extend(swing.audit.first.iter().map(|told| format!("audit, {}: {told}", swing.name)));
            audited(result, swing.audit.violations);
        }
    }
    if data.is_none() {
        let reason = format!("no data: name the folder of the shared data in {DATA}");
        result.rows.push(Row::skipped("articulated, shared", reason));
    } else if tried > 0 {
        result.figure("articulated_open75_success", good as f64 / tried as f64);
    }
    Ok(())
}

/// One door or drawer, opened and shut.
#[derive(Debug, Clone, PartialEq)]
pub struct Swing {
    /// Model and part.
    pub name: String,
    /// Whether it turns.
    pub is_hinge: bool,
    /// How far it can go, radians or metres.
    pub way: f64,
    /// The share of it that it stood open.
    pub opened: f64,
    /// The share of it that it was left open in the end.
    pub left: f64,
    /// Greatest force at the wrist, newtons.
    pub most_n: f64,
    /// What the physics audit found.
    pub audit: AuditReport,
    /// Why it was not opened or shut.
    pub failure: Option<String>,
}

impl Swing {
    /// Opened far enough and shut again, within the force that a wrist bears.
    pub fn good(&self) -> bool {
        let within = self.most_n <= CAP_N && self.audit.violations == 0;
        self.failure.is_none() && within && self.opened >= OPEN_SHARE && self.left <= SHUT_SHARE
    }
    /// One line.
    pub fn line(&self) -> String {
        let (kind, unit) = if self.is_hinge { ("hinge", "rad") } else { ("slide", "m") };
        let verdict = if self.good() { "ok" } else { "FAILED" };
        let why = self.failure.as_deref().unwrap_or_default();
        format!(
            "{:<56} {kind} {:.2} {unit}  open {:.2} left {:.2}  most {:.0} N  {verdict} {why}",
            self.name, self.way, self.opened, self.left, self.most_n
        )
    }
}

/// The models of ours, and those of the shared data if a folder with it is given.
pub fn models(data: Option<&Path>) -> Vec<String> {
    let mut names: Vec<String> = OWN.iter().map(|name| (*name).to_string()).collect();
    for category in SHARED.iter().filter(|_| data.is_some()) {
        let folder = data.map(|data| data.join("infinigen_articulated").join(category));
        let mut seeds: Vec<PathBuf> = folder
            .and_then(|folder| std::fs::read_dir(folder).ok())
            .into_iter()
            .flatten()
            .filter_map(|entry| entry.ok().map(|entry| entry.path()))
            .collect();
        seeds.sort();
        let seeds = seeds.iter().filter_map(|path| path.file_name().and_then(|name| name.to_str()));
        names.extend(seeds.map(|seed| format!("{SHARED_PREFIX}{category}/{seed}/{category}.urdf")));
    }
    names
}

/// Opens and shuts each outer door and drawer of a model, each in a world of its own.
///
/// # Errors
/// The world cannot be built.
pub fn run_model(model: &str) -> Result<Vec<Swing>> {
    let plain = Rig::new(&world(model, 0.0, 0.0), 0)?.object("thing")?;
    let drops = (0..plain.links.len()).filter_map(|link| Front::of(&plain, link)).any(|front| front.drops());
    let height_m = if plain.size_m.z > TALL_M && !drops { GROUND_M } else { RAISED_M };
    let text = world(model, height_m, height_m + plain.size_m.z);
    let thing = Rig::new(&text, 0)?.object("thing")?;
    let fronts: Vec<Front> = (0..thing.links.len()).filter_map(|link| Front::of(&thing, link)).collect();
    let hidden = |front: &Front| fronts.iter().map(|other| other.hides(front)).sum::<f64>();
    let outer = fronts.iter().filter(|front| hidden(front) < MOSTLY);
    outer.map(|front| swing(model, &text, &thing, front)).collect()
}

fn swing(model: &str, text: &str, thing: &TrueObject, front: &Front) -> Result<Swing> {
    let link = &thing.links[front.link];
    let mut rig = Rig::new(text, 0)?;
    let mut result = Swing {
        name: format!("{} / {}", model.trim_start_matches(SHARED_PREFIX), link.name),
        is_hinge: front.is_hinge,
        way: front.way,
        opened: 0.0,
        left: 1.0,
        most_n: 0.0,
        audit: AuditReport::default(),
        failure: None,
    };
    let opened = open(&mut rig, thing, front);
    rig.wait(0.5)?;
    let joint = now(&rig, front)?;
    (result.opened, result.most_n) = (joint.opened, rig.most_n);
    if let Err(reason) = opened {
        result.failure = Some(format!("open: {reason}"));
        result.audit = rig.simulation.audit();
        return Ok(result);
    }
    rig.go_home()?;
    let shut = shut(&mut rig, thing, front);
    rig.wait(0.5)?;
    let joint = now(&rig, front)?;
    (result.left, result.most_n) = (joint.opened, rig.most_n);
    result.failure = shut.err().map(|reason| format!("shut: {reason}"));
    result.audit = rig.simulation.audit();
    Ok(result)
}

fn now(rig: &Rig, front: &Front) -> Result<TrueJoint> {
    let thing = rig.object("thing")?;
    let link = thing.links.into_iter().nth(front.link).context("the part is gone")?;
    link.joint.context("the part has lost its joint")
}

fn open(rig: &mut Rig, thing: &TrueObject, front: &Front) -> Result<(), String> {
    // By its handle, or where it has none by the edge that is far from its hinge.
    let (frame, width_m) = match front.handle() {
        Some((frame, width_m)) => (frame, Some(width_m)),
        None => (front.edge().ok_or("it has neither a handle nor a free edge that the hand can take")?, None),
    };
    let handles = front.handles(thing);
    let travel = (OPEN_SHARE + FARTHER_SHARE) * front.way;
    let mut arguments = front.joint_in(&frame);
    arguments.extend(width_m.map(|width_m| ("grip_width", width_m)));
    arguments.push((if front.is_hinge { "angle" } else { "travel" }, travel));
    let kind = if front.is_hinge { "hinge-open" } else { "slide-open" };
    let mut skill = invocation(kind, THING, thing.pose, frame, &arguments);
    skill.support_height_m = 0.0;
    skill.obstacles = solids(thing, |link, piece| !handles.contains(&(link, piece)));
    rig.done(&skill).map(|_| ())
}

fn shut(rig: &mut Rig, shut_thing: &TrueObject, front: &Front) -> Result<(), String> {
    let thing = rig.object("thing").map_err(|error| error.to_string())?;
    let link = thing.links.get(front.link).ok_or("the part is gone")?;
    let joint = link.joint.as_ref().ok_or("the part has lost its joint")?;
    let handles = front.handles(shut_thing);
    let turned = link.pose * front.closed.inverse();
    let travel = (joint.position - joint.closed).abs();
    // Pushed shut from outside, unless outside is below, or it slides sideways: then drawn by its handle, if it has one.
    let below = turned.transform_vector(front.axes.z_axis).z < -BELOW;
    let sideways = !front.is_hinge && front.axis.dot(front.axes.z_axis).abs() < 0.5;
    let (taken, width_m) = match front.handle().filter(|_| below || sideways) {
        Some((frame, width_m)) => (frame, Some(width_m)),
        None => (front.flat().ok_or("its front has no flat that the hand can press")?, None),
    };
    let mut arguments = front.joint_in(&taken);
    arguments.push((if front.is_hinge { "angle" } else { "travel" }, travel));
    arguments.extend(width_m.map(|width_m| ("grip_width", width_m)));
    let kind = if front.is_hinge { "hinge-close" } else { "slide-close" };
    let mut skill = invocation(kind, THING, thing.pose, turned * taken, &arguments);
    skill.support_height_m = 0.0;
    skill.obstacles = solids(&thing, |link, piece| width_m.is_none() || !handles.contains(&(link, piece)));
    rig.done(&skill).map(|_| ())
}

/// The boxes round the pieces of some links, as the hand is told of what is in its way. They belong to another object
/// than the one it acts on, so that they count.
fn solids(thing: &TrueObject, wanted: impl Fn(usize, usize) -> bool) -> Vec<(ObjectId, PlacedSolid)> {
    let solid = |link: &TrueLink, piece: &TruePiece| {
        let pose = link.pose * Pose::from_translation(0.5 * (piece.low + piece.high));
        (ObjectId(2), PlacedSolid { solid: Solid::Box { size: piece.high - piece.low }, pose })
    };
    let pieces = |(at, link): (usize, &TrueLink)| -> Vec<(ObjectId, PlacedSolid)> {
        let counts = link.pieces.iter().enumerate().filter(|(index, _)| wanted(at, *index));
        counts.map(|(_, piece)| solid(link, piece)).collect()
    };
    thing.links.iter().enumerate().flat_map(pieces).collect()
}

/// A world with one thing in it. It hangs at its height, as if in a kitchen's wall: some doors reach below their foot.
fn world(model: &str, height_m: f64, top_m: f64) -> String {
    let field = if model.starts_with("data:") { "model_file" } else { "model" };
    let objects = format!("[[object]]\nname = \"thing\"\n{field} = \"{model}\"\nposition = [0, 0, {height_m}]\n");
    rig::scenario_on(
        "",
        &objects,
        0.5,
        0.0,
        DVec3::new(1.3, 0.0, HOME_M.max(top_m + OVER_M)),
        [DVec3::new(-2.5, -2.5, 0.004), DVec3::new(2.5, 2.5, 3.0)],
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    #[test]
    fn our_own_doors_and_drawers_open_and_shut() {
        let swings: Vec<Swing> = models(None).iter().flat_map(|model| run_model(model).unwrap()).collect();
        assert!(swings.len() >= 10, "{} doors and drawers", swings.len());
        for swing in swings {
            assert!(swing.good(), "{}", swing.line());
        }
    }
}
