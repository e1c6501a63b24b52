//! Readable ids: `O12` for an object, `P12.3` for its fourth part, `T7` for a transition, `S2` for a skill.

use serde::{Deserialize, Serialize};
use std::{fmt, str::FromStr};
use thiserror::Error;

/// A text that is not a readable id of the expected kind.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("`{text}` is not {expected}: write it like `{example}`")]
pub struct ParseIdError {
    text: String,
    expected: &'static str,
    example: &'static str,
}

macro_rules! readable_id {
    ($(#[$doc:meta])* $name:ident, $letter:literal, $what:literal, $example:literal) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(into = "String", try_from = "String")]
        pub struct $name(pub u64);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!($letter, "{}"), self.0)
            }
        }
        impl FromStr for $name {
            type Err = ParseIdError;
            fn from_str(text: &str) -> Result<Self, ParseIdError> {
                text.strip_prefix($letter)
                    .and_then(|digits| digits.parse().ok())
                    .map($name)
                    .ok_or_else(|| ParseIdError { text: text.into(), expected: $what, example: $example })
            }
        }
        impl From<$name> for String {
            fn from(id: $name) -> String {
                id.to_string()
            }
        }
        impl TryFrom<String> for $name {
            type Error = ParseIdError;
            fn try_from(text: String) -> Result<Self, ParseIdError> {
                text.parse()
            }
        }
    };
}

readable_id!(
    /// A persistent object identity, given by memory.
    ///
    /// ```
    /// # use acm_concept::ids::ObjectId;
    /// assert_eq!(ObjectId(12).to_string(), "O12");
    /// assert_eq!("O12".parse(), Ok(ObjectId(12)));
    /// ```
    ObjectId, "O", "an object id", "O12"
);
readable_id!(
    /// One entry of transition memory.
    TransitionId, "T", "a transition id", "T7"
);
readable_id!(
    /// One entry of skill memory.
    SkillId, "S", "a skill id", "S2"
);
readable_id!(
    /// One camera frame of an episode, numbered from 0 by the source that captured it.
    FrameId, "F", "a frame id", "F41"
);

/// A part of an object: the object's id and the part's place in its list, from 0.
///
/// ```
/// # use acm_concept::ids::{ObjectId, PartId};
/// assert_eq!(PartId { object: ObjectId(12), index: 3 }.to_string(), "P12.3");
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub struct PartId {
    /// The object that the part belongs to.
    pub object: ObjectId,
    /// The part's index in the object's list of parts.
    pub index: u32,
}

impl fmt::Display for PartId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "P{}.{}", self.object.0, self.index)
    }
}
impl FromStr for PartId {
    type Err = ParseIdError;
    fn from_str(text: &str) -> Result<Self, ParseIdError> {
        text.strip_prefix('P')
            .and_then(|rest| rest.split_once('.'))
            .and_then(|(object, index)| Some((object.parse().ok()?, index.parse().ok()?)))
            .map(|(object, index)| PartId { object: ObjectId(object), index })
            .ok_or_else(|| ParseIdError { text: text.into(), expected: "a part id", example: "P12.3" })
    }
}
impl From<PartId> for String {
    fn from(id: PartId) -> String {
        id.to_string()
    }
}
impl TryFrom<String> for PartId {
    type Error = ParseIdError;
    fn try_from(text: String) -> Result<Self, ParseIdError> {
        text.parse()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_survive_json_and_reject_foreign_letters() {
        let part = PartId { object: ObjectId(4), index: 1 };
        let json = serde_json::to_string(&(ObjectId(4), part)).unwrap();
        assert_eq!(json, r#"["O4","P4.1"]"#);
        assert_eq!(serde_json::from_str::<(ObjectId, PartId)>(&json).unwrap(), (ObjectId(4), part));
        assert!("T4".parse::<ObjectId>().is_err());
        assert!("O-4".parse::<ObjectId>().is_err());
        assert!("P4".parse::<PartId>().is_err());
    }
}
