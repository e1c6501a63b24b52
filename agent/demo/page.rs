//! The demo as an HTML page: one file that asks for nothing from outside.

use super::reel::{Chapter, ObjectRow, Reel, Step};
use crate::embed;
use acm_concept::ids::{FrameId, ObjectId};
use anyhow::Context;
use image::{RgbImage, codecs::jpeg::JpegEncoder};
use serde::Serialize;
use std::{
    path::Path,
    sync::{Mutex, PoisonError},
};

/// The page without its data.
const TEMPLATE: &str = include_str!("page.html");
/// JPEG quality of steps and of cut-outs, 0-100.
const QUALITY: u8 = 80;
/// Largest page, bytes.
const MAX_BYTES: usize = 6_000_000;

/// What the page says of the whole.
#[derive(Debug, Clone, Serialize)]
pub struct Facts {
    /// The scenario's name.
    pub scenario: String,
    /// Its seed.
    pub seed: u64,
    /// What drew the frames.
    pub renderer: String,
    /// Whether the agent says done and the judge agrees.
    pub solved: bool,
    /// The judge's verdict.
    pub judge: String,
    /// Further seeds: asked, solved with memory, solved without.
    pub more: Option<[usize; 3]>,
    /// Commands that show the same again, with what they show.
    pub commands: Vec<(String, String)>,
}

/// One reason, with the frame that proves it.
#[derive(Debug, Clone)]
pub struct Card {
    object: ObjectId,
    frame: Option<FrameId>,
    title: String,
    text: String,
}

impl Card {
    /// A reason: what a frame shows of an object.
    pub fn new(object: ObjectId, frame: FrameId, title: &str, text: &str) -> Card {
        Card { object, frame: Some(frame), title: title.into(), text: text.into() }
    }
    /// A reason about an object, with the last frame that was watched of it.
    pub fn latest(object: ObjectId, title: &str, text: &str) -> Card {
        Card { object, frame: None, title: title.into(), text: text.into() }
    }
}

/// The reasons so far.
#[derive(Debug, Default)]
pub struct Cards(Mutex<Vec<Card>>);

impl Cards {
    /// Adds one.
    pub fn add(&self, card: Card) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push(card);
    }
    fn all(&self) -> Vec<Card> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// The page's data.
#[derive(Serialize)]
pub struct Page {
    schema: &'static str,
    facts: Facts,
    why: Vec<CardRow>,
    runs: Vec<RunRow>,
    #[serde(skip)]
    steps: [Vec<Step>; 2],
}

#[derive(Serialize)]
struct CardRow {
    object: String,
    frame: String,
    title: String,
    text: String,
    image: Option<String>,
}

#[derive(Serialize)]
struct RunRow {
    name: &'static str,
    steps: Vec<StepRow>,
}

#[derive(Serialize)]
struct StepRow {
    chapter: Chapter,
    time_s: f64,
    frame: String,
    caption: String,
    objects: Vec<ObjectRow>,
    /// Number of the step that has the same picture; a picture is written once.
    same_as: Option<usize>,
    image: Option<String>,
}

impl Page {
    /// Puts the page together from what the two agents saw.
    pub fn new(facts: Facts, with: Reel, without: Reel, cards: &Cards) -> Page {
        let card = |card: Card| {
            let frame = card.frame.or_else(|| with.last_frame_of(card.object));
            let crop = frame.and_then(|frame| with.crop(frame, card.object));
            CardRow {
                image: crop.map(|image| picture(&image)),
                object: card.object.to_string(),
                frame: frame.map_or_else(String::new, |frame| frame.to_string()),
                title: card.title,
                text: card.text,
            }
        };
        let steps = [with.steps(), without.steps()];
        let run = |name, steps: &[Step]| RunRow { name, steps: rows(steps) };
        let runs = vec![run("with memory", &steps[0]), run("without memory", &steps[1])];
        Page { schema: "acm.demo/1", facts, why: cards.all().into_iter().map(card).collect(), runs, steps }
    }

    /// The steps with memory, and those without.
    pub fn steps(&self) -> &[Vec<Step>; 2] {
        &self.steps
    }

    /// The page as text.
    ///
    /// # Errors
    /// It would be too large.
    pub fn html(&self) -> anyhow::Result<String> {
        let json = serde_json::to_string(self)?;
        let html = embed::fill(TEMPLATE, &json);
        anyhow::ensure!(html.len() <= MAX_BYTES, "the page has {} bytes, more than {MAX_BYTES}", html.len());
        Ok(html)
    }

    /// Writes the page.
    pub fn write(&self, path: &Path) -> anyhow::Result<()> {
        std::fs::write(path, self.html()?).with_context(|| format!("the page {} cannot be written", path.display()))
    }
}

fn rows(steps: &[Step]) -> Vec<StepRow> {
    let mut rows: Vec<StepRow> = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        let same = index.checked_sub(1).filter(|&before| steps.get(before).is_some_and(|b| b.image == step.image));
        let same_as = same.map(|before| rows.get(before).and_then(|row| row.same_as).unwrap_or(before));
        rows.push(StepRow {
            chapter: step.chapter,
            time_s: step.time_s,
            frame: step.frame.to_string(),
            caption: step.caption.clone(),
            objects: step.objects.clone(),
            image: same_as.is_none().then(|| picture(&step.image)),
            same_as,
        });
    }
    rows
}

/// A picture as a data URI.
fn picture(image: &RgbImage) -> String {
    let mut bytes = Vec::new();
    let encoded = JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode_image(image);
    // Writing to memory fails for an empty picture alone.
    encoded.map_or_else(|_empty| String::new(), |()| embed::data_uri("image/jpeg", &bytes))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is the test's verdict")]
    use super::*;

    #[test]
    fn a_page_asks_for_nothing_and_its_text_cannot_break_out() {
        let facts = Facts {
            scenario: "</script><b>".into(),
            seed: 3,
            renderer: "none".into(),
            solved: false,
            judge: String::new(),
            more: None,
            commands: Vec::new(),
        };
        let reel = || Reel::new(std::sync::Arc::new(acm_memory::default_library().unwrap()), Chapter::Watch);
        let html = Page::new(facts, reel(), reel(), &Cards::default()).html().unwrap();
        assert!(!html.contains("</script><b>"));
        for outside in ["http://", "https://", "src=", "url(", "@import", "<link", "fetch("] {
            assert!(!html.contains(outside), "{outside}");
        }
        let data = html.split(r#"<script type="application/json" id="data">"#).nth(1).unwrap();
        let data: serde_json::Value = serde_json::from_str(data.split("</script>").next().unwrap()).unwrap();
        assert_eq!(data["facts"]["scenario"], "</script><b>");
    }
}
