//! Takes a grounded frame: identities, then what each percept, and each absence, changes.

use crate::{
    constellation,
    draft::{Draft, Stage, Staged},
    entry::{HistoryEntry, Moment, ObjectEntry, PlaceCause, Presence},
    event::{Anchor, Change, Glance, Pending, Track},
    fusion,
    geometry::{self, Body},
    hand::HandFeeling,
    identity::{self, IdentityRule, MAX_PERCEPTS, Match, Percept, doubt::Doubt, predict},
    observation::{Displaced, Grounding, Observation, Resolved},
    scene, shown,
    state::MAX_OBJECTS,
};
use acm_concept::{
    color::Appearance,
    ids::ObjectId,
    literal::Evidence,
    object::{ExpectedView, GroundedPart, SupportPlane, Visibility},
    pose::Pose,
};
use glam::DVec3;

/// Percepts below this confidence that fit nothing remembered are held to be false alarms.
const FALSE_ALARM: f64 = 0.15;
/// Percepts below this confidence change nothing that is believed.
const LOW_CONFIDENCE: f64 = 0.3;
/// Squared Mahalanobis distance within which an object is still in its place (three degrees of freedom, 0.1 %).
const PLACE_GATE: f64 = 16.0;
/// A thing that is found within this distance of its place has not moved, metres.
pub(crate) const MOVED_M: f64 = 0.02;
/// How far a thing that is moved by hand goes from one view to the next, metres.
const STRIDE_M: f64 = 0.06;
/// A share of the predicted pixels that were looked through that is strong evidence of absence.
const STRONG_ABSENCE: f64 = 0.5;
/// A share that is enough on its own.
const CERTAIN_ABSENCE: f64 = 0.8;
/// Lower things are flat: they are seen by their colour, metres.
const FLAT_M: f64 = 0.005;
/// Colours nearer than this in the a-b plane are the same.
const SAME_COLOR: f64 = 15.0;
/// A newcomer that lies inside something is a piece of it unless it is larger by more than this factor says.
const FRAGMENT_AREA: f64 = 0.7;
/// A scrap has less than this share of the area of what it belongs to, and touches it within so much, metres.
const SCRAP_AREA: f64 = 0.5;
const SCRAP_GAP_M: f64 = 0.01;
/// What shares more than this of its place with something larger is part of that; less is enough if they are of one colour.
const TAKEN_IN: f64 = 0.75;
const TAKEN_IN_ALIKE: f64 = 0.4;
/// Matches above this probability may verify an object.
const SURE_MATCH: f64 = 0.6;

/// Takes a frame into the draft.
pub(crate) fn observe(draft: &mut Draft<'_>, observation: &Observation<'_>, rule: IdentityRule) -> Grounding {
    let percepts = observation.percepts;
    draft.at(percepts.frame.time);
    let evidence = [Evidence::Frame(percepts.frame.id)];
    let read = |(index, object)| Percept::read(index, object, draft.library);
    let mut readable: Vec<Percept<'_>> =
        percepts.objects.iter().take(MAX_PERCEPTS).enumerate().filter_map(read).collect();
    let eye = percepts.frame.camera_pose.translation;
    let displaced = match (percepts.blindness, rule) {
        (None, IdentityRule::Global) => constellation::displaced(&draft.state, &readable, eye, draft.library),
        // The paper's rule takes each percept on its own.
        _ => None,
    };
    // What a frame from elsewhere says of where things should be, it says of other places: nobody looked at theirs.
    let unseen = |view: &ExpectedView| ExpectedView { visibility: Visibility::OutOfView, ..view.clone() };
    let elsewhere: Vec<ExpectedView> = displaced.iter().flat_map(|_| percepts.expected.iter().map(unseen)).collect();
    let views = if displaced.is_some() { &elsewhere } else { &percepts.expected };
    let shows = percepts.blindness.is_none() && displaced.is_none_or(|displaced| displaced.undone);
    draft.emit(evidence.to_vec(), Change::Frame(glance(observation, views, shows, displaced)));
    let mut stage = Stage::default();
    follow_hand(draft, &mut stage);
    let mut grounding = Grounding { displaced, ..Grounding::default() };
    if shows {
        match displaced {
            Some(displaced) => readable = constellation::undo(&displaced, readable, draft.library),
            None => {
                if let Some(plane) = percepts.support.filter(|plane| differs(plane, draft.state.support.as_ref())) {
                    draft.emit(evidence.to_vec(), Change::Support(plane));
                }
            }
        }
        let matches = identity::resolve(rule, &draft.state, &readable, views, draft.library);
        let mut frame = Frame { draft, stage, views, percepts: &readable, eye, grounding };
        frame.take_matches(&matches, PlaceCause::Seen(percepts.frame.id));
        frame.take_absences(PlaceCause::Gone(percepts.frame.id));
        (stage, grounding) = (frame.stage, frame.grounding);
        scene::settle_supports(&mut stage, &draft.state, draft.library, PlaceCause::Seen(percepts.frame.id));
    }
    draft.emit_stage(stage, &evidence);
    grounding
}

fn glance(observation: &Observation<'_>, views: &[ExpectedView], showed: bool, displaced: Option<Displaced>) -> Glance {
    let percepts = observation.percepts;
    let tcp = observation.feedback.tcp;
    Glance {
        frame: percepts.frame.id,
        showed,
        // Numbers that are not finite have no place in the log.
        tcp: if tcp.is_valid() { tcp } else { Pose::IDENTITY },
        hand: HandFeeling::from_feedback(observation.feedback),
        visibility: views.iter().map(|view| (view.object, view.visibility)).collect(),
        displaced,
    }
}

/// What is held moves with the hand, and is held no longer when the fingers feel nothing.
fn follow_hand(draft: &Draft<'_>, stage: &mut Stage) {
    let state = &draft.state;
    let Some(held) = state.held() else { return };
    let (parts, _) = predict::predicted_parts(state, held, &state.track(held.id));
    let Some(staged) = stage.touch(state, held.id) else { return };
    staged.entry.parts = parts;
    if state.hand == HandFeeling::Empty {
        lose_grip(staged);
    }
}

/// The object is no longer in the hand and nobody knows where it is.
pub(crate) fn lose_grip(staged: &mut Staged) {
    staged.entry.presence = Presence::Missing;
    staged.entry.support = None;
    staged.track.grip = None;
}

fn differs(plane: &SupportPlane, known: Option<&SupportPlane>) -> bool {
    let color = &plane.appearance;
    let numbers = [plane.offset_m, plane.residual_m, color.mean.l, color.mean.a, color.mean.b, color.spread];
    let sane = plane.normal.is_normalized() && numbers.iter().all(|number| number.is_finite());
    sane && known.is_none_or(|known| {
        (known.offset_m - plane.offset_m).abs() > 0.001 || known.normal.angle_between(plane.normal) > 0.003
    })
}

/// One frame on its way into memory.
struct Frame<'f, 'a, 'p> {
    draft: &'f mut Draft<'a>,
    stage: Stage,
    views: &'f [ExpectedView],
    percepts: &'f [Percept<'p>],
    /// Where it was taken from, world, metres.
    eye: DVec3,
    grounding: Grounding,
}

impl Frame<'_, '_, '_> {
    fn take_matches(&mut self, matches: &[Match], cause: PlaceCause) {
        let percepts = self.percepts;
        for found in matches {
            let Some(percept) = percepts.get(found.percept) else { continue };
            let resolved = match found.object {
                Some(id) => self.take_known(id, percept, (found, matches), cause),
                None => self.take_new(percept, found, matches, cause),
            };
            self.grounding.resolved.extend(resolved);
        }
    }

    fn take_known(
        &mut self,
        id: ObjectId,
        percept: &Percept<'_>,
        (found, matches): (&Match, &[Match]),
        cause: PlaceCause,
    ) -> Option<Resolved> {
        let (moment, eye) = (self.draft.moment(), self.eye);
        let inside_another = self.is_fragment(percept, matches);
        let seen_through = self.views.iter().any(|v| v.object == id && v.visibility == Visibility::SeenThrough);
        let confused = self.confused_with(id);
        let library = self.draft.library;
        let doubt = self.doubt(id, percept, found);
        let corrected = self.grounding.displaced.is_some();
        let staged = self.stage.touch(&self.draft.state, id)?;
        let earlier_run = staged.entry.last_seen.episode < moment.episode;
        let low = percept.object.confidence < LOW_CONFIDENCE;
        let verdict = if low { View::Rejected } else { judge(staged, percept, seen_through || earlier_run, library) };
        // A known thing does not come to stand inside another one: that is a piece of the other.
        let verdict = if inside_another && matches!(verdict, View::Moved(_)) { View::Rejected } else { verdict };
        let accepted = !matches!(verdict, View::Rejected | View::Pending(_));
        let own = staged.track.unconfirmed.is_some() || staged.track.disturbed;
        match verdict {
            View::Rejected => {}
            View::Pending(pending) => staged.track.pending = Some(pending),
            View::InHand => remember_view(staged, percept, moment, eye),
            // A frame that had to be put right tells that a thing is still there, and nothing finer.
            View::InPlace(_) if corrected && staged.entry.presence == Presence::Present => {
                staged.entry.last_seen = moment;
            }
            View::InPlace(parts) => {
                let back = staged.entry.presence == Presence::Missing;
                staged.entry.verified = !back && (staged.entry.verified || found.probability >= SURE_MATCH);
                settle_place(staged, parts, back.then_some(cause));
                remember_view(staged, percept, moment, eye);
            }
            View::Moved(parts) => {
                // An own action and a view of its outcome are two witnesses; one view alone is not.
                staged.entry.verified = own && found.probability >= SURE_MATCH;
                settle_place(staged, parts, Some(cause));
                remember_view(staged, percept, moment, eye);
                if !own {
                    self.grounding.moved.push(id);
                }
            }
        }
        if accepted {
            staged.entry.last_frame = Some(frame_of(cause)?);
            if !found.alternatives.is_empty() {
                staged.entry.ambiguous_with.clone_from(&found.alternatives);
                staged.track.doubt = doubt;
            } else if let Some(doubt) = &mut staged.track.doubt {
                doubt.see(percept, library);
                staged.entry.ambiguous_with = doubt.alternatives(library);
            } else if staged.placed.is_some() {
                staged.entry.ambiguous_with = confused;
            }
        }
        let probability = found.probability;
        Some(Resolved { percept: percept.index, object: id, new: false, probability, accepted })
    }

    /// The doubt that an assignment leaves on a whole view: how those that it may be looked before is kept.
    fn doubt(&self, id: ObjectId, percept: &Percept<'_>, found: &Match) -> Option<Box<Doubt>> {
        if found.alternatives.is_empty() || percept.object.truncated {
            return None;
        }
        let own = std::iter::once((id, found.probability));
        let candidates: Vec<(&ObjectEntry, f64)> = own
            .chain(found.alternatives.iter().copied())
            .filter_map(|(id, probability)| Some((self.draft.state.object(id)?, probability)))
            .collect();
        Doubt::new(percept, &candidates, self.draft.library).map(Box::new)
    }

    /// Present objects that may in truth be this one: their doubt is this one's too.
    fn confused_with(&self, id: ObjectId) -> Vec<(ObjectId, f64)> {
        let doubt = |entry: &&ObjectEntry| {
            entry.ambiguous_with.iter().find(|(other, _)| *other == id).map(|(_, probability)| (entry.id, *probability))
        };
        self.stage.entries(&self.draft.state).iter().filter(|entry| entry.id != id).filter_map(doubt).collect()
    }

    fn take_new(
        &mut self,
        percept: &Percept<'_>,
        found: &Match,
        matches: &[Match],
        cause: PlaceCause,
    ) -> Option<Resolved> {
        let object = percept.object;
        let full = self.draft.state.objects.len() + self.stage.added() >= MAX_OBJECTS;
        let piece = self.is_piece_of_known(percept, found, matches)
            || self.is_fragment(percept, matches)
            || self.is_part_of_shown(None, &percept.parts, &object.appearance)
            || self.is_scrap(percept);
        if object.confidence < FALSE_ALARM || full || piece {
            return None;
        }
        let id = ObjectId(self.draft.state.next.object + self.stage.added() as u64);
        let own_category = || vec![(object.category.clone(), object.confidence)];
        let entry = ObjectEntry {
            id,
            category: object.category.clone(),
            categories: if object.categories.is_empty() { own_category() } else { object.categories.clone() },
            parts: percept.parts.clone(),
            appearance: object.appearance,
            presence: Presence::Present,
            support: None,
            state: Vec::new(),
            confidence: object.confidence,
            verified: false,
            last_seen: self.draft.moment(),
            last_frame: Some(frame_of(cause)?),
            views: 1,
            ambiguous_with: found.alternatives.clone(),
            history: Vec::new(),
        };
        self.stage.add(entry, cause);
        let probability = found.probability;
        Some(Resolved { percept: percept.index, object: id, new: true, probability, accepted: true })
    }

    /// Whether a newcomer that something cuts off may as well be a piece of what this frame shows beside it: a thing
    /// half hidden is seen in pieces, and only one of them can be given its identity.
    fn is_piece_of_known(&self, percept: &Percept<'_>, found: &Match, matches: &[Match]) -> bool {
        let beside = |other: &&Match| {
            let known = self.percepts.get(other.percept);
            let of = other.object.and_then(|id| self.stage.entry(&self.draft.state, id));
            known.zip(of).is_some_and(|(known, entry)| {
                let reach = Body::of(&entry.parts, self.draft.library).map_or(0.0, |body| body.extents()[0]);
                known.body.centre.distance(percept.body.centre) < reach
            })
        };
        let may_be = |other: &&Match| other.object.is_some_and(|id| found.possible.contains(&id));
        percept.object.truncated && matches.iter().filter(may_be).any(|other| beside(&other))
    }

    /// Whether a newcomer that something cuts off is a small piece of the same colour at the side of something larger
    /// that this frame shows.
    fn is_scrap(&self, percept: &Percept<'_>) -> bool {
        let beside = |other: &Percept<'_>| {
            let color = other.object.appearance.mean.chroma_distance(&percept.object.appearance.mean);
            other.index != percept.index
                && percept.body.area() < SCRAP_AREA * other.body.area()
                && percept.body.gap(&other.body) < SCRAP_GAP_M
                && color < SAME_COLOR
        };
        percept.object.truncated && percept.body.height() > FLAT_M && self.percepts.iter().any(beside)
    }

    /// Whether a newcomer lies inside something that this frame shows as well: two solids cannot share a place, so
    /// it is a piece of that. Flat things share theirs with all that stands on them; there the colour decides.
    fn is_fragment(&self, percept: &Percept<'_>, matches: &[Match]) -> bool {
        let body = &percept.body;
        let shown = |found: &&Match| self.percepts.get(found.percept).is_some_and(|p| p.index != percept.index);
        let whole = matches.iter().filter(shown).filter_map(|found| found.object);
        whole.filter_map(|id| self.stage.entry(&self.draft.state, id)).any(|entry| {
            let Some(other) = Body::of(&entry.parts, self.draft.library) else { return false };
            let shared = body.top_m.min(other.top_m) - body.base_m.max(other.base_m);
            let same_solid = if other.height() < FLAT_M {
                let color = entry.appearance.mean.chroma_distance(&percept.object.appearance.mean);
                body.height() < FLAT_M && color < SAME_COLOR && shared > -scene::REST_TOLERANCE_M
            } else {
                // Flat things under a block sink into it by the camera's error.
                body.height() > FLAT_M && shared > 0.5 * body.height()
            };
            same_solid && other.area() > FRAGMENT_AREA * body.area() && other.covers(body.centre, 0.0)
        })
    }

    fn take_absences(&mut self, cause: PlaceCause) {
        for view in self.views {
            let matched = self.grounding.resolved.iter().any(|found| found.object == view.object && found.accepted);
            let Some(entry) = self.stage.entry(&self.draft.state, view.object) else { continue };
            if matched || entry.presence != Presence::Present {
                continue;
            }
            let absences = self.draft.state.track(view.object).absences;
            let taken_in = view.visibility == Visibility::Seen && self.is_taken_in(entry);
            match view.visibility {
                _ if taken_in => {}
                Visibility::Seen if absences == 0 => continue,
                Visibility::Seen | Visibility::SeenThrough => {}
                Visibility::Occluded | Visibility::OutOfView | Visibility::NotMeasured => continue,
            }
            let Some(staged) = self.stage.touch(&self.draft.state, view.object) else { continue };
            if view.visibility == Visibility::Seen && !taken_in {
                staged.track.absences = 0;
                continue;
            }
            let fraction = if taken_in { STRONG_ABSENCE } else { view.fraction.clamp(0.0, 1.0) };
            staged.track.absences += u32::from(fraction >= STRONG_ABSENCE);
            staged.entry.confidence *= 1.0 - 0.5 * fraction;
            // What is flat is told from what it lies on by its colour alone, and light changes: one view does not decide.
            let flat = Body::of(&staged.entry.parts, self.draft.library).is_some_and(|body| body.height() < FLAT_M);
            if staged.track.absences >= 2 || fraction > CERTAIN_ABSENCE && !flat {
                staged.entry.presence = Presence::Missing;
                staged.entry.support = None;
                staged.left = Some(cause);
                staged.placed = None;
                self.grounding.missing.push(view.object);
            }
        }
    }

    /// Whether what was taken for a thing, and never moved by the robot, is part of something larger that this frame shows.
    fn is_taken_in(&self, entry: &ObjectEntry) -> bool {
        let own = |known: &HistoryEntry| matches!(known.cause, PlaceCause::Own(_) | PlaceCause::Grasped(_));
        !entry.history.iter().any(own) && self.is_part_of_shown(Some(entry.id), &entry.parts, &entry.appearance)
    }

    /// Whether some parts are part of something larger that this frame shows: two solids cannot share a place.
    fn is_part_of_shown(&self, own: Option<ObjectId>, parts: &[GroundedPart], color: &Appearance) -> bool {
        let library = self.draft.library;
        let Some(body) = Body::of(parts, library).filter(|body| body.height() > FLAT_M) else { return false };
        let shown = self.grounding.resolved.iter().filter(|found| found.accepted && Some(found.object) != own);
        shown.filter_map(|found| self.stage.entry(&self.draft.state, found.object)).any(|other| {
            let larger = Body::of(&other.parts, library).is_some_and(|b| FRAGMENT_AREA * b.area() > body.area());
            let alike = other.appearance.mean.distance(&color.mean) < SAME_COLOR;
            let least = if alike { TAKEN_IN_ALIKE } else { TAKEN_IN };
            larger && geometry::shared(parts, &other.parts, library) > least
        })
    }
}

/// What a view of a known object is worth.
enum View {
    /// Nothing: it is too unsure.
    Rejected,
    /// It contradicts what is believed and has to be repeated.
    Pending(Pending),
    /// It shows the object in the hand.
    InHand,
    /// It shows the object in its place; the parts with the view fused in.
    InPlace(Vec<GroundedPart>),
    /// It shows the object elsewhere; the parts as they are there.
    Moved(Vec<GroundedPart>),
}

fn judge(
    staged: &Staged,
    percept: &Percept<'_>,
    may_have_moved: bool,
    library: &acm_concept::template::TemplateLibrary,
) -> View {
    let (entry, track) = (&staged.entry, &staged.track);
    let in_place = is_in_place(entry, percept, library) && !has_crept(staged, percept);
    if entry.presence == Presence::Held && in_place {
        return View::InHand;
    }
    let fused = fusion::fuse_parts(&entry.parts, &percept.parts, percept.object.truncated, library);
    let explained =
        may_have_moved || entry.presence == Presence::Missing || track.disturbed || track.unconfirmed.is_some();
    match fused {
        Some(parts) if in_place => View::InPlace(parts),
        Some(parts) if explained && percept.is_reliable() => View::Moved(relocated(parts, &percept.parts)),
        fused => {
            let agreed = track.pending.as_ref().filter(|pending| agrees(&pending.parts, percept, library));
            let views = agreed.map_or(0, |pending| pending.views) + 1;
            let needed = if entry.verified { 3 } else { 2 };
            if views < needed || !percept.is_reliable() || percept.object.truncated {
                return View::Pending(Pending { parts: percept.parts.clone(), views });
            }
            let parts = fused.map_or_else(|| percept.parts.clone(), |parts| relocated(parts, &percept.parts));
            if in_place { View::InPlace(parts) } else { View::Moved(parts) }
        }
    }
}

/// Whether a view shows the object where it is believed to be, within the noise of both.
fn is_in_place(entry: &ObjectEntry, percept: &Percept<'_>, library: &acm_concept::template::TemplateLibrary) -> bool {
    let Some(known) = entry.parts.first().map(|part| &part.pose) else { return false };
    let offset = percept.pose.pose.translation - known.pose.translation;
    let slack = Body::of(&entry.parts, library).map_or(0.0, |body| {
        let (seen, known) = (percept.body.extents(), body.extents());
        0.5 * (known[0] - seen[0]).max(known[1] - seen[1]).max(0.0)
    });
    let held = if entry.presence == Presence::Held { predict::HAND_SIGMA_M } else { 0.0 };
    let square = |v: DVec3| v * v;
    let variance = square(percept.pose.position_sigma_m)
        + square(known.position_sigma_m)
        + square(predict::VIEW_SIGMA_M)
        + DVec3::splat(held * held)
        + DVec3::new(slack * slack, slack * slack, 0.0);
    let near = offset.truncate().length() <= MOVED_M && offset.z.abs() <= MOVED_M;
    near || (offset * offset / variance).element_sum() <= PLACE_GATE
}

/// Whether a whole view shows the object away from the spot at which it came to stand, although each step on the way
/// was within the noise.
fn has_crept(staged: &Staged, percept: &Percept<'_>) -> bool {
    let anchor = staged.track.anchor.filter(Anchor::is_settled);
    let off = |anchor: Anchor| (percept.pose.pose.translation - anchor.position).truncate().length() > MOVED_M;
    staged.entry.presence == Presence::Present && !percept.object.truncated && anchor.is_some_and(off)
}

/// Whether two views in a row tell of the same departure: the second shows the object where the first did, or a
/// little farther on its way.
fn agrees(pending: &[GroundedPart], percept: &Percept<'_>, library: &acm_concept::template::TemplateLibrary) -> bool {
    let near = pending.first().is_some_and(|part| {
        let offset = part.pose.pose.translation - percept.pose.pose.translation;
        let sigma = part.pose.position_sigma_m + percept.pose.position_sigma_m + predict::VIEW_SIGMA_M;
        offset.length() <= STRIDE_M || (offset * offset / (sigma * sigma)).element_sum() <= PLACE_GATE
    });
    near && fusion::fuse_parts(pending, &percept.parts, percept.object.truncated, library).is_some()
}

/// Parts with what was learned of their shape, at the poses of a view.
fn relocated(mut parts: Vec<GroundedPart>, seen: &[GroundedPart]) -> Vec<GroundedPart> {
    for (part, seen) in parts.iter_mut().zip(seen) {
        part.pose = seen.pose;
    }
    parts
}

fn settle_place(staged: &mut Staged, parts: Vec<GroundedPart>, cause: Option<PlaceCause>) {
    let position = parts.first().map(|part| part.pose.pose.translation);
    let anchor = if cause.is_none() { staged.track.anchor } else { None };
    staged.entry.parts = parts;
    staged.entry.presence = Presence::Present;
    staged.placed = cause;
    let doubt = staged.track.doubt.take();
    let anchor = position.map(|position| Anchor::seen_at(anchor, position));
    staged.track = Track { anchor, doubt, ..staged.track.moved() };
}

/// What every accepted view adds, wherever it shows the object.
fn remember_view(staged: &mut Staged, percept: &Percept<'_>, moment: Moment, eye: DVec3) {
    let (object, entry) = (percept.object, &mut staged.entry);
    shown::add(&mut staged.track.shown, &object.readings, eye, moment);
    let whole = !object.truncated && entry.presence != Presence::Held;
    if whole {
        staged.track.colored = shown::Colored::after(staged.track.colored, &object.appearance);
    }
    if whole || !object.readings.is_empty() {
        entry.state.retain(|literal| !shown::tells(literal));
        entry.state.extend(shown::literals(entry.id, &staged.track.shown, staged.track.colored.as_ref()));
    }
    if whole {
        entry.appearance = fusion::fuse_appearance(&entry.appearance, &object.appearance, entry.views);
        entry.categories = fusion::fuse_categories(&entry.categories, &object.categories, entry.views);
        if let Some((best, _)) = entry.categories.first() {
            entry.category.clone_from(best);
        }
    }
    entry.confidence = (1.0 - (1.0 - entry.confidence) * (1.0 - 0.5 * object.confidence)).min(0.999);
    entry.views = entry.views.saturating_add(1);
    entry.last_seen = moment;
}

fn frame_of(cause: PlaceCause) -> Option<acm_concept::ids::FrameId> {
    match cause {
        PlaceCause::Seen(frame) | PlaceCause::Gone(frame) => Some(frame),
        PlaceCause::Own(_) | PlaceCause::Grasped(_) => None,
    }
}
