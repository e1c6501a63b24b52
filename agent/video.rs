//! `acm run --video`: an episode as moving pictures.
//!
//! Drawn from what passes between the actors: frames, percepts and views of memory. The simulator's truth has no part
//! in it. There is one picture for each frame that was perceived, each decision and each verdict.
//!
//! | module | holds |
//! |---|---|
//! | [`scene`] | a frame with what was seen and what is believed drawn over it |
//! | [`ghost`] | dashed outlines of what is remembered and not seen |
//! | [`text`] | letters |
//! | [`film`] | pictures into a GIF that stays small |

pub mod film;
pub mod ghost;
pub mod scene;
pub mod text;

use crate::inject::FrameTap;
use acm_actors::message::{Message, View};
use acm_concept::{object::Percepts, template::TemplateLibrary};
use acm_memory::observation::{Grounding, Outcome, Verdict};
use acm_planner::Decision;
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use anyhow::{Context, bail};
pub use film::Picture;
use image::{Rgb, RgbImage, imageops};
use scene::Scene;
use std::{
    fs::File,
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

/// Most pictures of a video; an episode that goes on longer is shown up to here.
const MAX_PICTURES: usize = 240;
/// Height of the strip of text below the image, pixels.
const STRIP: u32 = 4 * text::LINE;
/// How long pictures stand, seconds.
const SEEN_S: f64 = 0.7;
const DECIDED_S: f64 = 1.4;
const FOUND_S: f64 = 1.0;
const END_S: f64 = 3.0;

const WHITE: Rgb<u8> = Rgb([255, 255, 255]);
const GREY: Rgb<u8> = Rgb([160, 170, 180]);
const GREEN: Rgb<u8> = Rgb([110, 230, 120]);
const RED: Rgb<u8> = Rgb([255, 110, 90]);
const YELLOW: Rgb<u8> = Rgb([255, 225, 60]);

/// A video file that was opened before the episode, so that a bad path costs nothing.
pub struct VideoFile {
    path: PathBuf,
    file: File,
}

impl VideoFile {
    /// Opens the file of a single episode's video.
    pub fn create(path: &Path, range: bool) -> anyhow::Result<VideoFile> {
        if range {
            bail!("--video draws one episode: give one --seed, not a range");
        }
        if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gif")) {
            bail!("the video {} must end in .gif: other formats are not written", path.display());
        }
        let file = File::create(path).with_context(|| format!("the video {} cannot be created", path.display()))?;
        Ok(VideoFile { path: path.into(), file })
    }
    /// Writes the pictures.
    pub fn write(mut self, pictures: &[Picture]) -> anyhow::Result<()> {
        let bytes = film::encode(pictures)?;
        std::io::Write::write_all(&mut self.file, &bytes)
            .with_context(|| format!("the video {} cannot be written", self.path.display()))
    }
}

/// Listens to an episode and draws it.
pub struct Camera {
    library: Arc<TemplateLibrary>,
    tap: FrameTap,
    reel: Mutex<Reel>,
}

#[derive(Default)]
struct Reel {
    pictures: Vec<Picture>,
    /// The last frame with what was seen in it drawn over, and what was seen.
    scene: Option<Scene>,
    percepts: Option<Percepts>,
    instruction: String,
    plan: String,
    steps: usize,
}

impl Camera {
    /// A camera that knows the shapes of a library's templates.
    pub fn new(library: Arc<TemplateLibrary>) -> Camera {
        Camera { library, tap: FrameTap::last(), reel: Mutex::default() }
    }
    /// The tap through which the episode's frames must pass.
    pub fn tap(&self) -> FrameTap {
        self.tap.clone()
    }
    /// The pictures, with the last one saying how it ended.
    pub fn pictures(&self, ending: String) -> Vec<Picture> {
        let mut reel = self.reel.lock().unwrap_or_else(PoisonError::into_inner);
        let mut pictures = std::mem::take(&mut reel.pictures);
        if let Some(last) = pictures.last() {
            let mut image = last.image.clone();
            strip(&mut image, 3, &ending, WHITE);
            pictures.push(Picture { image, seconds: END_S });
        }
        pictures
    }

    /// Draws the last frame with what was seen in it.
    fn scene(&self, percepts: &Percepts, grounding: &Grounding) -> Option<Scene> {
        let frame = self.tap.frames().into_iter().find(|frame| frame.header.id == percepts.frame.id)?;
        Some(Scene::new(&frame, percepts, grounding, &self.library))
    }
}

impl Journal<Message> for Camera {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut reel = self.reel.lock().unwrap_or_else(PoisonError::into_inner);
        let time_s = message.time_ns as f64 * 1e-9;
        match &message.body {
            Message::Parse { instruction } => reel.instruction.clone_from(instruction),
            Message::Percepts { percepts, .. } => reel.percepts = Some((**percepts).clone()),
            Message::Updated { grounding, view, .. } => {
                if let Some(percepts) = reel.percepts.take() {
                    reel.scene = self.scene(&percepts, grounding);
                }
                let missing: Vec<String> = grounding.missing.iter().map(ToString::to_string).collect();
                let gone = if missing.is_empty() { String::new() } else { format!(", {} gone", missing.join(", ")) };
                let news = format!("saw {} things{gone}", grounding.resolved.len());
                reel.add(&self.library, Some(view), time_s, (&news, GREY), SEEN_S);
            }
            Message::Decided { decision, .. } => reel.decided(decision, time_s, &self.library),
            // What an own action is believed to have done, before it is seen.
            Message::Kept { transition: Some(_), view } => {
                let news = ("done so; is it as predicted?", GREY);
                reel.add(&self.library, Some(view), time_s, news, SEEN_S);
            }
            Message::Verdict { verdict, .. } => {
                let (words, color) = verdict_words(verdict);
                reel.add(&self.library, None, time_s, (&words, color), FOUND_S);
            }
            _ => {}
        }
        Ok(())
    }
}

impl Reel {
    fn decided(&mut self, decision: &Decision, time_s: f64, library: &TemplateLibrary) {
        match decision {
            Decision::Act { step, .. } => {
                self.steps += 1;
                let effects: Vec<String> = step.prediction.effects.iter().map(|(l, _)| l.to_string()).collect();
                self.plan = format!("step {}: {step}", self.steps);
                let news = format!("predicted {:.2}: {}", step.prediction.success, effects.join(", "));
                self.add(library, None, time_s, (&news, WHITE), DECIDED_S);
            }
            Decision::SubtaskDone { index, .. } => {
                self.plan = format!("subtask {} is done", index + 1);
                self.add(library, None, time_s, ("", WHITE), FOUND_S);
            }
            Decision::Look { reason, .. } => {
                let news = format!("looks again: {reason}");
                self.add(library, None, time_s, (&news, GREY), SEEN_S);
            }
            Decision::Done { .. } | Decision::GiveUp { .. } => {}
        }
    }

    /// Adds a picture: the last scene with ghosts where memory believes otherwise. Without a view the last picture's
    /// image stays and the text alone changes.
    fn add(
        &mut self,
        library: &TemplateLibrary,
        view: Option<&View>,
        time_s: f64,
        news: (&str, Rgb<u8>),
        seconds: f64,
    ) {
        if self.pictures.len() >= MAX_PICTURES {
            return;
        }
        let mut image = match (view, &self.scene, self.pictures.last()) {
            (Some(view), Some(scene), _) => with_strip(&scene.with_beliefs(&*view.0, library)),
            (_, _, Some(last)) => last.image.clone(),
            _ => return,
        };
        strip(&mut image, 0, &self.instruction, GREY);
        strip(&mut image, 1, &format!("{time_s:>5.1} s  {}", self.plan), YELLOW);
        strip(&mut image, 2, news.0, news.1);
        strip(&mut image, 3, "solid: seen in the last frame  dashed: believed, not seen  ?: gone from its place", GREY);
        self.pictures.push(Picture { image, seconds });
    }
}

/// A picture with room for a strip of text below.
fn with_strip(picture: &RgbImage) -> RgbImage {
    let mut image = RgbImage::new(picture.width(), picture.height() + STRIP);
    imageops::replace(&mut image, picture, 0, 0);
    image
}

fn verdict_words(verdict: &Verdict) -> (String, Rgb<u8>) {
    match verdict.outcome {
        Outcome::Verified => ("VERIFIED".into(), GREEN),
        Outcome::Contradicted => (format!("CONTRADICTED: {}", verdict.reason), RED),
        Outcome::CannotTell => (format!("cannot tell yet: {}", verdict.reason), GREY),
    }
}

/// Writes one of the four lines below the image.
fn strip(image: &mut RgbImage, line: u32, words: &str, color: Rgb<u8>) {
    let top = image.height() - STRIP + line * text::LINE;
    for row in top..top + text::LINE {
        for column in 0..image.width() {
            image.put_pixel(column, row, Rgb([18, 20, 24]));
        }
    }
    let room = (image.width() / text::ADVANCE).saturating_sub(1) as usize;
    let mut fitted: String = words.chars().take(room).collect();
    if words.chars().count() > room {
        fitted.truncate(fitted.char_indices().nth(room.saturating_sub(3)).map_or(0, |(at, _)| at));
        fitted.push_str("...");
    }
    text::write(image, 4, i64::from(top) + 2, &fitted, color);
}
