//! Tasks in words: an outline to compare by, sentences to read.

use super::*;
use std::fmt;

/// Numbers things in the order in which they are named.
#[derive(Default)]
struct Numbers {
    order: Vec<ReferenceIndex>,
}

impl Numbers {
    fn of(&mut self, index: ReferenceIndex) -> String {
        let known = self.order.iter().position(|&known| known == index);
        let place = known.unwrap_or_else(|| {
            self.order.push(index);
            self.order.len() - 1
        });
        format!("#{place}")
    }
    fn list(&mut self, indices: &[ReferenceIndex]) -> String {
        indices.iter().map(|index| self.of(*index)).collect::<Vec<_>>().join(", ")
    }
    fn place(&mut self, destination: &Destination) -> String {
        match destination {
            Destination::On { reference } => format!("on {}", self.of(*reference)),
            Destination::In { reference } => format!("in {}", self.of(*reference)),
            Destination::Under { reference } => format!("under {}", self.of(*reference)),
            Destination::Middle { .. } => "middle".into(),
            Destination::Between { first, second } => {
                let first = self.of(*first);
                format!("between {first} and {}", self.of(*second))
            }
            Destination::Beside { reference, side } => format!("beside {} {side:?}", self.of(*reference)),
            Destination::Exchanged { with, heading: false, .. } => format!("in place of {}", self.of(*with)),
            Destination::Exchanged { with, heading: true, .. } => {
                format!("in place and heading of {}", self.of(*with))
            }
            Destination::History { object, reference } => format!("{reference:?} of {}", self.of(*object)),
        }
    }
    fn condition(&mut self, condition: &Condition) -> String {
        let not = if condition.negated { "not " } else { "" };
        format!("{not}{}({})", condition.predicate, self.list(&condition.arguments))
    }
    fn goal(&mut self, goal: &Goal) -> String {
        match goal {
            Goal::At { object, destination } => {
                let object = self.of(*object);
                format!("at({object}, {})", self.place(destination))
            }
            Goal::Holding { object, held } => {
                format!("{}holding({})", if *held { "" } else { "not " }, self.of(*object))
            }
            Goal::Performed { function, object, times } => {
                let object = self.of(*object);
                let often = match times {
                    Times::Count(count) => format!("x{count}"),
                    Times::Shown(by) => format!("x shown by {}", self.of(*by)),
                    Times::Until(condition) => format!("until {}", self.condition(condition)),
                };
                format!("{function}({object}) {often}")
            }
            Goal::State { predicate, object, holds, by } => {
                let object = self.of(*object);
                let by = by.map(|by| format!(" by {}", self.of(by))).unwrap_or_default();
                format!("{}{predicate}({object}){by}", if *holds { "" } else { "not " })
            }
            Goal::Each { members, order, body } => {
                let members = self.of(*members);
                let order = match order {
                    Ordering::Any => String::new(),
                    Ordering::From(side) => format!(" from {side:?}"),
                    Ordering::Named(named) => format!(" as {}", self.list(named)),
                };
                let body: Vec<String> = body.iter().map(|goal| self.goal(goal)).collect();
                format!("each {members}{order}: {}", body.join(" & "))
            }
            Goal::Find { members, vary, within, probe, sign } => {
                let mut line = format!("find {vary:?} of {}", self.of(*members));
                if let Some(within) = within {
                    line += &format!(" {}", self.place(within));
                }
                if let Some(probe) = probe {
                    line += &format!(" by {}", self.goal(probe));
                }
                if let Some(sign) = sign {
                    line += &format!(" until {}", self.condition(sign));
                }
                line
            }
            Goal::Await { condition } => format!("await {}", self.condition(condition)),
        }
    }
}

impl Task {
    /// The goals alone, one a line, with things numbered in the order in which they are named. Two instructions
    /// that ask for the same have the same outline, whatever nouns and colours they use.
    pub fn outline(&self) -> Vec<String> {
        let mut numbers = Numbers::default();
        let mut lines = Vec::with_capacity(self.subtasks.len());
        for subtask in &self.subtasks {
            let when = subtask.when.as_ref().map(|condition| format!("if {}: ", numbers.condition(condition)));
            lines.push(when.unwrap_or_default() + &numbers.goal(&subtask.goal));
        }
        lines
    }

    fn name(&self, index: ReferenceIndex) -> String {
        self.references.get(index).map_or_else(|| format!("reference {index}"), |r| format!("\"{}\"", r.phrase))
    }

    fn names(&self, indices: &[ReferenceIndex]) -> String {
        indices.iter().map(|index| self.name(*index)).collect::<Vec<_>>().join(", ")
    }

    fn place(&self, destination: &Destination) -> String {
        let name = |index: &ReferenceIndex| self.name(*index);
        match destination {
            Destination::On { reference } => format!("on {}", name(reference)),
            Destination::In { reference } => format!("in {}", name(reference)),
            Destination::Under { reference } => format!("under {}", name(reference)),
            Destination::Middle { of: Some(group) } => format!("in the middle of {}", name(group)),
            Destination::Middle { of: None } => "in the middle of the places".into(),
            Destination::Between { first, second } => format!("between {} and {}", name(first), name(second)),
            Destination::Beside { reference, .. } => format!("beside {}", name(reference)),
            Destination::Exchanged { with, heading, .. } => {
                format!("where {} stood{}", name(with), if *heading { " and turned as it was" } else { "" })
            }
            Destination::History { object, reference } => history_phrase(*reference, &name(object)),
        }
    }

    /// A condition in words.
    pub fn describe_condition(&self, condition: &Condition) -> String {
        let not = if condition.negated { "not " } else { "" };
        format!("{not}{}({})", condition.predicate, self.names(&condition.arguments))
    }

    /// A goal in words.
    pub fn describe(&self, goal: &Goal) -> String {
        let name = |index: &ReferenceIndex| self.name(*index);
        match goal {
            Goal::At { object, destination } => format!("{} stands {}", name(object), self.place(destination)),
            Goal::Holding { object, held: true } => format!("{} is in the hand", name(object)),
            Goal::Holding { object, held: false } => format!("{} is put down", name(object)),
            Goal::Performed { function, object, times } => match times {
                Times::Count(count) => format!("{function} {} x{count}", name(object)),
                Times::Shown(by) => format!("{function} {} as often as {} shows", name(object), name(by)),
                Times::Until(until) => format!("{function} {} until {}", name(object), self.describe_condition(until)),
            },
            Goal::State { predicate, object, holds, by } => {
                let by = by.map(|by| format!(" by {}", self.name(by))).unwrap_or_default();
                format!("{} is {}{predicate}{by}", name(object), if *holds { "" } else { "not " })
            }
            Goal::Each { members, order, body } => {
                let order = match order {
                    Ordering::Any => String::new(),
                    Ordering::From(side) => format!(" from the {}", format!("{side:?}").to_lowercase()),
                    Ordering::Named(named) => format!(" in the order {}", self.names(named)),
                };
                let body: Vec<String> = body.iter().map(|goal| self.describe(goal)).collect();
                format!("for each of {}{order}: {}", name(members), body.join(", then "))
            }
            Goal::Find { members, vary, within, probe, sign } => {
                let what = match vary {
                    Variation::Order => "the order",
                    Variation::Heading => "the heading",
                    Variation::Choice => "the one",
                };
                let mut text = format!("find {what} of {}", name(members));
                if let Some(within) = within {
                    text += &format!(" {}", self.place(within));
                }
                if let Some(probe) = probe {
                    text += &format!(", trying with: {}", self.describe(probe));
                }
                if let Some(sign) = sign {
                    text += &format!(", until {}", self.describe_condition(sign));
                }
                text
            }
            Goal::Await { condition } => format!("wait until {}", self.describe_condition(condition)),
        }
    }
}

impl fmt::Display for Task {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, subtask) in self.subtasks.iter().enumerate() {
            let separator = if index == 0 { "" } else { "; " };
            write!(f, "{separator}{}. ", index + 1)?;
            if let Some(condition) = &subtask.when {
                write!(f, "if {}: ", self.describe_condition(condition))?;
            }
            write!(f, "{}", self.describe(&subtask.goal))?;
        }
        Ok(())
    }
}
