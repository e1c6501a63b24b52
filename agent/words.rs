//! Words for what memory holds, as every story of an episode uses them.

use acm_concept::template::TemplateLibrary;
use acm_memory::entry::ObjectEntry;
use glam::DVec3;

/// Length, width and height: `15.3x6.3x19.1 cm`; nothing for an object without solids.
pub fn size(object: &ObjectEntry, library: &TemplateLibrary) -> String {
    library.extents_of(&object.parts).map_or_else(String::new, |size| {
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
