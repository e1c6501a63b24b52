//! What is believed of a ground literal: yes, no, or unknown, with a probability and what it rests on.

use crate::{
    entry::{ObjectEntry, Presence},
    geometry::{Body, symmetry},
    hand::HandFeeling,
    moves::first_departure,
    scene,
    state::State,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Evidence, Literal, Place, Term, Truth},
    object::Visibility,
    template::TemplateLibrary,
};

/// A probability above this is a yes; below one minus this, a no.
const DECIDED: f64 = 0.8;
/// How far in height an object may be from a place, metres.
const HEIGHT_M: f64 = 0.03;

/// The belief in a ground literal.
pub(crate) fn belief(state: &State, library: &TemplateLibrary, literal: &Literal) -> Belief {
    let mut belief = positive(&Reader { state, library }, literal);
    if literal.negated {
        belief.truth = belief.truth.negate();
    }
    belief
}

fn positive(reader: &Reader<'_>, literal: &Literal) -> Belief {
    let arguments: Vec<&Term> = literal.arguments.iter().collect();
    let first = literal.subject();
    match (literal.predicate.as_str(), first, arguments.as_slice()) {
        ("hand-empty", None, []) => reader.hand_empty(),
        ("holding", Some(object), [_]) => reader.with(object, |entry| reader.holding(entry)),
        ("clear", Some(object), [_]) => reader.with(object, |entry| reader.clear(entry)),
        ("visible", Some(object), [_]) => reader.with(object, |entry| reader.visible(entry)),
        ("moved", Some(object), [_]) => reader.with(object, |entry| reader.moved(entry)),
        ("pressed", Some(_), [_]) => reader.felt(literal),
        ("changed", Some(object), [_]) => reader.with(object, |entry| reader.changed(entry, literal)),
        ("at", Some(object), [_, Term::Place(place)]) => reader.with(object, |entry| reader.at(entry, place)),
        ("on", Some(object), [_, under]) => match object_of(under) {
            Some(under) => reader.with(object, |entry| reader.with(under, |below| reader.on(entry, below))),
            None => Belief::unknown(format!("{literal} does not say on which object")),
        },
        ("next-to", Some(object), [_, other]) => match object_of(other) {
            Some(other) => reader.with(object, |a| reader.with(other, |b| reader.next_to(a, b))),
            None => Belief::unknown(format!("{literal} does not say next to which object")),
        },
        (word, Some(object), [_]) if reader.is_affordance(word) => {
            reader.with(object, |entry| reader.affords(entry, word))
        }
        (_, Some(object), _) => reader.with(object, |entry| reader.state_literal(entry, literal)),
        _ => no_rule(literal),
    }
}

fn no_rule(literal: &Literal) -> Belief {
    let count = literal.arguments.len();
    Belief::unknown(format!("I have no way to tell whether {}/{count} holds", literal.predicate))
}

fn object_of(term: &Term) -> Option<ObjectId> {
    match term {
        Term::Object(id) => Some(*id),
        Term::Part(part) => Some(part.object),
        _ => None,
    }
}

fn say(truth: Truth, confidence: f64, evidence: Vec<Evidence>, reason: String) -> Belief {
    Belief { truth, confidence: confidence.clamp(0.0, 1.0), evidence, reason }
}

fn seen(entry: &ObjectEntry) -> Vec<Evidence> {
    entry.last_frame.map(Evidence::Frame).into_iter().collect()
}

struct Reader<'s> {
    state: &'s State,
    library: &'s TemplateLibrary,
}

impl Reader<'_> {
    fn with(&self, object: ObjectId, then: impl FnOnce(&ObjectEntry) -> Belief) -> Belief {
        match self.state.object(object) {
            Some(entry) => then(entry),
            None => Belief::unknown(format!("I know of no object {object}")),
        }
    }

    /// Why an object's whereabouts cannot be judged now: missing, or left by the robot and not seen since.
    fn unplaced(&self, entry: &ObjectEntry) -> Option<Belief> {
        if entry.presence == Presence::Missing {
            return Some(Belief::unknown(format!("I do not know where {} is", entry.id)));
        }
        let unconfirmed = self.state.tracks.get(&entry.id).and_then(|track| track.unconfirmed)?;
        let reason = format!("I left {} there ({unconfirmed}) but have not seen it since", entry.id);
        Some(Belief { evidence: vec![Evidence::Transition(unconfirmed)], ..Belief::unknown(reason) })
    }

    fn on(&self, upper: &ObjectEntry, lower: &ObjectEntry) -> Belief {
        let confidence = upper.confidence.min(lower.confidence);
        if upper.presence == Presence::Held {
            let reason = format!("{} is in my hand", upper.id);
            return say(Truth::No, 0.95, seen(upper), reason);
        }
        if let Some(unknown) = self.unplaced(upper).or_else(|| self.unplaced(lower)) {
            return unknown;
        }
        let evidence: Vec<Evidence> = seen(upper).into_iter().chain(seen(lower)).collect();
        match upper.support {
            Some(under) if under == lower.id => {
                say(Truth::Yes, confidence, evidence, format!("{} stands on {}", upper.id, lower.id))
            }
            Some(under) => say(Truth::No, confidence, evidence, format!("{} stands on {under}", upper.id)),
            None => say(Truth::No, confidence, evidence, format!("{} stands on no other object", upper.id)),
        }
    }

    fn at(&self, entry: &ObjectEntry, place: &Place) -> Belief {
        if entry.presence == Presence::Held {
            return say(Truth::No, 0.95, seen(entry), format!("{} is in my hand", entry.id));
        }
        if let Some(unknown) = self.unplaced(entry) {
            return unknown;
        }
        let Some(pose) = entry.parts.first().map(|part| &part.pose) else {
            return Belief::unknown(format!("the pose of {} is not known", entry.id));
        };
        let offset = pose.pose.translation - place.pose.translation;
        let distance = offset.truncate().length();
        let sigma = (0.5 * (pose.position_sigma_m.x.powi(2) + pose.position_sigma_m.y.powi(2))).sqrt();
        let level = offset.z.abs() <= HEIGHT_M + pose.position_sigma_m.z;
        let mut within = if level { probability_within(distance, sigma, place.tolerance_m) } else { 0.0 };
        let mut reason = format!(
            "{} is {:.0} mm from there ({:.0} mm allowed, {:.0} mm uncertain){}",
            entry.id,
            distance * 1e3,
            place.tolerance_m * 1e3,
            sigma * 1e3,
            if level { "" } else { ", at another height" }
        );
        if let (Some(allowed), Some(part)) = (place.heading_tolerance_rad, entry.parts.first()) {
            let heading = pose.pose.yaw();
            let wanted = symmetry(part, self.library).nearest(place.pose.yaw(), heading);
            let turn = heading - wanted;
            within *= probability_between(-allowed, allowed, turn, pose.yaw_sigma_rad);
            reason += &format!(", turned by {:.0} deg ({:.0} allowed)", turn.to_degrees(), allowed.to_degrees());
        }
        if within >= DECIDED {
            say(Truth::Yes, within * entry.confidence, seen(entry), reason)
        } else if within <= 1.0 - DECIDED {
            say(Truth::No, (1.0 - within) * entry.confidence, seen(entry), reason)
        } else {
            Belief { evidence: seen(entry), ..Belief::unknown(reason) }
        }
    }

    fn holding(&self, entry: &ObjectEntry) -> Belief {
        let grasped = || entry.history.last().map(crate::moves::evidence).into_iter().collect();
        if entry.presence == Presence::Held {
            let felt = if self.state.hand == HandFeeling::Something { 0.97 } else { 0.85 };
            return say(Truth::Yes, felt, grasped(), format!("{} is in my hand", entry.id));
        }
        let empty = self.hand_empty();
        match (self.state.held(), empty.truth) {
            (Some(other), _) => say(Truth::No, 0.95, seen(entry), format!("my hand holds {}", other.id)),
            (None, Truth::Yes) => say(Truth::No, empty.confidence, empty.evidence, empty.reason),
            (None, _) if entry.presence == Presence::Present => {
                say(Truth::No, entry.confidence, seen(entry), format!("I believe {} to be standing", entry.id))
            }
            (None, _) => Belief::unknown(format!("I do not know whether my hand holds {}", entry.id)),
        }
    }

    fn hand_empty(&self) -> Belief {
        if let Some(held) = self.state.held() {
            let evidence = held.history.last().map(crate::moves::evidence).into_iter().collect();
            return say(Truth::No, 0.95, evidence, format!("my hand holds {}", held.id));
        }
        let evidence = vec![Evidence::Inferred("what my fingers felt last".into())];
        match self.state.hand {
            HandFeeling::Empty => say(Truth::Yes, 0.95, evidence, "my fingers touch nothing".into()),
            HandFeeling::Something => say(Truth::No, 0.85, evidence, "my fingers are pressed by something".into()),
            HandFeeling::Unknown => Belief::unknown("my fingers have not told whether they hold something"),
        }
    }

    fn clear(&self, entry: &ObjectEntry) -> Belief {
        if entry.presence == Presence::Missing {
            return Belief::unknown(format!("I do not know where {} is", entry.id));
        }
        let on_top = |other: &&ObjectEntry| other.presence == Presence::Present && other.support == Some(entry.id);
        let Some(other) = self.state.objects.iter().find(on_top) else {
            return say(Truth::Yes, entry.confidence, seen(entry), format!("nothing stands on {}", entry.id));
        };
        let reason = format!("{} stands on {}", other.id, entry.id);
        if other.verified || other.confidence >= 0.5 {
            say(Truth::No, other.confidence, seen(other), reason)
        } else {
            // One unsure view must not stop the robot; the plan says that it rests on this.
            let reason = format!("{reason}, but that is unverified");
            say(Truth::Yes, entry.confidence * (1.0 - other.confidence), seen(entry), reason)
        }
    }

    fn visible(&self, entry: &ObjectEntry) -> Belief {
        let Some(glance) = &self.state.glance else { return Belief::unknown("I have not looked yet in this run") };
        let evidence = vec![Evidence::Frame(glance.frame)];
        if entry.last_frame == Some(glance.frame) && entry.last_seen.episode == self.state.next.episode {
            return say(Truth::Yes, entry.confidence, evidence, format!("{} is in the last frame", entry.id));
        }
        let view = glance.visibility.iter().find(|(id, _)| *id == entry.id).map(|(_, visibility)| *visibility);
        let no = |why: &str| say(Truth::No, 0.9, evidence.clone(), format!("{} {why}", entry.id));
        match view {
            Some(Visibility::Occluded) => no("is hidden behind something"),
            Some(Visibility::OutOfView) => no("is outside the camera's view"),
            Some(Visibility::SeenThrough) => no("is not where it was"),
            Some(Visibility::Seen) => {
                say(Truth::Yes, 0.6, evidence, format!("the pixels where {} should be agree with it", entry.id))
            }
            Some(Visibility::NotMeasured) | None => {
                Belief::unknown(format!("the last frame does not say whether {} can be seen", entry.id))
            }
        }
    }

    fn moved(&self, entry: &ObjectEntry) -> Belief {
        let episode = self.state.next.episode;
        if let Some(departure) = first_departure(entry, episode) {
            let evidence = vec![crate::moves::evidence(departure.from), crate::moves::evidence(departure.by)];
            return say(Truth::Yes, 0.95, evidence, format!("{} left its first place", entry.id));
        }
        let watched = self.state.from_start && entry.last_seen.episode == episode;
        if watched && entry.presence == Presence::Present {
            return say(Truth::No, 0.9, seen(entry), format!("{} is where I first saw it in this run", entry.id));
        }
        Belief::unknown(format!("I have not watched {} since this run began", entry.id))
    }

    fn next_to(&self, a: &ObjectEntry, b: &ObjectEntry) -> Belief {
        for entry in [a, b] {
            if entry.presence == Presence::Held {
                return say(Truth::No, 0.9, seen(entry), format!("{} is in my hand", entry.id));
            }
            if let Some(unknown) = self.unplaced(entry) {
                return unknown;
            }
        }
        let (Some(shape), Some(other)) = (Body::of(&a.parts, self.library), Body::of(&b.parts, self.library)) else {
            return Belief::unknown(format!("the shapes of {} and {} are not known", a.id, b.id));
        };
        let near = scene::next_to(&shape, &other);
        let reason = format!("the gap between {} and {} is {:.0} mm", a.id, b.id, shape.gap(&other) * 1e3);
        let evidence = seen(a).into_iter().chain(seen(b)).collect();
        say(if near { Truth::Yes } else { Truth::No }, a.confidence.min(b.confidence), evidence, reason)
    }

    /// What can only be felt while it is done: the latest transition within the present subtask decides.
    fn felt(&self, literal: &Literal) -> Belief {
        let asked = Literal { negated: false, ..literal.clone() };
        let (progress, episode) = (&self.state.progress, self.state.next.episode);
        let since = progress.current_since();
        let serves = |subtask: Option<u32>| subtask.is_none_or(|index| index == progress.current());
        let tried = self.state.transitions.iter().rev().find(|transition| {
            let felt = transition.report.felt.iter().map(|(literal, _)| literal);
            let about = transition
                .predicted
                .iter()
                .chain(felt)
                .any(|l| l.predicate == asked.predicate && l.arguments == asked.arguments);
            transition.moment.episode == episode && transition.moment > since && serves(transition.subtask) && about
        });
        let Some(transition) = tried else {
            if progress.instructed.episode != episode {
                return Belief::unknown("I remember no instruction of this run, so not what was done for it either");
            }
            let reason = format!("I have done nothing in this subtask that would make {asked}");
            return say(Truth::No, 0.9, Vec::new(), reason);
        };
        let evidence = vec![Evidence::Transition(transition.id)];
        let said = transition.report.felt.iter().rev();
        let mut said = said.filter(|(l, _)| l.predicate == asked.predicate && l.arguments == asked.arguments);
        match said.next() {
            Some((felt, confidence)) => {
                let truth = if felt.negated { Truth::No } else { Truth::Yes };
                say(truth, *confidence, evidence, format!("felt during {}", transition.id))
            }
            None => {
                say(Truth::No, 0.7, evidence, format!("{} should have done it, but it was not felt", transition.id))
            }
        }
    }

    fn is_affordance(&self, word: &str) -> bool {
        self.library.iter().any(|template| template.affordances().any(|affordance| affordance == word))
    }

    fn affords(&self, entry: &ObjectEntry, word: &str) -> Belief {
        let has = entry.parts.iter().any(|part| part.affordances.iter().any(|affordance| affordance == word));
        let reason = format!("a part of {} is {}{word}", entry.id, if has { "" } else { "not " });
        say(if has { Truth::Yes } else { Truth::No }, entry.confidence, seen(entry), reason)
    }

    /// Whether a thing shows something else than at first: as it was read since the last own action, which may have
    /// changed it.
    fn changed(&self, entry: &ObjectEntry, literal: &Literal) -> Belief {
        let shown = self.state.tracks.get(&entry.id).map(|track| track.shown.as_slice()).unwrap_or_default();
        let read = shown.iter().map(|known| known.last).max();
        let acted = self.state.transitions.last().map(|transition| transition.moment);
        match read {
            None => Belief::unknown(format!("I have read nothing on {} in this episode", entry.id)),
            Some(read) if acted.is_some_and(|acted| acted > read) => {
                Belief::unknown(format!("I have not read {} since I last acted", entry.id))
            }
            Some(_) => self.state_literal(entry, literal),
        }
    }

    fn state_literal(&self, entry: &ObjectEntry, literal: &Literal) -> Belief {
        let same = |known: &&Literal| known.predicate == literal.predicate && known.arguments == literal.arguments;
        match entry.state.iter().find(same) {
            Some(known) => {
                let truth = if known.negated { Truth::No } else { Truth::Yes };
                say(truth, entry.confidence, seen(entry), format!("remembered of {}", entry.id))
            }
            None => self.brought_about(literal).unwrap_or_else(|| no_rule(literal)),
        }
    }

    /// What an own action of this episode was found to have brought about or undone stays so until another one is; what
    /// an action should have done since, and nobody could tell, is unknown.
    fn brought_about(&self, literal: &Literal) -> Option<Belief> {
        let same = |known: &&Literal| known.predicate == literal.predicate && known.arguments == literal.arguments;
        let own = self.state.transitions.iter().rev().filter(|t| t.moment.episode == self.state.next.episode);
        own.into_iter().find_map(|transition| {
            let evidence = vec![Evidence::Transition(transition.id)];
            if let Some(found) = transition.after.iter().find(same) {
                let truth = if found.negated { Truth::No } else { Truth::Yes };
                return Some(say(truth, 0.9, evidence, format!("{found} was found after {}", transition.id)));
            }
            let felt = transition.report.felt.iter().rev().find(|(felt, _)| same(&felt));
            if let Some((felt, confidence)) = felt {
                let truth = if felt.negated { Truth::No } else { Truth::Yes };
                return Some(say(truth, *confidence, evidence, format!("{felt} was felt in {}", transition.id)));
            }
            transition.predicted.iter().find(same).map(|predicted| {
                let reason = format!("{} should have brought about {predicted}, and I could not tell", transition.id);
                Belief { evidence, ..Belief::unknown(reason) }
            })
        })
    }
}

/// Probability that a point spread by a round Gaussian about `distance` lies within `radius` of the origin.
fn probability_within(distance: f64, sigma: f64, radius: f64) -> f64 {
    const STRIPS: u32 = 48;
    let sigma = sigma.max(1e-5);
    let width = 2.0 * radius / f64::from(STRIPS);
    let strip = |index: u32| {
        // Strips across the line to the point: along it the density, across it the share within the disc.
        let x = -radius + (f64::from(index) + 0.5) * width;
        let half = (radius * radius - x * x).max(0.0).sqrt();
        let within = |a: f64, b: f64| {
            0.5 * (erf(b / (sigma * std::f64::consts::SQRT_2)) - erf(a / (sigma * std::f64::consts::SQRT_2)))
        };
        within(x - 0.5 * width - distance, x + 0.5 * width - distance) * within(-half, half)
    };
    (0..STRIPS).map(strip).sum::<f64>().clamp(0.0, 1.0)
}

/// Probability that a number spread by a Gaussian about `mean` lies between two bounds.
fn probability_between(low: f64, high: f64, mean: f64, sigma: f64) -> f64 {
    let scale = sigma.max(1e-5) * std::f64::consts::SQRT_2;
    (0.5 * (erf((high - mean) / scale) - erf((low - mean) / scale))).clamp(0.0, 1.0)
}

/// The error function (Abramowitz and Stegun 7.1.26), absolute error below 1.5e-7.
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.3275911 * x.abs());
    let polynomial = t * (0.254829592 + t * (-0.284496736 + t * (1.421413741 + t * (-1.453152027 + t * 1.061405429))));
    (1.0 - polynomial * (-x * x).exp()).copysign(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_disc_probability_agrees_with_its_closed_form() {
        // Centred: 1 - exp(-r^2 / 2 s^2).
        for (sigma, radius) in [(0.01f64, 0.03f64), (0.03, 0.03), (0.02, 0.01)] {
            let exact = 1.0 - (-(radius / sigma).powi(2) / 2.0).exp();
            assert!((probability_within(0.0, sigma, radius) - exact).abs() < 2e-3, "{sigma} {radius}");
        }
        assert!(probability_within(0.1, 0.01, 0.03) < 1e-6);
        assert!((probability_within(0.03, 1e-4, 0.03) - 0.5).abs() < 0.02);
    }
}
