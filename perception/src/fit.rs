//! Fits a template to the evidence of one segment: robust least squares over surface points and outline.

mod evidence;
mod minimise;
mod model;
mod profile;

pub(crate) use evidence::{Evidence, OutlineKind, OutlinePoint, SurfacePoint};
pub(crate) use minimise::{Minimum, approach, cost, minimise, rough_cost};
pub(crate) use model::{Base, Model, corners};
pub(crate) use profile::{Profile, profile};

#[cfg(test)]
mod tests;
