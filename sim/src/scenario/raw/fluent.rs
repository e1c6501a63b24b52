//! State that is not a pose: regions, named quantities and the rules that change them.

use super::{Number, RawReference};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// A box in space, at rest in the world or fixed to an object. What is in it is known to the judge, to events and to
/// rules: `REGION_has_OBJECT` (1 or 0) for every object without `count`, `REGION_count` for all objects together. An
/// object is in it while the middle of its upright extent is.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRegion {
    /// Name: lower-case letters, digits and underscores, a letter first.
    pub(crate) name: String,
    /// The object to whose base frame it is fixed, which itself is never in it. Default: the world.
    #[serde(default)]
    pub(crate) of: Option<RawReference>,
    /// Its corner with the smallest coordinates, metres.
    pub(crate) low: [Number; 3],
    /// Its corner with the largest coordinates, metres.
    pub(crate) high: [Number; 3],
}

/// A named quantity of the world: a temperature, a counter, a timer, whether something is heated or sliced. Its name is
/// a variable for the judge, for events and for rules. The agent sees of it what lamps and gauges show.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawFluent {
    /// Name: lower-case letters, digits and underscores, a letter first.
    pub(crate) name: String,
    /// Value at the start. Expressions can use places and plain draws. Default: 0.
    #[serde(default = "zero")]
    pub(crate) start: Number,
    /// Change in a second, an expression over the judge's variables such as `"(timer > 0) * 2"`. Default: none.
    #[serde(default)]
    pub(crate) rate: Option<Number>,
    /// It never falls below this.
    #[serde(default)]
    pub(crate) low: Option<f64>,
    /// It never rises above this.
    #[serde(default)]
    pub(crate) high: Option<f64>,
}

/// What happens each time that a condition becomes true: fluents take new values.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawRule {
    /// Name, for messages.
    pub(crate) name: String,
    /// Condition over the judge's variables. The rule acts once each time it becomes true.
    pub(crate) when: String,
    /// New values of fluents, by name; expressions over the judge's variables as they were before.
    pub(crate) set: BTreeMap<String, Number>,
}

/// A point that moves with an object, such as the end of a battery. Where it is are variables of the judge, of events and of
/// rules: `NAME_x`, `NAME_y`, `NAME_z`, metres.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawPoint {
    /// Name: lower-case letters, digits and underscores, a letter first.
    pub(crate) name: String,
    /// The object.
    pub(crate) of: RawReference,
    /// The point in the object's base frame, metres. Expressions can use places and plain draws.
    pub(crate) at: [Number; 3],
}

/// A number that follows from others: a condition or a distance that several predicates share.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RawDerived {
    /// Name: lower-case letters, digits and underscores, a letter first.
    pub(crate) name: String,
    /// Expression over the judge's variables and the derived numbers before it.
    pub(crate) is: Number,
}

fn zero() -> Number {
    Number::Plain(0.0)
}
