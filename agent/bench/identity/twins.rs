//! Six identical things in a row, 10 cm apart, seen again with noise.

use super::scene::{Answer, Change, Item, seen_twice};
use acm_concept::template::TemplateLibrary;
use acm_memory::IdentityRule;
use glam::DVec3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Noise (metres), share missed, newcomers a thing.
pub const SETTINGS: [(f64, f64); 6] = [(0.02, 0.0), (0.04, 0.0), (0.06, 0.0), (0.04, 0.2), (0.06, 0.2), (0.08, 0.2)];
const SPACING_M: f64 = 0.1;
const TWINS: u32 = 6;

/// All answers over a number of scenes.
///
/// # Errors
/// A memory takes no frame.
pub fn answers(
    (noise_m, share): (f64, f64),
    rule: IdentityRule,
    scenes: u64,
    library: &Arc<TemplateLibrary>,
) -> anyhow::Result<Vec<Answer>> {
    let item = |index: u32| Item {
        kind: "cube".into(),
        position: DVec3::new(SPACING_M * f64::from(index), 0.0, 0.0),
        size: [0.04; 3],
        noise_m,
    };
    let items: Vec<Item> = (0..TWINS).map(item).collect();
    let change = Change { missed: share, newcomers: share };
    let mut all = Vec::new();
    for seed in 0..scenes {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        all.extend(seen_twice(&items, rule, change, library, &mut random)?);
    }
    Ok(all)
}
