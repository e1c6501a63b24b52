//! Household rooms with many identical copies, seen again with noise that is a share of the distance between copies.

use super::scene::{Answer, Change, Item, seen_twice};
use acm_concept::template::TemplateLibrary;
use acm_memory::IdentityRule;
use anyhow::Context;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::Deserialize;
use std::{collections::BTreeMap, sync::Arc};

/// Side of a thing whose size nobody tells, metres.
const UNKNOWN_SIZE_M: f64 = 0.1;

#[derive(Deserialize)]
struct Episode {
    object_poses: Vec<(String, [f64; 3], [f64; 3])>,
}

/// Extents in metres by kind of thing.
pub type Sizes = BTreeMap<String, [f64; 3]>;

/// The rooms of a text with one episode a line: those that hold identical copies, each with its things.
///
/// # Errors
/// A line is no episode.
pub fn rooms(text: &str, sizes: &Sizes, wanted: usize) -> anyhow::Result<Vec<Vec<Item>>> {
    let mut rooms = Vec::new();
    // Episodes of the same room follow each other: every seventh gives different ones.
    for (number, line) in text.lines().enumerate().step_by(7) {
        if rooms.len() >= wanted {
            break;
        }
        let episode: Episode = serde_json::from_str(line).with_context(|| format!("episode {number}"))?;
        let item = |(name, [x, y, z], _): &(String, [f64; 3], [f64; 3])| {
            let kind = name.split('_').next().unwrap_or(name).to_lowercase();
            // y points up there, in a left-handed frame.
            let position = DVec3::new(*x, *z, *y);
            let size = sizes.get(&kind).copied().unwrap_or([UNKNOWN_SIZE_M; 3]);
            Item { kind: name.to_lowercase(), position, size, noise_m: 0.0 }
        };
        let items: Vec<Item> = episode.object_poses.iter().map(item).collect();
        if spacing(&items).iter().any(Option::is_some) {
            rooms.push(items);
        }
    }
    Ok(rooms)
}

/// How far each thing is from its nearest identical copy, metres; `None` for one without.
pub fn spacing(items: &[Item]) -> Vec<Option<f64>> {
    let nearest = |(index, item): (usize, &Item)| {
        let others = items.iter().enumerate().filter(|(other, copy)| *other != index && copy.kind == item.kind);
        others.map(|(_, copy)| copy.position.distance(item.position)).reduce(f64::min)
    };
    items.iter().enumerate().map(nearest).collect()
}

/// Answers by whether the thing has an identical copy, over all rooms.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Seen {
    /// Of things that have copies, and of newcomers, which always have.
    pub copies: Vec<Answer>,
    /// Of the others.
    pub singles: Vec<Answer>,
}

/// Shows every room twice. The noise is the given share of the distance to the nearest copy; things without a copy get
/// the smallest noise of the room.
///
/// # Errors
/// A memory takes no frame.
pub fn seen(
    rooms: &[Vec<Item>],
    share: f64,
    change: Change,
    rule: IdentityRule,
    library: &Arc<TemplateLibrary>,
) -> anyhow::Result<Seen> {
    let mut seen = Seen::default();
    for (room, seed) in rooms.iter().zip(0..) {
        let spacing = spacing(room);
        let least = spacing.iter().flatten().copied().fold(f64::INFINITY, f64::min);
        let noisy =
            |(item, spacing): (&Item, &Option<f64>)| Item { noise_m: share * spacing.unwrap_or(least), ..item.clone() };
        let items: Vec<Item> = room.iter().zip(&spacing).map(noisy).collect();
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        for answer in seen_twice(&items, rule, change, library, &mut random)? {
            let has_copy = answer.truth.is_none_or(|index| spacing.get(index).is_some_and(Option::is_some));
            if has_copy { seen.copies.push(answer) } else { seen.singles.push(answer) }
        }
    }
    Ok(seen)
}
