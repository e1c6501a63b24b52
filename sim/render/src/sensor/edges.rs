//! Pixels near jumps in depth, where a matcher's window covers two surfaces.

/// Farthest from a jump that a pixel is still marked, pixels.
pub(crate) const MAX_REACH: u8 = 4;
/// Neighbours whose disparities differ by more than this belong to two surfaces, pixels.
pub(crate) const JUMP_PX: f32 = 0.5;

/// For every pixel, how far the nearest jump is and how near the foreground there is.
pub(crate) struct Edges {
    /// Distance to the nearest jump: 1 for the pixels on both its sides, 0 where there is none within reach.
    pub distance: Vec<u8>,
    /// Largest disparity at the jumps within reach; 0 where there is none.
    pub foreground: Vec<f32>,
}

impl Edges {
    /// Looks along rows and columns for jumps, and marks what lies within `reach` pixels.
    pub(crate) fn find(disparity: &[f32], width: usize, reach: u8) -> Edges {
        let mut edges = Edges { distance: vec![0; disparity.len()], foreground: vec![0.0; disparity.len()] };
        let reach = reach.clamp(1, MAX_REACH);
        for (row, values) in disparity.chunks_exact(width).enumerate() {
            let below = disparity.chunks_exact(width).nth(row + 1);
            for (column, &value) in values.iter().enumerate() {
                let right = values.get(column + 1).copied().unwrap_or(value);
                if (value - right).abs() > JUMP_PX {
                    edges.mark(width, (column, row), value.max(right), reach);
                    edges.mark(width, (column + 1, row), value.max(right), reach);
                }
                let under = below.map_or(value, |below| below[column]);
                if (value - under).abs() > JUMP_PX {
                    edges.mark(width, (column, row), value.max(under), reach);
                    edges.mark(width, (column, row + 1), value.max(under), reach);
                }
            }
        }
        edges
    }

    fn mark(&mut self, width: usize, (column, row): (usize, usize), foreground: f32, reach: u8) {
        let around = usize::from(reach) - 1;
        let columns = column.saturating_sub(around)..(column + around + 1).min(width);
        for y in row.saturating_sub(around)..=row + around {
            let start = y * width;
            let Some(distances) = self.distance.get_mut(start + columns.start..start + columns.end) else { break };
            let near = &mut self.foreground[start + columns.start..start + columns.end];
            for (x, (distance, near)) in columns.clone().zip(distances.iter_mut().zip(near)) {
                let far = x.abs_diff(column).max(y.abs_diff(row)) as u8 + 1;
                *distance = if *distance == 0 { far } else { far.min(*distance) };
                *near = near.max(foreground);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_marked_on_both_sides_and_a_slope_is_not() {
        let row: Vec<f32> = [10.0, 10.3, 10.6, 10.9, 11.2, 15.0, 15.0, 15.0, 15.0, 15.0].to_vec();
        let edges = Edges::find(&row.repeat(3), 10, 3);
        assert_eq!(edges.distance[10..20], [0, 0, 3, 2, 1, 1, 2, 3, 0, 0]);
        assert_eq!(edges.foreground[10..20], [0.0, 0.0, 15.0, 15.0, 15.0, 15.0, 15.0, 15.0, 0.0, 0.0]);
    }

    #[test]
    fn a_step_between_rows_is_marked_too() {
        let field: Vec<f32> = [vec![5.0; 20], vec![9.0; 20]].concat();
        let edges = Edges::find(&field, 5, 2);
        let column: Vec<u8> = edges.distance.iter().skip(2).step_by(5).copied().collect();
        assert_eq!(column, [0, 0, 2, 1, 1, 2, 0, 0]);
    }
}
