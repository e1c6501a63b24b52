//! Listens to an episode: who was known again, what memory held, how it looked. The agent knows nothing of it.

use crate::inject::FrameTap;
use acm_actors::message::{Message, View};
use acm_concept::{camera::RgbdFrame, ids::ObjectId, object::Percepts};
use acm_memory::observation::Grounding;
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use acm_sim::TrueObject;
use glam::DVec3;
use image::RgbImage;
use serde::Serialize;
use std::{
    collections::BTreeMap,
    io,
    sync::{Mutex, PoisonError},
};

/// How far a percept may be from the true thing that it shows, metres.
const SAME_M: f64 = 0.03;
/// A thing that was moved by more is met anew, metres.
const MOVED_M: f64 = 0.02;
/// Pictures that are kept, and how they are made smaller.
const MAX_PICTURES: usize = 400;
const WIDTH: u32 = 160;

/// What was found.
#[derive(Debug, Clone, Default)]
pub struct Followed {
    /// Things seen again after they were out of sight or had moved.
    pub seen_again: u32,
    /// Those of them that had their old identity.
    pub known_again: u32,
    /// What memory held at the end, as JSON, bytes.
    pub memory_bytes: u64,
    /// Small pictures of the frames, where they are wanted.
    pub pictures: Vec<RgbImage>,
}

#[derive(Default)]
struct State {
    followed: Followed,
    percepts: Option<Box<Percepts>>,
    view: Option<View>,
    /// Of each true thing the identity under which it was seen first, and where and in which frame it was seen last.
    things: BTreeMap<String, (ObjectId, DVec3, u32)>,
    frame: u32,
}

/// Follows the messages of an episode.
pub struct Follower<W> {
    witness: W,
    tap: Option<FrameTap>,
    state: Mutex<State>,
}

impl<W: Fn() -> Vec<TrueObject>> Follower<W> {
    /// Follows with someone who tells the truth; with a tap, pictures are kept.
    pub fn new(witness: W, tap: Option<FrameTap>) -> Follower<W> {
        Follower { witness, tap, state: Mutex::default() }
    }
    /// What was found.
    pub fn take(&self) -> Followed {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(view) = state.view.take() {
            state.followed.memory_bytes =
                [size(view.0.objects()), size(view.0.transitions()), size(view.0.skills())].iter().sum();
        }
        std::mem::take(&mut state.followed)
    }

    /// Compares the identities of one frame with what it shows in truth.
    fn compare(&self, state: &mut State, percepts: &Percepts, grounding: &Grounding) {
        state.frame += 1;
        let truth = (self.witness)();
        let nearest = |at: DVec3| {
            let away = |thing: &&TrueObject| thing.pose.translation.distance(at);
            truth
                .iter()
                .filter(|thing| !thing.held)
                .min_by(|a, b| away(a).total_cmp(&away(b)))
                .filter(|t| away(t) < SAME_M)
        };
        for resolved in &grounding.resolved {
            let part = percepts.objects.get(resolved.percept).and_then(|object| object.parts.first());
            let Some(thing) = part.and_then(|part| nearest(part.pose.pose.translation)) else { continue };
            let at = thing.pose.translation;
            let Some((id, stood, frame)) = state.things.get(&thing.name).copied() else {
                state.things.insert(thing.name.clone(), (resolved.object, at, state.frame));
                continue;
            };
            if frame + 1 < state.frame || stood.distance(at) > MOVED_M {
                state.followed.seen_again += 1;
                state.followed.known_again += u32::from(id == resolved.object);
            }
            state.things.insert(thing.name.clone(), (id, at, state.frame));
        }
    }
}

impl<W: Fn() -> Vec<TrueObject> + Send + Sync> Journal<Message> for Follower<W> {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        match &message.body {
            Message::Percepts { percepts, .. } => {
                state.percepts = Some(percepts.clone());
                let frame = self.tap.as_ref().and_then(|tap| tap.frames().pop());
                if let Some(picture) =
                    frame.filter(|_| state.followed.pictures.len() < MAX_PICTURES).and_then(|f| small(&f))
                {
                    state.followed.pictures.push(picture);
                }
            }
            Message::Updated { grounding, view, .. } => {
                state.view = Some(view.clone());
                if let Some(percepts) = state.percepts.take() {
                    self.compare(&mut state, &percepts, grounding);
                }
            }
            Message::Kept { view, .. } => state.view = Some(view.clone()),
            _ => {}
        }
        Ok(())
    }
}

fn small(frame: &RgbdFrame) -> Option<RgbImage> {
    let size = &frame.header.intrinsics;
    let image = RgbImage::from_raw(size.width, size.height, frame.color.to_vec())?;
    let height = (WIDTH * size.height / size.width.max(1)).max(1);
    Some(image::imageops::thumbnail(&image, WIDTH, height))
}

/// Bytes of a value as JSON, without writing it anywhere.
fn size(value: &(impl Serialize + ?Sized)) -> u64 {
    struct Count(u64);
    impl io::Write for Count {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0 += bytes.len() as u64;
            Ok(bytes.len())
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let mut count = Count(0);
    // Counting cannot fail, and memory's entries can be written.
    serde_json::to_writer(&mut count, value).map_or(0, |()| count.0)
}
