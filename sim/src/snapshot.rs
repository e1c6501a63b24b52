//! A running simulation as bytes, and back.
//!
//! What a seed and a scenario fix is not in a snapshot: it is restored into a simulation of the same scenario, seed and
//! options, wherever that one stands. From there on both go on bit by bit alike: bodies, what is felt, events, judge,
//! audit, frames. Every room of the world says itself what it changes while the world runs; the judge's look ahead rests
//! on the same, so that whatever is forgotten here is found by the first test that reads a verdict.

use crate::{
    audit::Audit, body::BodyState, contact::Contacts, event::Phase, fluent::FluentState, mishap::MishapState,
    oracle::JudgeState, robot::RobotState, world::World,
};
use bincode::Options;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rapier3d::prelude::PhysicsWorld;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use thiserror::Error;

const MAGIC: [u8; 8] = *b"ACMWORLD";
/// Goes up whenever the bytes of an older one can no longer be read.
const VERSION: u32 = 1;
/// Largest snapshot that is read, bytes. A table with a dozen objects takes 30 kB.
const MAX_BYTES: u64 = 256 * 1024 * 1024;

/// A simulation at one moment, made by [`crate::Simulation::snapshot`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Snapshot(Vec<u8>);

/// Why a snapshot could not be made or restored.
#[derive(Debug, Error)]
pub enum SnapshotError {
    /// Not a snapshot at all.
    #[error("these {length} bytes are no snapshot of a simulation")]
    Foreign {
        /// How many bytes there are.
        length: usize,
    },
    /// Written by another version.
    #[error("the snapshot has version {found}, this program reads version {VERSION}; make it anew")]
    Version {
        /// The version found.
        found: u32,
    },
    /// Of another scenario, seed or option.
    #[error("the snapshot is of another world; restore it into a simulation of the same scenario, seed and options")]
    OtherWorld,
    /// Cut or damaged.
    #[error("the snapshot is damaged: {0}")]
    Damaged(#[from] bincode::Error),
}

impl Snapshot {
    /// The bytes, to be kept.
    pub fn as_bytes(&self) -> &[u8] {
        &self.0
    }

    /// Takes bytes that were kept. What they hold is looked at when they are restored.
    ///
    /// # Errors
    /// They are no snapshot, or one of another version.
    pub fn from_bytes(bytes: Vec<u8>) -> Result<Snapshot, SnapshotError> {
        let foreign = || SnapshotError::Foreign { length: bytes.len() };
        let rest = bytes.strip_prefix(&MAGIC).ok_or_else(foreign)?;
        let version = rest.first_chunk::<4>().ok_or_else(foreign)?;
        match u32::from_le_bytes(*version) {
            VERSION => Ok(Snapshot(bytes)),
            found => Err(SnapshotError::Version { found }),
        }
    }

    pub(crate) fn pack(whole: &Whole) -> Result<Snapshot, SnapshotError> {
        let mut bytes = [&MAGIC[..], &VERSION.to_le_bytes()].concat();
        options().serialize_into(&mut bytes, whole)?;
        Ok(Snapshot(bytes))
    }

    pub(crate) fn unpack(&self) -> Result<Whole, SnapshotError> {
        let foreign = SnapshotError::Foreign { length: self.0.len() };
        Ok(options().deserialize(self.0.get(MAGIC.len() + 4..).ok_or(foreign)?)?)
    }
}

fn options() -> impl Options {
    bincode::DefaultOptions::new().with_fixint_encoding().with_limit(MAX_BYTES)
}

/// Everything that a snapshot holds.
#[derive(Serialize, Deserialize)]
pub(crate) struct Whole {
    /// Tells worlds apart that have other things in other places.
    pub(crate) world_digest: String,
    pub(crate) world: WorldState,
    pub(crate) eyes: Eyes,
}

/// What the camera source that was handed out last goes on with.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Eyes {
    /// The sensor's noise.
    pub(crate) noise: SavedRng,
    /// Number of the next frame.
    pub(crate) next: u64,
    /// Colour and depth that each camera showed last, which a stuck one shows again.
    pub(crate) shown: Vec<Option<(Vec<u8>, Vec<f32>)>>,
}

/// A random generator as numbers.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct SavedRng {
    seed: [u8; 32],
    stream: u64,
    word: u128,
}

impl SavedRng {
    pub(crate) fn of(rng: &ChaCha8Rng) -> SavedRng {
        SavedRng { seed: rng.get_seed(), stream: rng.get_stream(), word: rng.get_word_pos() }
    }
    pub(crate) fn rng(&self) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::from_seed(self.seed);
        rng.set_stream(self.stream);
        rng.set_word_pos(self.word);
        rng
    }
}

/// All that a world changes while it runs.
#[derive(Serialize, Deserialize)]
pub(crate) struct WorldState {
    physics: PhysicsWorld,
    bodies: Vec<BodyState>,
    robot: RobotState,
    contacts: Contacts,
    events: Vec<Phase>,
    mishaps: Vec<MishapState>,
    fluents: FluentState,
    judge: JudgeState,
    audit: Audit,
    state: Vec<f64>,
    steps: u64,
    stopped: bool,
}

impl WorldState {
    /// The present. It goes on exactly as the world itself would.
    pub(crate) fn of(world: &World) -> Result<WorldState, bincode::Error> {
        Ok(WorldState {
            physics: copy(&world.physics)?,
            bodies: world.bodies.iter().map(|body| body.state()).collect(),
            robot: world.robot.state(),
            contacts: world.contacts.clone(),
            events: world.events.iter().map(|event| event.phase).collect(),
            mishaps: world.mishaps.iter().map(|mishap| mishap.state()).collect(),
            fluents: world.fluents.state(),
            judge: world.judge.state(),
            audit: world.audit.clone(),
            state: world.state.clone(),
            steps: world.steps,
            stopped: world.stopped,
        })
    }

    /// Whether it can be a state of this world.
    pub(crate) fn fits(&self, world: &World) -> bool {
        self.bodies.len() == world.bodies.len()
            && self.events.len() == world.events.len()
            && self.state.len() == world.state.len()
            && self.mishaps.len() == world.mishaps.len()
            && self.robot.fits(&world.robot)
            && self.judge.fits(&world.judge)
            && self.physics.bodies.len() == world.physics.bodies.len()
            && self.physics.colliders.len() == world.physics.colliders.len()
    }

    /// Puts a world that it fits where it was then.
    pub(crate) fn put_into(self, world: &mut World) {
        world.physics = self.physics;
        for (body, state) in world.bodies.iter_mut().zip(self.bodies) {
            body.set_state(state);
        }
        world.robot.set_state(self.robot);
        world.contacts = self.contacts;
        for (event, phase) in world.events.iter_mut().zip(self.events) {
            event.phase = phase;
        }
        for (mishap, state) in world.mishaps.iter_mut().zip(self.mishaps) {
            mishap.set_state(state);
        }
        world.fluents.set_state(self.fluents);
        world.judge.set_state(self.judge);
        (world.audit, world.state) = (self.audit, self.state);
        (world.steps, world.stopped) = (self.steps, self.stopped);
    }
}

/// A copy that goes on exactly as the original would. The engine's state has no other way of being copied.
fn copy<T: Serialize + DeserializeOwned>(original: &T) -> Result<T, bincode::Error> {
    bincode::deserialize(&bincode::serialize(original)?)
}

#[cfg(test)]
mod tests;
