//! The colour of the bare surface, against which what lies or stands on it is told.

use crate::{scan::Tint, scene::Scene};

/// What is lighter than the surface by this much (CIELAB) has another colour; what is darker may lie in the shade.
const LIGHTER: f32 = 14.0;

/// The bare surface's colour is fitted to every so many-th pixel: its few numbers need no more. Prime to usual widths.
const SAMPLED: usize = 11;

/// The bare surface's tint and lightness as planes over the image: white balance and light change slowly across it.
pub(crate) struct SurfaceTint {
    /// For a and b: constant, per column, per row (both from -1 to 1).
    coefficients: [nalgebra::Vector3<f32>; 2],
    /// The same for the lightness of what is not in the shade.
    lightness: nalgebra::Vector3<f32>,
}

/// A pixel of the plane, as the planes over the image are fitted to it.
struct Sample {
    place: nalgebra::Vector3<f32>,
    tint: Tint,
    lightness: f32,
}

impl SurfaceTint {
    /// Of the pixels in the plane; `None` if there are none.
    pub fn measure(scene: &Scene) -> Option<SurfaceTint> {
        let sample =
            |i: usize| Sample { place: place(scene, i), tint: scene.scan.tint(i), lightness: scene.scan.lab[i][0] };
        let samples: Vec<Sample> =
            (0..scene.grid.len()).step_by(SAMPLED).filter(|&i| scene.in_plane[i]).map(sample).collect();
        let mode = mode(&samples.iter().map(|sample| sample.tint).collect::<Vec<_>>())?;
        let constant = |value: f32| nalgebra::Vector3::new(value, 0.0, 0.0);
        let mut tint = SurfaceTint { coefficients: [constant(mode.a), constant(mode.b)], lightness: constant(0.0) };
        for _ in 0..3 {
            let (mut matrix, mut right) = (nalgebra::Matrix3::zeros(), [nalgebra::Vector3::zeros(); 2]);
            for sample in samples.iter().filter(|sample| tint.is_bare(scene, sample)) {
                matrix += sample.place * sample.place.transpose();
                right[0] += sample.place * sample.tint.a;
                right[1] += sample.place * sample.tint.b;
            }
            let inverse = (matrix + nalgebra::Matrix3::identity() * 10.0).try_inverse()?;
            let pull = |c: f32, sum| inverse * (sum + constant(10.0 * c));
            tint.coefficients = [pull(mode.a, right[0]), pull(mode.b, right[1])];
        }
        tint.lightness = tint.lit(scene, &samples)?;
        Some(tint)
    }
    /// Whether a pixel is darker than the bare surface would be there, by more than a difference of lightness.
    pub fn is_darker(&self, scene: &Scene, pixel: usize, by: f32) -> bool {
        self.lightness.dot(&place(scene, pixel)) - scene.scan.lab[pixel][0] > by
    }
    fn is_bare(&self, scene: &Scene, sample: &Sample) -> bool {
        sample.tint.distance(&self.tint_at(&sample.place)) <= 0.6 * scene.config.patch_contrast
    }
    /// The lightness of the bare surface: the middle of all, then a plane through what is near it.
    fn lit(&self, scene: &Scene, samples: &[Sample]) -> Option<nalgebra::Vector3<f32>> {
        let bare: Vec<&Sample> = samples.iter().filter(|sample| self.is_bare(scene, sample)).collect();
        let mut values: Vec<f32> = bare.iter().map(|sample| sample.lightness).collect();
        values.sort_by(f32::total_cmp);
        let middle = values.get(values.len() / 2).copied()?;
        let mut plane = nalgebra::Vector3::new(middle, 0.0, 0.0);
        for _ in 0..3 {
            let (mut matrix, mut right) = (nalgebra::Matrix3::identity() * 10.0, plane * 10.0);
            for sample in &bare {
                if (sample.lightness - plane.dot(&sample.place)).abs() < 0.6 * LIGHTER {
                    matrix += sample.place * sample.place.transpose();
                    right += sample.place * sample.lightness;
                }
            }
            plane = matrix.try_inverse()? * right;
        }
        Some(plane)
    }
    /// Whether a pixel has another colour than the bare surface would have there.
    pub fn is_unlike(&self, scene: &Scene, pixel: usize) -> bool {
        let place = place(scene, pixel);
        let lighter = scene.scan.lab[pixel][0] - self.lightness.dot(&place);
        scene.scan.tint(pixel).distance(&self.tint_at(&place)) > scene.config.patch_contrast || lighter > LIGHTER
    }
    fn tint_at(&self, place: &nalgebra::Vector3<f32>) -> Tint {
        Tint { a: self.coefficients[0].dot(place), b: self.coefficients[1].dot(place) }
    }
}

fn place(scene: &Scene, pixel: usize) -> nalgebra::Vector3<f32> {
    let across = scene.grid.column(pixel) as f32 / scene.grid.width as f32;
    let down = scene.grid.row(pixel) as f32 / scene.grid.height as f32;
    nalgebra::Vector3::new(1.0, 2.0 * across - 1.0, 2.0 * down - 1.0)
}

/// The most frequent tint: the fullest cell of a histogram, refined by the mean round it.
fn mode(tints: &[Tint]) -> Option<Tint> {
    const CELL: f32 = 4.0;
    const HALF: i32 = 40;
    let cell = |value: f32| (value / CELL).round().clamp(-HALF as f32, HALF as f32) as i32 + HALF;
    let side = 2 * HALF as usize + 1;
    let mut counts = vec![0u32; side * side];
    for tint in tints {
        counts[cell(tint.a) as usize * side + cell(tint.b) as usize] += 1;
    }
    let fullest = (0..counts.len()).max_by_key(|&i| (counts[i], std::cmp::Reverse(i)))?;
    let middle = |at: usize| (at as f32 - HALF as f32) * CELL;
    let middle = Tint { a: middle(fullest / side), b: middle(fullest % side) };
    mean(tints.iter().copied().filter(|tint| tint.distance(&middle) < 2.0 * CELL))
}

pub(crate) fn mean(tints: impl Iterator<Item = Tint>) -> Option<Tint> {
    let (sum, count) = tints.fold((Tint { a: 0.0, b: 0.0 }, 0.0f32), |(sum, count), tint| {
        (Tint { a: sum.a + tint.a, b: sum.b + tint.b }, count + 1.0)
    });
    (count > 0.0).then(|| Tint { a: sum.a / count, b: sum.b / count })
}
