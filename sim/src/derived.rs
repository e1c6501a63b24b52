//! Variables that follow from others: points that move with objects, and named expressions.

use crate::{
    layout::{Layout, LayoutError, vector},
    oracle::Watch,
    scenario::WorldSpec,
    world::World,
};
use glam::DVec3;

/// Points and derived numbers of a running world. They have no state of their own.
#[derive(Debug, Clone, Default)]
pub(crate) struct Derived {
    /// Index of the object, and the point in its base frame.
    points: Vec<(usize, DVec3)>,
    numbers: Vec<Watch>,
}

/// Names of the variables, in the order in which [`Derived::fill`] writes their values.
pub(crate) fn names<'a>(
    points: impl Iterator<Item = &'a str>,
    numbers: impl Iterator<Item = &'a str>,
) -> impl Iterator<Item = String> {
    let of_point = |point: &'a str| ["x", "y", "z"].map(|axis| format!("{point}_{axis}"));
    points.flat_map(of_point).chain(numbers.map(str::to_owned))
}

impl Derived {
    pub(crate) fn build(spec: &WorldSpec, layout: &Layout, variables: &[String]) -> Result<Derived, LayoutError> {
        let scope = layout.scope();
        let mut derived = Derived::default();
        for point in &spec.points {
            let name = &layout.find(spec, &point.of)?.name;
            // The name was just taken from this list.
            let object = layout.objects.iter().position(|object| object.name == *name).unwrap_or_default();
            derived.points.push((object, vector(&point.name, &point.at, &scope)?));
        }
        derived.numbers = spec.derived.iter().map(|number| Watch::new(&number.is, variables)).collect();
        Ok(derived)
    }

    /// Appends the values of all variables to those before them, which they follow from.
    pub(crate) fn fill(&self, world: &World, values: &mut Vec<f64>) {
        for (object, point) in &self.points {
            let at = world.bodies.get(*object).map(|body| body.pose(&world.physics).transform_point(*point));
            values.extend(at.unwrap_or(DVec3::NAN).to_array());
        }
        for number in &self.numbers {
            let value = number.value(values).unwrap_or(f64::NAN);
            values.push(value);
        }
    }
}

#[cfg(test)]
mod tests;
