//! A frame with what was seen in it, and what memory believes that the frame does not show.

use super::{ghost, text};
use acm_concept::{
    camera::{FrameHeader, RgbdFrame},
    ids::ObjectId,
    object::Percepts,
    pose::Pose,
    template::TemplateLibrary,
};
use acm_memory::{
    MemoryView,
    entry::{ObjectEntry, Presence},
    observation::Grounding,
};
use glam::DVec3;
use image::{Rgb, RgbImage};
use std::collections::BTreeMap;

/// Something remembered at least this far from where a frame showed it is drawn where it is remembered, metres.
const ELSEWHERE_M: f64 = 0.02;
const IN_HAND: Rgb<u8> = Rgb([255, 225, 60]);

/// A frame with the outlines, names and sizes of what was seen in it.
pub struct Scene {
    image: RgbImage,
    header: FrameHeader,
    /// Where the frame showed each object, world frame, metres.
    seen: BTreeMap<ObjectId, DVec3>,
}

impl Scene {
    /// Draws a frame's percepts over it, under the identities that memory gave them.
    pub fn new(frame: &RgbdFrame, percepts: &Percepts, grounding: &Grounding, library: &TemplateLibrary) -> Scene {
        let of = |index: usize| grounding.resolved.iter().find(|r| r.percept == index).map(|r| r.object);
        let ids: Vec<Option<ObjectId>> = (0..percepts.objects.len()).map(of).collect();
        let names: Vec<Option<String>> = ids.iter().map(|id| id.map(|id| id.to_string())).collect();
        let image = acm_perception::overlay::draw(frame, percepts, &names, library);
        let places = ids.iter().zip(&percepts.objects);
        let seen = places.filter_map(|(id, object)| Some(((*id)?, object.pose()?.pose.translation))).collect();
        Scene { image, header: percepts.frame.clone(), seen }
    }

    /// Whether the frame showed an object where it is believed to be.
    pub fn shows(&self, object: &ObjectEntry) -> bool {
        let near = |(pose, at): (Pose, &DVec3)| at.distance(pose.translation) < ELSEWHERE_M;
        object.pose().zip(self.seen.get(&object.id)).is_some_and(near)
    }

    /// The picture with dashed outlines where memory believes something that the frame did not show there.
    pub fn with_beliefs(&self, view: &dyn MemoryView, library: &TemplateLibrary) -> RgbImage {
        let mut image = self.image.clone();
        let mut held = 0;
        for object in view.objects() {
            match object.presence {
                Presence::Held => {
                    let label = format!("{} is in the hand", label(object));
                    text::write(&mut image, 8, 8 + held * i64::from(text::LINE), &label, IN_HAND);
                    held += 1;
                }
                Presence::Missing => ghost::draw(&mut image, &self.header, object, library, &format!("{}?", object.id)),
                Presence::Present if self.shows(object) => {}
                Presence::Present => ghost::draw(&mut image, &self.header, object, library, &label(object)),
            }
        }
        image
    }
}

fn label(object: &ObjectEntry) -> String {
    format!("{} {}", object.id, object.category)
}
