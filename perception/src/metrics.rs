//! Segmentation scores: overlap F and boundary F under the one-to-one matching that maximises F.

use std::collections::BTreeMap;

/// Distance in pixels within which boundaries agree.
pub const BOUNDARY_TOLERANCE_PX: usize = 3;

/// Scores of one frame. All shares are 0-1.
#[derive(Debug, Clone, PartialEq)]
pub struct SegmentationScore {
    /// F over the pixels of all matched objects, the support ignored.
    pub overlap_f: f64,
    /// F over the boundary pixels of all matched objects, [`BOUNDARY_TOLERANCE_PX`] apart at most.
    pub boundary_f: f64,
    /// Share of the true objects whose own F is over 0.75.
    pub share_over_75: f64,
    /// Number of true objects.
    pub truth: usize,
    /// Number of predicted objects.
    pub predicted: usize,
}

/// Compares a predicted label image with a true one, row by row, `width` columns, 0 for background. Each predicted
/// object is matched with at most one true object so that the sum of their F is largest.
///
/// Both slices must have the same length, a multiple of `width`; the shorter one decides otherwise.
///
/// ```
/// let truth = [0, 1, 1, 0, 2, 2];
/// let score = acm_perception::metrics::score(&[0, 7, 7, 0, 0, 2], &truth, 3);
/// assert!((score.overlap_f - 6.0 / 7.0).abs() < 1e-9 && score.share_over_75 == 0.5);
/// ```
pub fn score(predicted: &[u16], truth: &[u16], width: usize) -> SegmentationScore {
    let length = predicted.len().min(truth.len());
    let (predicted, truth) = (&predicted[..length], &truth[..length]);
    let (predicted_px, truth_px) = (by_label(predicted), by_label(truth));
    let matched = matches(predicted, truth);
    let hits: usize = matched.iter().map(|pair| pair.common_px).sum();
    let count = |px: &BTreeMap<u16, Vec<usize>>| px.values().map(Vec::len).sum::<usize>();
    let over_75 = matched.iter().filter(|pair| pair.f > 0.75).count();
    let pairs: Vec<(u16, u16)> = matched.iter().map(|pair| (pair.predicted, pair.truth)).collect();
    SegmentationScore {
        overlap_f: 2.0 * hits as f64 / (count(&predicted_px) + count(&truth_px)).max(1) as f64,
        boundary_f: boundary_f(predicted, truth, width, &pairs),
        share_over_75: over_75 as f64 / truth_px.len().max(1) as f64,
        truth: truth_px.len(),
        predicted: predicted_px.len(),
    }
}

/// A true object and the predicted one that it is matched with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Match {
    /// Label of the true object.
    pub truth: u16,
    /// Label of the predicted one.
    pub predicted: u16,
    /// Pixels that both have; never 0.
    pub common_px: usize,
    /// F over their pixels, 0-1.
    pub f: f64,
}

/// The one-to-one matching of two label images, 0 for background, that makes the sum of the objects' F largest, in the
/// order of the true labels. What is alone does not appear.
///
/// ```
/// let found = acm_perception::metrics::matches(&[0, 7, 7, 0, 0, 2], &[0, 1, 1, 0, 2, 2]);
/// assert_eq!((found[0].truth, found[0].predicted, found[0].f), (1, 7, 1.0));
/// assert!((found[1].f - 2.0 / 3.0).abs() < 1e-9);
/// ```
pub fn matches(predicted: &[u16], truth: &[u16]) -> Vec<Match> {
    let (predicted_px, truth_px) = (by_label(predicted), by_label(truth));
    let mut common: BTreeMap<(u16, u16), usize> = BTreeMap::new();
    for (&p, &t) in predicted.iter().zip(truth).filter(|(p, t)| **p != 0 && **t != 0) {
        *common.entry((p, t)).or_insert(0) += 1;
    }
    let pair = |t: u16, p: u16| {
        let common_px = common.get(&(p, t)).copied().unwrap_or(0);
        let sizes = predicted_px.get(&p).map_or(0, Vec::len) + truth_px.get(&t).map_or(0, Vec::len);
        Match { truth: t, predicted: p, common_px, f: 2.0 * common_px as f64 / sizes.max(1) as f64 }
    };
    let p_labels: Vec<u16> = predicted_px.keys().copied().collect();
    let t_labels: Vec<u16> = truth_px.keys().copied().collect();
    let gains: Vec<Vec<f64>> = t_labels.iter().map(|&t| p_labels.iter().map(|&p| pair(t, p).f).collect()).collect();
    let matched = assign(&gains).into_iter().zip(t_labels);
    matched.filter_map(|(p, t)| Some(pair(t, p_labels[p?]))).filter(|pair| pair.common_px > 0).collect()
}

fn by_label(labels: &[u16]) -> BTreeMap<u16, Vec<usize>> {
    let mut pixels: BTreeMap<u16, Vec<usize>> = BTreeMap::new();
    for (index, &label) in labels.iter().enumerate().filter(|(_, label)| **label != 0) {
        pixels.entry(label).or_default().push(index);
    }
    pixels
}

/// Pixels of a label with a neighbour, or the image border, outside it.
fn boundaries(labels: &[u16], width: usize) -> BTreeMap<u16, Vec<usize>> {
    let height = labels.len() / width.max(1);
    let is_border = |index: usize| {
        let (column, row) = (index % width, index / width);
        let same = |column: usize, row: usize| labels[row * width + column] == labels[index];
        column == 0
            || row == 0
            || column + 1 >= width
            || row + 1 >= height
            || !(same(column - 1, row) && same(column + 1, row) && same(column, row - 1) && same(column, row + 1))
    };
    let mut borders: BTreeMap<u16, Vec<usize>> = BTreeMap::new();
    for index in (0..width * height).filter(|&i| labels[i] != 0 && is_border(i)) {
        borders.entry(labels[index]).or_default().push(index);
    }
    borders
}

fn boundary_f(predicted: &[u16], truth: &[u16], width: usize, matched: &[(u16, u16)]) -> f64 {
    let (p_borders, t_borders) = (boundaries(predicted, width), boundaries(truth, width));
    let total = |borders: &BTreeMap<u16, Vec<usize>>| borders.values().map(Vec::len).sum::<usize>();
    let (mut p_hits, mut t_hits) = (0, 0);
    for (p, t) in matched {
        let none = Vec::new();
        let (p_border, t_border) = (p_borders.get(p).unwrap_or(&none), t_borders.get(t).unwrap_or(&none));
        p_hits += near(p_border, t_border, width);
        t_hits += near(t_border, p_border, width);
    }
    let precision = p_hits as f64 / total(&p_borders).max(1) as f64;
    let recall = t_hits as f64 / total(&t_borders).max(1) as f64;
    2.0 * precision * recall / (precision + recall).max(1e-12)
}

/// How many of `from` have one of `to` within the tolerance (steps along rows and columns).
fn near(from: &[usize], to: &[usize], width: usize) -> usize {
    let reach = BOUNDARY_TOLERANCE_PX as isize;
    let is_near = |&&index: &&usize| {
        let (column, row) = ((index % width) as isize, (index / width) as isize);
        (-reach..=reach).any(|dy| {
            let slack = reach - dy.abs();
            let y = row + dy;
            if y < 0 {
                return false;
            }
            let start = (column - slack).max(0) as usize + y as usize * width;
            let end = (column + slack).min(width as isize - 1) as usize + y as usize * width;
            let first = to.partition_point(|&other| other < start);
            to.get(first).is_some_and(|&other| other <= end)
        })
    };
    from.iter().filter(is_near).count()
}

/// One column for each row so that the sum of the gains is largest (the Hungarian method with potentials).
fn assign(gains: &[Vec<f64>]) -> Vec<Option<usize>> {
    let rows = gains.len();
    let columns = gains.first().map_or(0, Vec::len).max(rows);
    let cost = |row: usize, column: usize| -gains[row].get(column).copied().unwrap_or(0.0);
    let (mut u, mut v) = (vec![0.0; rows + 1], vec![0.0; columns + 1]);
    let mut row_of = vec![0usize; columns + 1];
    for row in 1..=rows {
        row_of[0] = row;
        let (mut least, mut done, mut way) =
            (vec![f64::INFINITY; columns + 1], vec![false; columns + 1], vec![0; columns + 1]);
        let mut at = 0;
        while row_of[at] != 0 {
            done[at] = true;
            let (mut step, mut next) = (f64::INFINITY, 0);
            for column in 1..=columns {
                if done[column] {
                    continue;
                }
                let reduced = cost(row_of[at] - 1, column - 1) - u[row_of[at]] - v[column];
                if reduced < least[column] {
                    (least[column], way[column]) = (reduced, at);
                }
                if least[column] < step {
                    (step, next) = (least[column], column);
                }
            }
            for column in 0..=columns {
                if done[column] {
                    u[row_of[column]] += step;
                    v[column] -= step;
                } else {
                    least[column] -= step;
                }
            }
            at = next;
        }
        while at != 0 {
            row_of[at] = row_of[way[at]];
            at = way[at];
        }
    }
    let mut matched = vec![None; rows];
    let real = gains.first().map_or(0, Vec::len);
    for (column, &row) in row_of.iter().enumerate().skip(1).filter(|(column, _)| column - 1 < real) {
        if row > 0 {
            matched[row - 1] = Some(column - 1);
        }
    }
    matched
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_perfect_answer_scores_one_under_any_names() {
        let truth = [0, 1, 1, 0, 3, 3, 0, 1, 1, 0, 3, 3];
        let renamed: Vec<u16> = truth.iter().map(|&l| if l == 1 { 9 } else { l * 2 }).collect();
        let score = score(&renamed, &truth, 6);
        assert_eq!((score.overlap_f, score.boundary_f, score.share_over_75), (1.0, 1.0, 1.0));
    }

    #[test]
    fn merging_two_objects_costs_one_of_them() {
        let truth = [1, 1, 1, 2, 2];
        let score = score(&[5, 5, 5, 5, 5], &truth, 5);
        assert!((score.overlap_f - 0.6).abs() < 1e-9, "{score:?}");
        assert_eq!((score.truth, score.predicted), (2, 1));
    }

    proptest! {
        #[test]
        fn the_assignment_beats_every_permutation(raw in prop::collection::vec(0.0..1.0f64, 12)) {
            let gains: Vec<Vec<f64>> = raw.chunks(4).map(<[f64]>::to_vec).collect();
            let found: f64 = assign(&gains).iter().enumerate().filter_map(|(t, p)| p.map(|p| gains[t][p])).sum();
            for a in 0..4 {
                for b in 0..4 {
                    for c in 0..4 {
                        if a != b && b != c && a != c {
                            prop_assert!(found + 1e-9 >= gains[0][a] + gains[1][b] + gains[2][c]);
                        }
                    }
                }
            }
        }
    }
}
