//! Image-shaped arrays: neighbours, morphology, connected components.

use rayon::prelude::*;

/// Pixels that one thread takes at a time: less is not worth handing over.
const AT_ONCE: usize = 8192;

/// The shape of a row-by-row image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Grid {
    pub width: usize,
    pub height: usize,
}

impl Grid {
    pub fn len(self) -> usize {
        self.width * self.height
    }
    pub fn index(self, column: usize, row: usize) -> usize {
        row * self.width + column
    }
    pub fn column(self, index: usize) -> usize {
        index % self.width
    }
    pub fn row(self, index: usize) -> usize {
        index / self.width
    }
    /// What is said of every pixel, by all processors.
    pub fn map<T: Send>(self, of: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
        (0..self.len()).into_par_iter().with_min_len(AT_ONCE).map(of).collect()
    }
    /// The index `dx` columns and `dy` rows away, if that is in the image.
    pub fn offset(self, index: usize, dx: isize, dy: isize) -> Option<usize> {
        let column = self.column(index).checked_add_signed(dx)?;
        let row = self.row(index).checked_add_signed(dy)?;
        (column < self.width && row < self.height).then(|| self.index(column, row))
    }
    /// The four direct neighbours that are in the image.
    pub fn neighbours(self, index: usize) -> impl Iterator<Item = usize> {
        let (column, width) = (self.column(index), self.width);
        let right = (column + 1 < width).then_some(index + 1);
        let below = (index + width < self.len()).then_some(index + width);
        let left = (column > 0).then(|| index - 1);
        [right, below, left, index.checked_sub(width)].into_iter().flatten()
    }

    /// Number of set pixels in the square window of half width `radius` round each pixel.
    pub fn count(self, mask: &[bool], radius: usize) -> Vec<u16> {
        let mut across = vec![0u16; self.len()];
        let rows = across.par_chunks_mut(self.width).zip(mask.par_chunks(self.width)).with_min_len(16);
        rows.for_each(|(across, line)| {
            let mut sum = line.iter().take(radius.min(self.width)).filter(|set| **set).count() as u16;
            for (column, across) in across.iter_mut().enumerate() {
                if column + radius < self.width {
                    sum += u16::from(line[column + radius]);
                }
                *across = sum;
                if column >= radius {
                    sum -= u16::from(line[column - radius]);
                }
            }
        });
        let (row, mut both) = (|row: usize| &across[row * self.width..(row + 1) * self.width], vec![0u16; self.len()]);
        let mut sums = vec![0u16; self.width];
        let add = |sums: &mut [u16], line: &[u16]| sums.iter_mut().zip(line).for_each(|(sum, one)| *sum += one);
        (0..radius.min(self.height)).for_each(|at| add(&mut sums, row(at)));
        for (at, both) in both.chunks_mut(self.width).enumerate() {
            if at + radius < self.height {
                add(&mut sums, row(at + radius));
            }
            both.copy_from_slice(&sums);
            if at >= radius {
                sums.iter_mut().zip(row(at - radius)).for_each(|(sum, one)| *sum -= one);
            }
        }
        both
    }
    /// The mask grown by a square of half width `radius`.
    pub fn dilate(self, mask: &[bool], radius: usize) -> Vec<bool> {
        self.count(mask, radius).into_iter().map(|n| n > 0).collect()
    }
    /// The mask shrunk by a square of half width `radius`; the image border does not shrink it.
    pub fn erode(self, mask: &[bool], radius: usize) -> Vec<bool> {
        let inverse: Vec<bool> = mask.iter().map(|set| !set).collect();
        self.count(&inverse, radius).into_iter().map(|n| n == 0).collect()
    }

    /// Four-connected components of the set pixels, as [`Grid::components`] gives them where all neighbours are linked: by
    /// runs of pixels, of which there are far fewer.
    pub fn blobs(self, mask: &[bool]) -> (Vec<u32>, Vec<usize>) {
        let mut runs: Vec<std::ops::Range<usize>> = Vec::new();
        // Where the runs of each row begin.
        let mut rows = Vec::with_capacity(self.height + 1);
        for row in 0..self.height {
            rows.push(runs.len());
            let (mut at, end) = (row * self.width, (row + 1) * self.width);
            while let Some(first) = mask[at..end].iter().position(|set| *set) {
                let length = mask[at + first..end].iter().position(|set| !set).unwrap_or(end - at - first);
                runs.push(at + first..at + first + length);
                at += first + length;
            }
        }
        rows.push(runs.len());
        let mut sets = DisjointSets::new(runs.len());
        for row in 1..self.height {
            let (mut above, mut own) = (rows[row - 1], rows[row]);
            while above < rows[row] && own < rows[row + 1] {
                let (from, to) = (runs[above].start + self.width, runs[above].end + self.width);
                if from < runs[own].end && runs[own].start < to {
                    sets.join(above, own);
                }
                if to < runs[own].end { above += 1 } else { own += 1 }
            }
        }
        // A root is the first of its runs, so that names are in reading order.
        let (mut labels, mut sizes, mut names) = (vec![u32::MAX; self.len()], Vec::new(), vec![0u32; runs.len()]);
        for (at, run) in runs.into_iter().enumerate() {
            let root = sets.root(at);
            if root == at {
                names[at] = sizes.len() as u32;
                sizes.push(0);
            }
            sizes[names[root] as usize] += run.len();
            labels[run].fill(names[root]);
        }
        (labels, sizes)
    }

    /// Four-connected components of the set pixels that `joined` allows to be linked: a label for every pixel
    /// (`u32::MAX` for background) and the sizes. `joined` gets the smaller index first.
    pub fn components(self, mask: &[bool], joined: impl Fn(usize, usize) -> bool) -> (Vec<u32>, Vec<usize>) {
        let (mut labels, mut sizes, mut front) = (vec![u32::MAX; self.len()], Vec::new(), Vec::new());
        for first in 0..self.len() {
            if !mask[first] || labels[first] != u32::MAX {
                continue;
            }
            let (name, mut size) = (sizes.len() as u32, 0);
            labels[first] = name;
            front.push(first);
            while let Some(index) = front.pop() {
                size += 1;
                for near in self.neighbours(index) {
                    if mask[near] && labels[near] == u32::MAX && joined(index.min(near), index.max(near)) {
                        labels[near] = name;
                        front.push(near);
                    }
                }
            }
            sizes.push(size);
        }
        (labels, sizes)
    }
}

/// Disjoint sets with path halving.
#[derive(Debug)]
pub(crate) struct DisjointSets {
    parent: Vec<u32>,
}

impl DisjointSets {
    pub fn new(count: usize) -> DisjointSets {
        DisjointSets { parent: (0..count as u32).collect() }
    }
    pub fn root(&mut self, mut index: usize) -> usize {
        while self.parent[index] as usize != index {
            self.parent[index] = self.parent[self.parent[index] as usize];
            index = self.parent[index] as usize;
        }
        index
    }
    /// Joins two sets; the smaller index stays the root, so that names do not depend on the order of joins.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        let (low, high) = (a.min(b), a.max(b));
        self.parent[high] = low as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const GRID: Grid = Grid { width: 5, height: 4 };

    fn mask(text: &str) -> Vec<bool> {
        text.chars().filter(|c| !c.is_whitespace()).map(|c| c == '#').collect()
    }

    #[test]
    fn counting_and_morphology_respect_borders() {
        let dot = mask("..... ..... ....# .....");
        assert_eq!(GRID.dilate(&dot, 1), mask("..... ...## ...## ...##"));
        let block = mask("###.. ###.. ###.. .....");
        assert_eq!(GRID.erode(&block, 1), mask("##... ##... ..... ....."));
        assert_eq!(GRID.count(&block, 4)[0], 9);
    }

    #[test]
    fn components_are_numbered_in_reading_order() {
        let (labels, sizes) = GRID.components(&mask("#.#.. #.### ..... ####."), |_, _| true);
        assert_eq!(sizes, [2, 4, 4]);
        assert_eq!((labels[0], labels[2], labels[9], labels[15]), (0, 1, 1, 2));
        let (_, cut) = GRID.components(&mask("##### ..... ..... ....."), |a, b| (a, b) != (1, 2));
        assert_eq!(cut, [2, 3]);
    }

    proptest! {
        #[test]
        fn blobs_are_the_components_of_plain_neighbours(mask in prop::collection::vec(prop::bool::weighted(0.6), 9 * 7)) {
            let grid = Grid { width: 9, height: 7 };
            prop_assert_eq!(grid.blobs(&mask), grid.components(&mask, |_, _| true));
        }
    }
}
