//! Words for what memory holds, as every story of an episode uses them.

use acm_concept::{pose::Pose, solid::Solid, template::TemplateLibrary};
use acm_memory::entry::ObjectEntry;
use glam::DVec3;

/// Extents of an object's solids along the axes of its main part's frame, metres; `None` without solids.
pub fn extents(object: &ObjectEntry, library: &TemplateLibrary) -> Option<DVec3> {
    let to_main = object.pose()?.inverse();
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for part in &object.parts {
        for placed in library.solids_of(part).unwrap_or_default() {
            let half = match placed.solid {
                Solid::Box { size } => 0.5 * size,
                Solid::Cylinder { radius, height } => DVec3::new(radius, radius, 0.5 * height),
            };
            let pose: Pose = to_main * part.pose.pose * placed.pose;
            for bits in 0..8u8 {
                let sign = |bit: u8| if bits & bit == 0 { -1.0 } else { 1.0 };
                let corner = pose.transform_point(half * DVec3::new(sign(1), sign(2), sign(4)));
                (low, high) = (low.min(corner), high.max(corner));
            }
        }
    }
    (low.x <= high.x).then(|| high - low)
}

/// Length, width and height: `15.3x6.3x19.1 cm`; nothing for an object without solids.
pub fn size(object: &ObjectEntry, library: &TemplateLibrary) -> String {
    extents(object, library).map_or_else(String::new, |size| {
        let [x, y, z] = (100.0 * size).to_array();
        format!("{x:.1}x{y:.1}x{z:.1} cm")
    })
}

/// A point of the table, to the centimetre: noise below that is no news.
pub fn spot(at: DVec3) -> String {
    // No -0.00.
    let rounded = |value: f64| (100.0 * value).round() / 100.0 + 0.0;
    format!("({:.2}, {:.2})", rounded(at.x), rounded(at.y))
}
