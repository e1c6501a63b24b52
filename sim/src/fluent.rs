//! State that is not a pose: what is in which region, and named quantities that change at a rate and by rules.

use crate::{
    body::Body,
    layout::{Layout, LayoutError, number, vector},
    oracle::Watch,
    scenario::WorldSpec,
    world::World,
};
use acm_concept::pose::Pose;
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Regions and fluents of a running world. Their values are variables of the judge.
#[derive(Debug, Clone, Default)]
pub(crate) struct Fluents {
    regions: Vec<Region>,
    fluents: Vec<Fluent>,
    rules: Vec<Rule>,
}

#[derive(Debug, Clone)]
struct Region {
    /// Index of the object that it is fixed to.
    of: Option<usize>,
    low: DVec3,
    high: DVec3,
}

#[derive(Debug, Clone)]
struct Fluent {
    value: f64,
    rate: Option<Watch>,
    low: f64,
    high: f64,
}

#[derive(Debug, Clone)]
struct Rule {
    when: Watch,
    set: Vec<(usize, Watch)>,
    held: bool,
}

/// Names of the variables, in the order in which [`Fluents::fill`] writes their values: of regions over the named
/// objects, then of fluents.
pub(crate) fn names<'a>(
    regions: impl Iterator<Item = &'a str>,
    fluents: impl Iterator<Item = &'a str>,
    objects: &[&str],
) -> Vec<String> {
    let of_region = |region: &'a str| {
        let has = objects.iter().map(move |object| format!("{region}_has_{object}"));
        has.chain([format!("{region}_count")]).collect::<Vec<_>>()
    };
    regions.flat_map(of_region).chain(fluents.map(str::to_owned)).collect()
}

/// All that they change while the world runs: values, and which rules hold.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct FluentState {
    values: Vec<f64>,
    held: Vec<bool>,
}

impl Fluents {
    pub(crate) fn state(&self) -> FluentState {
        FluentState {
            values: self.fluents.iter().map(|fluent| fluent.value).collect(),
            held: self.rules.iter().map(|rule| rule.held).collect(),
        }
    }
    pub(crate) fn set_state(&mut self, state: FluentState) {
        for (fluent, value) in self.fluents.iter_mut().zip(state.values) {
            fluent.value = value;
        }
        for (rule, held) in self.rules.iter_mut().zip(state.held) {
            rule.held = held;
        }
    }

    /// The fluents of a world at its start.
    pub(crate) fn build(spec: &WorldSpec, layout: &Layout, variables: &[String]) -> Result<Fluents, LayoutError> {
        let scope = layout.scope();
        let mut fluents = Fluents::default();
        for region in &spec.regions {
            let of = match &region.of {
                None => None,
                Some(of) => {
                    let name = &layout.find(spec, of)?.name;
                    layout.objects.iter().position(|object| object.name == *name)
                }
            };
            let (low, high) = (vector(&region.name, &region.low, &scope)?, vector(&region.name, &region.high, &scope)?);
            if !low.cmplt(high).all() {
                let reason = format!("its corner {low} must lie below {high} along every axis");
                return Err(LayoutError::Value { name: region.name.clone(), reason });
            }
            fluents.regions.push(Region { of, low, high });
        }
        for fluent in &spec.fluents {
            let value = number(&fluent.name, &fluent.start, &scope)?.clamp(fluent.low, fluent.high);
            let rate = fluent.rate.as_ref().map(|rate| Watch::new(rate, variables));
            fluents.fluents.push(Fluent { value, rate, low: fluent.low, high: fluent.high });
        }
        for rule in &spec.rules {
            let set = rule.set.iter().map(|(at, value)| (*at, Watch::new(value, variables))).collect();
            fluents.rules.push(Rule { when: Watch::new(&rule.when, variables), set, held: false });
        }
        Ok(fluents)
    }

    /// Goes on by one physics step from the state of all variables after the last one.
    pub(crate) fn step(&mut self, state: &[f64], step_s: f64) {
        let mut new: Vec<(usize, f64)> = Vec::new();
        for rule in &mut self.rules {
            let holds = rule.when.holds(state);
            if holds && !rule.held {
                new.extend(rule.set.iter().filter_map(|(at, value)| Some((*at, value.value(state)?))));
            }
            rule.held = holds;
        }
        for fluent in &mut self.fluents {
            let rate = fluent.rate.as_ref().and_then(|rate| rate.value(state)).unwrap_or(0.0);
            fluent.value = (fluent.value + rate * step_s).clamp(fluent.low, fluent.high);
        }
        // After the rates, so that a timer that is set shows the whole time.
        for (at, value) in new {
            if let Some(fluent) = self.fluents.get_mut(at) {
                fluent.value = value.clamp(fluent.low, fluent.high);
            }
        }
    }

    /// Appends the values of all variables.
    pub(crate) fn fill(&self, world: &World, values: &mut Vec<f64>) {
        for region in &self.regions {
            let inside: Vec<bool> =
                world.bodies.iter().enumerate().map(|(at, body)| region.holds(world, at, body)).collect();
            let named = world.bodies.iter().zip(&inside).filter(|(body, _)| !body.is_copy);
            values.extend(named.map(|(_, inside)| f64::from(u8::from(*inside))));
            values.push(inside.iter().filter(|inside| **inside).count() as f64);
        }
        values.extend(self.fluents.iter().map(|fluent| fluent.value));
    }
}

impl Region {
    fn holds(&self, world: &World, at: usize, body: &Body) -> bool {
        if self.of == Some(at) {
            return false;
        }
        let frame = self.of.and_then(|of| world.bodies.get(of)).map_or(Pose::IDENTITY, |of| of.pose(&world.physics));
        let middle = body.pose(&world.physics).transform_point(DVec3::Z * (0.5 * body.placed.height()));
        let middle = frame.inverse().transform_point(middle);
        middle.cmpge(self.low).all() && middle.cmple(self.high).all()
    }
}

#[cfg(test)]
mod tests;
