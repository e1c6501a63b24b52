//! The past in words: what a summary in plain sentences can hold of places and deeds.
//!
//! A place is written down as on what a thing stood, or in which part of the table, and which way it pointed; what is read
//! back is the middle of that. No number goes through the text. Only so many sentences are kept: the oldest go first.

use crate::prune::Content;
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Place, Term},
    pose::Pose,
    template::TemplateLibrary,
};
use acm_memory::{
    entry::{ObjectEntry, Presence},
    geometry::Body,
};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_PI_4;

/// Sentences that a summary holds: past places and deeds.
const MAX_SENTENCES: usize = 60;
/// Parts of the table from the world's left to its right, and from the front to the back, each so large, metres.
const ACROSS: [&str; 5] = ["far left", "left", "middle", "right", "far right"];
const ALONG: [&str; 5] = ["far front", "front", "middle", "back", "far back"];
const CELL_M: DVec2 = DVec2::new(0.15, 0.12);
/// Directions from the world's x on, each an eighth of a turn farther round.
const WAYS: [&str; 8] =
    ["right", "back and right", "back", "back and left", "left", "front and left", "front", "front and right"];

/// What words are read against: what is remembered now, and the table's height.
struct Scene<'a> {
    objects: Vec<ObjectEntry>,
    table_m: f64,
    library: &'a TemplateLibrary,
}

/// Replaces every past number by what its words say. What is in sight or in the hand is seen and not remembered, and the
/// deed under way is not yet written down.
pub(crate) fn put(content: &mut Content, in_sight: impl Fn(ObjectId) -> bool, library: &TemplateLibrary) {
    let objects = content.objects.iter().map(|object| object.believed.entry.clone()).collect();
    let table_m = content.rest.as_ref().and_then(|rest| rest.support).map_or(0.0, |plane| plane.offset_m);
    let scene = Scene { objects, table_m, library };
    forget_oldest(content);
    for object in &mut content.objects {
        let entry = &mut object.believed.entry;
        let seen = in_sight(entry.id);
        let past = object.history.len().saturating_sub(usize::from(seen));
        for told in object.history.iter_mut().take(past) {
            told.place = told.place.map(|place| scene.told(&place));
        }
        if !seen
            && entry.presence == Presence::Present
            && let Some(place) = entry.place()
        {
            let motion = scene.told(&place).pose * place.pose.inverse();
            entry.parts.iter_mut().for_each(|part| part.pose.pose = motion * part.pose.pose);
        }
    }
    let past = content.transitions.len().saturating_sub(1);
    for transition in content.transitions.iter_mut().take(past) {
        let told = |place: &Place| scene.told(place);
        let report = &mut transition.report;
        report.left_at = None;
        report.invocation.destination = report.invocation.destination.as_ref().map(told);
        report.measured.clear();
        report.primitives.clear();
        report.invocation.obstacles.clear();
        for literal in transition.predicted.iter_mut().chain(&mut transition.before).chain(&mut transition.after) {
            in_words(literal, &scene);
        }
    }
}

fn in_words(literal: &mut Literal, scene: &Scene<'_>) {
    for term in &mut literal.arguments {
        if let Term::Place(place) = term {
            *place = scene.told(place);
        }
    }
}

/// Keeps the newest sentences: one for each past place and each deed.
fn forget_oldest(content: &mut Content) {
    let places = content.objects.iter().flat_map(|object| object.history.iter().rev().skip(1).map(|past| past.moment));
    let mut moments: Vec<_> = places.chain(content.transitions.iter().map(|transition| transition.moment)).collect();
    moments.sort();
    let Some(first) = moments.len().checked_sub(MAX_SENTENCES).and_then(|from| moments.get(from)).copied() else {
        return;
    };
    for object in &mut content.objects {
        let last = object.history.len().saturating_sub(1);
        let mut at = 0..;
        object.history.retain(|past| past.moment >= first || at.next() == Some(last));
    }
    content.transitions.retain(|transition| transition.moment >= first);
    if let Some(rest) = &mut content.rest {
        rest.from_start = false;
    }
}

impl Scene<'_> {
    /// A place as its words say it.
    fn told(&self, place: &Place) -> Place {
        let said = self.say(place);
        self.read(&said).map_or(*place, |pose| Place { pose, ..*place })
    }
    fn top(&self, id: ObjectId) -> Option<(DVec2, f64)> {
        let entry = self.objects.iter().find(|entry| entry.id == id)?;
        let body = Body::of(&entry.parts, self.library)?;
        Some((body.centre, body.top_m))
    }
    /// `on O5, pointing left`, or `on the table, middle front, pointing back`.
    fn say(&self, place: &Place) -> String {
        let at = place.pose.translation;
        let way = (place.pose.yaw() / FRAC_PI_4).round().rem_euclid(8.0) as usize;
        let way = WAYS.get(way).copied().unwrap_or("right");
        match place.support.filter(|id| self.top(*id).is_some()) {
            Some(support) => format!("on {support}, pointing {way}"),
            None => {
                let part = |words: &[&'static str; 5], at: f64| words[((at.round() + 2.0).clamp(0.0, 4.0)) as usize];
                let (across, along) = (part(&ACROSS, at.x / CELL_M.x), part(&ALONG, at.y / CELL_M.y));
                format!("on the table, {across}, {along}, pointing {way}")
            }
        }
    }
    /// The middle of what the words say; `None` for words that are not ours.
    fn read(&self, words: &str) -> Option<Pose> {
        let (place, way) = words.strip_prefix("on ")?.split_once(", pointing ")?;
        let yaw = WAYS.iter().position(|known| *known == way)? as f64 * FRAC_PI_4;
        let at = match place.strip_prefix("the table, ").and_then(|part| part.split_once(", ")) {
            Some((across, along)) => {
                let cell =
                    |words: &[&str; 5], said: &str| Some(words.iter().position(|known| *known == said)? as f64 - 2.0);
                let cells = DVec2::new(cell(&ACROSS, across)?, cell(&ALONG, along)?);
                (cells * CELL_M).extend(self.table_m)
            }
            None => {
                let (centre, top_m) = self.top(ObjectId(place.strip_prefix('O')?.parse().ok()?))?;
                DVec3::new(centre.x, centre.y, top_m)
            }
        };
        Some(Pose::from_yaw(at, yaw))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;

    fn place(x: f64, y: f64, yaw: f64) -> Place {
        let pose = Pose::from_yaw(DVec3::new(x, y, 0.74), yaw);
        Place { support: None, pose, tolerance_m: 0.03, heading_tolerance_rad: None }
    }

    #[test]
    fn words_say_where_about_and_no_more() {
        let library = acm_memory::default_library().unwrap();
        let scene = Scene { objects: Vec::new(), table_m: 0.74, library: &library };
        assert_eq!(scene.say(&place(-0.13, -0.15, 1.5)), "on the table, left, front, pointing back");
        let (one, other) = (scene.told(&place(-0.13, -0.15, 1.5)), scene.told(&place(-0.19, -0.09, 1.3)));
        assert_eq!(one.pose, other.pose, "what the same words say is the same place");
        assert!(one.pose.translation.distance(DVec3::new(-0.15, -0.12, 0.74)) < 1e-9, "{}", one.pose.translation);
        assert_eq!(scene.told(&one), one, "what was read says itself");
        assert_eq!(scene.read("somewhere"), None);
    }
}
