//! Global one-to-one assignment with a "new" option, and the probability of each of its pairs.

use super::{Match, likelihood::Scores, predict::Prediction};
use acm_concept::ids::ObjectId;
use pathfinding::prelude::{Matrix, kuhn_munkres};
use std::collections::BTreeMap;

/// Log-likelihoods become integers for the assignment in these steps.
const STEPS: f64 = 1e4;
/// The score of a pair beyond the gates, natural logarithm.
const IMPOSSIBLE: f64 = -1e4;
/// Components with more percepts, or more joint assignments, than these get approximate probabilities.
const MAX_ENUMERATED_PERCEPTS: usize = 8;
const MAX_ENUMERATED: usize = 20_000;
/// Other identities below this probability are not worth a word.
const WORTH_NAMING: f64 = 0.1;

/// The best joint assignment of percepts to objects.
pub(crate) fn assign(scores: &Scores, predictions: &[Prediction]) -> Vec<Match> {
    let mut matches = Vec::with_capacity(scores.pairs.len());
    for percepts in components(scores) {
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

/// Probability of each answer for each percept, by enumerating the joint assignments; where there are too many
/// of them, each percept is taken on its own.
fn marginals(scores: &Scores, percepts: &[usize]) -> Vec<BTreeMap<Option<usize>, f64>> {
    let options: Vec<Vec<(Option<usize>, f64)>> = percepts
        .iter()
        .map(|&percept| {
            let pairs = scores.pairs[percept].iter().map(|(object, score)| (Some(*object), *score));
            pairs.chain([(None, scores.new[percept])]).collect()
        })
        .collect();
    let joint = options.iter().try_fold(1usize, |product, row| product.checked_mul(row.len()));
    let few = percepts.len() <= MAX_ENUMERATED_PERCEPTS && joint.is_some_and(|count| count <= MAX_ENUMERATED);
    let mut sums: Vec<BTreeMap<Option<usize>, f64>> = vec![BTreeMap::new(); percepts.len()];
    // Relative to each percept's best option nothing overflows.
    let offsets: Vec<f64> = options.iter().map(|row| row.iter().map(|o| o.1).fold(f64::MIN, f64::max)).collect();
    if few {
        let mut chosen = Vec::with_capacity(options.len());
        enumerate(&options, &offsets, 0.0, &mut chosen, &mut sums);
    }
    for ((sum, row), offset) in sums.iter_mut().zip(&options).zip(&offsets) {
        if sum.values().sum::<f64>() < 1e-300 {
            *sum = row.iter().map(|(option, score)| (*option, (score - offset).exp())).collect();
        }
        let total: f64 = sum.values().sum();
        sum.values_mut().for_each(|value| *value /= total);
    }
    sums
}

fn enumerate(
    options: &[Vec<(Option<usize>, f64)>],
    offsets: &[f64],
    log_likelihood: f64,
    chosen: &mut Vec<Option<usize>>,
    sums: &mut [BTreeMap<Option<usize>, f64>],
) {
    let row = chosen.len();
    let (Some(options_here), Some(offset)) = (options.get(row), offsets.get(row)) else {
        let likelihood = log_likelihood.exp();
        for (sum, option) in sums.iter_mut().zip(chosen.iter()) {
            *sum.entry(*option).or_insert(0.0) += likelihood;
        }
        return;
    };
    for (option, score) in options_here {
        if option.is_none() || !chosen.contains(option) {
            chosen.push(*option);
            enumerate(options, offsets, log_likelihood + score - offset, chosen, sums);
            chosen.pop();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn score(pairs: &[&[(usize, f64)]], new: f64) -> Scores {
        Scores { pairs: pairs.iter().map(|row| row.to_vec()).collect(), new: vec![new; pairs.len()] }
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
            let scores = Scores { new: vec![-3.0; pairs.len()], pairs };
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

    #[test]
    fn equal_hypotheses_get_half_the_probability_each() {
        let scores = score(&[&[(0, 5.0), (1, 5.0)]], -5.0);
        let sums = marginals(&scores, &[0]);
        assert!((sums[0][&Some(0)] - 0.5).abs() < 1e-3 && (sums[0][&Some(1)] - 0.5).abs() < 1e-3);
        assert_eq!(best(&scores, &[0]), [Some(0)]);
    }
}
