//! Things with digits, marks, lamps and dials on them, rendered from seeds, and what perception reads of them.
//!
//! | module | holds |
//! |---|---|
//! | `letters` | styles of print and of seven segments |
//! | `panel` | boxes with something to read on them; pictures of them |

mod letters;
mod panel;

use super::timed;
use crate::{
    bench::{BenchResult, Row, progress},
    cli::PerceptionArgs,
    statistics::median_and,
};
use acm_concept::{
    expectation::Expectation,
    object::Percepts,
    reading::{Content, Reading},
};
use acm_perception::{Grounder, GrounderConfig, overlay};
use acm_render::Renderer;
use anyhow::Context;
use panel::{Kind, Photo, Shown};
use std::{collections::BTreeMap, path::Path, sync::Arc};

/// Photographs, and the seed of the first.
const PHOTOS: usize = 600;
const FIRST_SEED: u64 = 5000;
/// Borders between the classes of height, pixels.
const HEIGHTS_PX: [f64; 4] = [9.0, 14.0, 20.0, 30.0];
/// A needle is read right within this angle, degrees.
const NEEDLE_DEG: f64 = 15.0;
/// From this confidence on a reading is sure.
const SURE: f64 = 0.9;

/// Measures readings.
pub fn measure(args: &PerceptionArgs, result: &mut BenchResult) -> anyhow::Result<()> {
    let mut renderer = match Renderer::new() {
        Ok(renderer) => renderer,
        Err(error) => {
            result.rows.push(Row::skipped("reading", error.to_string()));
            return Ok(());
        }
    };
    let library = Arc::new(acm_memory::default_library()?);
    let grounder = Grounder::new(Arc::clone(&library), GrounderConfig { read: true, ..GrounderConfig::default() });
    let asked = args.common.episodes.unwrap_or(PHOTOS).min(PHOTOS);
    let count = if args.common.quick { asked.div_ceil(10) } else { asked };
    if let Some(folder) = &args.pictures {
        std::fs::create_dir_all(folder).with_context(|| format!("the folder {} cannot be made", folder.display()))?;
    }
    let bar = progress("reading", count as u64);
    let mut judged = Vec::new();
    for (kind, seed) in Kind::ALL.into_iter().cycle().zip(args.seed_from.unwrap_or(FIRST_SEED)..).take(count) {
        let photo = panel::photo(&mut renderer, kind, seed)?;
        let (percepts, ms) = timed(&grounder, &photo.frame, &Expectation::default());
        let verdict = judge(&photo, &percepts);
        if let Some(folder) = &args.pictures {
            let word = verdict.word();
            let image = overlay::draw(&photo.frame, &percepts, &[], &library);
            save(&image, &folder.join(format!("{word}-{}-{seed:04}.png", kind.name())))?;
        }
        judged.push(Judged { kind, seed, height_px: photo.height_px, level: photo.level, ms, verdict });
        bar.inc(1);
    }
    bar.finish_and_clear();
    tell(&judged, result);
    Ok(())
}

fn save(image: &image::RgbImage, path: &Path) -> anyhow::Result<()> {
    image.save(path).with_context(|| format!("the picture {} cannot be written", path.display()))
}

/// What became of a photograph.
#[derive(Debug, Clone, PartialEq)]
struct Verdict {
    /// Whether what was read is right; none if nothing was read.
    right: Option<bool>,
    /// Whether what was not read says that it may stand upside down, and reads right one of the two ways.
    turned: bool,
    /// The stated confidence of what was read.
    confidence: f64,
    /// Error of a needle, degrees.
    needle_deg: Option<f64>,
    /// A lamp's colour and state are judged apart.
    lamp: Option<(bool, bool)>,
    /// Things that were reported: there is one.
    objects: usize,
    /// What was read, in words.
    said: String,
}

impl Verdict {
    fn word(&self) -> &'static str {
        match self.right {
            Some(true) => "right",
            Some(false) => "wrong",
            None => "unread",
        }
    }
}

#[derive(Debug)]
struct Judged {
    kind: Kind,
    seed: u64,
    height_px: f64,
    level: bool,
    ms: f64,
    verdict: Verdict,
}

/// Compares what was read with what is there. One reading too many is wrong, and so is any where there is nothing.
fn judge(photo: &Photo, percepts: &Percepts) -> Verdict {
    let all: Vec<&Reading> = percepts.objects.iter().flat_map(|object| &object.readings).collect();
    let read: Vec<&&Reading> = all.iter().filter(|reading| told(reading)).collect();
    let either = |reading: &&Reading| match (&photo.shown, &reading.content) {
        (Shown::Text(truth), Content::Text { text, turned: Some(turned), .. }) => truth == text || truth == turned,
        _ => false,
    };
    let mut verdict = Verdict {
        right: None,
        turned: read.is_empty() && all.iter().any(either),
        confidence: read.iter().map(|reading| reading.confidence).fold(0.0, f64::max),
        needle_deg: None,
        lamp: None,
        objects: percepts.objects.len(),
        said: all.iter().map(ToString::to_string).collect::<Vec<_>>().join("; "),
    };
    if let [only] = read[..] {
        verdict.right = Some(match (&photo.shown, &only.content) {
            (Shown::Text(truth), Content::Text { text, .. }) => text == truth,
            (Shown::Lamp(hue, lit), Content::Lamp { hue: seen, lit: bright, .. }) => {
                verdict.lamp = Some((hue == seen, lit == bright));
                hue == seen && lit == bright
            }
            (Shown::Needle(truth), Content::Needle { angle_deg, .. }) => {
                let error = (angle_deg - truth + 180.0).rem_euclid(360.0) - 180.0;
                verdict.needle_deg = Some(error.abs());
                error.abs() < NEEDLE_DEG
            }
            _ => false,
        });
    } else if !read.is_empty() {
        verdict.right = Some(false);
    }
    verdict
}

/// Whether a reading is one, and does not itself say that it may be read the other way round.
fn told(reading: &Reading) -> bool {
    match &reading.content {
        Content::Unreadable { .. } => false,
        Content::Text { turned, .. } => turned.is_none(),
        Content::Lamp { .. } | Content::Needle { .. } => true,
    }
}

fn tell(judged: &[Judged], result: &mut BenchResult) {
    let mut classes: BTreeMap<(Kind, usize), Vec<&Judged>> = BTreeMap::new();
    for one in judged {
        let class = HEIGHTS_PX.iter().filter(|border| one.height_px >= **border).count();
        classes.entry((one.kind, class)).or_default().push(one);
    }
    for kind in Kind::ALL {
        let of_kind: Vec<&Judged> = judged.iter().filter(|one| one.kind == kind).collect();
        result.rows.push(row(kind.name().into(), "reading", &of_kind));
    }
    for ((kind, class), some) in &classes {
        if *kind != Kind::Nothing {
            let low = class.checked_sub(1).and_then(|at| HEIGHTS_PX.get(at)).copied().unwrap_or(0.0);
            let high = HEIGHTS_PX.get(*class).map_or_else(String::new, |high| format!("-{high}"));
            result.rows.push(row(format!("{} {low}{high} px", kind.name()), "by height", some));
        }
    }
    let level: Vec<&Judged> = judged.iter().filter(|one| one.level && one.kind != Kind::Nothing).collect();
    result.rows.push(row("faces that look up".into(), "reading", &level));
    let needles: Vec<f64> = judged.iter().filter_map(|one| one.verdict.needle_deg).collect();
    let (p50, p90) = median_and(0.9, &needles);
    let lamps: Vec<(bool, bool)> = judged.iter().filter_map(|one| one.verdict.lamp).collect();
    let share = |count: usize, of: usize| count as f64 / of.max(1) as f64;
    let values = [
        ("needle_error_p50_deg", p50),
        ("needle_error_p90_deg", p90),
        ("lamp_color_right", share(lamps.iter().filter(|(color, _)| *color).count(), lamps.len())),
        ("lamp_state_right", share(lamps.iter().filter(|(_, lit)| *lit).count(), lamps.len())),
        ("one_object", share(judged.iter().filter(|one| one.verdict.objects == 1).count(), judged.len())),
        ("frame_ms", median_and(0.9, &judged.iter().map(|one| one.ms).collect::<Vec<_>>()).0),
    ];
    result.rows.push(Row { group: Some("reading".into()), ..Row::new("all", values) });
    let read: Vec<(f64, bool)> =
        judged.iter().filter_map(|one| Some((one.verdict.confidence, one.verdict.right?))).collect();
    for (low, high) in [(0.0, 0.7), (0.7, SURE), (SURE, 0.97), (0.97, 1.01)] {
        let some: Vec<&(f64, bool)> = read.iter().filter(|(c, _)| (low..high).contains(c)).collect();
        let values = [
            ("readings", some.len() as f64),
            ("stated", some.iter().map(|(c, _)| c).sum::<f64>() / some.len().max(1) as f64),
            ("right", share(some.iter().filter(|(_, right)| *right).count(), some.len())),
        ];
        let name = format!("stated {low:.2}-{:.2}", high.min(1.0));
        result.rows.push(Row { group: Some("calibration".into()), ..Row::new(name, values) });
    }
    for one in judged.iter().filter(|one| one.verdict.right == Some(false)) {
        let (kind, said) = (one.kind.name(), &one.verdict.said);
        result.notes.push(format!("Wrong: {kind}, seed {}, {:.0} px: {said}.", one.seed, one.height_px));
    }
    if let (Some(first), Some(last)) = (judged.first(), judged.last()) {
        result.seeds = vec![first.seed, last.seed];
    }
}

fn row(name: String, group: &str, some: &[&Judged]) -> Row {
    let count = |wanted: Option<bool>| some.iter().filter(|one| one.verdict.right == wanted).count() as f64;
    let total = some.len().max(1) as f64;
    let sure = some.iter().filter(|one| one.verdict.right == Some(false) && one.verdict.confidence > SURE).count();
    let values = [
        ("count", some.len() as f64),
        ("right", count(Some(true)) / total),
        ("wrong", count(Some(false)) / total),
        ("unread", count(None) / total),
        ("turned", some.iter().filter(|one| one.verdict.turned).count() as f64 / total),
        ("sure_and_wrong", sure as f64 / total),
    ];
    Row { group: Some(group.into()), ..Row::new(name, values) }
}
