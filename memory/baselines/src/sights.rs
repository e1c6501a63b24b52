//! Past frames: what each showed, and which of them are kept.

use crate::keeping::Frames;
use acm_concept::{
    camera::RgbdFrame,
    ids::{FrameId, ObjectId},
};
use acm_memory::{entry::Moment, event::Believed};
use std::collections::{BTreeMap, BTreeSet};

/// Columns and rows of the picture that stands for a frame's looks.
const COLUMNS: usize = 16;
const ROWS: usize = 12;

/// A past frame as it was understood.
#[derive(Debug, Clone)]
pub(crate) struct Sight {
    /// Its number in the run, from 0.
    pub number: u32,
    /// The frame.
    pub frame: FrameId,
    /// When it was taken.
    pub moment: Moment,
    /// What it showed, as it was believed then.
    pub shown: BTreeMap<ObjectId, Believed>,
    /// What it showed to be no longer in its place.
    pub gone: BTreeSet<ObjectId>,
    /// How it looked: mean colours of a coarse picture, 0-1.
    pub looks: Vec<f32>,
    /// Numbers of the nominated frames that it stands for; empty if it is no key frame.
    pub stands_for: Vec<u32>,
}

impl Sight {
    /// Whether it tells where an object was.
    pub fn tells_of(&self, object: ObjectId) -> bool {
        self.shown.contains_key(&object) || self.gone.contains(&object)
    }
}

/// The frames that are kept, oldest first. The last one is always among them.
#[derive(Debug)]
pub(crate) struct Sights {
    keeping: Frames,
    kept: Vec<Sight>,
}

impl Sights {
    /// None yet.
    pub fn new(keeping: Frames) -> Sights {
        Sights { keeping, kept: Vec::new() }
    }
    /// Forgets them all.
    pub fn clear(&mut self) {
        self.kept.clear();
    }
    /// Takes a frame, and drops what is not kept any longer.
    pub fn add(&mut self, sight: Sight) {
        self.kept.push(sight);
        self.drop_old();
    }
    /// Makes the last frame a key frame.
    pub fn nominate_last(&mut self) {
        if let Some(last) = self.kept.last_mut()
            && last.stands_for.is_empty()
        {
            last.stands_for.push(last.number);
        }
        self.drop_old();
    }
    /// All that are kept.
    pub fn kept(&self) -> Vec<&Sight> {
        self.kept.iter().collect()
    }
    /// Those that are read now: of a bank the ones that look most like the last frame, and that.
    pub fn read(&self) -> Vec<&Sight> {
        let (Frames::Bank { read, .. }, Some((last, past))) = (self.keeping, self.kept.split_last()) else {
            return self.kept();
        };
        let mut nearest: Vec<&Sight> = past.iter().collect();
        nearest.sort_by(|a, b| unlike(&a.looks, &last.looks).total_cmp(&unlike(&b.looks, &last.looks)));
        nearest.truncate(read);
        nearest.push(last);
        nearest.sort_by_key(|sight| sight.number);
        nearest
    }
    /// The moment from which on deeds belong to the window.
    pub fn window_began(&self) -> Option<Moment> {
        let (Frames::Recent(recent) | Frames::Key { recent, .. }) = self.keeping else { return None };
        let first = self.kept.last()?.number.saturating_sub(recent as u32 - 1);
        self.kept.iter().find(|sight| sight.number >= first).map(|sight| sight.moment)
    }

    fn drop_old(&mut self) {
        let Some(last) = self.kept.last().map(|sight| sight.number) else { return };
        let is_recent = |sight: &Sight, recent: usize| sight.number + recent as u32 > last;
        match self.keeping {
            Frames::Last => self.kept.retain(|sight| sight.number == last),
            Frames::First => self.kept.retain(|sight| sight.number == last || sight.number == 0),
            Frames::Recent(recent) => self.kept.retain(|sight| is_recent(sight, recent)),
            Frames::Key { recent, most } => {
                merge_keys(&mut self.kept, most);
                self.kept.retain(|sight| !sight.stands_for.is_empty() || is_recent(sight, recent));
            }
            Frames::Bank { most, .. } => {
                while self.kept.len() > most + 1 {
                    merge_most_alike(&mut self.kept);
                }
            }
            Frames::All => {}
        }
    }
}

/// Single-linkage clusters of nominated frames on their numbers, cut where `most` are left: the two neighbours with the
/// smallest gap become one, for which the frame nearest to the median of all its nominated ones stands.
fn merge_keys(sights: &mut [Sight], most: usize) {
    loop {
        let keys: Vec<usize> = (0..sights.len()).filter(|&at| !sights[at].stands_for.is_empty()).collect();
        if keys.len() <= most {
            return;
        }
        let gap = |pair: &&[usize]| {
            let ends = (sights[pair[0]].stands_for.last(), sights[pair[1]].stands_for.first());
            ends.0.zip(ends.1).map_or(0, |(end, begin)| begin.saturating_sub(*end))
        };
        // Of equal gaps the newer one closes: what is old is scarce.
        let Some(&[one, other]) = keys.windows(2).rev().min_by_key(gap) else { return };
        let mut members = std::mem::take(&mut sights[one].stands_for);
        members.append(&mut sights[other].stands_for);
        let median = members.get((members.len() - 1) / 2).copied().unwrap_or_default();
        let away = |at: usize| sights[at].number.abs_diff(median);
        let stays = if away(other) < away(one) { other } else { one };
        sights[stays].stands_for = members;
    }
}

/// Of the two neighbours that look most alike the older one stays; the last frame is never merged.
fn merge_most_alike(sights: &mut Vec<Sight>) {
    let past = sights.len().saturating_sub(1);
    let apart = |at: &usize| unlike(&sights[at - 1].looks, &sights[*at].looks);
    let alike = (1..past).min_by(|a, b| apart(a).total_cmp(&apart(b)));
    // A bank without two past frames has nothing to merge.
    sights.remove(alike.unwrap_or(0));
}

/// Mean squared difference of two looks.
fn unlike(one: &[f32], other: &[f32]) -> f32 {
    let sum: f32 = one.iter().zip(other).map(|(a, b)| (a - b).powi(2)).sum();
    sum / one.len().min(other.len()).max(1) as f32
}

/// How a frame looks: mean colours over a coarse grid, row by row, 0-1.
pub(crate) fn looks(frame: &RgbdFrame) -> Vec<f32> {
    let (width, height) = (frame.header.intrinsics.width as usize, frame.header.intrinsics.height as usize);
    let mut sums = vec![[0.0f32; 4]; COLUMNS * ROWS];
    for (index, rgb) in frame.color.as_chunks::<3>().0.iter().enumerate().take(width * height) {
        let (x, y) = (index % width, index / width);
        let cell = &mut sums[(y * ROWS / height) * COLUMNS + x * COLUMNS / width];
        rgb.iter().zip(cell.iter_mut()).for_each(|(value, sum)| *sum += f32::from(*value) / 255.0);
        cell[3] += 1.0;
    }
    sums.iter().flat_map(|cell| [0, 1, 2].map(|channel| cell[channel] / cell[3].max(1.0))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sight(number: u32, looks: f32) -> Sight {
        Sight {
            number,
            frame: FrameId(number.into()),
            moment: Moment::default(),
            shown: BTreeMap::new(),
            gone: BTreeSet::new(),
            looks: vec![looks],
            stands_for: Vec::new(),
        }
    }
    fn numbers(sights: &[&Sight]) -> Vec<u32> {
        sights.iter().map(|sight| sight.number).collect()
    }
    fn taken(keeping: Frames, count: u32, nominated: &[u32]) -> Sights {
        let mut sights = Sights::new(keeping);
        for number in 0..count {
            sights.add(sight(number, 0.0));
            if nominated.contains(&number) {
                sights.nominate_last();
            }
        }
        sights
    }

    #[test]
    fn each_keeps_its_frames() {
        assert_eq!(numbers(&taken(Frames::Last, 6, &[]).kept()), [5]);
        assert_eq!(numbers(&taken(Frames::First, 6, &[]).kept()), [0, 5]);
        assert_eq!(numbers(&taken(Frames::Recent(3), 6, &[]).kept()), [3, 4, 5]);
        assert_eq!(numbers(&taken(Frames::All, 4, &[]).kept()), [0, 1, 2, 3]);
        assert_eq!(taken(Frames::Recent(3), 6, &[]).window_began(), Some(Moment::default()));
        assert_eq!(taken(Frames::First, 6, &[]).window_began(), None);
    }

    #[test]
    fn key_frames_are_clustered_by_their_numbers() {
        let key = Frames::Key { recent: 1, most: 3 };
        assert_eq!(numbers(&taken(key, 30, &[0, 10, 20]).kept()), [0, 10, 20, 29]);
        // 10, 11 and 12 are one event, in the middle of which 11 stands.
        assert_eq!(numbers(&taken(key, 30, &[0, 10, 11, 12, 20]).kept()), [0, 11, 20, 29]);
        assert_eq!(numbers(&taken(key, 30, &[]).kept()), [29]);
    }

    #[test]
    fn a_bank_merges_what_looks_alike_and_reads_what_looks_like_now() {
        let mut bank = Sights::new(Frames::Bank { most: 3, read: 2 });
        for (number, looks) in [0.0, 0.5, 0.51, 0.9, 0.1].into_iter().enumerate() {
            bank.add(sight(number as u32, looks));
        }
        assert_eq!(numbers(&bank.kept()), [0, 1, 3, 4], "2 looked like 1");
        assert_eq!(numbers(&bank.read()), [0, 1, 4], "3 looks least like the last one");
    }
}
