//! Joints of articulated things, from two frames between which somebody moved a part.
//!
//! What moved is told by free space: a point that one frame measured where the other frame looks through is of a thing
//! that left, or came. A part that hangs on one joint moves by one of two families of rigid motions, a slide (three
//! numbers) or a turn (five). Both are searched from starts that the part's planes give, by how well the points of each
//! frame, moved into the other one, agree with what was measured there; the likelier family is the joint.
//!
//! | module | holds |
//! |---|---|
//! | `view` | a frame as points in the world, with the noise of each |
//! | `change` | pixels that left and pixels that came |
//! | `screw` | the motions of the two kinds of joints, and their numbers |
//! | `agreement` | how well a motion explains both frames |
//! | `planes`, `starts` | flat faces, and the motions that a search begins with |
//! | `search` | the best motion of each kind, and how sure it is |
//! | `part` | the pixels that moved along |

mod agreement;
mod change;
mod part;
mod planes;
mod screw;
mod search;
mod starts;
#[cfg(test)]
mod tests;
mod view;

use crate::GrounderConfig;
use acm_concept::{camera::RgbdFrame, object::Blindness};
use change::Changed;
use glam::DVec3;
use thiserror::Error;
use view::View;

/// Most parts that are looked for.
const MOST_PARTS: usize = 4;
/// Fewest changed pixels of a part.
const LEAST_CHANGED_PX: usize = 80;
/// A further part has at least this share of all that changed.
const LEAST_SHARE: f64 = 0.1;

/// The kind of a joint of one freedom, and its axis in the world.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum JointModel {
    /// It turns.
    Revolute {
        /// Direction of the axis, of length 1.
        axis: DVec3,
        /// The point of the axis that is nearest to the part, metres.
        point: DVec3,
        /// How far it turned from the first frame to the second, by the right hand about the axis, radians.
        angle_rad: f64,
        /// Standard deviations: of the axis' direction (radians), of its place across it (metres), of the angle (radians).
        sigma: [f64; 3],
    },
    /// It slides.
    Prismatic {
        /// Direction of the slide from the first frame to the second, of length 1.
        axis: DVec3,
        /// How far it slid, metres.
        distance_m: f64,
        /// Standard deviations: of the direction (radians), of the distance (metres).
        sigma: [f64; 2],
    },
}

/// A part that was moved, and the joint on which it hangs.
#[derive(Debug, Clone, PartialEq)]
pub struct MovedPart {
    /// Its pixels in the first frame, ascending.
    pub before: Vec<usize>,
    /// Its pixels in the second frame, ascending.
    pub after: Vec<usize>,
    /// Its joint.
    pub joint: JointModel,
    /// Probability that the kind of the joint is right.
    pub confidence: f64,
}

/// Why no joint is told.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum NotTold {
    /// A frame cannot be read.
    #[error("the {which} frame shows nothing: {reason:?}")]
    Blind {
        /// `first` or `second`.
        which: &'static str,
        /// What is wrong with it.
        reason: Blindness,
    },
    /// Nothing moved by more than the noise.
    #[error("nothing moved")]
    NothingMoved,
    /// Something moved, but too little of it is seen, or in a way that no single joint explains.
    #[error("what moved cannot be told: {changed_px} pixels changed, and {why}")]
    Unclear {
        /// How many pixels changed.
        changed_px: usize,
        /// What is missing.
        why: &'static str,
    },
}

/// What is looked at.
#[derive(Debug, Clone, Copy, Default)]
pub struct Asked<'a> {
    /// Pixels of the first frame that may have moved; all without it.
    pub before: Option<&'a [bool]>,
    /// Pixels of the second frame; all without it.
    pub after: Option<&'a [bool]>,
}

/// The parts that moved between two frames, the one with the most evidence first.
///
/// Frames carry their cameras' poses in one world with z up; the camera may have moved. Everything that changed and is
/// asked for is taken for parts on joints: the robot's own pixels are to be left out by `asked`.
///
/// # Errors
/// Nothing moved, or what moved cannot be told: an ordinary answer.
pub fn moved_parts(
    before: &RgbdFrame,
    after: &RgbdFrame,
    asked: &Asked,
    config: &GrounderConfig,
) -> Result<Vec<MovedPart>, NotTold> {
    let view =
        |frame, mask, which| View::new(frame, mask, config).map_err(|(reason, _)| NotTold::Blind { which, reason });
    let views = [view(before, asked.before, "first")?, view(after, asked.after, "second")?];
    let mut changed = Changed::between(&views);
    let changed_px = changed.count();
    if changed_px < LEAST_CHANGED_PX {
        return Err(NotTold::NothingMoved);
    }
    let mut found = Vec::new();
    for _ in 0..MOST_PARTS {
        if changed.largest() < LEAST_CHANGED_PX || (changed.largest() as f64) < LEAST_SHARE * changed_px as f64 {
            break;
        }
        let Some(best) = search::best_motion(&views, &changed, config) else { break };
        let pixels = part::pixels(&views, &changed, &best);
        changed.remove(&pixels);
        let [before, after] = pixels;
        found.push(MovedPart { before, after, joint: best.model(), confidence: best.confidence });
    }
    if found.is_empty() {
        return Err(NotTold::Unclear { changed_px, why: "no slide and no turn agrees with both frames" });
    }
    Ok(found)
}
