//! What a thing shows, from what was read on it view by view: `shows(thing, 7)` for a number, `shows(thing, green)` for a
//! lamp that is lit, `points(thing, 90)` for a needle, degrees from the dial's top.

use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Term},
    reading::{Content, Reading},
};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What earlier views said counts so much less with each view that is added: what changes is noticed after a few.
const FADING: f64 = 0.8;
/// What is believed to be shown has this weight at least: one sure view of a lamp, two of writing.
const BELIEVED: f64 = 1.2;
/// A lamp is no writing: it cannot be misread for another one, and counts more.
const LAMP: f64 = 1.6;
/// Less is forgotten.
const FORGOTTEN: f64 = 0.05;
/// Readings of less confidence count nothing.
const SURE: f64 = 0.5;
/// Needles are told apart by this, degrees.
const NEEDLE_STEP: f64 = 15.0;

/// The predicates of what is shown.
pub(crate) const PREDICATES: [&str; 2] = ["shows", "points"];

/// One thing that was read, and how often of late.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Shown {
    /// The predicate: `shows` or `points`.
    pub predicate: String,
    /// What is shown.
    pub what: Term,
    /// Sum of the confidences of the views that said so, faded.
    pub weight: f64,
}

/// Adds the readings of one view, taken from `eye` (world, metres).
pub(crate) fn add(shown: &mut Vec<Shown>, readings: &[Reading], eye: DVec3) {
    // A view in which nothing can be read says nothing.
    if readings.iter().all(|reading| matches!(reading.content, Content::Unreadable { .. })) {
        return;
    }
    let said: Vec<Shown> = readings.iter().filter_map(|reading| of(reading, eye)).collect();
    shown.iter_mut().for_each(|known| known.weight *= FADING);
    for one in said {
        match shown.iter_mut().find(|known| known.predicate == one.predicate && known.what == one.what) {
            Some(known) => known.weight += one.weight,
            None => shown.push(one),
        }
    }
    shown.retain(|known| known.weight > FORGOTTEN);
}

/// What is believed to be shown: of each predicate the heaviest.
pub(crate) fn literals(id: ObjectId, shown: &[Shown]) -> Vec<Literal> {
    let mut literals: Vec<Literal> = Vec::new();
    for predicate in PREDICATES {
        let of_it = shown.iter().filter(|known| known.predicate == predicate);
        let best = of_it.max_by(|a, b| a.weight.total_cmp(&b.weight)).filter(|best| best.weight >= BELIEVED);
        literals.extend(best.map(|best| Literal::new(predicate, vec![Term::Object(id), best.what.clone()])));
    }
    literals
}

fn of(reading: &Reading, eye: DVec3) -> Option<Shown> {
    let sure = reading.confidence >= SURE;
    let shown = |predicate: &str, what, weight| Some(Shown { predicate: predicate.into(), what, weight });
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
    use acm_concept::{
        color::Lab,
        reading::{Hue, Upright},
    };

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
        views.iter().for_each(|readings| add(&mut shown, readings, EYE));
        literals(ObjectId(3), &shown).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn a_number_is_believed_after_two_views_and_one_that_is_misread_changes_nothing() {
        let seven = || vec![text("7", None, DVec3::Y)];
        assert!(after(&[seven()]).is_empty());
        assert_eq!(after(&[seven(), seven()]), ["shows(O3, 7)"]);
        assert_eq!(after(&[seven(), seven(), vec![text("1", None, DVec3::Y)]]), ["shows(O3, 7)"]);
        assert_eq!(
            after(&[seven(), seven(), vec![]]),
            ["shows(O3, 7)"],
            "a view in which it cannot be read says nothing new"
        );
        assert!(after(&[vec![text("A", None, DVec3::Y)], vec![text("A", None, DVec3::Y)]]).is_empty());
    }

    #[test]
    fn what_reads_both_ways_is_read_as_it_lies_before_the_viewer() {
        let six = |up| vec![text("6", Some("9"), up)];
        assert_eq!(after(&[six(DVec3::Y), six(DVec3::Y)]), ["shows(O3, 6)"]);
        assert_eq!(after(&[six(DVec3::NEG_Y), six(DVec3::NEG_Y)]), ["shows(O3, 9)"]);
    }

    #[test]
    fn a_lamp_shows_its_colour_while_it_is_lit() {
        assert_eq!(after(&[vec![lamp(Hue::Green, true)]]), ["shows(O3, green)"]);
        assert!(after(&[vec![lamp(Hue::Green, false)]]).is_empty());
        let (red, green) = (|| vec![lamp(Hue::Red, true)], || vec![lamp(Hue::Green, true)]);
        assert_eq!(after(&[red(), green(), green()]), ["shows(O3, green)"]);
        let dark: Vec<Vec<Reading>> =
            std::iter::once(red()).chain((0..6).map(|_| vec![lamp(Hue::Red, false)])).collect();
        assert!(after(&dark).is_empty(), "what is no longer lit is forgotten");
    }
}
