//! Coarse-to-fine retrieval: nouns lead to categories and templates, hard filters drop, what is left is ranked by
//! a product of terms that explain the rank.

use crate::{
    entry::{ObjectEntry, Presence},
    query::{Hit, ObjectQuery, Retrieval},
    state::State,
};
use acm_concept::template::TemplateLibrary;

/// An object is not meant by a noun that fits it with less than this probability.
const NOUN_FITS: f64 = 0.05;
/// Distance at which the term `near` has fallen to 1/e, metres.
const NEAR_M: f64 = 0.3;

/// Objects that fit a description.
pub(crate) fn retrieve(state: &State, library: &TemplateLibrary, query: &ObjectQuery) -> Retrieval {
    let mut retrieval = Retrieval::default();
    for entry in state.objects.iter() {
        let category = query.nouns.iter().map(|noun| noun_probability(entry, noun, library)).fold(0.0, f64::max);
        let category = if query.nouns.is_empty() { 1.0 } else { category };
        match filter(entry, query, category) {
            Some(name) => retrieval.dropped.push((entry.id, name.into())),
            None => {
                retrieval.scored += 1;
                retrieval.hits.push(score(entry, query, category));
            }
        }
    }
    // Stable: equal scores stay in the order of ids.
    retrieval.hits.sort_by(|a, b| b.score.total_cmp(&a.score));
    retrieval
}

/// Probability that people would call the object by a noun. A noun of a template applies to all of its parts
/// whose parameters meet the noun's condition, so a cube is a block as well.
pub(crate) fn noun_probability(entry: &ObjectEntry, noun: &str, library: &TemplateLibrary) -> f64 {
    let named = entry.categories.iter().find(|(known, _)| known == noun).map_or(0.0, |(_, probability)| *probability);
    let of_part = |part: &acm_concept::object::GroundedPart| {
        let template = library.get(&part.template)?;
        if !template.nouns(&part.values()).contains(&noun) {
            return None;
        }
        let is_own = |known: &&(String, f64)| template.synopsis.nouns.iter().any(|n| n.noun == known.0);
        let mass: f64 = entry.categories.iter().filter(is_own).map(|(_, probability)| probability).sum();
        // A part beside the main one is known by its template alone.
        Some(if mass > 0.0 { mass.min(1.0) } else { 1.0 })
    };
    entry.parts.iter().filter_map(of_part).fold(named, f64::max)
}

/// The name of the first hard filter that drops an object.
fn filter(entry: &ObjectEntry, query: &ObjectQuery, category: f64) -> Option<&'static str> {
    let any_part = |has: &dyn Fn(&acm_concept::object::GroundedPart) -> bool| entry.parts.iter().any(has);
    let lacks = |word: &Option<String>, list: fn(&acm_concept::object::GroundedPart) -> &[String]| {
        word.as_ref().is_some_and(|word| !any_part(&|part| list(part).contains(word)))
    };
    if query.exclude.contains(&entry.id) {
        Some("exclude")
    } else if category < NOUN_FITS {
        Some("category")
    } else if entry.presence == Presence::Missing && !query.include_missing {
        Some("presence")
    } else if lacks(&query.affordance, |part| &part.affordances) {
        Some("affordance")
    } else if lacks(&query.function, |part| &part.functions) {
        Some("function")
    } else if query.color.is_some_and(|(lab, limit)| entry.appearance.mean.distance(&lab) > limit) {
        Some("color")
    } else {
        None
    }
}

fn score(entry: &ObjectEntry, query: &ObjectQuery, category: f64) -> Hit {
    let mut terms = vec![("category".to_string(), category)];
    if let Some((lab, limit)) = query.color {
        let distance = entry.appearance.mean.distance(&lab) / limit.max(1e-9);
        terms.push(("color".into(), (-0.5 * distance * distance).exp()));
    }
    if let (Some(near), Some(pose)) = (query.near, entry.pose()) {
        terms.push(("near".into(), (-pose.translation.distance(near) / NEAR_M).exp()));
    }
    terms.push(("confidence".into(), entry.confidence));
    // Scores stay above zero, as the contract has it.
    let score = terms.iter().map(|(_, value)| value).product::<f64>().clamp(f64::MIN_POSITIVE, 1.0);
    Hit { object: entry.id, score, terms }
}
