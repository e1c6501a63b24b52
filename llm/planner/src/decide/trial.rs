//! Finding by trying: every way in which it may be is a hypothesis, each try rules one out.
//!
//! The hypotheses are the same whenever they are asked for, and which of them were tried is read from own transitions
//! and the things' histories, so a plan that is interrupted goes on where it was and nothing is tried twice.

use super::{Grounded, MAX_LOOKS, Mind, goals::Next};
use crate::{
    decision::GiveUpCause,
    ground::{HEADING_TOLERANCE_RAD, PLACE_TOLERANCE_M, Stuck, missing, place_at, slots},
    search::Want,
    task::{Condition, Destination, Goal, Ordering, ReferenceIndex, Variation},
};
use acm_concept::{
    ids::ObjectId,
    literal::{Literal, Place, Term, Truth},
    pose::Pose,
};
use acm_memory::entry::{Moment, ObjectEntry, Presence};
use std::f64::consts::{FRAC_PI_2, PI};

/// More ways than this are not tried.
const MAX_HYPOTHESES: usize = 128;

/// Where each member stands, in the order of the members.
type Arrangement = Vec<Place>;

impl Mind<'_> {
    pub(super) fn find(
        &self,
        group: ReferenceIndex,
        vary: Variation,
        within: Option<&Destination>,
        probe: Option<&Goal>,
        sign: Option<&Condition>,
    ) -> Result<Next, Stuck> {
        let members = self.ground.members(group, &Ordering::Any)?;
        let gone = |member: &&ObjectId| self.view.object(**member).is_none_or(|e| e.presence == Presence::Missing);
        if let Some(member) = members.iter().find(gone) {
            return Err(missing(*member, self.ground.phrase(group)));
        }
        // What is shown before anything was tried says nothing of a try.
        let sign = sign.filter(|_| probe.is_none_or(|probe| self.was_done(probe)));
        let seen = match self.sign(sign)? {
            Sign::Shows(reason) => return Ok(Next::Reached(reason)),
            Sign::Look(reason) => return Ok(Next::Look(reason)),
            Sign::Absent => true,
            Sign::Invisible => false,
        };
        if vary == Variation::Choice {
            return self.find_member(group, &members, probe, seen);
        }
        let ways = self.arrangements(vary, &members, within)?;
        let tried = self.tried(&members, &ways, probe)?;
        let standing = self.standing(&members, None);
        let moves = |way: &Arrangement| way.iter().zip(&standing).filter(|(to, at)| !is_at(to, at.as_ref())).count();
        let open = ways.iter().enumerate().filter(|(index, _)| !tried.contains(index));
        let Some((_, way)) = open.min_by_key(|(index, way)| (moves(way), *index)) else {
            return self.all_tried(ways.len(), seen);
        };
        self.note(format!("{} of {} ways are tried", tried.len(), ways.len()));
        if moves(way) == 0
            && let Some(probe) = probe
        {
            return Ok(self.scaled(self.reach(probe, self.last_change(&members))?, ways.len()));
        }
        let literals = members.iter().zip(way).map(|(member, place)| {
            let at = Literal::new("at", vec![Term::Object(*member), Term::Place(*place)]);
            let belief = self.view.belief(&at);
            (at, belief)
        });
        let literals: Vec<_> = literals.collect();
        let wants = literals.iter().map(|(literal, _)| Want::Holds(literal.clone())).collect();
        let times = (ways.len() * members.len()) as u32;
        Ok(Next::Pursue(Box::new(Grounded { wants, literals, times, guessed: false })))
    }

    /// Whether something was done to try in this subtask.
    fn was_done(&self, probe: &Goal) -> bool {
        match probe {
            Goal::Performed { function, .. } => self.successes(self.since()).any(|t| t.skill() == function),
            _ => true,
        }
    }

    fn sign(&self, sign: Option<&Condition>) -> Result<Sign, Stuck> {
        let Some(sign) = sign else { return Ok(Sign::Invisible) };
        let (literal, belief) = self.condition(sign)?;
        self.weigh(&(literal.clone(), belief.clone()));
        Ok(match belief.truth {
            Truth::Yes => Sign::Shows(format!("{literal}: {}", belief.reason)),
            Truth::No => Sign::Absent,
            Truth::Unknown if self.situation.looks < MAX_LOOKS => {
                Sign::Look(format!("I cannot tell whether {literal}: {}", belief.reason))
            }
            Truth::Unknown => {
                self.note(format!("I cannot see whether {literal}: I go on until all is tried"));
                Sign::Invisible
            }
        })
    }

    /// "Open one after the other until ...": the probe is the goal for each member.
    fn find_member(
        &self,
        group: ReferenceIndex,
        members: &[ObjectId],
        probe: Option<&Goal>,
        seen: bool,
    ) -> Result<Next, Stuck> {
        let Some(probe) = probe else {
            let text = "the instruction does not say what shall be tried with each".to_owned();
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        };
        for (member, number) in members.iter().zip(1..) {
            let turn = || -> Result<Option<Next>, Stuck> {
                let next = self.reach(probe, self.since())?;
                let done = match (&next, probe) {
                    (Next::Reached(_), _) => true,
                    (_, Goal::State { predicate, holds, .. }) => {
                        let literal = Literal::new(predicate, vec![Term::Object(*member)]);
                        let literal = if *holds { literal } else { literal.negate() };
                        self.brought_about(&literal, self.since()).is_some()
                    }
                    _ => false,
                };
                Ok((!done).then_some(next))
            };
            if let Some(next) = self.ground.bound(group, *member, turn)? {
                self.note(format!("{member} is number {number} of {} to be tried", members.len()));
                return Ok(self.scaled(next, members.len()));
            }
        }
        self.all_tried(members.len(), seen)
    }

    fn scaled(&self, next: Next, ways: usize) -> Next {
        match next {
            Next::Pursue(mut goal) => {
                goal.times += ways as u32;
                Next::Pursue(goal)
            }
            other => other,
        }
    }

    /// Where the sign can be seen and never showed, the search has failed; where it cannot, all that could be done is done.
    fn all_tried(&self, ways: usize, seen: bool) -> Result<Next, Stuck> {
        if seen {
            let text = format!("I tried all {ways} ways and none of them is right");
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        Ok(Next::Reached(format!("all {ways} ways are tried, and nothing that I can see tells which one is right")))
    }

    /// All ways in which the members may stand, in a fixed order.
    fn arrangements(
        &self,
        vary: Variation,
        members: &[ObjectId],
        within: Option<&Destination>,
    ) -> Result<Vec<Arrangement>, Stuck> {
        let began = Some(self.since());
        let mut homes: Vec<Place> = Vec::with_capacity(members.len());
        let mut slots = match within {
            Some(Destination::In { reference }) => self.slots(*reference, members)?.into_iter(),
            _ => Vec::new().into_iter(),
        };
        for member in members {
            let place = match within {
                Some(Destination::In { .. }) => slots.next().ok_or_else(|| missing(*member, "a slot for it"))?,
                Some(destination) => self.ground.destination(destination, *member, self.current)?.value,
                None => {
                    let stood = self.view.object(*member).and_then(|entry| place_at(entry, began));
                    let (pose, support) = stood.ok_or_else(|| missing(*member, "one of them"))?;
                    Place { support, pose, tolerance_m: PLACE_TOLERANCE_M, heading_tolerance_rad: None }
                }
            };
            homes.push(place);
        }
        let count = match vary {
            Variation::Order => (1..=members.len()).try_fold(1usize, |product, n| product.checked_mul(n)),
            Variation::Heading | Variation::Choice => 1usize.checked_shl(members.len() as u32),
        };
        if members.is_empty() || count.is_none_or(|count| count > MAX_HYPOTHESES) {
            let text = format!("with {} things there are too many ways to try", members.len());
            return Err(Stuck::give_up(GiveUpCause::Plan, text));
        }
        if vary == Variation::Order {
            let orders = permutations(members.len());
            let arranged = |order: Vec<usize>| order.into_iter().filter_map(|at| homes.get(at).copied()).collect();
            return Ok(orders.into_iter().map(arranged).collect());
        }
        let turned = |bits: usize| -> Arrangement {
            let way_round = |(index, home): (usize, &Place)| {
                let turn = if bits >> index & 1 == 1 { PI } else { 0.0 };
                let pose = Pose::from_yaw(home.pose.translation, home.pose.yaw() + turn);
                Place { pose, heading_tolerance_rad: Some(HEADING_TOLERANCE_RAD), ..*home }
            };
            homes.iter().enumerate().map(way_round).collect()
        };
        Ok((0..1usize << members.len()).map(turned).collect())
    }

    /// Where the members belong in a thing, one slot each: slot and member from left to right, so that none has to cross.
    fn slots(&self, holder: ReferenceIndex, members: &[ObjectId]) -> Result<Vec<Place>, Stuck> {
        let (id, phrase) = (self.ground.object(holder)?.value, self.ground.phrase(holder));
        let found = self.view.object(id).and_then(|entry| slots(self.view, entry, members.len()));
        let mut poses = found.ok_or_else(|| missing(id, phrase))?;
        poses.sort_by(|a, b| a.translation.x.total_cmp(&b.translation.x));
        let began = Some(self.since());
        let stood = |member: ObjectId| {
            self.view.object(member).and_then(|entry| place_at(entry, began)).map_or(Pose::IDENTITY, |(pose, _)| pose)
        };
        let mut order: Vec<usize> = (0..members.len()).collect();
        let starts: Vec<Pose> = members.iter().map(|member| stood(*member)).collect();
        let start = |index: &usize| starts.get(*index).copied().unwrap_or_default();
        order.sort_by(|a, b| start(a).translation.x.total_cmp(&start(b).translation.x));
        let apart = poses.windows(2).map(|pair| match pair {
            [a, b] => a.translation.truncate().distance(b.translation.truncate()),
            _ => f64::INFINITY,
        });
        let tolerance_m = apart.fold(PLACE_TOLERANCE_M, |least, apart| least.min(0.4 * apart));
        let mut places: Vec<(usize, Place)> = Vec::with_capacity(members.len());
        for (index, slot) in order.into_iter().zip(poses) {
            // As it lies, or turned by less than a quarter turn, comes first.
            let turn = acm_concept::pose::wrap_angle(slot.yaw() - start(&index).yaw());
            let yaw = if turn.abs() > FRAC_PI_2 { slot.yaw() + PI } else { slot.yaw() };
            let pose = Pose::from_yaw(slot.translation, yaw);
            places.push((index, Place { support: Some(id), pose, tolerance_m, heading_tolerance_rad: None }));
        }
        places.sort_by_key(|(index, _)| *index);
        Ok(places.into_iter().map(|(_, place)| place).collect())
    }

    /// Which ways were tried: those that stood when the probe took effect, or, without a probe, all that ever stood.
    fn tried(&self, members: &[ObjectId], ways: &[Arrangement], probe: Option<&Goal>) -> Result<Vec<usize>, Stuck> {
        let moments: Vec<Option<Moment>> = match probe {
            Some(Goal::Performed { function, object, .. }) => {
                let object = self.ground.object(*object)?.value;
                let probes = self.successes(self.since()).filter(|t| t.skill() == function && t.object() == object);
                probes.map(|t| Some(t.moment)).collect()
            }
            Some(_) => {
                let text = "what tries an arrangement must be something that is done to a thing".to_owned();
                return Err(Stuck::give_up(GiveUpCause::Plan, text));
            }
            None => {
                let since = self.since();
                [Some(since), None].into_iter().chain(self.successes(since).map(|t| Some(t.moment))).collect()
            }
        };
        let mut tried: Vec<usize> = Vec::new();
        for moment in moments {
            let standing = self.standing(members, moment);
            let stood = ways.iter().position(|way| way.iter().zip(&standing).all(|(to, at)| is_at(to, at.as_ref())));
            tried.extend(stood.filter(|index| !tried.contains(index)));
        }
        Ok(tried)
    }

    /// Where the members stood at a moment, or stand now; `None` for one that was in the hand or is missing.
    fn standing(&self, members: &[ObjectId], moment: Option<Moment>) -> Vec<Option<Pose>> {
        let stood = |entry: &ObjectEntry| match moment {
            None => entry.place().map(|place| place.pose),
            Some(moment) => {
                entry.history.iter().rev().find(|h| h.moment <= moment).and_then(|h| h.place).map(|place| place.pose)
            }
        };
        members.iter().map(|member| self.view.object(*member).and_then(stood)).collect()
    }

    /// When one of the members was last put somewhere, or the subtask began.
    fn last_change(&self, members: &[ObjectId]) -> Moment {
        let entries = members.iter().filter_map(|member| self.view.object(*member));
        let last = entries.filter_map(|entry| entry.history.last()).map(|h| h.moment).max();
        last.unwrap_or_default().max(self.since())
    }
}

enum Sign {
    /// It shows.
    Shows(String),
    /// It could be seen and does not show.
    Absent,
    /// There is none, or it cannot be told.
    Invisible,
    /// Another look may tell.
    Look(String),
}

fn is_at(wanted: &Place, stands: Option<&Pose>) -> bool {
    stands.is_some_and(|pose| {
        let apart = pose.translation.truncate().distance(wanted.pose.translation.truncate());
        let turn = acm_concept::pose::wrap_angle(pose.yaw() - wanted.pose.yaw()).abs();
        apart <= wanted.tolerance_m && wanted.heading_tolerance_rad.is_none_or(|allowed| turn <= allowed)
    })
}

/// All orders of `0..count` in lexicographic order.
fn permutations(count: usize) -> Vec<Vec<usize>> {
    let mut orders = vec![Vec::new()];
    for _ in 0..count {
        let longer = |order: Vec<usize>| {
            let next = (0..count).filter(|n| !order.contains(n)).collect::<Vec<_>>();
            next.into_iter().map(move |n| order.iter().copied().chain([n]).collect::<Vec<_>>())
        };
        orders = orders.into_iter().flat_map(longer).collect();
    }
    orders
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orders_are_complete_and_sorted() {
        assert_eq!(permutations(0), [Vec::<usize>::new()]);
        let three = permutations(3);
        assert_eq!(three.len(), 6);
        assert!(three.windows(2).all(|pair| pair[0] < pair[1]));
    }
}
