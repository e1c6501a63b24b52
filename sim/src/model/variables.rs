//! What can be known of an object's state, by name: for the judge, for events, for lamps and gauges.

use super::{ObjectModel, joint::Joint};

/// Of every object: base frame in metres, speed in m/s and rad/s, angle from upright, turn about z without the tilt,
/// distance and turn from the start, pads in contact.
pub(crate) const OF_OBJECT: [&str; 10] = ["x", "y", "z", "speed", "spin", "tilt", "yaw", "moved", "turned", "touched"];
/// Of an object with a press counter, of its first one.
const OF_COUNTER: [&str; 3] = ["pressed", "presses", "depth"];

/// Names of an object's own variables in the order in which [`crate::body::Body::values`] gives them, without the
/// object's name.
pub(crate) fn own(model: &ObjectModel) -> Vec<String> {
    let mut names: Vec<String> = OF_OBJECT.iter().map(|name| name.to_string()).collect();
    if model.counter().is_some() {
        names.extend(OF_COUNTER.iter().map(|name| name.to_string()));
    }
    for (link, joint) in model.joints() {
        let link = &model.links[link].name;
        names.push(link.clone());
        names.extend(of_joint(joint).map(|name| format!("{link}_{name}")));
    }
    names
}

/// What can be known of a joint besides its position.
fn of_joint(joint: &Joint) -> impl Iterator<Item = &'static str> {
    let press: &[&str] = if joint.press.is_some() { &["pressed", "presses"] } else { &[] };
    let latch: &[&str] = if joint.latch.is_some() { &["latched"] } else { &[] };
    ["speed", "open"].iter().chain(press).chain(latch).copied()
}
