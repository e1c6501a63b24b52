//! The nine atomic primitives (paper, appendix "Atomic primitives").

use serde::{Deserialize, Serialize};
use std::fmt;

/// One of the nine atomic primitives through which every skill acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Primitive {
    /// Close the fingers on a part.
    Grasp,
    /// Bring the hand to a pose without touching anything.
    Reach,
    /// Carry what is held.
    Move,
    /// Turn a part or what is held upside down.
    Flip,
    /// Turn a part about an axis.
    Rotate,
    /// Draw a part towards the hand.
    Pull,
    /// Press on or shove a part.
    Push,
    /// Bring what is held into an opening.
    Insert,
    /// Open the fingers and withdraw.
    Release,
}

impl fmt::Display for Primitive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Primitive::Grasp => "grasp",
            Primitive::Reach => "reach",
            Primitive::Move => "move",
            Primitive::Flip => "flip",
            Primitive::Rotate => "rotate",
            Primitive::Pull => "pull",
            Primitive::Push => "push",
            Primitive::Insert => "insert",
            Primitive::Release => "release",
        })
    }
}
