//! Global one-to-one assignment with a "new" option, and the probability of each of its pairs.

use super::{Match, likelihood::Scores, predict::Prediction};
use acm_concept::ids::ObjectId;
use pathfinding::prelude::{Matrix, kuhn_munkres};
use std::collections::BTreeMap;

/// Log-likelihoods become integers for the assignment in these steps.
const STEPS: f64 = 1e4;
/// The score of a pair beyond the gates, natural logarithm.
const IMPOSSIBLE: f64 = -1e4;
/// Components in which percepts compete for more objects than this get approximate probabilities.
const MAX_EXACT: usize = 13;
/// Other identities below this probability are not worth a word.
const WORTH_NAMING: f64 = 0.1;

/// What is known before a frame of whether things are found that should be: so many that were, and that were not.
const PRIOR_FOUND: (f64, f64) = (4.5, 0.5);
/// What is known before a frame of newcomers: so many in so many frames.
const PRIOR_NEW: (f64, f64) = (0.075, 0.5);
/// Rounds in which the frame's own rates are estimated.
const ROUNDS: u32 = 3;
/// Rounds of messages between percepts and objects: they converge always, and mostly within ten.
const MESSAGE_ROUNDS: u32 = 30;

/// How often things are found that should be, and how many things of a frame are new: what a frame says of itself, beside
/// what is known of frames.
#[derive(Debug, Clone, PartialEq)]
struct Rates {
    /// Log-odds that an object is found that the camera should see.
    found: f64,
    /// By percept: logarithm of the number of newcomers that are expected by all the others. None speaks for itself.
    new: Vec<f64>,
}

impl Rates {
    fn of(found: f64, lost: f64, new: &[f64]) -> Rates {
        let found = (found + PRIOR_FOUND.0) / (lost + PRIOR_FOUND.1);
        let all: f64 = new.iter().sum();
        let others = |own: &f64| ((all - own).max(0.0) + PRIOR_NEW.0) / (1.0 + PRIOR_NEW.1);
        Rates { found: found.ln(), new: new.iter().map(|own| others(own).ln()).collect() }
    }
    /// The scores with the rates in them.
    fn apply(&self, scores: &Scores) -> Scores {
        let due = |object: usize| scores.due.get(object).copied().unwrap_or(false);
        let found = |(object, score): &(usize, f64)| (*object, score + if due(*object) { self.found } else { 0.0 });
        Scores {
            pairs: scores.pairs.iter().map(|row| row.iter().map(found).collect()).collect(),
            new: scores.new.iter().zip(&self.new).map(|(score, rate)| score + rate).collect(),
            due: scores.due.clone(),
        }
    }
}

/// The rates of a frame by expectation and maximisation.
fn rates(scores: &Scores, components: &[Vec<usize>]) -> Rates {
    let mut new = vec![0.0; scores.pairs.len()];
    let mut rates = Rates::of(0.0, 0.0, &new);
    let due = scores.due.iter().filter(|due| **due).count() as f64;
    for _ in 0..ROUNDS {
        let rated = rates.apply(scores);
        let mut found = 0.0;
        for percepts in components {
            for (percept, sums) in percepts.iter().zip(marginals(&rated, percepts)) {
                let matched = |(object, _): &(&Option<usize>, &f64)| {
                    object.is_some_and(|object| scores.due.get(object) == Some(&true))
                };
                found += sums.iter().filter(matched).map(|(_, probability)| probability).sum::<f64>();
                new[*percept] = sums.get(&None).copied().unwrap_or(0.0);
            }
        }
        rates = Rates::of(found, (due - found).max(0.0), &new);
    }
    rates
}

/// The best joint assignment of percepts to objects.
pub(crate) fn assign(scores: &Scores, predictions: &[Prediction]) -> Vec<Match> {
    let mut matches = Vec::with_capacity(scores.pairs.len());
    let components = components(scores);
    let scores = &rates(scores, &components).apply(scores);
    for percepts in components {
        let best = best(scores, &percepts);
        let marginals = marginals(scores, &percepts);
        for (row, &percept) in percepts.iter().enumerate() {
            let chosen = best.get(row).copied().flatten();
            let probability = |object: Option<usize>| marginals[row].get(&object).copied().unwrap_or(0.0);
            let mut alternatives: Vec<(ObjectId, f64)> = scores.pairs[percept]
                .iter()
                .filter(|(object, _)| Some(*object) != chosen && probability(Some(*object)) >= WORTH_NAMING)
                .map(|(object, _)| (predictions[*object].id, probability(Some(*object))))
                .collect();
            alternatives.sort_by(|a, b| b.1.total_cmp(&a.1));
            matches.push(Match {
                percept,
                object: chosen.map(|object| predictions[object].id),
                probability: probability(chosen),
                alternatives,
                possible: scores.pairs[percept].iter().map(|(object, _)| predictions[*object].id).collect(),
            });
        }
    }
    matches.sort_by_key(|found| found.percept);
    matches
}

/// Percepts that compete for the same objects, directly or through others. Each group is solved on its own.
fn components(scores: &Scores) -> Vec<Vec<usize>> {
    let mut group: Vec<usize> = (0..scores.pairs.len()).collect();
    let mut first_with: BTreeMap<usize, usize> = BTreeMap::new();
    fn root(group: &[usize], mut at: usize) -> usize {
        while group[at] != at {
            at = group[at];
        }
        at
    }
    for (percept, pairs) in scores.pairs.iter().enumerate() {
        for (object, _) in pairs {
            let other = *first_with.entry(*object).or_insert(percept);
            let (a, b) = (root(&group, percept), root(&group, other));
            group[a.max(b)] = a.min(b);
        }
    }
    let mut components: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for percept in 0..group.len() {
        components.entry(root(&group, percept)).or_default().push(percept);
    }
    components.into_values().collect()
}

/// Kuhn-Munkres over the objects within the gates and one "new" column a percept.
fn best(scores: &Scores, percepts: &[usize]) -> Vec<Option<usize>> {
    let mut objects: Vec<usize> = percepts.iter().flat_map(|&p| scores.pairs[p].iter().map(|(o, _)| *o)).collect();
    objects.sort_unstable();
    objects.dedup();
    let weights = Matrix::from_fn(percepts.len(), objects.len() + percepts.len(), |(row, column)| {
        let percept = percepts[row];
        let score = match objects.get(column) {
            Some(object) => pair(scores, percept, *object).unwrap_or(IMPOSSIBLE),
            None if column - objects.len() == row => scores.new[percept],
            None => IMPOSSIBLE,
        };
        // The column breaks ties, so that equal hypotheses are decided for the older identity.
        (score.max(IMPOSSIBLE) * STEPS).round() as i64 - column as i64
    });
    let (_, columns) = kuhn_munkres(&weights);
    let taken = |(row, column): (usize, usize)| {
        objects.get(column).copied().filter(|&object| pair(scores, percepts[row], object).is_some())
    };
    columns.into_iter().enumerate().map(taken).collect()
}

fn pair(scores: &Scores, percept: usize, object: usize) -> Option<f64> {
    scores.pairs[percept].iter().find(|(known, _)| *known == object).map(|(_, score)| *score)
}

/// Probability of each answer for each percept over all joint assignments: exactly, or, where percepts compete for too
/// many objects, by messages between percepts and objects (Williams and Lau 2014, "Approximate evaluation of marginal
/// association probabilities with belief propagation").
fn marginals(scores: &Scores, percepts: &[usize]) -> Vec<BTreeMap<Option<usize>, f64>> {
    let mut objects: Vec<usize> = percepts.iter().flat_map(|&p| scores.pairs[p].iter().map(|(o, _)| *o)).collect();
    objects.sort_unstable();
    objects.dedup();
    let mut sums =
        if objects.len() <= MAX_EXACT { exactly(scores, percepts, &objects) } else { by_messages(scores, percepts) };
    for (sum, percept) in sums.iter_mut().zip(percepts) {
        let total: f64 = sum.values().sum();
        if !(total > 1e-300 && total.is_finite()) {
            // Beyond what numbers can tell each percept is taken on its own.
            let pairs = scores.pairs[*percept].iter().map(|(object, score)| (Some(*object), *score));
            let options: Vec<(Option<usize>, f64)> = pairs.chain([(None, scores.new[*percept])]).collect();
            let best = options.iter().map(|(_, score)| *score).fold(f64::MIN, f64::max);
            *sum = options.into_iter().map(|(option, score)| (option, (score - best).exp())).collect();
        }
        let total: f64 = sum.values().sum();
        sum.values_mut().for_each(|value| *value /= total);
    }
    sums
}

/// Sums over all joint assignments, percept by percept over the sets of objects that are taken: what comes before a
/// percept times what comes after it.
fn exactly(scores: &Scores, percepts: &[usize], objects: &[usize]) -> Vec<BTreeMap<Option<usize>, f64>> {
    let sets = 1usize << objects.len();
    let bit = |object: usize| objects.binary_search(&object).map_or(0, |at| 1usize << at);
    /// The pairs of a percept, each with its object, that object's bit and the pair's weight; and the weight of being new.
    type Row = (Vec<(usize, usize, f64)>, f64);
    // Weights are scaled to the best of each percept.
    let rows: Vec<Row> = percepts
        .iter()
        .map(|&percept| {
            let pairs = &scores.pairs[percept];
            let best = pairs.iter().map(|(_, score)| *score).fold(scores.new[percept], f64::max);
            let weighed = pairs.iter().map(|(object, score)| (*object, bit(*object), (score - best).exp()));
            (weighed.collect(), (scores.new[percept] - best).exp())
        })
        .collect();
    let mut after = vec![vec![1.0; sets]];
    for (pairs, new) in rows.iter().rev() {
        let next = after.last().cloned().unwrap_or_default();
        let of = |taken: usize| {
            let free = pairs.iter().filter(|(_, bit, _)| taken & bit == 0);
            new * next[taken] + free.map(|(_, bit, weight)| weight * next[taken | bit]).sum::<f64>()
        };
        after.push((0..sets).map(of).collect());
    }
    after.reverse();
    let mut before = vec![0.0; sets];
    before[0] = 1.0;
    let mut sums = Vec::with_capacity(rows.len());
    for ((pairs, new), after) in rows.iter().zip(after.iter().skip(1)) {
        let mut answers: BTreeMap<Option<usize>, f64> = BTreeMap::new();
        let mut next = vec![0.0; sets];
        for (taken, reached) in before.iter().enumerate().filter(|(_, reached)| **reached > 0.0) {
            next[taken] += reached * new;
            *answers.entry(None).or_default() += reached * new * after[taken];
            for (object, bit, weight) in pairs.iter().filter(|(_, bit, _)| taken & bit == 0) {
                next[taken | bit] += reached * weight;
                *answers.entry(Some(*object)).or_default() += reached * weight * after[taken | bit];
            }
        }
        before = next;
        sums.push(answers);
    }
    sums
}

/// What each percept may be, relative to its being new.
fn by_messages(scores: &Scores, percepts: &[usize]) -> Vec<BTreeMap<Option<usize>, f64>> {
    // Weights of the pairs against "new", by percept; a message to an object goes over the same pair.
    let weight = |percept: usize, score: f64| (score - scores.new[percept]).clamp(-50.0, 50.0).exp();
    let weights: Vec<Vec<(usize, f64)>> = percepts
        .iter()
        .map(|&percept| {
            scores.pairs[percept].iter().map(|(object, score)| (*object, weight(percept, *score))).collect()
        })
        .collect();
    let mut to_objects: Vec<Vec<f64>> = weights.iter().map(|row| vec![1.0; row.len()]).collect();
    let mut to_percepts: Vec<Vec<f64>> = to_objects.clone();
    for _ in 0..MESSAGE_ROUNDS {
        let mut sums: BTreeMap<usize, f64> = BTreeMap::new();
        for (row, messages) in weights.iter().zip(&to_objects) {
            for ((object, weight), message) in row.iter().zip(messages) {
                *sums.entry(*object).or_default() += weight * message;
            }
        }
        for ((row, from), to) in weights.iter().zip(&to_objects).zip(&mut to_percepts) {
            for (((object, weight), from), to) in row.iter().zip(from).zip(to) {
                let others = (sums.get(object).copied().unwrap_or_default() - weight * from).max(0.0);
                *to = weight / (1.0 + others);
            }
        }
        for (from, to) in to_percepts.iter().zip(&mut to_objects) {
            let sum: f64 = from.iter().sum();
            for (from, to) in from.iter().zip(to) {
                *to = 1.0 / (1.0 + (sum - from).max(0.0));
            }
        }
    }
    let answers = |(row, messages): (&Vec<(usize, f64)>, &Vec<f64>)| {
        let pairs = row.iter().zip(messages).map(|((object, _), message)| (Some(*object), *message));
        pairs.chain([(None, 1.0)]).collect()
    };
    weights.iter().zip(&to_percepts).map(answers).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn score(pairs: &[&[(usize, f64)]], new: f64) -> Scores {
        Scores { pairs: pairs.iter().map(|row| row.to_vec()).collect(), new: vec![new; pairs.len()], due: Vec::new() }
    }

    /// The best total over all joint assignments, by trying them all.
    fn brute_force(scores: &Scores, row: usize, used: &mut Vec<usize>) -> f64 {
        if row == scores.pairs.len() {
            return 0.0;
        }
        let mut best = scores.new[row] + brute_force(scores, row + 1, used);
        for (object, score) in &scores.pairs[row] {
            if !used.contains(object) {
                used.push(*object);
                best = best.max(score + brute_force(scores, row + 1, used));
                used.pop();
            }
        }
        best
    }

    proptest! {
        #[test]
        fn the_assignment_is_the_best_there_is_and_its_probabilities_add_up(
            table in prop::collection::vec(prop::collection::vec(prop::option::of(-6.0..6.0f64), 4), 1..5),
        ) {
            let pairs: Vec<Vec<(usize, f64)>> = table
                .iter()
                .map(|row| row.iter().enumerate().filter_map(|(o, s)| s.map(|s| (o, s))).collect())
                .collect();
            let scores = Scores { new: vec![-3.0; pairs.len()], pairs, due: Vec::new() };
            let mut total = 0.0;
            let mut taken = Vec::new();
            for percepts in components(&scores) {
                let best = best(&scores, &percepts);
                for (row, sums) in marginals(&scores, &percepts).iter().enumerate() {
                    prop_assert!((sums.values().sum::<f64>() - 1.0).abs() < 1e-9);
                    let percept = percepts[row];
                    total += match best[row] {
                        Some(object) => {
                            prop_assert!(!taken.contains(&object), "an object was given twice");
                            taken.push(object);
                            pair(&scores, percept, object).unwrap_or(f64::NAN)
                        }
                        None => scores.new[percept],
                    };
                }
            }
            let reference = brute_force(&scores, 0, &mut Vec::new());
            prop_assert!((total - reference).abs() < 0.01, "{total} against {reference}");
        }
    }

    /// Likelihood of every answer of every percept, summed over all joint assignments by trying them all.
    fn tried_all(scores: &Scores, chosen: &mut Vec<Option<usize>>, sums: &mut Vec<BTreeMap<Option<usize>, f64>>) {
        let row = chosen.len();
        if row == scores.pairs.len() {
            let score = |(percept, object): (usize, &Option<usize>)| match object {
                Some(object) => pair(scores, percept, *object).unwrap_or(f64::NEG_INFINITY),
                None => scores.new[percept],
            };
            let likelihood = chosen.iter().enumerate().map(score).sum::<f64>().exp();
            for (sum, option) in sums.iter_mut().zip(chosen.iter()) {
                *sum.entry(*option).or_insert(0.0) += likelihood;
            }
            return;
        }
        let options: Vec<Option<usize>> = scores.pairs[row].iter().map(|(object, _)| Some(*object)).collect();
        for option in options.into_iter().chain([None]) {
            if option.is_none() || !chosen.contains(&option) {
                chosen.push(option);
                tried_all(scores, chosen, sums);
                chosen.pop();
            }
        }
    }

    proptest! {
        #[test]
        fn probabilities_are_those_of_all_joint_assignments_and_messages_come_near_them(
            table in prop::collection::vec(prop::collection::vec(prop::option::of(-4.0..4.0f64), 4), 2..5),
        ) {
            let pairs: Vec<Vec<(usize, f64)>> = table
                .iter()
                .map(|row| row.iter().enumerate().filter_map(|(o, s)| s.map(|s| (o, s))).collect())
                .collect();
            let scores = Scores { new: vec![-1.0; pairs.len()], pairs, due: Vec::new() };
            let all: Vec<usize> = (0..scores.pairs.len()).collect();
            let mut sums = vec![BTreeMap::new(); all.len()];
            tried_all(&scores, &mut Vec::new(), &mut sums);
            let near = by_messages(&scores, &all);
            for ((tried, exact), near) in sums.iter().zip(marginals(&scores, &all)).zip(&near) {
                let (total, mass): (f64, f64) = (tried.values().sum(), near.values().sum());
                for (option, likelihood) in tried {
                    let said = exact.get(option).copied().unwrap_or(0.0);
                    prop_assert!((likelihood / total - said).abs() < 1e-9);
                    prop_assert!((near[option] / mass - said).abs() < 0.25, "{} against {said}", near[option] / mass);
                }
            }
        }
    }

    #[test]
    fn equal_hypotheses_get_half_the_probability_each() {
        let scores = score(&[&[(0, 5.0), (1, 5.0)]], -5.0);
        let sums = marginals(&scores, &[0]);
        assert!((sums[0][&Some(0)] - 0.5).abs() < 1e-3 && (sums[0][&Some(1)] - 0.5).abs() < 1e-3);
        assert_eq!(best(&scores, &[0]), [Some(0)]);
    }
}
