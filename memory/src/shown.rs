//! What a thing shows, from what was read on it view by view: `shows(thing, 7)` for a number, `shows(thing, green)` for a
//! lamp that is lit, `points(thing, 90)` for a needle, degrees from the dial's top; and whether that is other than what it
//! showed when it was first read in the episode: `changed(thing)`. A thing that takes another colour where it stands, as a
//! lamp does, shows that colour.

use crate::entry::Moment;
use acm_concept::{
    color::{Appearance, Lab},
    ids::ObjectId,
    literal::{Literal, Term},
    reading::{Content, Hue, Reading},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What earlier views said counts so much less with each view that is added. What is written seldom changes and is often
/// misread; a needle's change is noticed after two views, a lamp's after one.
const FADING_TEXT: f64 = 0.8;
const FADING_NEEDLE: f64 = 0.5;
const FADING_LAMP: f64 = 0.4;
/// What is believed to be shown has this weight at least: one sure view of a lamp, two of writing.
const BELIEVED: f64 = 1.2;
/// A lamp is no writing: it cannot be misread for another one, and counts more.
const LAMP: f64 = 1.6;
/// Less is forgotten.
const FORGOTTEN: f64 = 0.05;
/// Readings of less confidence count nothing.
const SURE: f64 = 0.5;
/// Needles are told apart by this, and have moved from twice that on, degrees.
const NEEDLE_STEP: f64 = 15.0;

/// A thing has another colour than at first from this distance of hue and chroma on (CIELAB), which shade and another side do
/// not reach, and shows it if it is that colourful. What is part bright and part dark, as a
/// lamp on its foot, has one colour; a mixture of bright ones has none.
const OTHER_COLOR: f64 = 30.0;
const COLORFUL: f64 = 22.0;
const ONE_COLOR: f64 = 45.0;
/// Share of a new view in the colour that a thing has now.
const NOW: f64 = 0.7;

/// The predicates of what is shown.
const PREDICATES: [&str; 2] = ["shows", "points"];
/// The predicate of what shows something else than at first.
const CHANGED: &str = "changed";

/// Whether a literal tells what a thing shows.
pub(crate) fn tells(literal: &Literal) -> bool {
    literal.predicate == CHANGED || PREDICATES.contains(&literal.predicate.as_str())
}

/// One thing that was read, and how often of late.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// The predicate: `shows` or `points`.
    pub predicate: String,
    /// What is shown.
    pub what: Term,
    /// Sum of the confidences of the views that said so, faded.
    pub weight: f64,
    /// Whether it is what the thing showed when something was first believed of it in this episode.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub first: bool,
    /// When it was last read.
    #[serde(default)]
    pub last: Moment,
}

/// The colour that a thing had in the first views of an episode, and has now.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Colored {
    first: Lab,
    now: Lab,
}

impl Colored {
    /// After one more view that shows the thing whole.
    pub(crate) fn after(known: Option<Colored>, seen: &Appearance) -> Option<Colored> {
        let mix = |a: f64, b: f64| a + NOW * (b - a);
        match known {
            _ if seen.spread > ONE_COLOR => known,
            None => Some(Colored { first: seen.mean, now: seen.mean }),
            Some(Colored { first, now }) => {
                let now = Lab { l: mix(now.l, seen.mean.l), a: mix(now.a, seen.mean.a), b: mix(now.b, seen.mean.b) };
                Some(Colored { first, now })
            }
        }
    }
    /// The colour that it has taken; `None` while it is as at first, or grey.
    fn taken(&self) -> Option<Hue> {
        let other = self.first.chroma_distance(&self.now) > OTHER_COLOR && self.now.chroma() > COLORFUL;
        other.then(|| Hue::of(&self.now))
    }
}

/// Adds the readings of one view, taken from `eye` (world, metres).
pub(crate) fn add(shown: &mut Vec<Shown>, readings: &[Reading], eye: DVec3, moment: Moment) {
    // A view in which nothing can be read says nothing.
    if readings.iter().all(|reading| matches!(reading.content, Content::Unreadable { .. })) {
        return;
    }
    let said: Vec<Shown> = readings.iter().filter_map(|reading| of(reading, eye, moment)).collect();
    shown.iter_mut().for_each(|known| known.weight *= fading(known));
    for one in said {
        match shown.iter_mut().find(|known| is_same(known, &one)) {
            Some(known) => (known.weight, known.last) = (known.weight + one.weight, moment),
            None => shown.push(one),
        }
    }
    for predicate in PREDICATES {
        let any_first = shown.iter().any(|known| known.predicate == predicate && known.first);
        if let Some(best) = believed(shown, predicate).filter(|_| !any_first) {
            shown[best].first = true;
        }
    }
    shown.retain(|known| known.weight > FORGOTTEN || known.first);
}

fn fading(known: &Shown) -> f64 {
    match (known.predicate.as_str(), &known.what) {
        ("points", _) => FADING_NEEDLE,
        (_, Term::Symbol(_)) => FADING_LAMP,
        _ => FADING_TEXT,
    }
}

/// Which of what was read is believed of a predicate: the heaviest.
fn believed(shown: &[Shown], predicate: &str) -> Option<usize> {
    let of_it = shown.iter().enumerate().filter(|(_, known)| known.predicate == predicate);
    let best = of_it.max_by(|a, b| a.1.weight.total_cmp(&b.1.weight));
    best.filter(|(_, best)| best.weight >= BELIEVED).map(|(index, _)| index)
}

/// What is believed to be shown, and whether that is other than at first.
pub(crate) fn literals(id: ObjectId, shown: &[Shown], colored: Option<&Colored>) -> Vec<Literal> {
    let mut literals: Vec<Literal> = Vec::new();
    let mut other: Option<bool> = None;
    for predicate in PREDICATES {
        let Some(best) = believed(shown, predicate).and_then(|index| shown.get(index)) else { continue };
        literals.push(Literal::new(predicate, vec![Term::Object(id), best.what.clone()]));
        if let Some(first) = shown.iter().find(|known| known.predicate == predicate && known.first) {
            other = Some(other.unwrap_or(false) || differ(predicate, &first.what, &best.what));
        }
    }
    if let Some(hue) = colored.and_then(Colored::taken) {
        let shows = Literal::new("shows", vec![Term::Object(id), Term::Symbol(hue.name().into())]);
        literals.extend(Some(shows).filter(|shows| !literals.contains(shows)));
        other = Some(true);
    }
    let changed = Literal::new(CHANGED, vec![Term::Object(id)]);
    literals.extend(other.map(|other| if other { changed } else { changed.negate() }));
    literals
}

/// Whether two readings are one: those of a needle may differ by a step.
fn is_same(known: &Shown, one: &Shown) -> bool {
    known.predicate == one.predicate
        && match (known.predicate.as_str(), &known.what, &one.what) {
            ("points", Term::Number(a), Term::Number(b)) => apart_deg(*a, *b) < 1.5 * NEEDLE_STEP,
            (_, a, b) => a == b,
        }
}

/// Whether two readings are too unlike to be one.
fn differ(predicate: &str, a: &Term, b: &Term) -> bool {
    match (predicate, a, b) {
        ("points", Term::Number(a), Term::Number(b)) => apart_deg(*a, *b) > 2.0 * NEEDLE_STEP - 1.0,
        _ => a != b,
    }
}

fn apart_deg(a: f64, b: f64) -> f64 {
    let apart = (a - b).rem_euclid(360.0);
    apart.min(360.0 - apart)
}

fn of(reading: &Reading, eye: DVec3, moment: Moment) -> Option<Shown> {
    let sure = reading.confidence >= SURE;
    let shown = |predicate: &str, what, weight| {
        Some(Shown { predicate: predicate.into(), what, weight, first: false, last: moment })
    };
    match &reading.content {
        Content::Text { text, upright, turned } => {
            // What reads as well the other way up is taken as who looks at it sees it.
            let away = (reading.position - eye).dot(upright.up) >= 0.0;
            let text = turned.as_ref().filter(|_| upright.assumed && !away).unwrap_or(text);
            let number = text.parse::<f64>().ok().filter(|number| number.is_finite())?;
            (sure || turned.is_some()).then(|| shown("shows", Term::Number(number), reading.confidence.max(SURE)))?
        }
        Content::Lamp { hue, lit: true, .. } if sure => {
            shown("shows", Term::Symbol(hue.name().into()), LAMP * reading.confidence)
        }
        Content::Needle { angle_deg, .. } if sure => {
            let step = (angle_deg / NEEDLE_STEP).round() * NEEDLE_STEP;
            shown("points", Term::Number(step.rem_euclid(360.0)), reading.confidence)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::reading::Upright;

    const EYE: DVec3 = DVec3::new(0.0, -0.5, 1.0);

    fn text(text: &str, turned: Option<&str>, up: DVec3) -> Reading {
        let upright = Upright { up, assumed: true };
        let content = Content::Text { text: text.into(), upright, turned: turned.map(Into::into) };
        Reading { content, confidence: 0.9, bounds: [0, 0, 9, 9], height_px: 20.0, position: DVec3::ZERO }
    }

    fn lamp(hue: Hue, lit: bool) -> Reading {
        let content = Content::Lamp { color: Lab::from_srgb([30, 200, 40]), hue, lit };
        Reading { content, ..text("", None, DVec3::Y) }
    }

    fn after(views: &[Vec<Reading>]) -> Vec<String> {
        let mut shown = Vec::new();
        views.iter().for_each(|readings| add(&mut shown, readings, EYE, Moment::default()));
        literals(ObjectId(3), &shown, None).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_number_is_believed_after_two_views_and_one_that_is_misread_changes_nothing() {
        let seven = || vec![text("7", None, DVec3::Y)];
        assert!(after(&[seven()]).is_empty());
        assert_eq!(after(&[seven(), seven()]), ["shows(O3, 7)", "not changed(O3)"]);
        assert_eq!(after(&[seven(), seven(), vec![text("1", None, DVec3::Y)]]), ["shows(O3, 7)", "not changed(O3)"]);
        assert_eq!(
            after(&[seven(), seven(), vec![]]),
            ["shows(O3, 7)", "not changed(O3)"],
            "a view in which it cannot be read says nothing new"
        );
        assert!(after(&[vec![text("A", None, DVec3::Y)], vec![text("A", None, DVec3::Y)]]).is_empty());
    }

    #[test]
    fn what_reads_both_ways_is_read_as_it_lies_before_the_viewer() {
        let six = |up| vec![text("6", Some("9"), up)];
        assert_eq!(after(&[six(DVec3::Y), six(DVec3::Y)]), ["shows(O3, 6)", "not changed(O3)"]);
        assert_eq!(after(&[six(DVec3::NEG_Y), six(DVec3::NEG_Y)]), ["shows(O3, 9)", "not changed(O3)"]);
    }

    #[test]
    fn a_lamp_shows_its_colour_while_it_is_lit() {
        assert_eq!(after(&[vec![lamp(Hue::Green, true)]]), ["shows(O3, green)", "not changed(O3)"]);
        assert!(after(&[vec![lamp(Hue::Green, false)]]).is_empty());
        let (red, green) = (|| vec![lamp(Hue::Red, true)], || vec![lamp(Hue::Green, true)]);
        assert_eq!(after(&[red(), red(), red(), green()]), ["shows(O3, green)", "changed(O3)"]);
        let dark: Vec<Vec<Reading>> =
            std::iter::once(red()).chain((0..6).map(|_| vec![lamp(Hue::Red, false)])).collect();
        assert!(after(&dark).is_empty(), "what is no longer lit is forgotten");
    }

    #[test]
    fn what_takes_another_colour_shows_it_and_what_comes_into_the_shade_does_not() {
        let seen = |rgb: [u8; 3]| Appearance::plain(Lab::from_srgb(rgb), 8.0);
        let after = |views: &[[u8; 3]]| {
            let colored = views.iter().fold(None, |known, rgb| Colored::after(known, &seen(*rgb)));
            let literals = literals(ObjectId(3), &[], colored.as_ref());
            literals.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let (dark, red, green) = ([75, 78, 74], [230, 45, 30], [50, 200, 80]);
        assert!(after(&[dark, dark]).is_empty());
        assert_eq!(after(&[dark, red]), ["shows(O3, red)", "changed(O3)"]);
        assert_eq!(after(&[dark, red, red, red, green]), ["shows(O3, green)", "changed(O3)"]);
        assert!(after(&[dark, red, dark, dark, dark]).is_empty(), "it went out");
        assert!(after(&[[200, 40, 40], [120, 22, 22]]).is_empty(), "shade");
    }

    #[test]
    fn a_needle_has_moved_when_two_views_say_so_and_is_back_where_it_was() {
        let needle = |angle_deg| {
            let upright = Upright { up: DVec3::Y, assumed: true };
            let content = Content::Needle { angle_deg, upright };
            vec![Reading { content, ..text("", None, DVec3::Y) }]
        };
        let (still, moved) = (|| needle(272.0), || needle(3.0));
        assert_eq!(after(&[still(), still(), needle(260.0)]), ["points(O3, 270)", "not changed(O3)"]);
        assert!(after(&[still(), still(), still(), moved()]).is_empty(), "one view leaves it open");
        let after_both = after(&[still(), still(), still(), moved(), moved()]);
        assert_eq!(after_both, ["points(O3, 0)", "changed(O3)"]);
        let back = [still(), still(), moved(), moved(), still(), still(), still()];
        assert_eq!(after(&back), ["points(O3, 270)", "not changed(O3)"]);
    }
}
