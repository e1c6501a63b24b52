//! What the cameras saw: each frame of a run with what perception and memory made of it.

mod odds;

pub use odds::{Odds, odds};

use super::run_file::{Entry, RunFile};
use acm_concept::{
    camera::FrameHeader,
    ids::{FrameId, ObjectId},
    object::Visibility,
    pose::Pose,
};
use acm_memory::observation::Grounding;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Radius of the box around a remembered place of which no percept tells, metres.
const PLACE_RADIUS_M: f64 = 0.06;

/// A frame and what was made of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Sight {
    /// Its number, camera, time, calibration and the camera's pose.
    pub header: FrameHeader,
    /// The message that brought it.
    pub seq: u64,
    /// The message that took it into memory, where the trace has it.
    pub updated: Option<u64>,
    /// What perception grounded on it.
    pub seen: Vec<Seen>,
    /// What memory expected of it, with what the frame says.
    pub expected: Vec<(ObjectId, Visibility)>,
    /// Why nothing could be grounded, if so.
    pub blindness: Option<String>,
    /// The first frame of this camera whose colour is the same bit for bit: a sensor with noise gives no two.
    pub same_as: Option<FrameId>,
}

/// Something that a frame shows.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Seen {
    /// The identity that memory gave it; none for a false alarm, and where the trace ends before.
    pub object: Option<ObjectId>,
    /// Whether memory took it over.
    pub accepted: bool,
    /// Most likely category.
    pub category: String,
    /// Probability that it is an object and its grounding is right, 0-1.
    pub confidence: f64,
    /// First column, first row, last column, last row; pixels of the whole frame.
    pub bounds: [u32; 4],
    /// Where its main part is, world frame, metres.
    pub at: Option<DVec3>,
}

#[derive(Deserialize)]
struct Body<T> {
    body: T,
}
#[derive(Deserialize)]
struct FrameBody {
    header: FrameHeader,
}
#[derive(Deserialize)]
struct PerceptsBody {
    percepts: SeenPercepts,
}
/// The part of percepts that is shown; their masks and parts are left unread.
#[derive(Deserialize)]
struct SeenPercepts {
    frame: FrameName,
    objects: Vec<SeenObject>,
    expected: Vec<SeenExpected>,
    blindness: Option<String>,
}
#[derive(Deserialize)]
struct FrameName {
    id: FrameId,
}
#[derive(Deserialize)]
struct SeenObject {
    category: String,
    confidence: f64,
    support: Bounds,
    parts: Vec<SeenPart>,
}
#[derive(Deserialize)]
struct SeenPart {
    pose: SeenPose,
}
#[derive(Deserialize)]
struct SeenPose {
    pose: Pose,
}
#[derive(Deserialize)]
struct Bounds {
    bounds: [u32; 4],
}
#[derive(Deserialize)]
struct SeenExpected {
    object: ObjectId,
    visibility: Visibility,
}
#[derive(Deserialize)]
struct UpdatedBody {
    grounding: Grounding,
}

/// The frames of a run by their numbers. Messages of another form than today's are passed over.
pub fn sights(run: &RunFile) -> BTreeMap<FrameId, Sight> {
    let (mut sights, mut last) = (BTreeMap::new(), None);
    let same_as = same_pictures(run);
    for entry in &run.entries {
        match entry.header.kind.as_str() {
            "frame" => {
                let Some(FrameBody { header }) = body(entry) else { continue };
                let same_as = same_as.get(&header.id).copied();
                let sight = Sight { same_as, ..Sight::new(header, entry.header.seq) };
                sights.insert(sight.header.id, sight);
            }
            "percepts" => {
                let Some(PerceptsBody { percepts }) = body(entry) else { continue };
                last = Some(percepts.frame.id);
                if let Some(sight) = sights.get_mut(&percepts.frame.id) {
                    sight.take(percepts);
                }
            }
            "updated" => {
                let Some(sight) = last.take().and_then(|frame| sights.get_mut(&frame)) else { continue };
                let Some(UpdatedBody { grounding }) = body(entry) else { continue };
                sight.updated = Some(entry.header.seq);
                for resolved in grounding.resolved {
                    if let Some(seen) = sight.seen.get_mut(resolved.percept) {
                        (seen.object, seen.accepted) = (Some(resolved.object), resolved.accepted);
                    }
                }
            }
            _ => {}
        }
    }
    sights
}

/// For each frame whose colour was there before, bit for bit, the first one that had it.
fn same_pictures(run: &RunFile) -> BTreeMap<FrameId, FrameId> {
    let (mut first, mut same) = (BTreeMap::new(), BTreeMap::new());
    for effect in run.effects.iter().filter(|effect| effect.kind == "frame") {
        let text = |name: &str| effect.record.get(name).and_then(|value| value.as_str());
        let (Some(camera), Some(hash)) = (text("camera"), text("color_blake3")) else { continue };
        let Some(frame) = text("frame").and_then(|frame| frame.parse::<FrameId>().ok()) else { continue };
        let earlier = *first.entry((camera, hash)).or_insert(frame);
        if earlier != frame {
            same.insert(frame, earlier);
        }
    }
    same
}

fn body<T: for<'a> Deserialize<'a>>(entry: &Entry) -> Option<T> {
    serde_json::from_slice::<Body<T>>(entry.raw()).ok().map(|whole| whole.body)
}

impl Sight {
    /// A frame of which nothing is known but that a message brought it.
    fn new(header: FrameHeader, seq: u64) -> Sight {
        let (seen, expected) = (Vec::new(), Vec::new());
        Sight { header, seq, updated: None, seen, expected, blindness: None, same_as: None }
    }

    fn take(&mut self, percepts: SeenPercepts) {
        self.blindness = percepts.blindness;
        self.expected = percepts.expected.into_iter().map(|view| (view.object, view.visibility)).collect();
        let seen = |object: SeenObject| Seen {
            object: None,
            accepted: false,
            category: object.category,
            confidence: object.confidence,
            bounds: object.support.bounds,
            at: object.parts.first().map(|part| part.pose.pose.translation),
        };
        self.seen = percepts.objects.into_iter().map(seen).collect();
    }

    /// Where the frame shows an object.
    pub fn of(&self, object: ObjectId) -> Option<&Seen> {
        self.seen.iter().find(|seen| seen.object == Some(object))
    }

    /// What the frame says of an object that was expected in it.
    pub fn visibility(&self, object: ObjectId) -> Option<Visibility> {
        self.expected.iter().find(|(expected, _)| *expected == object).map(|(_, visibility)| *visibility)
    }

    /// The pixels around a place of the world (metres), by the camera's nominal calibration and pose; none for a place
    /// that it does not cover.
    pub fn around(&self, place: DVec3) -> Option<[u32; 4]> {
        let intrinsics = &self.header.intrinsics;
        let point = self.header.camera_pose.inverse().transform_point(place);
        let at = intrinsics.project(point).filter(|at| intrinsics.contains(*at))?;
        let radius = intrinsics.fx * PLACE_RADIUS_M / point.z;
        let clamp = |value: f64, size: u32| value.clamp(0.0, f64::from(size.saturating_sub(1))).round() as u32;
        let (width, height) = (intrinsics.width, intrinsics.height);
        Some([
            clamp(at.x - radius, width),
            clamp(at.y - radius, height),
            clamp(at.x + radius, width),
            clamp(at.y + radius, height),
        ])
    }
}

/// The word for what a frame says of an expected object.
pub fn visibility_word(visibility: Visibility) -> &'static str {
    match visibility {
        Visibility::Seen => "seen",
        Visibility::Occluded => "hidden behind something nearer",
        Visibility::OutOfView => "out of view",
        Visibility::SeenThrough => "not there: what lies behind it was seen",
        Visibility::NotMeasured => "no depth was measured there",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::{camera::Intrinsics, time::Time};

    #[test]
    fn a_place_is_boxed_where_the_camera_sees_it() {
        let header = FrameHeader {
            id: FrameId(1),
            camera: "a".into(),
            time: Time(0),
            intrinsics: Intrinsics { width: 200, height: 100, fx: 100.0, fy: 100.0, cx: 99.5, cy: 49.5 },
            camera_pose: Pose::from_translation(DVec3::new(0.0, 0.0, -2.0)),
        };
        let sight = Sight::new(header, 1);
        // Two metres ahead six centimetres are three pixels.
        assert_eq!(sight.around(DVec3::ZERO), Some([97, 47, 103, 53]));
        assert_eq!(sight.around(DVec3::new(0.0, 0.0, -3.0)), None);
        assert_eq!(sight.around(DVec3::new(5.0, 0.0, 0.0)), None);
    }
}
