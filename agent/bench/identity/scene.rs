//! A scene that is seen twice: what is remembered from the first time, and who is who the second time.

use acm_concept::{ids::ObjectId, template::TemplateLibrary};
use acm_memory::{
    AcmMemory, IdentityRule,
    staging::{Thing, begin, look, open_hand},
};
use anyhow::Context;
use glam::DVec3;
use rand::{Rng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use std::{collections::BTreeMap, sync::Arc};

/// A thing of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Item {
    /// What it is: equal for identical copies.
    pub kind: String,
    /// Where the middle of its base is, metres.
    pub position: DVec3,
    /// Length, width and height, metres.
    pub size: [f64; 3],
    /// Standard deviation of the noise on each coordinate of its position the second time, metres.
    pub noise_m: f64,
}

/// What happens to a scene until it is seen again.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Change {
    /// Probability that a thing is missed.
    pub missed: f64,
    /// Newcomers for each thing, on average: copies of things of the scene at other places.
    pub newcomers: f64,
}

/// An answer for a thing that was seen the second time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Answer {
    /// Which item it is; `None` for a newcomer.
    pub truth: Option<usize>,
    /// Whether the answer is right: the same identity as the first time, or a new one for a newcomer.
    pub right: bool,
    /// The probability that memory gave its answer.
    pub probability: f64,
    /// Whether the identity was given to another thing of the same frame too.
    pub doubled: bool,
}

/// Shows a scene to a fresh memory twice and tells how it named the things the second time.
///
/// # Errors
/// The memory takes no frame.
pub fn seen_twice(
    items: &[Item],
    rule: IdentityRule,
    change: Change,
    library: &Arc<TemplateLibrary>,
    random: &mut ChaCha8Rng,
) -> anyhow::Result<Vec<Answer>> {
    let mut memory = AcmMemory::in_memory(Arc::clone(library)).with_identity(rule);
    begin(&mut memory)?;
    let first: Vec<Thing> = items.iter().map(|item| thing(item, item.position)).collect();
    let named = look(&mut memory, 0, 0.0, &first, &[], &open_hand(0.0))?;
    let mut known: BTreeMap<usize, ObjectId> = BTreeMap::new();
    for found in &named.resolved {
        known.insert(found.percept, found.object);
    }
    let mut again: Vec<(Option<usize>, Thing)> = Vec::new();
    for (index, item) in items.iter().enumerate() {
        let moved = item.position + noise(random, item.noise_m);
        if !random.random_bool(change.missed) {
            again.push((Some(index), thing(item, moved).spread(item.noise_m.max(1e-4))));
        }
        if random.random_bool(change.newcomers) {
            let at = newcomer(items, item, random);
            again.push((None, thing(item, at).spread(item.noise_m.max(1e-4))));
        }
    }
    again.shuffle(random);
    let things: Vec<Thing> = again.iter().map(|(_, thing)| thing.clone()).collect();
    let second = look(&mut memory, 1, 1.0, &things, &[], &open_hand(1.0))?;
    let mut given: BTreeMap<ObjectId, u32> = BTreeMap::new();
    for found in &second.resolved {
        *given.entry(found.object).or_default() += 1;
    }
    let mut answers: Vec<Answer> = again
        .iter()
        .map(|(truth, _)| Answer { truth: *truth, right: false, probability: 0.0, doubled: false })
        .collect();
    for found in &second.resolved {
        let answer = answers.get_mut(found.percept).context("an answer for a percept that was not shown")?;
        answer.right = match answer.truth {
            Some(index) => known.get(&index) == Some(&found.object),
            None => found.new,
        };
        answer.probability = found.probability;
        answer.doubled = given.get(&found.object).is_some_and(|count| *count > 1);
    }
    Ok(answers)
}

fn thing(item: &Item, at: DVec3) -> Thing {
    // Equal for identical copies, and else as different as chance makes it.
    let hash = item
        .kind
        .bytes()
        .fold(0xcbf2_9ce4_8422_2325_u64, |h, byte| (h ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
    let [red, green, blue, ..] = hash.to_le_bytes();
    Thing::block(item.size).at(at.x, at.y, at.z).colored([red, green, blue])
}

/// How far beyond the outermost things newcomers stand, metres.
const AROUND_M: f64 = 0.3;

/// A place anywhere about the scene.
fn newcomer(items: &[Item], like: &Item, random: &mut ChaCha8Rng) -> DVec3 {
    let low = items.iter().map(|item| item.position).fold(like.position, DVec3::min) - AROUND_M;
    let high = items.iter().map(|item| item.position).fold(like.position, DVec3::max) + AROUND_M;
    DVec3::new(random.random_range(low.x..=high.x), random.random_range(low.y..=high.y), like.position.z)
}

/// Gaussian noise in the plane, by Box and Muller.
fn noise(random: &mut ChaCha8Rng, sigma: f64) -> DVec3 {
    let mut normal = || {
        let (a, b): (f64, f64) = (random.random_range(1e-12..1.0), random.random());
        (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
    };
    DVec3::new(sigma * normal(), sigma * normal(), 0.0)
}
