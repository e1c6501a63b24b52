//! Cuts segments that are two things in two: where depth runs on from one to the other their colours tell them apart, and
//! two templates explain them better than one.

use crate::{
    hypotheses::Context,
    joins::{Piece, apart_or_together},
    scan::Tint,
    scene::Scene,
    segments::Segments,
};
use std::ops::Range;

/// Two colours differ by at least this, in the units of a tint, and by so many times their own spread.
const CONTRAST: f32 = 14.0;
const TIMES_SPREAD: f32 = 4.3;
/// What has one colour is mostly in one place; a pattern is not.
const IN_ONE_PLACE: f64 = 0.75;
/// Most cuts in one frame.
const MAX_CUTS: usize = 12;

/// Parts segments until none shows two things. Those with the labels in `known` are left as they are.
pub(crate) fn part(scene: &Scene, segments: &mut Segments, context: Context, known: Range<u32>) {
    let mut open: Vec<(u32, Vec<usize>)> =
        (0..).zip(segments.pixels()).filter(|(label, _)| !known.contains(label)).collect();
    let mut cuts = 0;
    while let Some((label, pixels)) = open.pop() {
        let Some(halves) = halves(scene, &pixels).filter(|_| cuts < MAX_CUTS) else { continue };
        let other = segments.count as u32;
        let mut parted =
            Segments { labels: segments.labels.clone(), count: segments.count + 1, inner: segments.inner.clone() };
        halves[1].iter().for_each(|&pixel| parted.labels[pixel] = other);
        let whole = Piece::measure(scene, segments, label, pixels);
        let [first, second] = [(label, &halves[0]), (other, &halves[1])]
            .map(|(label, pixels)| Piece::measure(scene, &parted, label, pixels.clone()));
        let (Some(whole), Some(first), Some(second)) = (whole, first, second) else { continue };
        if apart_or_together(context, &whole, &first, &second) {
            *segments = parted;
            cuts += 1;
            let [first, second] = halves;
            open.extend([(label, first), (other, second)]);
        }
    }
}

/// The pixels of a segment by their two colours, both ascending; `None` if it has one, or a pattern.
fn halves(scene: &Scene, pixels: &[usize]) -> Option<[Vec<usize>; 2]> {
    let tints: Vec<Tint> = pixels.iter().map(|&pixel| scene.scan.tint(pixel)).collect();
    let means = two_means(&tints)?;
    let mut mask = vec![false; scene.grid.len()];
    let half = |first: bool, mask: &mut Vec<bool>| {
        mask.fill(false);
        let own = |tint: &Tint| (tint.distance(&means[0]) <= tint.distance(&means[1])) == first;
        pixels.iter().zip(&tints).filter(|(_, tint)| own(tint)).for_each(|(&pixel, _)| mask[pixel] = true);
        let all = mask.iter().filter(|set| **set).count();
        let (labels, sizes) = scene.grid.blobs(mask);
        let (largest, size) = (0u32..).zip(&sizes).max_by_key(|(_, size)| **size)?;
        let held = *size as f64 > IN_ONE_PLACE * all as f64 && *size >= scene.min_segment_px();
        held.then(|| pixels.iter().copied().filter(|&pixel| labels[pixel] == largest).collect::<Vec<_>>())
    };
    let (second, first) = (half(false, &mut mask)?, half(true, &mut mask)?);
    let lesser = if first.len() < second.len() { first } else { second };
    // Specks of the lesser colour stay with the other.
    let rest = pixels.iter().copied().filter(|pixel| lesser.binary_search(pixel).is_err()).collect();
    Some([rest, lesser])
}

/// The two colours of some pixels by Lloyd's algorithm, begun along the line on which they differ most; `None` if they are
/// one.
fn two_means(tints: &[Tint]) -> Option<[Tint; 2]> {
    let count = tints.len().max(1) as f32;
    let mean = |of: &mut dyn Iterator<Item = &Tint>| {
        let (a, b, n) = of.fold((0.0f32, 0.0f32, 0usize), |(a, b, n), t| (a + t.a, b + t.b, n + 1));
        (n > 0).then(|| Tint { a: a / n as f32, b: b / n as f32 })
    };
    let middle = mean(&mut tints.iter())?;
    let (mut aa, mut ab, mut bb) = (0.0f32, 0.0f32, 0.0f32);
    for tint in tints {
        let (a, b) = (tint.a - middle.a, tint.b - middle.b);
        (aa, ab, bb) = (aa + a * a / count, ab + a * b / count, bb + b * b / count);
    }
    let angle = 0.5 * (2.0 * ab).atan2(aa - bb);
    let reach = (0.5 * (aa + bb)).sqrt();
    let end = |sign: f32| Tint { a: middle.a + sign * reach * angle.cos(), b: middle.b + sign * reach * angle.sin() };
    let mut means = [end(-1.0), end(1.0)];
    let nearer = |means: &[Tint; 2], tint: &Tint| usize::from(tint.distance(&means[1]) < tint.distance(&means[0]));
    for _ in 0..8 {
        let of = |side: usize| mean(&mut tints.iter().filter(|tint| nearer(&means, tint) == side));
        means = [of(0)?, of(1)?];
    }
    let spread = tints.iter().map(|tint| tint.distance(&means[nearer(&means, tint)])).sum::<f32>() / count;
    let contrast = means[0].distance(&means[1]);
    (contrast > CONTRAST && contrast > TIMES_SPREAD * spread).then_some(means)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_colours_are_told_from_one_that_varies() {
        let noisy = |a: f32, b: f32| (0..200).map(move |i| Tint { a: a + (i % 7) as f32, b: b - (i % 5) as f32 });
        let one: Vec<Tint> = noisy(10.0, 5.0).collect();
        assert_eq!(two_means(&one), None);
        let two: Vec<Tint> = noisy(10.0, 5.0).chain(noisy(-30.0, 5.0).take(60)).collect();
        let means = two_means(&two).unwrap();
        assert!((means[0].a - means[1].a).abs() > 35.0, "{means:?}");
        let slope: Vec<Tint> = (0..300).map(|i| Tint { a: i as f32 * 0.1, b: 0.0 }).collect();
        assert_eq!(two_means(&slope), None);
        assert_eq!(two_means(&[]), None);
    }
}
