//! Doors and drawers opened to three quarters of their way and shut again: the executor alone, with exact geometry.
//!
//! What a person would see of a closed door is taken from the truth: the box of its handle, the flat of its front, the
//! axis of its hinge. Everything else is the function kinds' own.

use super::{
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
use acm_sim::{TrueJoint, TrueLink, TrueObject, TruePiece};
use anyhow::{Context, Result};
use glam::{DMat3, DQuat, DVec2, DVec3};
use std::path::{Path, PathBuf};

const THING: ObjectId = ObjectId(1);
/// The share of its way that counts as open; and how much farther the hand is told to go.
pub const OPEN_SHARE: f64 = 0.75;
const FARTHER_SHARE: f64 = 0.04;
/// Open by no more than this share counts as shut.
pub const SHUT_SHARE: f64 = 0.05;
/// A front that looks down by more than this share cannot be pushed from outside.
const BELOW: f64 = 0.25;
/// A door's or drawer's front is at least so wide and high, metres; it goes at least so far, radians or metres.
const FRONT_M: f64 = 0.07;
const LEAST_TURN_RAD: f64 = 0.7;
const LEAST_SLIDE_M: f64 = 0.08;
/// Shortest handle along the fingers' width, and how near pieces of one handle are, metres.
const NARROWEST_M: f64 = 0.006;
const TOUCHING_M: f64 = 0.002;
/// Widest handle, metres.
const WIDEST_M: f64 = 0.068;
/// Pieces whose front is this near to the foremost one are handles, if they stand out from the front by so much; metres.
const FOREMOST_M: f64 = 0.02;
const STANDS_OUT_M: f64 = 0.008;
/// Half of the flat that closed finger tips need, metres.
const FOOTPRINT_M: f64 = 0.014;
/// Half of the palm's sides, metres; and how far the fingers reach beyond it.
const PALM_M: DVec2 = DVec2::new(0.108, 0.038);
const FINGERS_M: f64 = 0.04;
/// The height of things that are not tall, metres: the hand must get under their handles.
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
    /// Why it was not opened or shut.
    pub failure: Option<String>,
}

impl Swing {
    /// Opened far enough and shut again.
    pub fn good(&self) -> bool {
        self.failure.is_none() && self.opened >= OPEN_SHARE && self.left <= SHUT_SHARE
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
    let height_m = if plain.size_m.z > TALL_M { GROUND_M } else { RAISED_M };
    let text = world(model, height_m, height_m + plain.size_m.z);
    let thing = Rig::new(&text, 0)?.object("thing")?;
    let fronts: Vec<Front> = (0..thing.links.len()).filter_map(|link| Front::of(&thing, link)).collect();
    let outer = fronts.iter().filter(|front| !fronts.iter().any(|other| other.hides(front)));
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
        failure: None,
    };
    let opened = open(&mut rig, thing, front);
    rig.wait(0.5)?;
    let joint = now(&rig, front)?;
    (result.opened, result.most_n) = (joint.opened, rig.most_n);
    if let Err(reason) = opened {
        result.failure = Some(format!("open: {reason}"));
        return Ok(result);
    }
    rig.go_home()?;
    let shut = shut(&mut rig, thing, front);
    rig.wait(0.5)?;
    let joint = now(&rig, front)?;
    (result.left, result.most_n) = (joint.opened, rig.most_n);
    result.failure = shut.err().map(|reason| format!("shut: {reason}"));
    Ok(result)
}

fn now(rig: &Rig, front: &Front) -> Result<TrueJoint> {
    let thing = rig.object("thing")?;
    let link = thing.links.into_iter().nth(front.link).context("the part is gone")?;
    link.joint.context("the part has lost its joint")
}

fn open(rig: &mut Rig, thing: &TrueObject, front: &Front) -> Result<(), String> {
    let (frame, width_m) = front.handle().ok_or("it has no handle that the hand can take")?;
    let handles = front.handles(thing);
    let travel = (OPEN_SHARE + FARTHER_SHARE) * front.way;
    let mut arguments = front.joint_in(&frame);
    arguments.push(("grip_width", width_m));
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
    // Pushed shut from outside, unless outside is below, or it slides sideways: then drawn by its handle.
    let below = turned.transform_vector(front.axes.z_axis).z < -BELOW;
    let sideways = !front.is_hinge && front.axis.dot(front.axes.z_axis).abs() < 0.5;
    let (taken, width_m) = if below || sideways {
        let (frame, width_m) = front.handle().ok_or("it has no handle that the hand can take")?;
        (frame, Some(width_m))
    } else {
        (front.flat().ok_or("its front has no flat that the hand can press")?, None)
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

/// A box, aligned with the thing's axes when all is shut, in coordinates along right, up and out of a front.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    low: DVec3,
    high: DVec3,
}

impl Piece {
    fn size(&self) -> DVec3 {
        self.high - self.low
    }
    fn middle(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }
    fn touches(&self, other: &Piece) -> bool {
        let apart = (self.low - other.high).max(other.low - self.high);
        apart.max_element() < TOUCHING_M
    }
    fn covers(&self, right: f64, up: f64) -> bool {
        (self.low.x..=self.high.x).contains(&right) && (self.low.y..=self.high.y).contains(&up)
    }
}

/// A part that opens, seen from before it.
#[derive(Debug, Clone)]
struct Front {
    link: usize,
    is_hinge: bool,
    /// How far it goes, radians or metres.
    way: f64,
    /// The link's pose when it is shut, world frame.
    closed: Pose,
    /// Columns: right, up, out; world frame.
    axes: DMat3,
    /// A point of the hinge, and the direction about which, or along which, it opens; world frame.
    origin: DVec3,
    axis: DVec3,
    /// Its pieces, along right, up and out.
    pieces: Vec<Piece>,
}

impl Front {
    fn of(thing: &TrueObject, index: usize) -> Option<Front> {
        let link = thing.links.get(index)?;
        let joint = link.joint.as_ref()?;
        let [low, high] = joint.range?;
        let sense = if high - joint.closed >= joint.closed - low { 1.0 } else { -1.0 };
        let way = (high - joint.closed).max(joint.closed - low);
        let hangs_on_base = hanger(thing, link.parent);
        if !hangs_on_base || way < if joint.is_hinge { LEAST_TURN_RAD } else { LEAST_SLIDE_M } {
            return None;
        }
        let own: Vec<&TrueLink> = (0..thing.links.len())
            .filter(|at| carrier(thing, *at) == index)
            .filter_map(|at| thing.links.get(at))
            .collect();
        let corners: Vec<(Pose, DVec3, DVec3)> =
            own.iter().flat_map(|link| link.pieces.iter().map(|piece| (link.pose, piece.low, piece.high))).collect();
        let count = corners.len().max(1) as f64;
        let middle =
            corners.iter().map(|(pose, low, high)| pose.transform_point(0.5 * (*low + *high))).sum::<DVec3>() / count;
        let axis = sense * joint.axis;
        // Models look along +x; a door of an oven or of a chest may open to another side.
        let ahead = thing.pose.transform_vector(DVec3::X);
        let out = if joint.is_hinge { snapped(axis.cross(middle - joint.origin), thing.pose.rotation) } else { ahead };
        let up = if out.z.abs() > 0.5 { snapped(DVec3::X, thing.pose.rotation) } else { DVec3::Z };
        let axes = DMat3::from_cols(up.cross(out), up, out);
        let pieces = corners.iter().map(|(pose, low, high)| seen(pose, *low, *high, &axes)).collect();
        let front = Front {
            link: index,
            is_hinge: joint.is_hinge,
            way,
            closed: link.pose,
            axes,
            origin: joint.origin,
            axis,
            pieces,
        };
        let size = front.bounds().size();
        (size.x.min(size.y) >= FRONT_M).then_some(front)
    }

    fn bounds(&self) -> Piece {
        let start = Piece { low: DVec3::MAX, high: DVec3::MIN };
        self.pieces
            .iter()
            .fold(start, |all, piece| Piece { low: all.low.min(piece.low), high: all.high.max(piece.high) })
    }

    /// Whether this front stands before another part.
    fn hides(&self, other: &Front) -> bool {
        let (mine, theirs) = (self.bounds(), other.bounds());
        let middle = theirs.middle();
        self.link != other.link
            && (self.axes.z_axis - other.axes.z_axis).length() < 0.1
            && mine.covers(middle.x, middle.y)
            && mine.middle().z > theirs.high.z - FOREMOST_M
    }

    /// How far a place is from the hinge, seen from before it; for a slide how near it is to the middle.
    fn merit(&self, right: f64, up: f64) -> f64 {
        let middle = self.bounds().middle();
        if !self.is_hinge {
            return -(right - middle.x).hypot(up - middle.y);
        }
        let at = self.axes * DVec3::new(right, up, middle.z);
        (at - self.origin).reject_from_normalized(self.axis).length()
    }

    /// The boxes of what stands out from the front: pieces that touch each other together make a handle.
    fn standing_out(&self) -> Vec<Piece> {
        let panel = self.panel();
        let out = self.pieces.iter().filter(|piece| piece.high.z > panel + STANDS_OUT_M);
        let mut boxes: Vec<Piece> = Vec::new();
        for piece in out {
            let mut joined = *piece;
            // Boxes that the new one touches become one with it.
            let (touched, apart): (Vec<Piece>, Vec<Piece>) = boxes.into_iter().partition(|other| joined.touches(other));
            for other in touched {
                joined = Piece { low: joined.low.min(other.low), high: joined.high.max(other.high) };
            }
            boxes = apart;
            boxes.push(joined);
        }
        boxes
    }

    /// The frame in which the handle is taken, and its width: a piece of it that is alone narrow enough, like the bar
    /// between its feet, or all of it together, like a shell of many pieces.
    fn handle(&self) -> Option<(Pose, f64)> {
        let foremost = self.bounds().high.z;
        let panel = self.panel();
        let graspable = |piece: &Piece| {
            let size = piece.size();
            piece.high.z > foremost - FOREMOST_M
                && piece.high.z > panel + STANDS_OUT_M
                && size.x.min(size.y) < WIDEST_M
                && size.x.max(size.y) > NARROWEST_M
        };
        let merit = |piece: &Piece| {
            let (size, middle) = (piece.size(), piece.middle());
            // Of pieces that are alike, the longer: the bar, not its feet.
            size.x.max(size.y) + 0.2 * self.merit(middle.x, middle.y)
        };
        let whole = self.standing_out();
        let candidates = if whole.iter().any(graspable) { whole } else { self.pieces.clone() };
        let best = candidates.into_iter().filter(graspable).max_by(|a, b| merit(a).total_cmp(&merit(b)))?;
        let (size, middle) = (best.size(), best.middle());
        let deep = (0.5 * size.z).min(0.015).min(best.high.z - panel - 0.014).max(0.003);
        let at = self.axes * DVec3::new(middle.x, middle.y, best.high.z - deep);
        // The fingers close across its narrow side.
        let across = if size.x <= size.y { self.axes.x_axis } else { self.axes.y_axis };
        Some((framed(at, across, self.axes.z_axis), size.x.min(size.y)))
    }

    /// The pieces of the shut thing that stand out from this front: link and number.
    fn handles(&self, thing: &TrueObject) -> Vec<(usize, usize)> {
        let panel = self.panel();
        let own = thing.links.iter().enumerate().filter(|(at, _)| carrier(thing, *at) == self.link);
        let stands_out = |(at, link): (usize, &TrueLink)| -> Vec<(usize, usize)> {
            let pieces = link.pieces.iter().enumerate();
            let out = pieces
                .filter(|(_, piece)| seen(&link.pose, piece.low, piece.high, &self.axes).high.z > panel + STANDS_OUT_M);
            out.map(|(index, _)| (at, index)).collect()
        };
        own.flat_map(stands_out).collect()
    }

    /// How far out the front's largest piece reaches.
    fn panel(&self) -> f64 {
        let area = |piece: &&Piece| piece.size().x * piece.size().y;
        self.pieces.iter().max_by(|a, b| area(a).total_cmp(&area(b))).map_or(0.0, |piece| piece.high.z)
    }

    /// How far out the front is at a place.
    fn height(&self, right: f64, up: f64) -> Option<f64> {
        let there = self.pieces.iter().filter(|piece| piece.covers(right, up)).map(|piece| piece.high.z);
        there.max_by(f64::total_cmp)
    }

    /// A frame on a flat of the front, far from the hinge, where the palm meets no handle; else on the handle.
    fn flat(&self) -> Option<Pose> {
        const GRID: i32 = 24;
        const AROUND: [(f64, f64); 8] =
            [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.7), (1.7, 0.0), (0.0, -1.7), (-1.7, 0.0)];
        let bounds = self.bounds();
        let (low, size, middle) = (bounds.low, bounds.size(), bounds.middle());
        let mut best: Option<(f64, DVec3, DVec3)> = None;
        for (i, j) in (1..GRID).flat_map(|i| (1..GRID).map(move |j| (i, j))) {
            let right = low.x + size.x * f64::from(i) / f64::from(GRID);
            let up = low.y + size.y * f64::from(j) / f64::from(GRID);
            let Some(height) = self.height(right, up) else { continue };
            let level = AROUND.iter().all(|(x, y)| {
                let there = self.height(right + x * FOOTPRINT_M, up + y * FOOTPRINT_M);
                there.is_some_and(|there| (there - height).abs() < 0.002)
            });
            let along = [(PALM_M, self.axes.x_axis), (DVec2::new(PALM_M.y, PALM_M.x), self.axes.y_axis)];
            let Some((_, palm)) = along.into_iter().find(|(half, _)| self.room(right, up, height, *half)) else {
                continue;
            };
            // Far from the hinge, and not at an end of it.
            let aside = if self.axis.dot(self.axes.y_axis).abs() > 0.5 { up - middle.y } else { right - middle.x };
            let merit = self.merit(right, up) - if self.is_hinge { 0.5 * aside.abs() } else { 0.0 };
            if level && best.is_none_or(|(most, _, _)| merit > most) {
                best = Some((merit, DVec3::new(right, up, height), palm));
            }
        }
        let free = best.map(|(_, at, palm)| framed(self.axes * at, palm, self.axes.z_axis));
        free.or_else(|| {
            let (frame, _) = self.handle()?;
            let (at, foremost) = (self.axes.transpose() * frame.translation, bounds.high.z);
            Some(Pose::new(self.axes * at.with_z(foremost), frame.rotation))
        })
    }

    /// Whether nothing stands out so far beside a place that the palm would meet it before the tips are there.
    fn room(&self, right: f64, up: f64, height: f64, half: DVec2) -> bool {
        let beside = |piece: &Piece| {
            piece.low.x < right + half.x
                && piece.high.x > right - half.x
                && piece.low.y < up + half.y
                && piece.high.y > up - half.y
        };
        !self.pieces.iter().any(|piece| beside(piece) && piece.high.z > height + FINGERS_M)
    }

    /// The joint as arguments of a function, in a frame of the closed part.
    fn joint_in(&self, frame: &Pose) -> Vec<(&'static str, f64)> {
        let inverse = frame.inverse();
        let (axis, point) = (inverse.transform_vector(self.axis), inverse.transform_point(self.origin));
        let mut arguments = vec![("axis_x", axis.x), ("axis_y", axis.y), ("axis_z", axis.z)];
        if self.is_hinge {
            arguments.extend([("hinge_x", point.x), ("hinge_y", point.y), ("hinge_z", point.z)]);
        }
        arguments
    }
}

/// Whether a link is the base, or fixed to it.
fn hanger(thing: &TrueObject, index: usize) -> bool {
    carrier(thing, index) == 0
}

/// The link with a joint, or the base, that a link is fixed to.
fn carrier(thing: &TrueObject, index: usize) -> usize {
    let mut at = index;
    for _ in 0..thing.links.len() {
        match thing.links.get(at) {
            Some(link) if link.joint.is_none() && at != 0 => at = link.parent,
            _ => break,
        }
    }
    at
}

/// The axis of a frame that is nearest to a direction.
fn snapped(direction: DVec3, frame: DQuat) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| frame * axis);
    let nearest = axes.into_iter().max_by(|a, b| a.dot(direction).abs().total_cmp(&b.dot(direction).abs()));
    nearest.map_or(direction, |axis| axis * axis.dot(direction).signum())
}

/// A box of a link, seen along other axes.
fn seen(pose: &Pose, low: DVec3, high: DVec3, axes: &DMat3) -> Piece {
    let corners = (0..8u8).map(|i| {
        let pick = |bit: u8, low: f64, high: f64| if i & bit == 0 { low } else { high };
        let corner = DVec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z));
        axes.transpose() * pose.transform_point(corner)
    });
    let start = Piece { low: DVec3::MAX, high: DVec3::MIN };
    corners.fold(start, |all, corner| Piece { low: all.low.min(corner), high: all.high.max(corner) })
}

/// The frame with this origin, y and z.
fn framed(at: DVec3, y: DVec3, z: DVec3) -> Pose {
    Pose::new(at, DQuat::from_mat3(&DMat3::from_cols(y.cross(z), y, z)).normalize())
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
