//! One try of a cell: the world of a seed, the skill, and what truly came of it.

use super::{
    rig::{Rig, TABLE_M, invocation, part, place, scenario, scenario_with},
    table::{Cell, Fault, Values},
};
use acm_concept::{
    ids::ObjectId,
    pose::Pose,
    primitive::Primitive,
    skill::{SkillInvocation, SkillReport},
    solid::{PlacedSolid, Solid},
};
use acm_sim::AuditReport;
use anyhow::Result;
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

const THING: ObjectId = ObjectId(1);
/// Where the opening is.
const FIXTURE: DVec3 = DVec3::new(0.15, -0.1, TABLE_M);
/// Thickness of the opening's walls, metres.
const WALL_M: f64 = 0.02;
/// How long the world goes on before it is judged, seconds.
const AFTER_S: f64 = 0.4;
/// Tolerances of the judge: positions, metres, and directions, radians; a slide over the table; how far the thing may
/// end from where a skill without contact found it.
const PLACE_M: f64 = 0.005;
const TURN_RAD: f64 = 0.053;
const SLIDE_M: f64 = 0.01;
const ASIDE_M: f64 = 0.015;
const STILL_M: f64 = 0.0005;
const FLIP_RAD: f64 = 0.26;

/// What came of a try.
#[derive(Debug, Clone, PartialEq)]
pub struct Trial {
    /// Whether the skill under test said that it was done.
    pub done: bool,
    /// Whether the world is as it should be.
    pub right: bool,
    /// Why not, in words; or what was measured.
    pub words: String,
    /// Greatest force at the wrist, newtons.
    pub most_n: f64,
    /// What the physics audit found.
    pub audit: AuditReport,
}

/// The thing of a cell.
#[derive(Debug, Clone, Copy)]
struct Thing {
    width: f64,
    depth: f64,
    height: f64,
    round: bool,
}

impl Thing {
    fn of(values: &Values) -> Thing {
        let (width, round) = (values.metres("width"), values.is("round"));
        let depth = values.metres("depth");
        Thing {
            width,
            depth: if round || depth == 0.0 { width } else { depth },
            height: values.metres("height"),
            round,
        }
    }
    /// Its model; the closing direction, y, sees the width.
    fn model(&self, values: &Values, fixed: bool) -> String {
        let Thing { width, depth, height, round } = *self;
        let (solid, volume) = if round {
            (
                format!("shape = \"cylinder\"\nradius = {}\nheight = {height}", 0.5 * width),
                PI * width * width * height / 4.0,
            )
        } else {
            (format!("shape = \"box\"\nsize = [{depth}, {width}, {height}]"), width * depth * height)
        };
        let density = (1e-3 * values.get("mass_g") / volume).min(values.get("densest_kg_m3"));
        format!(
            "[[model]]\nmodel = \"thing\"\nsummary = \"\"\nfixed = {fixed}\ndensity_kg_m3 = {density}\nfriction = {}\n\
             [[model.solid]]\n{solid}\nposition = [0, 0, {}]\ncolor = \"#c02020\"\n",
            values.get("friction"),
            0.5 * height
        )
    }
    /// Where it is when its base is there.
    fn solid(&self, base: Pose) -> PlacedSolid {
        let Thing { width, depth, height, round } = *self;
        let solid = match round {
            true => Solid::Cylinder { radius: 0.5 * width, height },
            false => Solid::Box { size: DVec3::new(depth, width, height) },
        };
        PlacedSolid { solid, pose: base * Pose::from_translation(0.5 * height * DVec3::Z) }
    }
    fn arguments(&self) -> Vec<(&'static str, f64)> {
        vec![("grip_width", self.width), ("cross_width", self.depth), ("height", self.height)]
    }
    /// The frame in which it is taken from above.
    fn top(&self, base: Pose) -> Pose {
        base * Pose::from_translation(DVec3::Z * (self.height - 0.02f64.min(0.5 * self.height)))
    }
    /// The same as deep as the fingers reach: what is drawn over the table is best taken low.
    fn deep(&self, base: Pose) -> Pose {
        base * Pose::from_translation(DVec3::Z * (self.height - 0.034f64.min(0.5 * self.height)))
    }
    /// The frame in which it is taken from its +x side: z level and out, y level.
    fn side(&self, base: Pose) -> Pose {
        let out = DQuat::from_rotation_z(FRAC_PI_2) * DQuat::from_rotation_x(FRAC_PI_2);
        // y of the frame must be level: turn it about z.
        let frame = out * DQuat::from_rotation_z(FRAC_PI_2);
        base * Pose::new(DVec3::Z * (0.5 * self.height), frame)
    }
}

/// When the primitive under test began and ended, seconds; for a grasp and a release the whole skill, since a thing may be
/// lost on the way to them and after them.
type Window = (f64, f64);

/// Runs a cell with a seed. A slip needs to know when: the try is first run without it.
///
/// # Errors
/// The world cannot be built.
pub fn run(cell: &Cell, values: &Values, seed: u64) -> Result<Trial> {
    let (trial, window) = attempt(cell, values, seed, None)?;
    if cell.fault != Some(Fault::Slip) {
        return Ok(trial);
    }
    let share = 0.3 + 0.3 * values.get("turn") / std::f64::consts::TAU;
    let at_s = window.0 + share * (window.1 - window.0);
    Ok(attempt(cell, values, seed, Some(at_s))?.0)
}

fn attempt(cell: &Cell, values: &Values, seed: u64, slip_s: Option<f64>) -> Result<(Trial, Window)> {
    let mut stage = Stage::build(cell, values, seed, slip_s)?;
    let outcome = stage.act();
    stage.rig.wait(AFTER_S)?;
    let (done, right, words) = match outcome {
        Ok(report) => match stage.judge(&report)? {
            None => (true, true, String::new()),
            Some(wrong) => (true, false, wrong),
        },
        Err(reason) => (false, false, reason),
    };
    let (most_n, audit) = (stage.rig.most_n, stage.rig.simulation.audit());
    Ok((Trial { done, right, words, most_n, audit }, stage.window))
}

/// A world and what is tried in it.
struct Stage<'a> {
    cell: &'a Cell,
    values: &'a Values,
    thing: Thing,
    rig: Rig,
    /// Where the thing was believed, and truly was unless it is missing.
    base: Pose,
    goal: Pose,
    window: Window,
}

impl<'a> Stage<'a> {
    fn build(cell: &'a Cell, values: &'a Values, seed: u64, slip_s: Option<f64>) -> Result<Stage<'a>> {
        let thing = Thing::of(values);
        let at = DVec3::new(values.metres("x"), values.metres("y"), TABLE_M);
        let base = Pose::from_yaw(at, values.get("heading_deg").to_radians());
        let goal = goal(cell, values, &thing, base);
        let missing = cell.fault == Some(Fault::Missing) && cell.primitive != Primitive::Insert;
        let stuck = cell.fault == Some(Fault::Block)
            && matches!(cell.primitive, Primitive::Grasp | Primitive::Pull | Primitive::Push);
        let real = if missing { DVec3::new(1.2, 1.2, TABLE_M) } else { at };
        let mut models = thing.model(values, stuck);
        let mut objects = object("thing", "thing", real, base.yaw());
        if cell.primitive == Primitive::Insert {
            models += &fixture(values, &thing, cell.fault == Some(Fault::Block));
            let there = if cell.fault == Some(Fault::Missing) { DVec3::new(-1.2, 1.2, TABLE_M) } else { FIXTURE };
            objects += &object("fixture", "fixture", there, 0.0);
        }
        if cell.fault == Some(Fault::Block) && matches!(cell.primitive, Primitive::Reach | Primitive::Move) {
            models += "[[model]]\nmodel = \"wall\"\nsummary = \"\"\nfixed = true\n[[model.solid]]\nshape = \"box\"\n\
                       size = [0.4, 0.4, 0.42]\nposition = [0, 0, 0.21]\ncolor = \"#808080\"\n";
            let wall = if cell.primitive == Primitive::Reach {
                at + 0.26 * DVec3::X
            } else {
                goal.translation.with_z(TABLE_M)
            };
            objects += &object("wall", "wall", wall, 0.0);
        }
        if let Some(at_s) = slip_s {
            objects += &format!(
                "[[event]]\nname = \"slip\"\nafter_s = {at_s}\nover_s = 0\ncarry = {{ object = \"thing\" }}\nto = [0.9, 0.9, {TABLE_M}]\n"
            );
        }
        let friction = values.get("friction");
        let text = match &cell.robot {
            None => scenario(&models, &objects, friction),
            Some(robot) => scenario_with(robot, &models, &objects, friction),
        };
        let rig = Rig::new(&text, seed)?;
        Ok(Stage { cell, values, thing, rig, base, goal, window: (0.0, 0.0) })
    }

    /// Runs the skill under test, after whatever must come before it.
    fn act(&mut self) -> Result<SkillReport, String> {
        let (thing, base) = (self.thing, self.base);
        let arguments = thing.arguments();
        let side = self.values.is("side");
        let pick = if side {
            let sides = if thing.round { 0.0 } else { 2.0 };
            let arguments = [arguments.clone(), vec![("sides", sides)]].concat();
            invocation("grasp-along", THING, base, thing.side(base), &arguments)
        } else {
            invocation("grasp-from-above", THING, base, thing.top(base), &arguments)
        };
        match self.cell.primitive {
            Primitive::Grasp => self.test(pick),
            Primitive::Reach => {
                let frame = if side {
                    thing.side(base) * Pose::from_translation(DVec3::Z * 0.5 * thing.depth)
                } else {
                    base * Pose::from_translation(DVec3::Z * thing.height)
                };
                let mut reach = invocation("reach", THING, base, frame, &[("distance", 0.03), ("opening", 0.08)]);
                if self.cell.fault == Some(Fault::Block) {
                    // To where the wall is.
                    reach.frame.translation += 0.26 * DVec3::X;
                }
                self.test(reach)
            }
            Primitive::Flip => {
                let sides = if thing.round { 0.0 } else { 2.0 };
                let arguments = [arguments.clone(), vec![("sides", sides)]].concat();
                self.test(invocation("flip", THING, base, thing.side(base), &arguments))
            }
            Primitive::Pull => {
                let arguments = [arguments.clone(), vec![("travel", self.values.metres("travel"))]].concat();
                self.test(invocation("pull-along", THING, base, thing.deep(base), &arguments))
            }
            Primitive::Push => {
                let side = base
                    * Pose::new(
                        DVec3::new(0.5 * thing.depth, 0.0, 0.5 * thing.height),
                        DQuat::from_rotation_y(FRAC_PI_2),
                    );
                self.test(invocation("push-along", THING, base, side, &[("travel", self.values.metres("travel"))]))
            }
            Primitive::Move | Primitive::Rotate | Primitive::Insert | Primitive::Release => {
                let report =
                    self.run(pick).map_err(|reason| format!("before the {}: {reason}", self.cell.primitive))?;
                let Some((_, held)) = report.held else {
                    return Err("the grasp did not say how the thing sits in the hand".into());
                };
                let with_held = |kind: &str, arguments: &[(&str, f64)]| {
                    let mut invocation = invocation(kind, THING, base, base, arguments);
                    invocation.held = Some((THING, held, part(base)));
                    invocation.destination = place(self.goal);
                    invocation
                };
                let next = match self.cell.primitive {
                    Primitive::Move => with_held("move-to", &[]),
                    Primitive::Rotate => with_held("rotate", &[("angle", self.values.get("angle_deg").to_radians())]),
                    Primitive::Insert => {
                        let off = self.values.metres("lateral") * DVec2::from_angle(self.values.get("turn"));
                        let arguments =
                            [("depth", self.values.metres("sink")), ("clearance", self.values.metres("clearance"))];
                        let mut insert = with_held("insert-along", &arguments);
                        insert.destination = place(Pose::new(FIXTURE + off.extend(0.0), self.goal.rotation));
                        insert
                    }
                    _ => {
                        let mut down =
                            with_held("place-upright", &[("grip_width", thing.width), ("height", thing.height)]);
                        let off = self.values.metres("believed_off") * DVec3::X;
                        down.destination = place(Pose::new(self.goal.translation + off, self.goal.rotation));
                        down
                    }
                };
                self.test(next)
            }
        }
    }

    /// Runs a skill that is told the thing's solid where it was believed to stand, unless it is in the hand.
    fn run(&mut self, mut invocation: SkillInvocation) -> Result<SkillReport, String> {
        if invocation.held.is_none() {
            invocation.obstacles.push((THING, self.thing.solid(self.base)));
        }
        self.rig.done(&invocation)
    }

    fn test(&mut self, invocation: SkillInvocation) -> Result<SkillReport, String> {
        let began_s = self.rig.feedback().time.seconds();
        let report = self.run(invocation);
        self.window = (began_s, self.rig.feedback().time.seconds());
        let whole = matches!(self.cell.primitive, Primitive::Grasp | Primitive::Release);
        if let Ok(report) = &report
            && let Some(own) = report.primitives.iter().rev().find(|own| own.primitive == self.cell.primitive && !whole)
        {
            self.window = (own.started.seconds(), own.ended.seconds());
        }
        report
    }

    /// What is wrong with the world, if anything.
    fn judge(&self, report: &SkillReport) -> Result<Option<String>> {
        let thing = self.rig.object("thing")?;
        let (at, start) = (thing.pose.translation, self.base.translation);
        let tilt = thing.pose.transform_vector(DVec3::Z).angle_between(DVec3::Z);
        let far =
            |what: &str, off_m: f64, most_m: f64| (off_m > most_m).then(|| format!("{what} by {:.1} mm", 1e3 * off_m));
        let free = (thing.held).then(|| "the hand still holds it".to_string());
        let held = (!thing.held).then(|| "the hand does not hold it".to_string());
        Ok(match self.cell.primitive {
            Primitive::Grasp => held.or_else(|| (at.z < start.z + 0.03).then(|| "it was not lifted".into())),
            Primitive::Reach => far("the thing moved", at.distance(start), STILL_M),
            Primitive::Move => held.or_else(|| far("it is off", at.distance(self.goal.translation), PLACE_M)),
            Primitive::Rotate => {
                let turned = report.measured.get("turned_rad").copied().unwrap_or(0.0);
                let wanted = self.values.get("angle_deg").to_radians();
                let truly = acm_concept::pose::wrap_angle(thing.pose.yaw() - self.base.yaw());
                let off = (turned - wanted).abs().max(0.0);
                // The grasp may have turned the hand, never the thing; the hand looks down, so it turns the other way.
                let wrong = acm_concept::pose::wrap_angle(truly + wanted).abs().max(off);
                held.or_else(|| {
                    (wrong > TURN_RAD).then(|| format!("the turn is off by {:.1} degrees", wrong.to_degrees()))
                })
            }
            Primitive::Flip => free.or_else(|| {
                (tilt < PI - FLIP_RAD).then(|| format!("it is tilted by {:.0} degrees", tilt.to_degrees()))
            }),
            Primitive::Pull | Primitive::Push => {
                let way = self.goal.translation - start;
                let gone = (at - start).dot(way.normalize_or_zero());
                let aside = (at - start).reject_from(way).truncate().length();
                free.or_else(|| far("the way is off", (gone - way.length()).abs(), SLIDE_M))
                    .or_else(|| far("it went aside", aside, ASIDE_M))
                    .or_else(|| (tilt > FLIP_RAD).then(|| "it fell over".into()))
            }
            Primitive::Insert => {
                let off = (at - FIXTURE).truncate().length();
                let up_m = at.z - FIXTURE.z;
                free.or_else(|| far("it is beside the opening", off, self.values.metres("clearance") + 0.001))
                    .or_else(|| far("it is not in", up_m, 0.2 * self.values.metres("sink") + 0.001))
            }
            Primitive::Release => free
                .or_else(|| far("it is off", at.distance(self.goal.translation), PLACE_M))
                .or_else(|| (tilt > 0.1).then(|| "it fell over".into())),
        })
    }
}

/// Where the thing's base should come to be.
fn goal(cell: &Cell, values: &Values, thing: &Thing, base: Pose) -> Pose {
    let travel = values.metres("travel");
    let start = base.translation;
    match cell.primitive {
        Primitive::Move => Pose::new(start + DVec3::new(travel, 0.2 * travel, 0.15), base.rotation),
        Primitive::Pull => Pose::new(start + base.transform_vector(DVec3::X) * travel, base.rotation),
        Primitive::Push => Pose::new(start - base.transform_vector(DVec3::X) * travel, base.rotation),
        // A quarter turn changes nothing for a peg: the one that is nearest to how it stands.
        Primitive::Insert => {
            let quarter = if thing.round { base.yaw() } else { (base.yaw() / FRAC_PI_2).round() * FRAC_PI_2 };
            Pose::from_yaw(FIXTURE, quarter)
        }
        Primitive::Release => Pose::from_yaw(start + DVec3::new(0.2, 0.0, 0.0), base.yaw()),
        _ => base,
    }
}

fn object(name: &str, model: &str, at: DVec3, yaw: f64) -> String {
    let DVec3 { x, y, z } = at;
    format!("[[object]]\nname = \"{name}\"\nmodel = \"{model}\"\nposition = [{x}, {y}, {z}]\nyaw = {yaw}\n")
}

/// Four walls round an opening; closed by a fifth.
fn fixture(values: &Values, thing: &Thing, closed: bool) -> String {
    let (hole, sink) = (thing.width + values.metres("clearance"), values.metres("sink"));
    let (off, long) = (0.5 * (hole + WALL_M), hole + 2.0 * WALL_M);
    let mut walls =
        vec![(off, 0.0, WALL_M, long), (-off, 0.0, WALL_M, long), (0.0, off, hole, WALL_M), (0.0, -off, hole, WALL_M)];
    if closed {
        walls.push((0.0, 0.0, hole, hole));
    }
    let mut text = format!(
        "[[model]]\nmodel = \"fixture\"\nsummary = \"\"\nfixed = true\nfriction = {}\n",
        values.get("friction")
    );
    for (x, y, along, across) in walls {
        text += &format!(
            "[[model.solid]]\nshape = \"box\"\nsize = [{along}, {across}, {sink}]\nposition = [{x}, {y}, {}]\ncolor = \"#808080\"\n",
            0.5 * sink
        );
    }
    text
}
