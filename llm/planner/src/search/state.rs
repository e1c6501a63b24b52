//! What would be so after some steps: memory's beliefs with the steps' effects laid over them.

use crate::ground::{
    PLACE_TOLERANCE_M, carrying_centre,
    geometry::{Extent, symmetry},
    has_effect, surface_under,
};
use acm_concept::{
    ids::ObjectId,
    literal::{Belief, Evidence, Literal, Place, Term, Truth},
    pose::Pose,
    template::YawSymmetry,
};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence, Transition, TransitionResult},
};
use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// Overlap of heights and outlines that is taken for noise, metres.
const TOUCH_M: f64 = 0.003;
/// Distances that are kept round things put aside, metres: room for the fingers, or less where there is none.
const CLEARANCES_M: [f64; 2] = [0.055, 0.03];
/// Where a thing could not be put, it is not put so near either, metres.
const SAME_SPOT_M: f64 = 0.03;
/// How far beyond the outermost things a free spot is looked for, metres: farther where there is none nearer, since
/// nothing is known of the table's edge and of the arm's reach there.
const MARGINS_M: [f64; 3] = [0.05, 0.12, 0.2];
/// Rings on which free spots are looked for: first radius, step, and number, metres.
const RINGS_M: (f64, f64, u32) = (0.08, 0.03, 14);
/// Spots on a ring.
const RING_SPOTS: u32 = 16;

/// Where a moved object is in an imagined state.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Whereabouts {
    Held,
    Standing(Place),
}

/// Memory's beliefs with effects laid over them.
#[derive(Clone)]
pub(super) struct State<'v> {
    view: &'v dyn MemoryView,
    moved: BTreeMap<ObjectId, Whereabouts>,
    facts: Vec<Literal>,
}

impl<'v> State<'v> {
    pub fn now(view: &'v dyn MemoryView) -> State<'v> {
        State { view, moved: BTreeMap::new(), facts: Vec::new() }
    }

    /// What is believed of a literal in this state.
    pub fn belief(&self, literal: &Literal) -> Belief {
        let positive = Literal { negated: false, ..literal.clone() };
        let mut belief = self.imagined(&positive).unwrap_or_else(|| {
            let remembered = self.view.belief(&positive);
            let unknown = remembered.truth == Truth::Unknown;
            if unknown { super::derived::concluded(self, &positive).unwrap_or(remembered) } else { remembered }
        });
        if literal.negated {
            belief.truth = belief.truth.negate();
        }
        belief
    }

    /// What the effects laid over say of a positive literal, if they touch it.
    fn imagined(&self, literal: &Literal) -> Option<Belief> {
        if let Some(fact) = self.facts.iter().rev().find(|fact| same_atom(fact, literal)) {
            return Some(inferred(!fact.negated, "by an earlier step"));
        }
        if self.moved.is_empty() {
            return None;
        }
        if let Some(belief) = super::derived::concluded(self, literal) {
            return Some(belief);
        }
        let subject = literal.subject();
        match literal.predicate.as_str() {
            "clear" => Some(inferred(self.carried_by(subject?).is_empty(), "by what stands on it then")),
            "at" => match (self.moved.get(&subject?)?, literal.arguments.get(1)?) {
                (Whereabouts::Standing(place), Term::Place(wanted)) => {
                    let apart = flat(&place.pose).distance(flat(&wanted.pose));
                    let turned = wanted.heading_tolerance_rad.is_some_and(|allowed| {
                        let entry = subject.and_then(|id| self.view.object(id));
                        let symmetry = entry.map_or(YawSymmetry::Fold(1), |entry| symmetry(self.view, entry));
                        symmetry.difference(place.pose.yaw(), wanted.pose.yaw()) > allowed
                    });
                    Some(inferred(apart <= wanted.tolerance_m && !turned, "by where it stands then"))
                }
                _ => Some(inferred(false, "it is in the hand then")),
            },
            _ => None,
        }
    }

    /// The state after a step's declared effects.
    pub fn after(&self, effects: &[Literal]) -> State<'v> {
        let mut next = self.clone();
        for effect in effects {
            next.facts.retain(|fact| !same_atom(fact, effect));
            // Places and what is clear follow from `moved`.
            if !matches!(effect.predicate.as_str(), "at" | "clear") {
                next.facts.push(effect.clone());
            }
            let Some(subject) = effect.subject() else { continue };
            match (effect.predicate.as_str(), effect.negated, effect.arguments.get(1)) {
                ("holding", false, _) => {
                    next.moved.insert(subject, Whereabouts::Held);
                }
                ("at", false, Some(Term::Place(place))) => {
                    next.moved.insert(subject, Whereabouts::Standing(*place));
                }
                _ => {}
            }
        }
        next
    }

    /// Where an object stands in this state; `None` while held or missing.
    fn standing(&self, entry: &ObjectEntry) -> Option<Pose> {
        match self.moved.get(&entry.id) {
            Some(Whereabouts::Standing(place)) => Some(place.pose),
            Some(Whereabouts::Held) => None,
            None => entry.pose().filter(|_| entry.presence == Presence::Present),
        }
    }

    /// What is in the hand in this state.
    pub fn held(&self) -> Option<ObjectId> {
        let imagined = self.moved.iter().find(|(_, at)| **at == Whereabouts::Held).map(|(id, _)| *id);
        let remembered = || self.view.held().map(|entry| entry.id).filter(|id| !self.moved.contains_key(id));
        imagined.or_else(remembered)
    }

    /// What stands on an object in this state.
    pub fn carried_by(&self, under: ObjectId) -> Vec<ObjectId> {
        let carrier = self.view.object(under).and_then(|entry| Extent::at(self.view, entry, &self.standing(entry)?));
        let on_it = |entry: &&ObjectEntry| {
            if entry.id == under {
                return false;
            }
            match self.moved.get(&entry.id) {
                Some(Whereabouts::Held) => false,
                Some(Whereabouts::Standing(place)) if place.support.is_some() => place.support == Some(under),
                Some(Whereabouts::Standing(place)) => carrier.as_ref().is_some_and(|carrier| {
                    carrier.covers(flat(&place.pose)) && place.pose.translation.z > carrier.high - TOUCH_M
                }),
                None => entry.presence == Presence::Present && entry.support == Some(under),
            }
        };
        self.view.objects().iter().filter(on_it).map(|entry| entry.id).collect()
    }

    /// Memory as it is.
    pub fn view(&self) -> &'v dyn MemoryView {
        self.view
    }

    /// What an object takes up in this state; `None` while it is held or missing.
    pub fn extent(&self, object: ObjectId) -> Option<Extent> {
        let entry = self.view.object(object)?;
        Extent::at(self.view, entry, &self.standing(entry)?)
    }

    /// Where an object stands in this state and what carries it.
    pub fn place(&self, object: ObjectId) -> Option<(Pose, Option<ObjectId>)> {
        let entry = self.view.object(object)?;
        let support = match self.moved.get(&object) {
            Some(Whereabouts::Standing(place)) => place.support,
            _ => entry.support,
        };
        Some((self.standing(entry)?, support))
    }

    /// Covers that stand over an object.
    pub fn covering(&self, object: ObjectId) -> Vec<ObjectId> {
        let covers = self.view.objects().iter().filter(|entry| entry.id != object && super::derived::is_cover(entry));
        let stands_over = |entry: &&ObjectEntry| self.stands_over(entry.id, object);
        covers.filter(stands_over).map(|entry| entry.id).collect()
    }

    fn stands_over(&self, cover: ObjectId, object: ObjectId) -> bool {
        let (Some(over), Some((pose, _))) = (self.extent(cover), self.place(object)) else { return false };
        over.covers(flat(&pose)) && pose.translation.z > over.low - TOUCH_M && pose.translation.z < over.high
    }

    /// Things that stand where `object` shall stand, other than what carries the place.
    pub fn in_the_way(&self, place: &Place, object: ObjectId) -> Vec<ObjectId> {
        let Some(wanted) = self.view.object(object).and_then(|e| Extent::at(self.view, e, &place.pose)) else {
            return Vec::new();
        };
        let covers = self.view.object(object).is_some_and(super::derived::is_cover);
        let hinders = |entry: &&ObjectEntry| {
            if entry.id == object || place.support == Some(entry.id) {
                return false;
            }
            let extent = self.standing(entry).and_then(|pose| Extent::at(self.view, entry, &pose));
            // A cover goes round what stands where it shall stand; what is put inside goes between walls.
            let goes_round = |outer: &Extent, inner: &Extent| {
                outer.radius() > inner.radius() && outer.high - outer.low > inner.high - inner.low
            };
            let fits = extent.as_ref().is_some_and(|extent| covers && goes_round(&wanted, extent));
            if fits {
                return false;
            }
            extent.is_some_and(|extent| extent.gap(&wanted) < -TOUCH_M && extent.shared_height(&wanted) > TOUCH_M)
        };
        self.view.objects().iter().filter(hinders).map(|entry| entry.id).collect()
    }

    /// A free spot on the bare support near where `object` is, clear of everything and of the places in `reserved`;
    /// if there is none, one that may lie on flat things.
    pub fn free_spot(&self, object: ObjectId, reserved: &[(ObjectId, Place)]) -> Option<Place> {
        let entry = self.view.object(object)?;
        let standing: Vec<(&ObjectEntry, Pose)> = self
            .view
            .objects()
            .iter()
            .filter(|other| other.id != object)
            .filter_map(|other| Some((other, self.standing(other)?)))
            .collect();
        let spots: Vec<DVec2> = standing.iter().map(|(_, pose)| flat(pose)).collect();
        let middle = spots.iter().sum::<DVec2>() / spots.len().max(1) as f64;
        let start = self.standing(entry).map_or(middle, |pose| flat(&pose));
        let known = || spots.iter().copied().chain(reserved.iter().map(|(_, place)| flat(&place.pose)));
        let (low, high) = (known().fold(start, DVec2::min), known().fold(start, DVec2::max));
        let taken = |keep_off_flat: bool| -> Vec<Extent> {
            let things = standing
                .iter()
                .filter(|(other, _)| keep_off_flat || has_effect(self.view, other, "holding") || !carries(other));
            let extents = things.filter_map(|(other, pose)| Extent::at(self.view, other, pose));
            let reserved =
                reserved.iter().filter_map(|(id, place)| Extent::at(self.view, self.view.object(*id)?, &place.pose));
            extents.chain(reserved).collect()
        };
        let yaw = entry.pose().map_or(0.0, |pose| pose.yaw());
        let failed: Vec<DVec2> = self.failed_places(object);
        let tried = [true, false].into_iter().flat_map(|keep| MARGINS_M.map(|margin| (keep, margin)));
        let tried = tried.flat_map(|(keep, margin)| CLEARANCES_M.map(|clearance_m| (keep, margin, clearance_m)));
        for (keep_off_flat, margin, clearance_m) in tried {
            let taken = taken(keep_off_flat);
            for spot in ring_spots(start) {
                let inside = spot.cmpge(low - margin).all() && spot.cmple(high + margin).all();
                let place = self.place_at(spot, object, yaw);
                let extent = place.and_then(|place| Extent::at(self.view, entry, &place.pose));
                let free = |extent: &Extent| taken.iter().all(|other| other.gap(extent) > clearance_m);
                let is_new = failed.iter().all(|failed| failed.distance(spot) > SAME_SPOT_M);
                if inside && is_new && extent.as_ref().is_some_and(free) {
                    return place;
                }
            }
        }
        None
    }

    /// Where the object was to be put, and could not be.
    fn failed_places(&self, object: ObjectId) -> Vec<DVec2> {
        let now = self.view.object(object).map(|entry| entry.last_seen.episode);
        let failed = |t: &&Transition| {
            Some(t.moment.episode) == now && t.object() == object && matches!(t.result, TransitionResult::Failed { .. })
        };
        let place = |t: &Transition| t.report.invocation.destination.map(|place| flat(&place.pose));
        self.view.transitions().iter().filter(failed).filter_map(place).collect()
    }

    /// The place for an object on or in a thing that carries nothing and shall carry nothing else.
    pub fn spot_on(&self, carrier: ObjectId, object: ObjectId, reserved: &[(ObjectId, Place)]) -> Option<Place> {
        let (under, moved) = (self.view.object(carrier)?, self.view.object(object)?);
        let outline = Extent::at(self.view, under, &self.standing(under)?)?;
        let wanted =
            |(_, place): &(ObjectId, Place)| place.support == Some(carrier) || outline.covers(flat(&place.pose));
        if carrier == object || !self.carried_by(carrier).is_empty() || reserved.iter().any(wanted) {
            return None;
        }
        let pose = carrying_centre(self.view, under)?;
        Some(Place {
            support: Some(carrier),
            pose: Pose::from_yaw(pose.translation, moved.pose().map_or(pose.yaw(), |pose| pose.yaw())),
            tolerance_m: PLACE_TOLERANCE_M,
            heading_tolerance_rad: None,
        })
    }

    fn place_at(&self, spot: DVec2, object: ObjectId, yaw: f64) -> Option<Place> {
        let (support, height) = surface_under(self.view, spot, object);
        let pose = Pose::from_yaw(DVec3::new(spot.x, spot.y, height?), yaw);
        Some(Place { support, pose, tolerance_m: PLACE_TOLERANCE_M, heading_tolerance_rad: None })
    }
}

fn carries(entry: &ObjectEntry) -> bool {
    entry.parts.iter().any(|part| part.affordances.iter().any(|affordance| affordance == "supportive"))
}

fn ring_spots(start: DVec2) -> impl Iterator<Item = DVec2> {
    let (first, step, rings) = RINGS_M;
    (0..rings).flat_map(move |ring| {
        (0..RING_SPOTS).map(move |spot| {
            let angle = f64::from(spot) * std::f64::consts::TAU / f64::from(RING_SPOTS);
            start + DVec2::from_angle(angle) * (first + step * f64::from(ring))
        })
    })
}

fn flat(pose: &Pose) -> DVec2 {
    pose.translation.truncate()
}

fn inferred(holds: bool, how: &str) -> Belief {
    Belief {
        truth: if holds { Truth::Yes } else { Truth::No },
        confidence: 1.0,
        evidence: vec![Evidence::Inferred(how.into())],
        reason: how.into(),
    }
}

/// Whether two literals speak of the same, whatever their signs. Places are the same within a micrometre.
pub(crate) fn same_atom(a: &Literal, b: &Literal) -> bool {
    let same_term = |a: &Term, b: &Term| match (a, b) {
        (Term::Place(a), Term::Place(b)) => a.pose.translation.distance(b.pose.translation) < 1e-6,
        (Term::Object(id), Term::Part(part)) | (Term::Part(part), Term::Object(id)) => part.object == *id,
        (a, b) => a == b,
    };
    a.predicate == b.predicate
        && a.arguments.len() == b.arguments.len()
        && a.arguments.iter().zip(&b.arguments).all(|(a, b)| same_term(a, b))
}
