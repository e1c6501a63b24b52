//! What an agent goes by, and how that may change once while it runs.

use crate::tools::ToolSettings;
use acm_concept::task::OnUnknown;
use acm_perception::GrounderConfig;
use serde::{Deserialize, Serialize};
use std::{
    fmt,
    str::FromStr,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

/// What an agent goes by, but for its memory and its words.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Settings {
    /// What to do when memory cannot decide.
    pub on_unknown: OnUnknown,
    /// Thresholds of perception.
    pub perception: GrounderConfig,
    /// Tools that help perception on single frames. An agent that is to run refuses them: see [`AgentError::Tools`].
    ///
    /// [`AgentError::Tools`]: crate::AgentError::Tools
    #[serde(skip_serializing_if = "ToolSettings::is_default")]
    pub tools: ToolSettings,
}

impl Default for Settings {
    /// An agent that acts reads what is written and shown on things: tasks speak of it.
    fn default() -> Settings {
        let perception = GrounderConfig { read: true, ..GrounderConfig::default() };
        Settings { perception, on_unknown: OnUnknown::default(), tools: ToolSettings::default() }
    }
}

/// What a language model may be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// To turn the instruction into goals.
    Parse,
    /// To choose among several ways that lead to a goal.
    Select,
    /// To say what went wrong with a skill that failed, and how to go on.
    Reflect,
}

impl Stage {
    /// All of them.
    pub const ALL: [Stage; 3] = [Stage::Parse, Stage::Select, Stage::Reflect];

    /// As it is written.
    pub const fn name(self) -> &'static str {
        match self {
            Stage::Parse => "parse",
            Stage::Select => "select",
            Stage::Reflect => "reflect",
        }
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Stage {
    type Err = String;
    fn from_str(text: &str) -> Result<Stage, String> {
        let names = Stage::ALL.map(Stage::name).join(", ");
        let found = Stage::ALL.into_iter().find(|stage| stage.name() == text);
        found.ok_or_else(|| format!("`{text}` is nothing that a model may be asked for: there are {names}"))
    }
}

/// Something that is to happen once another thing has happened.
#[derive(Debug, Clone, Default)]
pub struct Signal(Arc<AtomicBool>);

impl Signal {
    /// It has happened.
    pub fn give(&self) {
        self.0.store(true, Ordering::SeqCst);
    }
    /// Whether it has.
    pub fn is_given(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

impl PartialEq for Signal {
    /// Two handles of one signal.
    fn eq(&self, other: &Signal) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Signal {}

/// A value that gives way to another one when a signal is given. Messages have one order, so a signal that is given
/// before a message is handled holds for it.
#[derive(Debug, Clone)]
pub struct Turning<T> {
    first: T,
    then: Option<(Signal, T)>,
}

impl<T> Turning<T> {
    /// `first`, and with a signal the other from there on.
    pub fn new(first: T, then: Option<(Signal, T)>) -> Turning<T> {
        Turning { first, then }
    }
    /// The value that holds now.
    pub fn now(&self) -> &T {
        match &self.then {
            Some((signal, then)) if signal.is_given() => then,
            _ => &self.first,
        }
    }
    /// The same of something that is made of the value.
    pub fn map<U>(self, mut make: impl FnMut(T) -> U) -> Turning<U> {
        Turning { first: make(self.first), then: self.then.map(|(signal, then)| (signal, make(then))) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_other_value_holds_from_the_signal_on() {
        let signal = Signal::default();
        let turning = Turning::new(1, Some((signal.clone(), 2))).map(|value| 10 * value);
        assert_eq!(*turning.now(), 10);
        signal.give();
        assert_eq!(*turning.now(), 20);
        assert_eq!(*Turning::new(1, None).now(), 1);
    }
}
