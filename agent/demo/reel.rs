//! Pictures of an episode, step by step, with what memory held at each.

use crate::{inject::FrameTap, video::scene::Scene, words};
use acm_actors::message::{Message, View};
use acm_concept::{
    camera::RgbdFrame,
    ids::{FrameId, ObjectId},
    object::Percepts,
    template::TemplateLibrary,
};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence},
    observation::{Grounding, Outcome},
};
use acm_planner::Decision;
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use image::{RgbImage, imageops};
use serde::Serialize;
use std::{
    collections::BTreeMap,
    sync::{Arc, Mutex, PoisonError},
};

/// Of the frames in which nothing happens, every so many-th is kept.
const EVERY: u64 = 4;
/// Most steps that are kept; what comes later is left out.
const MAX_STEPS: usize = 60;
/// Room round an object in its picture, pixels.
const MARGIN: u32 = 28;

/// A part of the story.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Chapter {
    /// Before the instruction.
    #[default]
    Watch,
    /// From the instruction on.
    Ask,
}

/// A picture with what was believed.
#[derive(Debug, Clone)]
pub struct Step {
    /// The part of the story.
    pub chapter: Chapter,
    /// Virtual time, seconds.
    pub time_s: f64,
    /// The frame that is shown.
    pub frame: FrameId,
    /// What happened.
    pub caption: String,
    /// What was seen and what is believed.
    pub image: RgbImage,
    /// Memory's objects.
    pub objects: Vec<ObjectRow>,
}

/// An object as it is believed at a step.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectRow {
    /// Its identity.
    pub id: String,
    /// Its category.
    pub category: String,
    /// Length, width and height.
    pub size: String,
    /// Where it is believed, metres.
    pub at: Option<[f64; 2]>,
    /// What it stands on.
    pub on: String,
    /// `seen` in the frame, `believed` without being seen, `unknown`, `held`.
    pub state: &'static str,
    /// Probability that it is as described, 0-1.
    pub confidence: f64,
}

/// Listens to agents and draws what they see and believe.
pub struct Reel {
    library: Arc<TemplateLibrary>,
    tap: FrameTap,
    rolls: Mutex<Rolls>,
}

#[derive(Default)]
struct Rolls {
    chapter: Chapter,
    steps: Vec<Step>,
    /// Cut-outs of each object in each frame that was watched.
    crops: BTreeMap<(FrameId, ObjectId), RgbImage>,
    percepts: Option<Percepts>,
    last: Option<(Scene, FrameId)>,
    /// Whether a skill was just written down.
    recorded: bool,
    states: BTreeMap<ObjectId, &'static str>,
    skills: usize,
}

impl Reel {
    /// An empty reel.
    pub fn new(library: Arc<TemplateLibrary>, chapter: Chapter) -> Reel {
        Reel { library, tap: FrameTap::last(), rolls: Mutex::new(Rolls { chapter, ..Rolls::default() }) }
    }
    /// The tap through which the frames must pass.
    pub fn tap(&self) -> FrameTap {
        self.tap.clone()
    }
    /// Begins a part of the story.
    pub fn chapter(&self, chapter: Chapter) {
        let mut rolls = self.rolls.lock().unwrap_or_else(PoisonError::into_inner);
        rolls.chapter = chapter;
        rolls.percepts = None;
    }
    /// Repeats the last picture with how it ended.
    pub fn end(&self, caption: &str) {
        let mut rolls = self.rolls.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(last) = rolls.steps.last().cloned() {
            rolls.steps.push(Step { caption: caption.into(), ..last });
        }
    }
    /// The reel so far, as one that nobody writes to.
    pub fn take(&self) -> Reel {
        let rolls = std::mem::take(&mut *self.rolls.lock().unwrap_or_else(PoisonError::into_inner));
        Reel { library: Arc::clone(&self.library), tap: self.tap.clone(), rolls: Mutex::new(rolls) }
    }
    /// The steps in their order.
    pub fn steps(&self) -> Vec<Step> {
        self.rolls.lock().unwrap_or_else(PoisonError::into_inner).steps.clone()
    }
    /// The last frame that was watched and showed an object.
    pub fn last_frame_of(&self, object: ObjectId) -> Option<FrameId> {
        let rolls = self.rolls.lock().unwrap_or_else(PoisonError::into_inner);
        rolls.crops.keys().filter(|(_, shown)| *shown == object).map(|(frame, _)| *frame).max()
    }
    /// An object's pixels in a frame that was watched.
    pub fn crop(&self, frame: FrameId, object: ObjectId) -> Option<RgbImage> {
        self.rolls.lock().unwrap_or_else(PoisonError::into_inner).crops.get(&(frame, object)).cloned()
    }
}

impl Journal<Message> for Reel {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut rolls = self.rolls.lock().unwrap_or_else(PoisonError::into_inner);
        let time_s = message.time_ns as f64 * 1e-9;
        match &message.body {
            Message::Percepts { percepts, .. } => rolls.percepts = Some((**percepts).clone()),
            Message::Updated { grounding, view, .. } => {
                let frames = self.tap.frames();
                if let (Some(percepts), Some(frame)) = (rolls.percepts.take(), frames.first())
                    && frame.header.id == percepts.frame.id
                {
                    rolls.frame(frame, &percepts, grounding, view, time_s, &self.library);
                }
            }
            Message::Decided { decision, .. } => rolls.decided(decision, time_s),
            Message::Record(_) => rolls.recorded = true,
            Message::Kept { view, .. } if std::mem::take(&mut rolls.recorded) => {
                rolls.add("done so, it believes: is it as predicted?".into(), Some(view), time_s, &self.library);
            }
            Message::Verdict { verdict, .. } => {
                let word = match verdict.outcome {
                    Outcome::Verified => "VERIFIED",
                    Outcome::Contradicted => "CONTRADICTED",
                    Outcome::CannotTell => "cannot tell yet",
                };
                rolls.add(format!("{word}: {}", verdict.reason), None, time_s, &self.library);
            }
            _ => {}
        }
        Ok(())
    }
}

impl Rolls {
    fn frame(
        &mut self,
        frame: &RgbdFrame,
        percepts: &Percepts,
        grounding: &Grounding,
        view: &View,
        time_s: f64,
        library: &TemplateLibrary,
    ) {
        let id = frame.header.id;
        if self.chapter == Chapter::Watch {
            self.cut_out(frame, percepts, grounding);
        }
        let scene = Scene::new(frame, percepts, grounding, library);
        let news = self.news(&*view.0, &scene, grounding);
        if news.is_empty() && self.chapter == Chapter::Watch && !id.0.is_multiple_of(EVERY) {
            return;
        }
        self.last = Some((scene, id));
        let unknown = self.states.iter().filter(|(_, state)| **state == "unknown");
        let unknown: Vec<String> = unknown.map(|(id, _)| format!("{id} is not where it was; where now?")).collect();
        let caption = match (news.is_empty(), unknown.is_empty()) {
            (false, _) => news.join("; "),
            (true, true) => format!("{} things in sight, nothing new", grounding.resolved.len()),
            (true, false) => unknown.join(", "),
        };
        self.add(caption, Some(view), time_s, library);
    }

    /// Objects whose state changed since the last frame, or that were seen to move.
    fn news(&mut self, view: &dyn MemoryView, scene: &Scene, grounding: &Grounding) -> Vec<String> {
        let mut news = Vec::new();
        for object in view.objects() {
            let (id, state) = (object.id, state(object, scene));
            let before = self.states.insert(id, state);
            news.extend(match (before, state) {
                (None, _) => Some(format!("{id} {} is new", object.category)),
                (Some("unknown"), "seen") => Some(format!("{id} is in sight again")),
                (Some("seen" | "believed"), "unknown") => Some(format!("{id} is not where it was; where now?")),
                _ if grounding.moved.contains(&id) => Some(format!("{id} was moved, not by me")),
                _ => None,
            });
        }
        news
    }

    fn cut_out(&mut self, frame: &RgbdFrame, percepts: &Percepts, grounding: &Grounding) {
        let (width, height) = (frame.header.intrinsics.width, frame.header.intrinsics.height);
        let Some(image) = RgbImage::from_raw(width, height, frame.color.to_vec()) else { return };
        for resolved in &grounding.resolved {
            let Some(object) = percepts.objects.get(resolved.percept) else { continue };
            let [left, top, right, bottom] = object.support.bounds;
            let (left, top) = (left.saturating_sub(MARGIN), top.saturating_sub(MARGIN));
            let (right, bottom) = ((right + MARGIN).min(width - 1), (bottom + MARGIN).min(height - 1));
            let crop = imageops::crop_imm(&image, left, top, right - left + 1, bottom - top + 1).to_image();
            self.crops.insert((frame.header.id, resolved.object), crop);
        }
    }

    fn decided(&mut self, decision: &Decision, time_s: f64) {
        let caption = match decision {
            Decision::Act { step, .. } => {
                self.skills += 1;
                format!("step {}: {step}, predicted {:.2}", self.skills, step.prediction.success)
            }
            Decision::Look { reason, .. } => format!("looks again: {reason}"),
            Decision::SubtaskDone { reason, .. } => format!("done: {reason}"),
            Decision::GiveUp { unknown, .. } => format!("gives up: {}", unknown.text),
            Decision::Done { .. } => return,
        };
        self.repeat(caption, time_s);
    }

    /// The last picture with another caption.
    fn repeat(&mut self, caption: String, time_s: f64) {
        if let Some(last) = self.steps.last().cloned().filter(|_| self.steps.len() < MAX_STEPS) {
            self.steps.push(Step { caption, time_s, chapter: self.chapter, ..last });
        }
    }

    fn add(&mut self, caption: String, view: Option<&View>, time_s: f64, library: &TemplateLibrary) {
        let (Some(view), Some((scene, frame))) = (view, &self.last) else { return self.repeat(caption, time_s) };
        if self.steps.len() >= MAX_STEPS {
            return;
        }
        let rows = view.0.objects().iter().map(|object| row(object, scene, library)).collect();
        self.steps.push(Step {
            chapter: self.chapter,
            time_s,
            frame: *frame,
            caption,
            image: scene.with_beliefs(&*view.0, library),
            objects: rows,
        });
    }
}

fn state(object: &ObjectEntry, scene: &Scene) -> &'static str {
    match object.presence {
        Presence::Held => "held",
        Presence::Missing => "unknown",
        Presence::Present if scene.shows(object) => "seen",
        Presence::Present => "believed",
    }
}

fn row(object: &ObjectEntry, scene: &Scene, library: &TemplateLibrary) -> ObjectRow {
    let place = object.pose().map(|pose| [pose.translation.x, pose.translation.y]);
    ObjectRow {
        id: object.id.to_string(),
        category: object.category.clone(),
        size: words::size(object, library),
        at: place.filter(|_| object.presence != Presence::Held),
        on: match (object.presence, object.support) {
            (Presence::Held, _) => "the hand".into(),
            (Presence::Missing, _) => "?".into(),
            (Presence::Present, Some(id)) => id.to_string(),
            (Presence::Present, None) => "the table".into(),
        },
        state: state(object, scene),
        confidence: object.confidence,
    }
}
