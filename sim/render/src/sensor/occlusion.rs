//! The shadow that near things throw on far ones because the second imager cannot see behind them.

/// How much larger a disparity must be to hide another one, pixels. Neighbours on one slanted surface, which land on
/// the same pixel of the second imager, differ by less.
const MARGIN_PX: f32 = 1.0;
/// If disparity nowhere rises faster than this from a pixel to the next, two pixels that land within two pixels of
/// each other are at most two apart, differ by less than the margin, and nothing is hidden.
const HARMLESS_RISE_PX: f32 = 0.3;

/// Finds what the second imager, to the right of the first, does not see. Keeps its buffer between rows.
#[derive(Default)]
pub(crate) struct Occlusion {
    nearest: Vec<f32>,
}

impl Occlusion {
    /// Marks the occluded pixels of one row. `disparity`, times `scale`, is in pixels of this very image; 0 where
    /// there is nothing.
    ///
    /// Every pixel moves left by its disparity into the second image, where the largest disparity wins; whoever
    /// finds a larger one in its place is hidden.
    pub(crate) fn mark(&mut self, disparity: &[f32], scale: f32, hidden: &mut [bool]) {
        hidden.fill(false);
        let rise = disparity.windows(2).map(|pair| pair[1] - pair[0]).fold(0f32, |most, rise| most.max(rise));
        if rise * scale <= HARMLESS_RISE_PX {
            return;
        }
        let width = disparity.len();
        self.nearest.clear();
        self.nearest.resize(2 * width + 2, 0.0);
        for (column, &d) in disparity.iter().enumerate() {
            let Some(at) = place(column, d * scale, width) else { continue };
            // A pixel lands between two; taking both closes the gaps of surfaces that the second imager sees wider.
            if let Some(slots) = self.nearest.get_mut(at..at + 2) {
                slots[0] = slots[0].max(d);
                slots[1] = slots[1].max(d);
            }
        }
        let margin = MARGIN_PX / scale;
        for (column, (&d, hidden)) in disparity.iter().zip(hidden).enumerate() {
            let front = place(column, d * scale, width).and_then(|at| self.nearest.get(at));
            *hidden = front.is_some_and(|&front| front > d + margin);
        }
    }
}

/// Where a pixel lands in the second image, which begins one width further left than the first. `None` for what is
/// so near that it lands outside; nothing far lands there, so it hides nothing.
fn place(column: usize, disparity: f32, width: usize) -> Option<usize> {
    let at = (column + width) as f32 - disparity;
    (at >= 0.0).then_some(at as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hidden(disparity: &[f32]) -> Vec<usize> {
        let mut marks = vec![false; disparity.len()];
        Occlusion::default().mark(disparity, 1.0, &mut marks);
        (0..disparity.len()).filter(|&column| marks[column]).collect()
    }

    #[test]
    fn the_shadow_lies_left_of_the_near_thing_and_is_as_wide_as_the_disparities_differ() {
        // 12 pixels against 30: a shadow of 18 pixels just left of columns 50 to 79, none on the right.
        let row: Vec<f32> = (0..120).map(|column| if (50..80).contains(&column) { 30.0 } else { 12.0 }).collect();
        assert_eq!(hidden(&row), (32..50).collect::<Vec<_>>());
    }

    #[test]
    fn the_second_imager_sees_past_a_thin_bar() {
        let row: Vec<f32> = (0..120).map(|column| if (50..54).contains(&column) { 30.0 } else { 12.0 }).collect();
        let found = hidden(&row);
        // As wide as the bar, give or take a pixel, and as far left as the disparities differ.
        assert!((4..=5).contains(&found.len()) && found.contains(&33), "{found:?}");
    }

    #[test]
    fn a_slanted_surface_does_not_hide_itself() {
        let row: Vec<f32> = (0..200).map(|column| 10.0 + 0.4 * column as f32).collect();
        assert_eq!(hidden(&row), Vec::<usize>::new());
        let row: Vec<f32> = (0..200).map(|column| 90.0 - 0.4 * column as f32).collect();
        assert_eq!(hidden(&row), Vec::<usize>::new());
    }
}
