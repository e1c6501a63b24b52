//! The answer for a person.

use super::{Crop, How, Kind, Node, Why};
use std::{
    collections::BTreeMap,
    io::{self, Write},
};

/// Width of the column with the titles.
const TITLE: usize = 14;

/// What is printed, in this order, under these titles.
const SECTIONS: [(Kind, &str); 10] = [
    (Kind::Decision, "decided"),
    (Kind::Instruction, "asked by"),
    (Kind::Model, "model"),
    (Kind::Reference, "meant"),
    (Kind::Belief, "believed"),
    (Kind::Rejected, "not chosen"),
    (Kind::Outcome, "came out"),
    (Kind::Entry, "memory read"),
    (Kind::Change, "written by"),
    (Kind::Frame, "seen in"),
];

/// Prints the answer.
pub fn print(why: &Why, out: &mut impl Write) -> io::Result<()> {
    let roles = roles(why);
    chain(why, out)?;
    for (kind, title) in SECTIONS {
        let mut nodes: Vec<&Node> = why.nodes.iter().filter(|node| node.kind == kind).collect();
        if matches!(kind, Kind::Change | Kind::Frame) {
            nodes.sort_by_key(|node| node.seq);
        }
        for (index, node) in nodes.into_iter().enumerate() {
            write!(out, "{:<TITLE$}", if index == 0 { title } else { "" })?;
            one(node, roles.get(node.id.as_str()).map_or(&[], Vec::as_slice), out)?;
        }
    }
    for (index, lack) in why.lacks.iter().enumerate() {
        writeln!(out, "{:<TITLE$}{}", if index == 0 { "NOT IN TRACE" } else { "" }, plain(lack))?;
    }
    Ok(())
}

/// For each node, what points at it, as `role from`.
fn roles(why: &Why) -> BTreeMap<&str, Vec<String>> {
    let mut roles: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for link in &why.links {
        let told = roles.entry(&link.to).or_default();
        // Only entries, changes and frames have names that stand in the text.
        let role = match link.from.starts_with(['O', 'F', 'e']) {
            true => format!("{} {}", link.role, link.from),
            false => link.role.to_owned(),
        };
        if !told.contains(&role) {
            told.push(role);
        }
    }
    roles
}

fn chain(why: &Why, out: &mut impl Write) -> io::Result<()> {
    let chain = why.nodes.iter().filter(|node| matches!(node.kind, Kind::Message | Kind::Messages));
    for (index, node) in chain.enumerate() {
        let title = if index == 0 { format!("why {}", why.seq) } else { "caused by".into() };
        writeln!(out, "{title:<TITLE$}{}  {}", stamp(node), plain(&node.title))?;
    }
    Ok(())
}

/// Number and time of a node's message.
fn stamp(node: &Node) -> String {
    let seq = node.seq.map_or_else(String::new, |seq| seq.to_string());
    let time = node.t.map_or_else(String::new, |t| format!("{t:.2} s"));
    format!("{seq:>6} {time:>9}")
}

fn one(node: &Node, roles: &[String], out: &mut impl Write) -> io::Result<()> {
    let title = plain(&node.title);
    match node.kind {
        Kind::Belief => writeln!(out, "{title}   [{}]", node.lines.join(", "))?,
        Kind::Entry => {
            writeln!(out, "{title}   [{}]", roles.join(", "))?;
            lines(&node.lines, out)?;
        }
        Kind::Change => {
            let evidence =
                if node.lines.is_empty() { String::new() } else { format!("   [{}]", node.lines.join(", ")) };
            writeln!(out, "{}  {} {title}{evidence}", stamp(node), node.id)?;
        }
        Kind::Frame => {
            writeln!(out, "{}  {title}", stamp(node))?;
            lines(&node.lines, out)?;
            for crop in &node.crops {
                writeln!(out, "{:TITLE$}  {}", "", crop_words(crop))?;
            }
        }
        _ => {
            writeln!(out, "{title}")?;
            lines(&node.lines, out)?;
        }
    }
    Ok(())
}

fn lines(lines: &[String], out: &mut impl Write) -> io::Result<()> {
    lines.iter().try_for_each(|line| writeln!(out, "{:TITLE$}  {}", "", plain(line)))
}

fn crop_words(crop: &Crop) -> String {
    let at = match crop.bounds {
        Some([left, top, right, bottom]) => format!("columns {left}-{right}, rows {top}-{bottom}"),
        None => "no pixels".into(),
    };
    let how = match (crop.how, crop.bounds) {
        (How::Seen, _) => format!("seen as {}", crop.label),
        (How::Projected, Some(_)) => format!("was believed there; {}", crop.label),
        (How::Projected, None) => crop.label.clone(),
    };
    let file = crop.file.as_ref().map_or_else(String::new, |file| format!("   {file}"));
    format!("{}  {at}  {}{file}", crop.object, plain(&how))
}

/// Text of a file that nobody vouches for: control characters become blanks.
fn plain(text: &str) -> String {
    text.chars().map(|sign| if sign.is_control() { ' ' } else { sign }).collect()
}
