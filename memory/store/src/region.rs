//! What was searched when. What was not found where somebody looked is absent for a while; elsewhere it is unknown.

use crate::{Nanos, event::Sure, symbols::Symbol};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Most searches that are remembered of one region and category.
const MAX_SEARCHES: usize = 32;

/// One look at a region.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Search {
    /// When.
    pub valid: Nanos,
    /// Sequence number of the event.
    pub sequence: u64,
    /// Share of the region that was seen, times the chance to see what is there, 0-1.
    pub share: f32,
}

/// All looks, by region and category (0: anything).
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Regions(BTreeMap<(Symbol, Symbol), Vec<Search>>);

impl Regions {
    pub(crate) fn add(&mut self, region: Symbol, category: Symbol, search: Search) {
        let searches = self.0.entry((region, category)).or_default();
        if searches.len() >= MAX_SEARCHES {
            searches.remove(0);
        }
        searches.push(search);
    }
    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = (Symbol, Symbol, &Search)> {
        self.0.iter().flat_map(|((region, category), all)| all.iter().map(move |search| (*region, *category, search)))
    }
    /// The chance that something of a category that was in a region at `now` would have been found: each look counts less
    /// the longer ago it was, by half in `half_life`. `categories` are the category and all that it is a kind of.
    pub fn found(&self, region: Symbol, categories: &[Symbol], now: Nanos, half_life: Nanos) -> f32 {
        let mut missed = 1.0f32;
        for category in categories.iter().chain([&0]) {
            for search in self.0.get(&(region, *category)).into_iter().flatten().filter(|search| search.valid <= now) {
                let age = (now - search.valid) as f64 / half_life.max(1) as f64;
                missed *= 1.0 - search.share.clamp(0.0, 1.0) * (-age).exp2() as f32;
            }
        }
        1.0 - missed
    }
}

/// Whether something is somewhere, from what is known and where somebody looked.
pub fn answer(known: f32, found: f32, decided: f32) -> (Sure, f32) {
    if known >= decided {
        (Sure::Yes, known)
    } else if (1.0 - known) * found >= decided {
        (Sure::No, (1.0 - known) * found)
    } else {
        (Sure::Unknown, 0.0)
    }
}
