//! Published tasks as problems of the planner: what their predicates are called here, what moves and what opens.
//!
//! Neither source says what a thing affords, so that is read off the tasks themselves: what is said to be on or in
//! something makes that a support or a container, for all things of its type in the task.

use crate::bench::bddl;
use acm_concept::literal::{Literal, Term};
use acm_planner::classical::{Formula, Problem, sexpr::ExpressionError};
use std::collections::{BTreeMap, BTreeSet};

/// A task as it was published, and as a problem of the planner.
pub struct Task {
    /// Its name.
    pub name: String,
    /// As it was published.
    pub source: bddl::Problem,
    /// For the planner.
    pub problem: Problem,
}

/// What is known of types beyond one task.
#[derive(Default)]
pub struct Abilities {
    /// Types, or types and regions, that can be opened and closed.
    pub openable: BTreeSet<String>,
    /// Types above a type.
    pub above: BTreeMap<String, Vec<String>>,
    /// Types that can be filled.
    pub fillable: BTreeSet<String>,
}

impl Task {
    /// A household activity. What belongs to a room stays where it is, unless the goal says that it shall be somewhere.
    ///
    /// # Errors
    /// A part of the task has another form than it should.
    pub fn household(name: &str, source: bddl::Problem, abilities: &Abilities) -> Result<Task, ExpressionError> {
        let mut draft = Draft::new(&source)?;
        let mut objects = Vec::new();
        for (object, kind) in source.typed("objects")? {
            objects.push((object.to_string(), kind.to_string()));
            draft.names.insert(object.to_string());
        }
        draft.read_goal(&source)?;
        let mut rooms: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for literal in draft.facts(&source)? {
            match (literal.predicate.as_str(), literal.arguments.as_slice()) {
                ("inroom", [object, room]) => rooms.entry(room.to_string()).or_default().push(object.to_string()),
                _ => draft.init.push(literal),
            }
        }
        let wanted: BTreeSet<String> = draft.placed_by_goal();
        for members in rooms.values() {
            for one in members {
                let others = members.iter().filter(|other| *other != one);
                draft.init.extend(others.map(|other| two("shares-room", one, other)));
            }
        }
        let in_room: BTreeSet<&String> = rooms.values().flatten().collect();
        for (object, kind) in &objects {
            let mut kinds = BTreeSet::from([kind.clone()]);
            kinds.extend(abilities.above.get(kind).into_iter().flatten().cloned());
            let fixed = in_room.contains(object) && !wanted.contains(object);
            kinds.insert(if fixed { "fixed" } else { "movable" }.into());
            if fixed {
                kinds.insert("supportive".into());
            }
            if abilities.openable.contains(kind) {
                kinds.insert("openable".into());
            }
            if abilities.openable.contains(kind) || abilities.fillable.contains(kind) {
                kinds.insert("container".into());
            }
            draft.objects.insert(object.clone(), kinds);
        }
        draft.afford(&objects.into_iter().collect());
        Ok(draft.task(name, source))
    }

    /// A tabletop task. Fixtures and regions stay where they are; a region of what can be moved is in it.
    ///
    /// # Errors
    /// A part of the task has another form than it should.
    pub fn tabletop(name: &str, source: bddl::Problem, abilities: &Abilities) -> Result<Task, ExpressionError> {
        let mut draft = Draft::new(&source)?;
        let mut types = BTreeMap::new();
        for (section, kind) in [("fixtures", "fixed"), ("objects", "movable")] {
            for (object, of_type) in source.typed(section)? {
                types.insert(object.to_string(), of_type.to_string());
                draft.objects.insert(object.into(), [kind.to_string(), of_type.to_string()].into());
            }
        }
        for (region, owner) in regions(&source)? {
            let name = format!("{owner}_{region}");
            let of_type = format!("{}/{region}", types.get(&owner).unwrap_or(&owner));
            draft.objects.insert(name.clone(), ["fixed".to_string(), of_type.clone()].into());
            if draft.objects.get(&owner).is_some_and(|kinds| kinds.contains("movable")) {
                draft.init.push(two("inside", &name, &owner));
                draft.objects.entry(owner).or_default().insert("container".into());
            }
            types.insert(name, of_type);
        }
        draft.names = draft.objects.keys().cloned().collect();
        for (object, kinds) in &mut draft.objects {
            if types.get(object).is_some_and(|of_type| abilities.openable.contains(of_type)) {
                kinds.extend(["openable".to_string(), "container".to_string()]);
            }
            if kinds.contains("fixed") {
                kinds.extend(["supportive".to_string(), "toggleable".to_string()]);
            }
        }
        draft.read_goal(&source)?;
        let facts = draft.facts(&source)?;
        draft.init.extend(facts);
        draft.afford(&types);
        Ok(draft.task(name, source))
    }
}

/// The regions of a tabletop task with what they belong to.
///
/// # Errors
/// A region names nothing that it belongs to.
pub fn regions(source: &bddl::Problem) -> Result<Vec<(String, String)>, ExpressionError> {
    let read = |region: &acm_planner::classical::sexpr::Expression| {
        let (name, parts) = region.expect_headed("a region")?;
        let target = parts.iter().filter_map(|part| part.headed()).find(|(head, _)| *head == ":target");
        let owner = target.and_then(|(_, rest)| rest.first()?.word());
        let owner = owner.ok_or_else(|| region.error(format!("the region {name} has no (:target NAME)")))?;
        Ok((name.to_string(), owner.to_string()))
    };
    source.section("regions").iter().map(read).collect()
}

/// A problem in the making.
struct Draft {
    objects: BTreeMap<String, BTreeSet<String>>,
    names: BTreeSet<String>,
    init: Vec<Literal>,
    goal: Formula,
}

impl Draft {
    fn new(source: &bddl::Problem) -> Result<Draft, ExpressionError> {
        source.typed("objects")?;
        let init = vec![Literal::new("hand-empty", Vec::new())];
        Ok(Draft { objects: BTreeMap::new(), names: BTreeSet::new(), init, goal: Formula::All(Vec::new()) })
    }
    /// All formulas of the section: a few activities have two.
    fn read_goal(&mut self, source: &bddl::Problem) -> Result<(), ExpressionError> {
        let read = source.section("goal").iter().map(Formula::read).collect::<Result<Vec<_>, _>>()?;
        let mut rename = |literal: &Literal| Ok(Formula::Literal(self.renamed(literal, "within")));
        self.goal = Formula::All(read).map(&mut rename)?;
        Ok(())
    }
    /// What holds at first; what is said not to hold is left out.
    fn facts(&self, source: &bddl::Problem) -> Result<Vec<Literal>, ExpressionError> {
        let mut facts = Vec::new();
        for expression in source.section("init") {
            match Formula::read(expression)? {
                Formula::Literal(literal) => facts.push(self.renamed(&literal, "inside")),
                Formula::Not(_) => {}
                other => return Err(expression.error(format!("a fact is expected, not {other}"))),
            }
        }
        Ok(facts.into_iter().filter(|fact| !fact.negated).collect())
    }
    /// The predicate's name here, and objects for variables that bear the name of one.
    fn renamed(&self, literal: &Literal, inside: &str) -> Literal {
        let lower = literal.predicate.to_ascii_lowercase();
        let (name, negated) = match lower.as_str() {
            "ontop" | "on" => ("on", false),
            "inside" | "in" => (inside, false),
            "nextto" => ("next-to", false),
            "close" => ("open", true),
            "turnon" | "toggled_on" => ("turned-on", false),
            "turnoff" => ("turned-on", true),
            other => (other, false),
        };
        let term = |term: &Term| match term {
            Term::Variable(name) if self.names.contains(name) => Term::Symbol(name.clone()),
            other => other.clone(),
        };
        let mut renamed = Literal::new(&name.replace('_', "-"), literal.arguments.iter().map(term).collect());
        renamed.negated = negated;
        renamed
    }
    /// Objects that the goal says where to have.
    fn placed_by_goal(&self) -> BTreeSet<String> {
        let places = |literal: &&Literal| matches!(literal.predicate.as_str(), "on" | "within" | "next-to" | "under");
        let first = |literal: &Literal| literal.arguments.first().map(Term::to_string);
        self.goal.literals().into_iter().filter(places).filter_map(first).collect()
    }
    /// What things of a type carry or hold at first, or shall, all things of the type can.
    fn afford(&mut self, types: &BTreeMap<String, String>) {
        let mut able: BTreeSet<(String, &str)> = BTreeSet::new();
        let goal = self.goal.literals();
        for literal in self.init.iter().chain(goal) {
            let ability = match literal.predicate.as_str() {
                "on" => "supportive",
                "inside" | "within" => "container",
                _ => continue,
            };
            match literal.arguments.get(1) {
                Some(Term::Variable(variable)) => {
                    able.extend(quantified(&self.goal, variable).into_iter().map(|kind| (kind, ability)));
                }
                Some(object) => {
                    able.extend(types.get(&object.to_string()).map(|of_type| (of_type.clone(), ability)));
                }
                None => {}
            }
        }
        for kinds in self.objects.values_mut() {
            let new =
                able.iter().filter(|(of_type, _)| kinds.contains(of_type)).map(|(_, ability)| ability.to_string());
            kinds.extend(new.collect::<Vec<_>>());
        }
    }
    /// The task, in which nothing stays in the hand: what shall not be here is put elsewhere.
    fn task(self, name: &str, source: bddl::Problem) -> Task {
        let put_down = Formula::Literal(Literal::new("hand-empty", Vec::new()));
        let goal = Formula::All(vec![self.goal, put_down]);
        Task { name: name.into(), source, problem: Problem::new(self.objects, self.init, goal) }
    }
}

/// The kinds that a variable of this name runs over somewhere in a formula.
fn quantified(formula: &Formula, name: &str) -> Vec<String> {
    let (variables, bodies): (Vec<_>, Vec<&Formula>) = match formula {
        Formula::Literal(_) => return Vec::new(),
        Formula::All(list) | Formula::Any(list) => (Vec::new(), list.iter().collect()),
        Formula::Not(body) => (Vec::new(), vec![body]),
        Formula::Implies(both) => (Vec::new(), vec![&both.0, &both.1]),
        Formula::ForAll(variable, body) | Formula::Exists(variable, body) | Formula::Exactly(_, variable, body) => {
            (vec![variable], vec![body])
        }
        Formula::Pairs(_, first, second, body) => (vec![first, second], vec![body]),
    };
    let own = variables.into_iter().filter(|variable| variable.name == name).map(|variable| variable.kind.clone());
    own.chain(bodies.into_iter().flat_map(|body| quantified(body, name))).collect()
}

fn two(predicate: &str, first: &str, second: &str) -> Literal {
    Literal::new(predicate, vec![Term::Symbol(first.into()), Term::Symbol(second.into())])
}
