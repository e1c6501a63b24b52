//! Mishaps with what the hand carries: it is gone and stands somewhere near, or the fingers let it fall.

use crate::{body::Body, event::put, layout::gap, placed::solids_at, snapshot::SavedRng, world::World};
use acm_concept::{camera::CameraModel, pose::Pose};
use glam::{DVec2, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// An object that is this much higher than where the pads took it is carried, metres.
const LIFTED_M: f64 = 0.05;
/// A carry ends when the pads have let go of the object for this long, seconds.
const LET_GO_S: f64 = 0.2;
/// How far from where it was taken it is set down, seen from above, metres.
const DISTANCE_M: [f64; 2] = [0.05, 0.12];
/// Smallest gap to other objects, metres.
const CLEARANCE_M: f64 = 0.03;
/// Smallest distance from the edge of what it is set down on, metres.
const EDGE_M: f64 = 0.05;
/// Smallest distance from the image's border, pixels at a width of 640.
const BORDER: f64 = 30.0 / 640.0;
/// Places tried in one physics step; the next step tries again from where the hand is then.
const TRIES: u32 = 64;

/// How long the hand lets go in a drop, seconds.
const DROP_S: f64 = 0.3;

/// What goes wrong with what the hand carries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum MishapKind {
    /// It is taken out of the hand unseen and set down 5 to 12 cm away.
    Slip,
    /// The fingers open for 0.3 s, and it falls.
    Drop,
}

/// Watches what the hand carries and strikes once, during the given carry.
#[derive(Debug, Clone)]
pub(crate) struct Mishap {
    kind: MishapKind,
    /// Counted from 1.
    at_carry: u32,
    rng: ChaCha8Rng,
    camera: Option<CameraModel>,
    carries: u32,
    gripped: Option<Gripped>,
    done: bool,
    /// Until when a drop holds the fingers open, seconds.
    open_until_s: f64,
}

#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub(crate) struct Gripped {
    body: usize,
    height_m: f64,
    last_touched_s: f64,
    counted: bool,
}

/// All that a mishap changes while the world runs.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct MishapState {
    rng: SavedRng,
    carries: u32,
    gripped: Option<Gripped>,
    done: bool,
    open_until_s: f64,
}

impl Mishap {
    pub(crate) fn state(&self) -> MishapState {
        let Mishap { carries, gripped, done, open_until_s, .. } = *self;
        MishapState { rng: SavedRng::of(&self.rng), carries, gripped, done, open_until_s }
    }
    pub(crate) fn set_state(&mut self, state: MishapState) {
        self.rng = state.rng.rng();
        (self.carries, self.gripped) = (state.carries, state.gripped);
        (self.done, self.open_until_s) = (state.done, state.open_until_s);
    }

    pub(crate) fn new(kind: MishapKind, at_carry: u32, seed: u64, camera: Option<CameraModel>) -> Mishap {
        // A stream of its own: the mishap changes nothing else.
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(2);
        Mishap { kind, at_carry, rng, camera, carries: 0, gripped: None, done: false, open_until_s: 0.0 }
    }

    /// Looks at the world after a physics step.
    pub(crate) fn step(&mut self, world: &mut World) {
        if self.done {
            return;
        }
        let now_s = world.seconds();
        let held = world.bodies.iter().position(|b| !b.placed.fixed && world.contacts.pads_touching(&b.colliders) == 2);
        self.gripped = match (self.gripped, held) {
            (Some(gripped), Some(body)) if gripped.body == body => Some(Gripped { last_touched_s: now_s, ..gripped }),
            (_, Some(body)) => {
                let height_m = world.bodies[body].pose(&world.physics).translation.z;
                Some(Gripped { body, height_m, last_touched_s: now_s, counted: false })
            }
            (gripped, None) => gripped.filter(|gripped| now_s - gripped.last_touched_s < LET_GO_S),
        };
        let Some(gripped) = &mut self.gripped else { return };
        let lifted = world.bodies[gripped.body].pose(&world.physics).translation.z - gripped.height_m > LIFTED_M;
        if lifted && !gripped.counted {
            gripped.counted = true;
            self.carries += 1;
        }
        if lifted && self.carries == self.at_carry {
            self.strike(world);
        }
    }

    /// Whether the hand lets go now, whatever it was told.
    pub(crate) fn drops(&self, world: &World) -> bool {
        world.seconds() < self.open_until_s
    }

    fn strike(&mut self, world: &mut World) {
        let Some(gripped) = self.gripped else { return };
        if self.kind == MishapKind::Drop {
            (self.open_until_s, self.done) = (world.seconds() + DROP_S, true);
            return;
        }
        for _ in 0..TRIES {
            let pose = self.candidate(world, &world.bodies[gripped.body]);
            if let Some(pose) = pose.filter(|pose| self.is_free(world, gripped.body, pose)) {
                put(&mut world.physics, &world.bodies[gripped.body], &pose);
                world.excuse(gripped.body);
                self.done = true;
                return;
            }
        }
    }

    /// A place near the object on the highest support below it, or `None` if there is no support.
    fn candidate(&mut self, world: &World, body: &Body) -> Option<Pose> {
        let now = body.pose(&world.physics);
        let distance = self.rng.random_range(DISTANCE_M[0]..DISTANCE_M[1]);
        let angle = self.rng.random_range(0.0..TAU);
        let spot = now.translation.truncate() + distance * DVec2::from_angle(angle);
        let below = world.surfaces.iter().filter_map(|(_, surface)| {
            let top = surface.position.z + 0.5 * surface.size.z;
            let inside = (spot - surface.position.truncate()).abs() + DVec2::splat(EDGE_M);
            let fits = surface.support && inside.cmple(0.5 * surface.size.truncate()).all();
            (fits && top < now.translation.z).then_some(top)
        });
        let top = below.max_by(f64::total_cmp)?;
        Some(Pose::from_yaw(spot.extend(top), now.yaw()))
    }

    fn is_free(&self, world: &World, body: usize, pose: &Pose) -> bool {
        let object = &world.bodies[body].placed;
        let centre = pose.translation + DVec3::Z * 0.5 * object.height();
        let seen = self.camera.as_ref().is_none_or(|camera| {
            let pixel = camera.intrinsics.project(camera.pose.inverse().transform_point(centre));
            let size = DVec2::new(camera.intrinsics.width.into(), camera.intrinsics.height.into());
            let border = DVec2::splat(BORDER * size.x);
            pixel.is_some_and(|pixel| pixel.cmpgt(border).all() && pixel.cmplt(size - border).all())
        });
        let here = solids_at(object, pose);
        let clear = world.bodies.iter().enumerate().filter(|(other, _)| *other != body).all(|(_, other)| {
            let there = solids_at(&other.placed, &other.pose(&world.physics));
            gap(&here, &there).is_ok_and(|gap| gap >= CLEARANCE_M)
        });
        seen && clear && world.robot.description.reaches(centre)
    }
}
