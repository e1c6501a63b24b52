//! Tells what is watched before the instruction: first sights, moves of others, what went out of sight and came back.

use super::page::{Card, Cards};
use crate::words;
use acm_actors::message::Message;
use acm_concept::{
    ids::{FrameId, ObjectId},
    object::Percepts,
};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence},
    observation::Grounding,
};
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use glam::DVec3;
use std::{
    collections::BTreeMap,
    io::Write,
    sync::{Arc, Mutex, PoisonError},
};

/// Frames in a row without an object after which it counts as out of sight.
const HIDDEN_FRAMES: u32 = 2;
/// How far from an object's pixels a thing may disappear and still count as gone behind it, pixels.
const BEHIND_PX: f64 = 60.0;
/// Two things of one kind look the same if their sizes and colours differ by no more: metres, delta E.
const SAME_SIZE_M: f64 = 0.008;
const SAME_COLOR: f64 = 12.0;

/// Listens to the watching agent.
pub struct Watch {
    told: Mutex<Told>,
    cards: Arc<Cards>,
}

struct Told {
    sink: Box<dyn Write + Send>,
    percepts: Option<Percepts>,
    objects: BTreeMap<ObjectId, Seen>,
}

/// What was watched of an object.
#[derive(Default)]
struct Seen {
    /// Where the last frame that showed it had it.
    at: DVec3,
    /// Frames in a row that did not show it.
    unseen: u32,
    first_unseen: Option<FrameId>,
    last_unseen: Option<FrameId>,
    /// Whether it is told that it is hidden.
    hidden: bool,
    moved: bool,
    /// The last frame in which memory took a move over.
    moved_in: Option<FrameId>,
}

impl Watch {
    /// Tells into `sink`, and keeps for the page which frames prove what.
    pub fn new(sink: Box<dyn Write + Send>, cards: Arc<Cards>) -> Watch {
        Watch { told: Mutex::new(Told { sink, percepts: None, objects: BTreeMap::new() }), cards }
    }
}

impl Watch {
    /// Where the things that were moved have come to rest.
    pub fn at_rest(&self) -> Vec<String> {
        let told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        let line = |(id, seen): (&ObjectId, &Seen)| {
            let frame = seen.moved_in.filter(|_| seen.moved)?;
            let text = format!("rests   {id} at {}, last seen to move in {frame}", words::spot(seen.at));
            Some(super::below(&text))
        };
        told.objects.iter().filter_map(line).collect()
    }
}

impl Journal<Message> for Watch {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut told = self.told.lock().unwrap_or_else(PoisonError::into_inner);
        match &message.body {
            Message::Percepts { percepts, .. } => {
                told.percepts = Some((**percepts).clone());
                Ok(())
            }
            Message::Updated { grounding, view, .. } => match told.percepts.take() {
                Some(percepts) if percepts.blindness.is_none() => {
                    told.frame(&percepts, grounding, &*view.0, &self.cards).map_err(|e| JournalError(e.to_string()))
                }
                _ => Ok(()),
            },
            _ => Ok(()),
        }
    }
}

impl Told {
    fn frame(
        &mut self,
        percepts: &Percepts,
        grounding: &Grounding,
        view: &dyn MemoryView,
        cards: &Cards,
    ) -> std::io::Result<()> {
        let frame = percepts.frame.id;
        let mut lines = Vec::new();
        for (index, object) in view.objects().iter().enumerate() {
            let shown = grounding.resolved.iter().find(|r| r.object == object.id);
            let shown = shown.and_then(|r| percepts.objects.get(r.percept)).and_then(|o| o.pose());
            let news = match shown {
                Some(pose) => self.shown(object, pose.pose.translation, frame, view, index, cards),
                None => self.not_shown(object, percepts, grounding, view, cards),
            };
            lines.extend(news.map(|news| super::noted(&news, &format!("[{frame}]"))));
        }
        for line in lines {
            writeln!(self.sink, "{line}")?;
        }
        self.sink.flush()
    }

    fn shown(
        &mut self,
        object: &ObjectEntry,
        at: DVec3,
        frame: FrameId,
        view: &dyn MemoryView,
        index: usize,
        cards: &Cards,
    ) -> Option<String> {
        let (id, library) = (object.id, view.library());
        let Some(seen) = self.objects.get_mut(&id) else {
            self.objects.insert(id, Seen { at, ..Seen::default() });
            let twin = view.objects().get(..index)?.iter().find(|other| looks_the_same(object, other, view));
            let twin = twin.map_or_else(String::new, |twin| format!("   looks the same as {}", twin.id));
            let (size, spot) = (words::size(object, library), words::spot(at));
            let text = format!("{id} {} {size} at {spot}", object.category);
            cards.add(Card::new(id, frame, "seen first", &format!("{text}{twin}")));
            return Some(format!("saw     {text}{twin}"));
        };
        seen.at = at;
        seen.unseen = 0;
        let moves = object.history.len() > 1 && object.history.last().is_some_and(|h| h.cause == seen_in(frame));
        if moves {
            seen.moved_in = Some(frame);
        }
        // Memory takes nothing for the same thing again before a second view agrees.
        if seen.hidden && object.presence == Presence::Present {
            seen.hidden = false;
            let unseen = seen.first_unseen.take().zip(seen.last_unseen.take());
            let unseen = unseen.map_or_else(String::new, |(first, last)| format!("; not seen in {first} to {last}"));
            let text = format!("{id} {} comes out at {}{unseen}", object.category, words::spot(at));
            cards.add(Card::new(id, frame, "seen again", &text));
            return Some(format!("again   {text}"));
        }
        if moves && !seen.moved {
            seen.moved = true;
            let from = object.history.first().and_then(|h| h.place).map(|p| words::spot(p.pose.translation));
            let text = format!("{id} {} leaves {}, by no hand of mine", object.category, from.unwrap_or_default());
            cards.add(Card::new(id, frame, "seen to leave", &text));
            return Some(format!("moves   {text}"));
        }
        None
    }

    fn not_shown(
        &mut self,
        object: &ObjectEntry,
        percepts: &Percepts,
        grounding: &Grounding,
        view: &dyn MemoryView,
        cards: &Cards,
    ) -> Option<String> {
        let frame = percepts.frame.id;
        let seen = self.objects.get_mut(&object.id)?;
        seen.unseen += 1;
        if seen.unseen == 1 && !seen.hidden {
            seen.first_unseen = Some(frame);
        }
        seen.last_unseen = Some(frame);
        if seen.hidden || seen.unseen < HIDDEN_FRAMES {
            return None;
        }
        seen.hidden = true;
        let hider = hider(seen.at, percepts, grounding).and_then(|id| view.object(id));
        let how = hider
            .map_or_else(|| "is out of sight".into(), |hider| format!("passes behind {} {}", hider.id, hider.category));
        let believed = match object.presence {
            Presence::Missing => "where it is now: unknown",
            _ => "believed to be where it was",
        };
        let text = format!("{} {} {how}; {believed}", object.id, object.category);
        cards.add(Card::new(hider.map_or(object.id, |hider| hider.id), frame, "out of sight", &text));
        Some(format!("hidden  {text}"))
    }
}

fn seen_in(frame: FrameId) -> acm_memory::entry::PlaceCause {
    acm_memory::entry::PlaceCause::Seen(frame)
}

fn looks_the_same(a: &ObjectEntry, b: &ObjectEntry, view: &dyn MemoryView) -> bool {
    let size = |object: &ObjectEntry| view.library().extents_of(&object.parts);
    let (Some(one), Some(other)) = (size(a), size(b)) else { return false };
    a.category == b.category
        && (one - other).abs().max_element() < SAME_SIZE_M
        && a.appearance.mean.distance(&b.appearance.mean) < SAME_COLOR
}

/// What stands between the camera and a point: the thing nearer to the camera whose pixels are nearest to the point's.
fn hider(point: DVec3, percepts: &Percepts, grounding: &Grounding) -> Option<ObjectId> {
    let header = &percepts.frame;
    let pixel = header.intrinsics.project(header.camera_pose.inverse().transform_point(point))?;
    let eye = header.camera_pose.translation;
    let candidates = grounding.resolved.iter().filter_map(|resolved| {
        let object = percepts.objects.get(resolved.percept)?;
        let nearer = object.pose()?.pose.translation.distance(eye) < point.distance(eye);
        let [left, top, right, bottom] = object.support.bounds.map(f64::from);
        let outside = |value: f64, low: f64, high: f64| (low - value).max(value - high).max(0.0);
        let distance = outside(pixel.x, left, right).hypot(outside(pixel.y, top, bottom));
        (nearer && distance < BEHIND_PX).then_some((distance, resolved.object))
    });
    candidates.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, id)| id)
}
