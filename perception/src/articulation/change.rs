//! Pixels that left and pixels that came: points of one frame where the other one looks through.

use super::view::{Sight, View};

/// A point is gone where the other frame looks through it by so many standard deviations of both, and by so much more.
const SIGMAS: f64 = 4.0;
const LEAST_M: f64 = 0.006;
/// Depths of edges are unsure: changed pixels without so many changed ones in the square round them are not believed.
const AROUND_PX: usize = 2;
const LEAST_AROUND: u16 = 15;

/// What changed, in the first frame (it left) and in the second one (it came).
pub(super) struct Changed {
    /// Which pixels.
    pub masks: [Vec<bool>; 2],
    /// Pixels of each frame that the other one measured at the same place.
    pub still: [Vec<bool>; 2],
    /// Connected pixels, of both frames, the largest first: which frame, which pixels.
    pub groups: Vec<(usize, Vec<usize>)>,
}

impl Changed {
    pub fn between(views: &[View; 2]) -> Changed {
        let masks = [gone(&views[0], &views[1]), gone(&views[1], &views[0])];
        let still = [still(&views[0], &views[1]), still(&views[1], &views[0])];
        let mut changed = Changed { masks, still, groups: Vec::new() };
        changed.group(views);
        changed
    }

    pub fn count(&self) -> usize {
        self.groups.iter().map(|(_, pixels)| pixels.len()).sum()
    }

    /// Pixels of the largest group.
    pub fn largest(&self) -> usize {
        self.groups.first().map_or(0, |(_, pixels)| pixels.len())
    }

    /// All changed pixels of a frame.
    pub fn pixels(&self, frame: usize) -> Vec<usize> {
        let own = self.groups.iter().filter(|(of, _)| *of == frame);
        own.flat_map(|(_, pixels)| pixels.iter().copied()).collect()
    }

    /// Takes out what a part explains.
    pub fn remove(&mut self, part: &[Vec<usize>; 2]) {
        for (mask, pixels) in self.masks.iter_mut().zip(part) {
            for pixel in pixels {
                mask[*pixel] = false;
            }
        }
        let masks = &self.masks;
        for (frame, pixels) in &mut self.groups {
            pixels.retain(|pixel| masks[*frame][*pixel]);
        }
        self.groups.retain(|(_, pixels)| !pixels.is_empty());
        self.groups.sort_by_key(|(_, pixels)| std::cmp::Reverse(pixels.len()));
    }

    fn group(&mut self, views: &[View; 2]) {
        let mut groups = Vec::new();
        for (frame, (mask, view)) in self.masks.iter_mut().zip(views).enumerate() {
            let (labels, sizes) = view.grid().blobs(mask);
            let mut own: Vec<Vec<usize>> = sizes.iter().map(|size| Vec::with_capacity(*size)).collect();
            for (pixel, label) in labels.iter().enumerate().filter(|(_, label)| **label != u32::MAX) {
                own[*label as usize].push(pixel);
            }
            for pixels in own {
                if pixels.len() < LEAST_GROUP_PX {
                    pixels.iter().for_each(|pixel| mask[*pixel] = false);
                } else {
                    groups.push((frame, pixels));
                }
            }
        }
        groups.sort_by_key(|(_, pixels)| std::cmp::Reverse(pixels.len()));
        self.groups = groups;
    }
}

/// A point is still there within so many standard deviations.
const STILL: f64 = 3.0;
/// Smaller groups are noise.
const LEAST_GROUP_PX: usize = 25;

/// The pixels of a view whose points another view looks through.
fn gone(view: &View, other: &View) -> Vec<bool> {
    let grid = view.grid();
    let through = |pixel: usize| {
        if !view.takes(pixel) {
            return false;
        }
        let Some((there, depth)) = other.pixel(view.point(pixel)) else { return false };
        let nearest = f64::from(other.nearest[there]);
        let noise = f64::from(view.sigma[pixel]).hypot(f64::from(other.sigma[there]));
        nearest > 0.0 && nearest - depth > SIGMAS * noise + LEAST_M
    };
    let raw: Vec<bool> = (0..grid.len()).map(through).collect();
    let around = grid.count(&raw, AROUND_PX);
    raw.iter().zip(around).map(|(gone, count)| *gone && count >= LEAST_AROUND).collect()
}

/// The pixels of a view that another view measured at the same place.
fn still(view: &View, other: &View) -> Vec<bool> {
    let same = |pixel: usize| {
        view.takes(pixel)
            && matches!(other.sight(view.point(pixel)), Sight::Beyond { sigmas, .. } if sigmas.abs() < STILL)
    };
    (0..view.grid().len()).map(same).collect()
}
