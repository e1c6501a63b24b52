//! What memory expects a camera to see: the input with which perception compares a frame.

use crate::{
    color::Appearance,
    ids::ObjectId,
    object::{GroundedPart, SupportPlane},
    solid::PlacedSolid,
    time::Time,
};
use serde::{Deserialize, Serialize};

/// A remembered object with its predicted pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ExpectedObject {
    /// Its identity.
    pub id: ObjectId,
    /// Its category.
    pub category: String,
    /// Its parts at their predicted poses; sigmas are inflated for the time and motion since it was last seen.
    pub parts: Vec<GroundedPart>,
    /// Its colour.
    pub appearance: Appearance,
    /// Probability that it is where predicted, 0-1.
    pub confidence: f64,
    /// In how many frames it was seen: how settled its parameters are.
    pub views: u32,
    /// Whether the hand holds it.
    pub held: bool,
    /// Whether the robot itself put it where it is predicted: which object it is, is in no doubt there.
    pub was_put: bool,
}

/// The whole expectation for one frame. An empty one is valid and means that nothing is known.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Expectation {
    /// When the frame is taken.
    pub time: Time,
    /// Remembered objects that may be seen.
    pub objects: Vec<ExpectedObject>,
    /// The surface found earlier.
    pub support: Option<SupportPlane>,
    /// The robot's own solids in the world, from its description and reported pose: pixels on them are its own.
    pub robot: Vec<PlacedSolid>,
    /// Nouns of the current instruction; they raise the prior of the templates that carry them (the paper's
    /// choice "by the semantic synopsis").
    pub nouns: Vec<String>,
}
