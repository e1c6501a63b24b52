//! The pixels that moved along.

use super::{
    change::Changed,
    search::Found,
    view::{Sight, View},
};
use acm_concept::pose::Pose;

/// A pixel's point, moved, is met where the other frame measured it within so many standard deviations.
const MET: f64 = 3.0;

/// The pixels of the part in both frames.
pub(super) fn pixels(views: &[View; 2], changed: &Changed, found: &Found) -> [Vec<usize>; 2] {
    let motion = found.screw.pose();
    [own(views, changed, &motion, 0), own(views, changed, &motion.inverse(), 1)]
}

fn own(views: &[View; 2], changed: &Changed, motion: &Pose, frame: usize) -> Vec<usize> {
    let (view, other) = (&views[frame], &views[1 - frame]);
    let grid = view.grid();
    let met = |sight: Sight| matches!(sight, Sight::Beyond { sigmas, .. } if sigmas.abs() < MET);
    let mask: Vec<bool> = (0..grid.len())
        .map(|pixel| {
            if changed.masks[frame][pixel] {
                return true;
            }
            if !view.takes(pixel) {
                return false;
            }
            let point = view.point(pixel);
            met(other.sight(motion.transform_point(point))) && !met(other.sight(point))
        })
        .collect();
    let around = grid.count(&mask, 2);
    (0..grid.len()).filter(|pixel| view.takes(*pixel) && around[*pixel] >= 13).collect()
}
