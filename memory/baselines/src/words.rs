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
/// What covers stands higher than what is under it by more, metres.
const FLAT_M: f64 = 0.005;
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
        let id = entry.id;
        let seen = in_sight(id);
        let past = object.history.len().saturating_sub(usize::from(seen));
        for told in object.history.iter_mut().take(past) {
            told.place = told.place.map(|place| scene.told(&place, id));
        }
        if !seen
            && entry.presence == Presence::Present
            && let Some(place) = entry.place()
        {
            let motion = scene.told(&place, id).pose * place.pose.inverse();
            entry.parts.iter_mut().for_each(|part| part.pose.pose = motion * part.pose.pose);
        }
    }
    let past = content.transitions.len().saturating_sub(1);
    for transition in content.transitions.iter_mut().take(past) {
        let id = transition.object();
        let told = |place: &Place| scene.told(place, id);
        let report = &mut transition.report;
        report.left_at = None;
        report.invocation.destination = report.invocation.destination.as_ref().map(told);
        report.measured.clear();
        report.primitives.clear();
        report.invocation.obstacles.clear();
        for literal in transition.predicted.iter_mut().chain(&mut transition.before).chain(&mut transition.after) {
            in_words(literal, id, &scene);
        }
    }
}

fn in_words(literal: &mut Literal, id: ObjectId, scene: &Scene<'_>) {
    for term in &mut literal.arguments {
        if let Term::Place(place) = term {
            *place = scene.told(place, id);
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

fn covers(entry: &ObjectEntry) -> bool {
    entry.parts.iter().any(|part| part.affordances.iter().any(|word| word == "covering"))
}

impl Scene<'_> {
    /// A thing's place as its words say it.
    fn told(&self, place: &Place, of: ObjectId) -> Place {
        let said = self.say(place, of);
        self.read(&said).map_or(*place, |pose| Place { pose, ..*place })
    }
    fn top(&self, id: ObjectId) -> Option<(DVec2, f64)> {
        let entry = self.objects.iter().find(|entry| entry.id == id)?;
        let body = Body::of(&entry.parts, self.library)?;
        Some((body.centre, body.top_m))
    }
    /// What stands over a spot now, hiding it.
    fn over(&self, at: DVec3, but: ObjectId) -> Option<ObjectId> {
        let hides = |entry: &&ObjectEntry| {
            let there = entry.id != but && covers(entry) && entry.presence == Presence::Present;
            let body = Body::of(&entry.parts, self.library).filter(|_| there);
            body.is_some_and(|body| body.top_m > at.z + FLAT_M && body.covers(at.truncate(), 0.0))
        };
        self.objects.iter().find(hides).map(|entry| entry.id)
    }
    /// What is in the middle under a cover that stands on a spot.
    fn beneath(&self, at: DVec3, cover: ObjectId) -> Option<ObjectId> {
        let cover = self.objects.iter().find(|entry| entry.id == cover && covers(entry))?;
        let reach = Body::of(&cover.parts, self.library)?.extents()[0] / 4.0;
        let is_near = |entry: &&ObjectEntry| {
            let near = entry.pose().is_some_and(|pose| pose.translation.truncate().distance(at.truncate()) < reach);
            near && entry.id != cover.id && !covers(entry)
        };
        self.objects.iter().find(is_near).map(|entry| entry.id)
    }
    /// `on O5, pointing left`, `under O3, ...`, `over O5, ...`, or `on the table, middle, front, pointing back`.
    fn say(&self, place: &Place, of: ObjectId) -> String {
        let at = place.pose.translation;
        let way = (place.pose.yaw() / FRAC_PI_4).round().rem_euclid(8.0) as usize;
        let way = WAYS.get(way).copied().unwrap_or("right");
        let where_it_is = if let Some(support) = place.support.filter(|id| self.top(*id).is_some()) {
            format!("on {support}")
        } else if let Some(cover) = self.over(at, of) {
            format!("under {cover}")
        } else if let Some(thing) = self.beneath(at, of) {
            format!("over {thing}")
        } else {
            let part = |words: &[&'static str; 5], at: f64| words[((at.round() + 2.0).clamp(0.0, 4.0)) as usize];
            format!("on the table, {}, {}", part(&ACROSS, at.x / CELL_M.x), part(&ALONG, at.y / CELL_M.y))
        };
        format!("{where_it_is}, pointing {way}")
    }
    /// The middle of what the words say; `None` for words that are not ours.
    fn read(&self, words: &str) -> Option<Pose> {
        let (place, way) = words.split_once(", pointing ")?;
        let yaw = WAYS.iter().position(|known| *known == way)? as f64 * FRAC_PI_4;
        let cell = |words: &[&str; 5], said: &str| Some(words.iter().position(|known| *known == said)? as f64 - 2.0);
        let named = |id: &str| self.top(ObjectId(id.parse().ok()?));
        let at = if let Some((across, along)) =
            place.strip_prefix("on the table, ").and_then(|part| part.split_once(", "))
        {
            (DVec2::new(cell(&ACROSS, across)?, cell(&ALONG, along)?) * CELL_M).extend(self.table_m)
        } else if let Some((centre, _)) =
            ["under O", "over O"].iter().find_map(|word| place.strip_prefix(word)).and_then(named)
        {
            centre.extend(self.table_m)
        } else {
            let (centre, top_m) = place.strip_prefix("on O").and_then(named)?;
            centre.extend(top_m)
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
        let (scene, thing) = (Scene { objects: Vec::new(), table_m: 0.74, library: &library }, ObjectId(1));
        assert_eq!(scene.say(&place(-0.13, -0.15, 1.5), thing), "on the table, left, front, pointing back");
        let told = |x, y, yaw| scene.told(&place(x, y, yaw), thing);
        let (one, other) = (told(-0.13, -0.15, 1.5), told(-0.19, -0.09, 1.3));
        assert_eq!(one.pose, other.pose, "what the same words say is the same place");
        assert!(one.pose.translation.distance(DVec3::new(-0.15, -0.12, 0.74)) < 1e-9, "{}", one.pose.translation);
        assert_eq!(scene.told(&one, thing), one, "what was read says itself");
        assert_eq!(scene.read("somewhere, pointing left"), None);
    }
}
