//! The meaning of regions, fluents, rules, points and derived numbers.

use super::{super::spec::*, Meaning, as_strs};
use crate::scenario::{ScenarioError, nearest, raw::*};
use acm_concept::expression::Expression;

impl Meaning<'_> {
    pub(super) fn region(&self, raw: &RawRegion) -> Result<RegionSpec, ScenarioError> {
        let field = format!("region `{}`", raw.name);
        let others = self.others();
        let names = as_strs(&others);
        Ok(RegionSpec {
            name: raw.name.clone(),
            of: raw.of.as_ref().map(|of| self.reference(&field, of)).transpose()?,
            low: self.triple(&format!("{field}.low"), &raw.low, &names)?,
            high: self.triple(&format!("{field}.high"), &raw.high, &names)?,
        })
    }

    pub(super) fn fluent(&self, raw: &RawFluent) -> Result<FluentSpec, ScenarioError> {
        let field = format!("fluent `{}`", raw.name);
        let (low, high) = (raw.low.unwrap_or(f64::NEG_INFINITY), raw.high.unwrap_or(f64::INFINITY));
        if low.is_nan() || high.is_nan() || low >= high {
            return Err(self.wrong(field, format!("low = {low} must be less than high = {high}")));
        }
        let variables = self.variables();
        let rate = |rate: &Number| self.number(&format!("{field}.rate"), rate, &as_strs(&variables));
        Ok(FluentSpec {
            name: raw.name.clone(),
            start: self.number(&format!("{field}.start"), &raw.start, &as_strs(&self.others()))?,
            rate: raw.rate.as_ref().map(rate).transpose()?,
            low,
            high,
        })
    }

    pub(super) fn rule(&self, raw: &RawRule) -> Result<RuleSpec, ScenarioError> {
        let field = format!("rule `{}`", raw.name);
        let variables = self.variables();
        let known = || self.raw.fluent.iter().map(|fluent| fluent.name.as_str());
        let set = |(name, value): (&String, &Number)| -> Result<(usize, Expression), ScenarioError> {
            let fluent = known()
                .position(|fluent| fluent == name)
                .ok_or_else(|| self.wrong(&field, format!("there is no fluent `{name}`{}", nearest(name, known()))))?;
            Ok((fluent, self.number(&format!("{field}.set.{name}"), value, &as_strs(&variables))?))
        };
        if raw.set.is_empty() {
            return Err(self.wrong(field, "sets nothing"));
        }
        Ok(RuleSpec {
            when: self.expression(&format!("{field}.when"), &raw.when, &as_strs(&variables))?,
            set: raw.set.iter().map(set).collect::<Result<_, _>>()?,
        })
    }

    pub(super) fn point(&self, raw: &RawPoint) -> Result<PointSpec, ScenarioError> {
        let field = format!("point `{}`", raw.name);
        let at = self.triple(&format!("{field}.at"), &raw.at, &as_strs(&self.others()))?;
        Ok(PointSpec { name: raw.name.clone(), of: self.reference(&field, &raw.of)?, at })
    }

    /// A derived number can use those before it.
    pub(super) fn derived(&self, at: usize) -> Result<DerivedSpec, ScenarioError> {
        let raw = &self.raw.derived[at];
        let later: Vec<&str> = self.raw.derived[at..].iter().map(|derived| derived.name.as_str()).collect();
        let variables = self.variables();
        let known: Vec<&str> = variables.iter().map(String::as_str).filter(|name| !later.contains(name)).collect();
        let is = self.number(&format!("derived `{}`", raw.name), &raw.is, &known)?;
        Ok(DerivedSpec { name: raw.name.clone(), is })
    }
}
