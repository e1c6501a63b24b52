//! A small world of its own to follow plans in: where each thing is, as a tree, what stands open, what the hand holds.
//!
//! It knows what the words of the steps and of the published predicates mean, and nothing of the planner's operators,
//! formulas or search.

use crate::bench::bddl;
use acm_planner::classical::sexpr::Expression;
use std::collections::{BTreeMap, BTreeSet};

/// How a thing is at another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum How {
    On,
    In,
}

/// Things, where they are and how they stand.
#[derive(Debug, Clone, Default)]
pub struct World {
    types: BTreeMap<String, String>,
    at: BTreeMap<String, (How, String)>,
    rooms: BTreeSet<(String, String)>,
    near: BTreeSet<(String, String)>,
    under: BTreeSet<(String, String)>,
    open: BTreeSet<String>,
    running: BTreeSet<String>,
    hand: Option<String>,
    /// What cannot be taken.
    pub fixed: BTreeSet<String>,
    /// What has a door or a lid.
    pub opens: BTreeSet<String>,
}

impl World {
    /// The world as a published task describes it.
    ///
    /// # Errors
    /// A fact that is not understood, in words.
    pub fn new(source: &bddl::Problem, fixed: BTreeSet<String>, opens: BTreeSet<String>) -> Result<World, String> {
        let mut world = World { fixed, opens, ..World::default() };
        for section in ["objects", "fixtures"] {
            let typed = source.typed(section).map_err(|error| error.to_string())?;
            world.types.extend(typed.into_iter().map(|(name, of_type)| (name.to_string(), of_type.to_string())));
        }
        for (region, owner) in super::published::regions(source).map_err(|error| error.to_string())? {
            world.at.insert(format!("{owner}_{region}"), (How::In, owner));
        }
        for fact in source.section("init") {
            let Some((predicate, arguments)) = fact.headed() else { return Err(format!("no fact: {fact}")) };
            let words: Vec<String> = arguments.iter().filter_map(Expression::word).map(str::to_string).collect();
            let pair = |thing: &String, other: &String| (thing.clone(), other.clone());
            let _new = match (predicate.to_ascii_lowercase().as_str(), words.as_slice()) {
                ("ontop" | "on", [thing, support]) => {
                    world.at.insert(thing.clone(), (How::On, support.clone())).is_none()
                }
                ("inside" | "in", [thing, container]) => {
                    world.at.insert(thing.clone(), (How::In, container.clone())).is_none()
                }
                ("inroom", [thing, room]) => world.rooms.insert(pair(thing, room)),
                ("under", [thing, other]) => world.under.insert(pair(thing, other)),
                ("nextto", [thing, other]) => world.near.insert(pair(thing, other)),
                ("open", [thing]) => world.open.insert(thing.clone()),
                ("turnon" | "toggled_on", [thing]) => world.running.insert(thing.clone()),
                _ => false,
            };
        }
        Ok(world)
    }

    /// What a thing is on or in, and what that is on or in, and so on.
    fn around(&self, thing: &str) -> Vec<(How, &str)> {
        let mut chain: Vec<(How, &str)> = Vec::new();
        let mut at = thing;
        while let Some((how, next)) = self.at.get(at) {
            if chain.len() > self.at.len() {
                break;
            }
            chain.push((*how, next));
            at = next;
        }
        chain
    }
    fn is_in(&self, thing: &str, container: &str) -> bool {
        // Up to the container every link counts, but one of them must lead into it.
        self.around(thing).into_iter().any(|(how, outer)| how == How::In && outer == container)
    }
    fn reachable(&self, thing: &str) -> Result<(), String> {
        let shut = |outer: &str| self.opens.contains(outer) && !self.open.contains(outer);
        match self.around(thing).into_iter().find(|(how, outer)| *how == How::In && shut(outer)) {
            Some((_, outer)) => Err(format!("{thing} is shut in {outer}")),
            None => Ok(()),
        }
    }
    fn free_hand(&self) -> Result<(), String> {
        self.hand.as_ref().map_or(Ok(()), |held| Err(format!("the hand holds {held}")))
    }

    /// Does a step.
    ///
    /// # Errors
    /// Why it cannot be done, in words.
    pub fn act(&mut self, verb: &str, things: &[&str]) -> Result<(), String> {
        match (verb, things) {
            ("pick", [thing]) => self.take(thing),
            ("place-on", [thing, support]) => self.put(thing, How::On, support),
            ("place-in", [thing, container]) => self.put(thing, How::In, container),
            ("place-next-to", [thing, other, support]) => {
                self.beside(other, support, How::On)?;
                self.put(thing, How::On, support)?;
                self.near.insert((thing.to_string(), other.to_string()));
                Ok(())
            }
            ("place-next-to-in", [thing, other, container]) => {
                self.beside(other, container, How::In)?;
                self.put(thing, How::In, container)?;
                self.near.insert((thing.to_string(), other.to_string()));
                Ok(())
            }
            ("place-under", [thing, other, support]) => {
                self.beside(other, support, How::On)?;
                self.put(thing, How::On, support)?;
                self.under.insert((thing.to_string(), other.to_string()));
                Ok(())
            }
            ("open" | "close" | "turn-on" | "turn-off", [thing]) => {
                self.free_hand()?;
                self.reachable(thing)?;
                if matches!(verb, "open" | "close") && !self.opens.contains(*thing) {
                    return Err(format!("{thing} does not open"));
                }
                let (set, on) = match verb {
                    "open" | "close" => (&mut self.open, verb == "open"),
                    _ => (&mut self.running, verb == "turn-on"),
                };
                let changed = if on { set.insert(thing.to_string()) } else { set.remove(*thing) };
                if changed { Ok(()) } else { Err(format!("{verb} {thing}: it is so already")) }
            }
            _ => Err(format!("nobody knows how to {verb} {}", things.join(" "))),
        }
    }

    fn take(&mut self, thing: &str) -> Result<(), String> {
        self.free_hand()?;
        self.reachable(thing)?;
        if self.fixed.contains(thing) {
            return Err(format!("{thing} cannot be taken"));
        }
        if let Some((above, _)) = self.at.iter().find(|(_, (how, below))| *how == How::On && below == thing) {
            return Err(format!("{above} stands on {thing}"));
        }
        // What is in it goes with it; what either of them was near or under it leaves behind.
        let moved: BTreeSet<String> = self
            .at
            .keys()
            .filter(|inner| *inner == thing || self.is_in(inner, thing))
            .cloned()
            .chain([thing.to_string()])
            .collect();
        let stays = |pair: &(String, String)| moved.contains(&pair.0) == moved.contains(&pair.1);
        self.near.retain(stays);
        self.under.retain(stays);
        self.at.remove(thing);
        self.hand = Some(thing.to_string());
        Ok(())
    }

    fn put(&mut self, thing: &str, how: How, place: &str) -> Result<(), String> {
        if self.hand.as_deref() != Some(thing) {
            return Err(format!("the hand does not hold {thing}"));
        }
        if place == thing || self.around(place).iter().any(|(_, outer)| *outer == thing) {
            return Err(format!("{place} belongs to {thing} itself"));
        }
        self.reachable(place)?;
        if how == How::In && self.opens.contains(place) && !self.open.contains(place) {
            return Err(format!("{place} is closed"));
        }
        self.at.insert(thing.to_string(), (how, place.to_string()));
        self.hand = None;
        Ok(())
    }

    /// Whether what is put at this place comes to be beside the other thing.
    fn beside(&self, other: &str, place: &str, how: How) -> Result<(), String> {
        let room = |thing: &str| self.rooms.iter().find(|(inner, _)| inner == thing).map(|(_, room)| room);
        let direct = self.at.get(other).is_some_and(|(link, outer)| *link == how && outer == place);
        let of_one_room = how == How::On && room(other).is_some() && room(other) == room(place);
        if direct || of_one_room { Ok(()) } else { Err(format!("{place} is not where {other} is")) }
    }

    /// What the hand holds.
    pub fn held(&self) -> Option<&str> {
        self.hand.as_deref()
    }
    /// Whether a published goal holds.
    ///
    /// # Errors
    /// A part that is not understood, in words.
    pub fn holds(&self, goal: &Expression) -> Result<bool, String> {
        self.evaluate(goal, &BTreeMap::new())
    }

    fn evaluate(&self, goal: &Expression, bound: &BTreeMap<String, String>) -> Result<bool, String> {
        let Some((head, rest)) = goal.headed() else { return Err(format!("no condition: {goal}")) };
        let head = head.to_ascii_lowercase();
        let each =
            |rest: &[Expression]| rest.iter().map(|part| self.evaluate(part, bound)).collect::<Result<Vec<_>, _>>();
        let over = |variable: &Expression, body: &Expression| -> Result<Vec<bool>, String> {
            let (name, members) = self.members(variable)?;
            let with = |member: &String| {
                let mut bound = bound.clone();
                bound.insert(name.clone(), member.clone());
                self.evaluate(body, &bound)
            };
            members.iter().map(with).collect()
        };
        match (head.as_str(), rest) {
            ("and", rest) => Ok(each(rest)?.into_iter().all(|holds| holds)),
            ("or", rest) => Ok(each(rest)?.into_iter().any(|holds| holds)),
            ("not", [body]) => Ok(!self.evaluate(body, bound)?),
            ("imply", [first, second]) => Ok(!self.evaluate(first, bound)? || self.evaluate(second, bound)?),
            ("forall", [variable, body]) => Ok(over(variable, body)?.into_iter().all(|holds| holds)),
            ("exists", [variable, body]) => Ok(over(variable, body)?.into_iter().any(|holds| holds)),
            ("forn", [count, variable, body]) => {
                let found = over(variable, body)?.into_iter().filter(|holds| *holds).count();
                Ok(found.to_string() == count.to_string().replace(['(', ')'], ""))
            }
            ("forpairs", [first, second, body]) => {
                let (row_name, rows) = self.members(first)?;
                let (column_name, columns) = self.members(second)?;
                let mut pairs = BTreeSet::new();
                for row in &rows {
                    for column in columns.iter().filter(|column| *column != row) {
                        let mut bound = bound.clone();
                        bound.extend([(row_name.clone(), row.clone()), (column_name.clone(), column.clone())]);
                        if self.evaluate(body, &bound)? {
                            pairs.insert((row, column));
                        }
                    }
                }
                let paired_rows: BTreeSet<_> = pairs.iter().map(|pair| pair.0).collect();
                let paired_columns: BTreeSet<_> = pairs.iter().map(|pair| pair.1).collect();
                Ok(paired_rows.len().min(paired_columns.len()) >= rows.len().min(columns.len()))
            }
            (predicate, arguments) => {
                let name = |word: &str| bound.get(word).cloned().unwrap_or_else(|| word.trim_start_matches('?').into());
                let words: Vec<String> = arguments.iter().filter_map(Expression::word).map(name).collect();
                let pair = || (words[0].clone(), words[1].clone());
                let mirrored = || (words[1].clone(), words[0].clone());
                match (predicate, words.len()) {
                    ("ontop" | "on", 2) => Ok(self.at.get(&words[0]) == Some(&(How::On, words[1].clone()))),
                    ("inside" | "in", 2) => Ok(self.is_in(&words[0], &words[1])),
                    ("nextto", 2) => Ok(self.near.contains(&pair()) || self.near.contains(&mirrored())),
                    ("under", 2) => Ok(self.under.contains(&pair())),
                    ("open", 1) => Ok(self.open.contains(&words[0])),
                    ("close", 1) => Ok(!self.open.contains(&words[0])),
                    ("turnon", 1) => Ok(self.running.contains(&words[0])),
                    ("turnoff", 1) => Ok(!self.running.contains(&words[0])),
                    _ => Err(format!("the predicate of {goal} is not understood")),
                }
            }
        }
    }

    /// The name of a quantified variable and the things of its type.
    fn members(&self, variable: &Expression) -> Result<(String, Vec<String>), String> {
        let words: Vec<&str> = variable.list().unwrap_or_default().iter().filter_map(Expression::word).collect();
        let [name, "-", of_type] = words.as_slice() else { return Err(format!("no variable: {variable}")) };
        let members = self.types.iter().filter(|(_, known)| known == of_type).map(|(thing, _)| thing.clone());
        Ok((name.to_string(), members.collect()))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    const TASK: &str = "(define (problem p) (:objects cup_1 cup_2 - cup box_1 - box table_1 floor_1 - fixture)
        (:init (ontop cup_1 box_1) (inside cup_2 box_1) (ontop box_1 table_1) (inroom table_1 room) (inroom floor_1 room)))";

    fn world() -> World {
        let source = bddl::Problem::parse(TASK).unwrap();
        let names = |names: &[&str]| names.iter().map(|name| name.to_string()).collect();
        World::new(&source, names(&["table_1", "floor_1"]), names(&["box_1"])).unwrap()
    }
    fn holds(world: &World, goal: &str) -> bool {
        world.holds(&Expression::parse(goal).unwrap()[0]).unwrap()
    }

    #[test]
    fn what_cannot_be_done_is_refused() {
        let mut world = world();
        for (verb, things, words) in [
            ("pick", &["cup_2"][..], "shut in box_1"),
            ("pick", &["box_1"], "cup_1 stands on box_1"),
            ("pick", &["table_1"], "cannot be taken"),
            ("open", &["cup_1"], "does not open"),
            ("close", &["box_1"], "so already"),
            ("place-on", &["cup_1", "table_1"], "does not hold cup_1"),
            ("wash", &["cup_1"], "nobody knows"),
        ] {
            let refusal = world.act(verb, things).unwrap_err();
            assert!(refusal.contains(words), "{refusal}");
        }
        world.act("pick", &["cup_1"]).unwrap();
        assert!(world.act("place-in", &["cup_1", "box_1"]).unwrap_err().contains("closed"));
        assert!(world.act("open", &["box_1"]).unwrap_err().contains("the hand holds cup_1"));
        world.act("place-next-to", &["cup_1", "box_1", "table_1"]).unwrap();
        world.act("pick", &["box_1"]).unwrap();
        assert!(world.act("place-on", &["box_1", "cup_2"]).unwrap_err().contains("belongs to box_1"));
    }

    #[test]
    fn goals_are_judged() {
        let mut world = world();
        assert!(holds(&world, "(and (inside ?cup_2 ?box_1) (not (open ?box_1)))"));
        assert!(!holds(&world, "(nextto ?cup_1 ?table_1)"));
        for (verb, things) in [
            ("pick", &["cup_1"][..]),
            ("place-next-to", &["cup_1", "box_1", "table_1"]),
            ("open", &["box_1"]),
            ("pick", &["cup_2"]),
            ("place-next-to", &["cup_2", "table_1", "floor_1"]),
        ] {
            world.act(verb, things).unwrap();
        }
        assert!(holds(&world, "(and (nextto ?box_1 ?cup_1) (nextto ?cup_2 ?table_1) (open ?box_1))"));
        assert!(holds(&world, "(forn (1) (?cup - cup) (ontop ?cup ?floor_1))"));
        assert!(holds(&world, "(forpairs (?cup - cup) (?place - fixture) (ontop ?cup ?place))"));
        assert!(!holds(&world, "(forall (?cup - cup) (exists (?box - box) (inside ?cup ?box)))"));
        world.act("pick", &["box_1"]).unwrap();
        assert!(!holds(&world, "(nextto ?box_1 ?cup_1)"), "what is taken away is no longer near");
    }
}
