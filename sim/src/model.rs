//! The simulator's own object models: solids, material and mechanism, read from text files. They are not the
//! agent's templates and share no code or data with them.

use crate::scenario::{Color, ScenarioError};
use acm_concept::{
    pose::Pose,
    solid::{PlacedSolid, Solid},
    suggest::suggest,
};
use glam::{DQuat, DVec3};
use include_dir::{Dir, include_dir};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

static EMBEDDED: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/scenarios/objects");

const MAX_SOLIDS: usize = 64;
const MAX_SIZE_M: f64 = 3.0;

/// A kind of object that scenarios place. Its base frame lies at the middle of its bottom, z up.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ObjectModel {
    /// Name that scenario files refer to.
    pub(crate) model: String,
    /// What it is, one line.
    pub(crate) summary: String,
    /// Whether it stands still whatever touches it. Default: false.
    #[serde(default)]
    pub(crate) fixed: bool,
    /// Density of its solids, kg/m3. Default: 700, a light wood.
    #[serde(default = "wood")]
    pub(crate) density_kg_m3: f64,
    /// Coulomb friction of its surface; a contact takes the mean of both surfaces, the gripper's pads excepted.
    /// Default: 0.5.
    #[serde(default = "half")]
    pub(crate) friction: f64,
    /// Its solids.
    pub(crate) solid: Vec<ModelSolid>,
    /// A cap that can be pressed.
    #[serde(default)]
    pub(crate) button: Option<ButtonModel>,
}

/// A solid of an object model.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, tag = "shape", rename_all = "kebab-case")]
pub(crate) enum ModelSolid {
    /// A cuboid.
    Box {
        /// Edge lengths along x, y, z, metres.
        size: [f64; 3],
        /// Its centre in the base frame, metres.
        position: [f64; 3],
        /// Heading about z, degrees. Default: 0.
        #[serde(default)]
        yaw_deg: f64,
        /// Turn about its own y axis after the heading, degrees: positive lowers its +x end. Default: 0.
        #[serde(default)]
        tilt_deg: f64,
        /// Colour.
        color: Color,
    },
    /// A cylinder about z.
    Cylinder {
        /// Radius, metres.
        radius: f64,
        /// Full height, metres.
        height: f64,
        /// Its centre in the base frame, metres.
        position: [f64; 3],
        /// Colour.
        color: Color,
    },
}

/// A cap on a spring that is counted as pressed when it has gone down far enough.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ButtonModel {
    /// How far the cap can go down, metres.
    pub(crate) travel_m: f64,
    /// It is pressed once it is deeper than this, metres.
    pub(crate) pressed_m: f64,
    /// It is ready for the next press once it is less deep than this, metres.
    pub(crate) rearmed_m: f64,
    /// Force of the spring when the cap is up, newtons.
    pub(crate) preload_n: f64,
    /// Stiffness of the spring, newtons per metre.
    pub(crate) stiffness_n_m: f64,
    /// Speed at which a free cap comes back, metres per second.
    pub(crate) return_speed_m_s: f64,
    /// Mass of the cap, kilograms.
    pub(crate) mass_kg: f64,
    /// The cap's solids in the object's base frame, cap up.
    pub(crate) solid: Vec<ModelSolid>,
}

fn wood() -> f64 {
    700.0
}
fn half() -> f64 {
    0.5
}

impl ModelSolid {
    pub(crate) fn placed(&self) -> PlacedSolid {
        match *self {
            ModelSolid::Box { size, position, yaw_deg, tilt_deg, .. } => PlacedSolid {
                solid: Solid::Box { size: size.into() },
                pose: Pose::from_yaw(position.into(), yaw_deg.to_radians())
                    * Pose::new(DVec3::ZERO, DQuat::from_rotation_y(tilt_deg.to_radians())),
            },
            ModelSolid::Cylinder { radius, height, position, .. } => {
                PlacedSolid { solid: Solid::Cylinder { radius, height }, pose: Pose::from_translation(position.into()) }
            }
        }
    }
    pub(crate) fn color(&self) -> Color {
        match *self {
            ModelSolid::Box { color, .. } | ModelSolid::Cylinder { color, .. } => color,
        }
    }
    fn problem(&self) -> Option<String> {
        let PlacedSolid { solid, pose } = self.placed();
        let size = 2.0 * solid.half_extents();
        let fits = size.is_finite() && size.cmpgt(DVec3::ZERO).all() && size.cmple(DVec3::splat(MAX_SIZE_M)).all();
        if !fits {
            return Some(format!("a solid's size {size} m must lie in (0, {MAX_SIZE_M}] along every axis"));
        }
        (!pose.is_valid()).then(|| "a solid's position is not finite".into())
    }
}

impl ObjectModel {
    /// Reads one model file.
    pub(crate) fn parse(file: &str, text: &str) -> Result<ObjectModel, ScenarioError> {
        let wrong = |reason: String| ScenarioError::Model { file: file.into(), reason };
        let model: ObjectModel = toml::from_str(text).map_err(|e| wrong(suggest(e.to_string())))?;
        match model.problem() {
            Some(problem) => Err(wrong(problem)),
            None => Ok(model),
        }
    }

    /// What makes no sense in it, if anything.
    pub(crate) fn problem(&self) -> Option<String> {
        let caps = self.button.iter().flat_map(|button| &button.solid);
        let solids: Vec<&ModelSolid> = self.solid.iter().chain(caps).collect();
        if self.solid.is_empty() || solids.len() > MAX_SOLIDS {
            return Some(format!("needs 1 to {MAX_SOLIDS} solids, has {}", solids.len()));
        }
        if let Some(problem) = solids.iter().find_map(|solid| solid.problem()) {
            return Some(problem);
        }
        if !(self.density_kg_m3 > 0.0 && self.density_kg_m3 < 30_000.0) {
            return Some(format!("density_kg_m3 = {} must lie in (0, 30000)", self.density_kg_m3));
        }
        if !(0.0..=5.0).contains(&self.friction) {
            return Some(format!("friction = {} must lie in [0, 5]", self.friction));
        }
        self.button.as_ref().and_then(ButtonModel::problem)
    }
}

impl ButtonModel {
    fn problem(&self) -> Option<String> {
        if self.solid.is_empty() {
            return Some("[button] needs at least one [[button.solid]]".into());
        }
        let ordered = 0.0 < self.rearmed_m && self.rearmed_m < self.pressed_m && self.pressed_m < self.travel_m;
        if !(ordered && self.travel_m <= 0.05) {
            return Some("[button] needs 0 < rearmed_m < pressed_m < travel_m <= 0.05".into());
        }
        let positive = [self.preload_n, self.stiffness_n_m, self.return_speed_m_s, self.mass_kg];
        let bad = positive.iter().any(|value| !(*value > 0.0 && *value < 1e5));
        bad.then(|| "[button] needs a positive preload, stiffness, return speed and mass".into())
    }
}

/// The models that a scenario may name.
#[derive(Debug, Clone, Default)]
pub(crate) struct ModelLibrary {
    models: BTreeMap<String, ObjectModel>,
}

impl ModelLibrary {
    /// The models that ship with the simulator.
    pub(crate) fn embedded() -> Result<ModelLibrary, ScenarioError> {
        let mut library = ModelLibrary::default();
        for file in EMBEDDED.files() {
            let name = file.path().display().to_string();
            library.add(ObjectModel::parse(&name, file.contents_utf8().unwrap_or_default())?);
        }
        Ok(library)
    }
    /// Adds a model; one of the same name is replaced.
    pub(crate) fn add(&mut self, model: ObjectModel) {
        self.models.insert(model.model.clone(), model);
    }
    pub(crate) fn get(&self, name: &str) -> Option<&ObjectModel> {
        self.models.get(name)
    }
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.models.keys().map(String::as_str)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    const MAT: &str = "model = 'm'\nsummary = ''\nfixed = true\n[[solid]]\nshape = 'box'\nsize = [0.1, 0.1, 0.001]\n\
                       position = [0, 0, 0.0005]\ncolor = '#0080ff'\n";

    #[test]
    fn the_embedded_models_are_sound() {
        let library = ModelLibrary::embedded().unwrap();
        assert!(library.names().count() >= 3);
        for name in library.names() {
            let bottom = |solid: &ModelSolid| {
                let placed = solid.placed();
                placed.pose.translation.z - placed.half_extents().z
            };
            let lowest = library.get(name).unwrap().solid.iter().map(bottom).fold(f64::INFINITY, f64::min);
            assert!(lowest.abs() < 1e-9, "{name} does not stand on its base frame");
        }
    }

    #[test]
    fn bad_models_say_what_is_wrong() {
        assert!(ObjectModel::parse("a.toml", MAT).is_ok());
        let message = |text: &str| ObjectModel::parse("a.toml", text).unwrap_err().to_string();
        assert!(message(&MAT.replace("fixed", "fixd")).contains("did you mean `fixed`"));
        assert!(message(&MAT.replace("0.001]", "-0.001]")).contains("size"));
        assert!(message(&MAT.replace("#0080ff", "blue")).contains("#rrggbb"));
        assert!(message("model = 'm'\nsummary = ''\nsolid = []\n").contains("1 to 64 solids"));
    }
}
