//! What speaks against a frame: that others of its camera show the same things, all moved by the same way.

use super::Sight;
use acm_concept::ids::FrameId;
use glam::DVec3;
use std::collections::BTreeMap;

/// Things that moved alike lie within this of each other, metres. Below twice of it nothing is said to have moved.
const ALIKE_M: f64 = 0.015;
/// Fewer things than this may have moved together by chance.
const FEWEST: usize = 3;
/// Most things of a frame that are compared.
const MOST: usize = 48;

/// Frames that show things elsewhere than another frame does.
#[derive(Debug, Clone, PartialEq)]
pub struct Odds {
    /// The frames that do.
    pub frames: Vec<FrameId>,
    /// How many others agree with it.
    pub agree: usize,
    /// How far from where it shows them, on average over those frames, metres.
    pub by: DVec3,
    /// How many things the first of those frames shows so, and how many both show at most.
    pub things: (usize, usize),
}

/// What speaks against a frame; none where most others that can be compared agree with it. One thing that is carried
/// away is no reason: most of what both frames show must have gone the same way.
pub fn odds(sights: &BTreeMap<FrameId, Sight>, frame: FrameId) -> Option<Odds> {
    let own = sights.get(&frame)?;
    let of_camera = |sight: &&Sight| sight.header.camera == own.header.camera && sight.header.id != frame;
    let (mut odds, mut agree) = (Vec::new(), 0);
    for other in sights.values().filter(of_camera) {
        match shift(own, other) {
            Some(shift) if shift.by.length() > 2.0 * ALIKE_M => odds.push((other.header.id, shift)),
            Some(_) => agree += 1,
            None => {}
        }
    }
    let (_, first) = odds.first()?;
    (odds.len() >= agree.max(1)).then(|| Odds {
        frames: odds.iter().map(|(id, _)| *id).collect(),
        agree,
        by: odds.iter().map(|(_, shift)| shift.by).sum::<DVec3>() / odds.len() as f64,
        things: (first.things, first.of),
    })
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Shift {
    by: DVec3,
    things: usize,
    of: usize,
}

/// The one way by which most things of a frame went to where another frame shows them; none where there is no such way.
fn shift(from: &Sight, to: &Sight) -> Option<Shift> {
    let (before, after) = (places(from), places(to));
    let of = before.len().min(after.len());
    let pairs = before.iter().flat_map(|a| after.iter().filter(|b| b.0 == a.0).map(|b| b.1 - a.1));
    let best = pairs.map(|by| supporters(&before, &after, by)).max_by(|a, b| {
        let shorter = |ways: &[DVec3]| ways.first().map_or(0.0, |way| -way.length());
        a.len().cmp(&b.len()).then(shorter(a).total_cmp(&shorter(b)))
    })?;
    let things = best.len();
    let by = best.iter().sum::<DVec3>() / things.max(1) as f64;
    (things >= FEWEST && 2 * things > of).then_some(Shift { by, things, of })
}

/// The ways of the things that went about as far as `by`, each thing counted once.
fn supporters(before: &[(&str, DVec3)], after: &[(&str, DVec3)], by: DVec3) -> Vec<DVec3> {
    let mut free: Vec<&(&str, DVec3)> = after.iter().collect();
    let mut ways = Vec::new();
    for (category, at) in before {
        let there = free.iter().position(|(of, place)| of == category && (*place - *at - by).length() <= ALIKE_M);
        if let Some(there) = there {
            ways.push(free.swap_remove(there).1 - *at);
        }
    }
    ways
}

/// Categories and places of the things that a frame shows.
fn places(sight: &Sight) -> Vec<(&str, DVec3)> {
    sight.seen.iter().filter_map(|seen| Some((seen.category.as_str(), seen.at?))).take(MOST).collect()
}

#[cfg(test)]
mod tests {
    use super::{super::Seen, *};
    use acm_concept::{
        camera::{FrameHeader, Intrinsics},
        pose::Pose,
        time::Time,
    };

    fn sight(frame: u64, things: &[(&str, f64, f64)], aside: f64) -> (FrameId, Sight) {
        let seen = |(category, x, y): &(&str, f64, f64)| Seen {
            object: None,
            accepted: true,
            category: (*category).into(),
            confidence: 1.0,
            bounds: [0; 4],
            at: Some(DVec3::new(x + aside, *y, 0.7)),
        };
        let header = FrameHeader {
            id: FrameId(frame),
            camera: "head".into(),
            time: Time(frame),
            intrinsics: Intrinsics { width: 2, height: 2, fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 },
            camera_pose: Pose::IDENTITY,
        };
        let seen = things.iter().map(seen).collect();
        (FrameId(frame), Sight { seen, ..Sight::new(header, frame) })
    }

    const THINGS: [(&str, f64, f64); 5] =
        [("mat", 0.0, 0.1), ("mat", 0.12, 0.1), ("mat", 0.24, 0.1), ("cube", 0.12, 0.1), ("button", 0.3, -0.2)];

    #[test]
    fn the_frame_that_shows_all_things_aside_stands_out() {
        // Shifted by the mats' own spacing, so that each but one lies where another was.
        let sights: BTreeMap<_, _> = [sight(0, &THINGS, 0.12), sight(1, &THINGS, 0.0), sight(2, &THINGS, 0.002)].into();
        let told = odds(&sights, FrameId(0)).unwrap();
        assert_eq!((told.frames, told.agree, told.things), (vec![FrameId(1), FrameId(2)], 0, (5, 5)));
        assert!((told.by - DVec3::new(-0.119, 0.0, 0.0)).length() < 1e-9, "{}", told.by);
        // The others disagree with one frame and agree with each other.
        let one = odds(&sights, FrameId(1));
        assert!(one.is_none_or(|told| told.frames == [FrameId(0)] && told.agree == 1));
    }

    #[test]
    fn things_that_are_carried_speak_against_no_frame() {
        let mut moved = THINGS;
        (moved[3].1, moved[3].2) = (0.4, 0.3);
        let sights: BTreeMap<_, _> = [sight(0, &THINGS, 0.0), sight(1, &moved, 0.0)].into();
        assert_eq!([FrameId(0), FrameId(1)].map(|frame| odds(&sights, frame)), [None, None]);
        // Two things say too little.
        let sights: BTreeMap<_, _> = [sight(0, &THINGS[..2], 0.0), sight(1, &THINGS[..2], 0.1)].into();
        assert_eq!(odds(&sights, FrameId(0)), None);
    }
}
