//! What `acm scenario preview --info` says of an object's model: links, joints, ranges, masses, and for one from a
//! robotics format what its file said and what could not be taken as it was.

use super::{Link, ObjectModel, joint::JointKind};
use crate::articulation::Articulation;
use std::fmt::Write;

/// One line a link, then warnings. `links` are as this copy is made, `joints` as they are now.
pub(crate) fn lines(model: &ObjectModel, links: &[Link], joints: &[(usize, Articulation)]) -> Vec<String> {
    let mut lines = Vec::new();
    if links.len() > 1 || model.loaded.is_some() {
        lines.push(format!("{}: {} links, {} joints", model.summary, links.len(), joints.len()));
        lines.extend((0..links.len()).map(|at| line(model, links, at, joints)));
    }
    let warnings = model.loaded.iter().flat_map(|loaded| &loaded.warnings);
    lines.extend(warnings.map(|warning| format!("warning: {warning}")));
    lines
}

fn line(model: &ObjectModel, links: &[Link], at: usize, joints: &[(usize, Articulation)]) -> String {
    let link = &links[at];
    let solids = link.pieces.iter().filter(|piece| piece.solid).count();
    let mut line = format!("  {:<18} {:>7.3} kg, {solids} solids", link.name, link.mass_kg());
    let loaded = model.loaded.as_ref();
    if let Some(mass) = loaded.and_then(|loaded| loaded.masses_kg.get(at).copied().flatten()) {
        add(&mut line, format_args!(" (file: {mass:.3} kg)"));
    }
    let Some((_, made)) = joints.iter().find(|(known, _)| *known == at) else {
        if at > 0 {
            add(&mut line, format_args!(", fixed to {}", links[link.parent].name));
        }
        return line;
    };
    let joint = &made.joint;
    let (kind, unit, force) = match joint.kind {
        JointKind::Hinge => ("hinge", "rad", "N m"),
        JointKind::Slider => ("slider", "m", "N"),
    };
    let range = joint.range.map_or("without end".into(), |[low, high]| format!("{low:.3} to {high:.3} {unit}"));
    let parent = &links[link.parent].name;
    add(&mut line, format_args!(", {kind} on {parent}, {range}, at {:.3}", made.position));
    add(&mut line, format_args!(", friction {:.2} {force}, damping {:.3}", joint.friction, joint.damping));
    if let Some(original) = loaded.and_then(|loaded| loaded.originals.get(at).copied().flatten()) {
        add(&mut line, format_args!(" (file: friction {}, damping {})", original.friction, original.damping));
    }
    line
}

/// Writing to a string cannot fail.
fn add(line: &mut String, text: std::fmt::Arguments) {
    line.write_fmt(text).unwrap_or_default();
}
