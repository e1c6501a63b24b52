//! Segments put together and cut by what memory expects in them.

use super::{Ghost, Remembered, Vote};
use crate::{
    scene::Scene,
    segments::{NONE, Segments},
};
use std::collections::BTreeMap;

/// An expected object claims a segment of which it explains so much.
const CLAIMED: f64 = 0.75;
/// Expected objects split a segment if each finds at least so many of its pixels in it, and so much of itself.
const SPLIT_PX: usize = 60;
const SPLIT_SHARE: f64 = 0.4;

/// Joins segments that one expected object explains: pieces of one thing between which noise has drawn an edge.
pub(crate) fn merge(remembered: &Remembered, segments: &mut Segments) {
    let mut size = vec![0usize; segments.count];
    for label in segments.labels.iter().filter(|label| **label != NONE) {
        size[*label as usize] += 1;
    }
    let mut claimed = vec![false; segments.count];
    for ghost in remembered.ghosts.iter().filter(|ghost| !ghost.flat) {
        let mut agreeing = vec![0usize; size.len()];
        for (pixel, _) in ghost.votes.iter().filter(|(_, vote)| *vote == Vote::Agrees) {
            if let Some(count) = agreeing.get_mut(segments.labels[*pixel] as usize) {
                *count += 1;
            }
        }
        let claims = |label: &usize| agreeing[*label] > 0 && agreeing[*label] as f64 > CLAIMED * size[*label] as f64;
        let pieces: Vec<usize> = (0..size.len()).filter(|label| !claimed[*label]).filter(claims).collect();
        let Some((&whole, rest)) = pieces.split_first() else { continue };
        for label in segments.labels.iter_mut().filter(|label| rest.contains(&(**label as usize))) {
            *label = whole as u32;
        }
        for label in pieces {
            claimed[label] = true;
        }
    }
}

/// Cuts segments in which two or more expected objects are found, each pixel going to the nearest of them.
pub(crate) fn split(scene: &Scene, remembered: &Remembered, segments: &mut Segments) {
    let mut found: BTreeMap<u32, Vec<&Ghost>> = BTreeMap::new();
    for ghost in remembered.ghosts.iter().filter(|ghost| !ghost.flat) {
        let mut agreeing: BTreeMap<u32, usize> = BTreeMap::new();
        let mut visible = 0usize;
        for &(pixel, vote) in &ghost.votes {
            visible += usize::from(vote != Vote::Nearer);
            if vote == Vote::Agrees && segments.labels[pixel] != NONE {
                *agreeing.entry(segments.labels[pixel]).or_insert(0) += 1;
            }
        }
        let enough = |(_, count): &(u32, usize)| *count >= SPLIT_PX && *count as f64 > SPLIT_SHARE * visible as f64;
        if let Some((label, _)) = agreeing.into_iter().max_by_key(|(_, count)| *count).filter(enough) {
            found.entry(label).or_default().push(ghost);
        }
    }
    let to_world = scene.world;
    for (label, ghosts) in found.into_iter().filter(|(_, ghosts)| ghosts.len() > 1) {
        let first = segments.count as u32;
        segments.count += ghosts.len();
        for pixel in 0..segments.labels.len() {
            if segments.labels[pixel] != label {
                continue;
            }
            let point = to_world.transform_point(scene.point[pixel].as_dvec3());
            let nearest =
                ghosts.iter().map(|ghost| ghost.distance_m(point)).enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((i, _)) = nearest.filter(|(_, d)| *d < 0.02) {
                segments.labels[pixel] = first + i as u32;
            }
        }
    }
}
