//! The plane faces of a thing, each with coordinates of its own: what is drawn on it seen from straight ahead.

use crate::{grid::Grid, scene::Scene};
use acm_concept::object::PixelSupport;
use glam::{DVec2, DVec3};
use nalgebra::{Matrix3, SymmetricEigen, Vector3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Faces of one thing that are looked for: a box shows three.
const MAX_FACES: usize = 3;
/// Points that planes are drawn from and judged by.
const SAMPLES: usize = 240;
/// Triples that are drawn for a face.
const DRAWS: usize = 30;
/// Fewer pixels are no face that could be read.
const LEAST_PX: usize = 100;
/// A face is no smaller a share of what is left of the thing.
const LEAST_SHARE: f64 = 0.15;
/// Pixels within so many tolerances of the plane are the face's.
const ON: f64 = 4.0;
/// Cosine of the steepest view of a face that is read.
const LEAST_VIEW: f64 = 0.3;
/// A face whose normal is more upright than this has no up of its own.
const LEVEL_COSINE: f64 = 0.8;

/// A rectangle of the image.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub left: usize,
    pub top: usize,
    pub grid: Grid,
}

impl Window {
    fn of(support: &PixelSupport) -> Window {
        let [left, top, right, bottom] = support.bounds.map(|value| value as usize);
        Window { left, top, grid: Grid { width: right + 1 - left, height: bottom + 1 - top } }
    }
    /// Image index of a place in the window.
    pub fn pixel(&self, at: usize, image: Grid) -> usize {
        image.index(self.left + self.grid.column(at), self.top + self.grid.row(at))
    }
}

/// A plane face: metres along `right` and `up` from `origin`, as seen from the front. Support frame.
#[derive(Debug, Clone)]
pub(super) struct Face {
    pub window: Window,
    /// Its pixels, holes filled, as a mask over the window.
    pub mask: Vec<bool>,
    pub origin: DVec3,
    pub right: DVec3,
    pub up: DVec3,
    pub normal: DVec3,
    /// Whether it looks up, so that `up`, away from the viewer, is assumed.
    pub level: bool,
    eye: DVec3,
    /// Directions in the camera's axes times this are the support frame's.
    camera: acm_concept::pose::Pose,
    intrinsics: acm_concept::camera::Intrinsics,
}

impl Face {
    /// Where a place of the window (its columns and rows) lies on the face, metres.
    pub fn place(&self, column: f64, row: f64) -> DVec2 {
        let ray = self.intrinsics.ray(column + self.window.left as f64, row + self.window.top as f64);
        let ray = self.camera.transform_vector(ray);
        let point = self.eye + ray * (self.normal.dot(self.origin - self.eye) / self.normal.dot(ray));
        DVec2::new(self.right.dot(point - self.origin), self.up.dot(point - self.origin))
    }
    /// The middle of a pixel of the window.
    pub fn place_of(&self, at: usize) -> DVec2 {
        self.place(self.window.grid.column(at) as f64, self.window.grid.row(at) as f64)
    }
    /// The point of a place on the face, support frame.
    pub fn point(&self, place: DVec2) -> DVec3 {
        self.origin + self.right * place.x + self.up * place.y
    }
    /// Column and row in the window of a place on the face.
    pub fn project(&self, place: DVec2) -> Option<DVec2> {
        let pixel = self.intrinsics.project(self.camera.inverse().transform_point(self.point(place)))?;
        Some(pixel - DVec2::new(self.window.left as f64, self.window.top as f64))
    }
    /// Pixels to a metre round a place, along a direction of the face.
    pub fn pixels_per_metre(&self, place: DVec2, along: DVec2) -> f64 {
        let step = 1e-3;
        let ends = (self.project(place - along * step), self.project(place + along * step));
        ends.0.zip(ends.1).map_or(0.0, |(a, b)| a.distance(b) / (2.0 * step))
    }
}

/// The plane faces of a thing, largest first.
pub(super) fn find(scene: &Scene, support: &PixelSupport) -> Vec<Face> {
    let window = Window::of(support);
    let pixels = support.indices();
    let at = |pixel: usize| {
        let (column, row) = (scene.grid.column(pixel), scene.grid.row(pixel));
        window.grid.index(column - window.left, row - window.top)
    };
    let mut left: Vec<usize> = pixels.iter().copied().filter(|&pixel| scene.point[pixel].x.is_finite()).collect();
    let total = left.len();
    let mut planes: Vec<(DVec3, DVec3)> = Vec::new();
    let mut rng = ChaCha8Rng::seed_from_u64(total as u64);
    let tolerance = |pixel: usize| 0.0025f32.max(0.004 * scene.scan.smooth[pixel]);
    while planes.len() < MAX_FACES && left.len() >= LEAST_PX.max((LEAST_SHARE * total as f64) as usize) {
        let Some((centre, normal)) = plane(scene, &left, tolerance(left[0]), &mut rng) else { break };
        let on =
            |&pixel: &usize| normal.dot(scene.point[pixel].as_dvec3() - centre).abs() < f64::from(tolerance(pixel));
        let before = left.len();
        left.retain(|pixel| !on(pixel));
        if before - left.len() < LEAST_PX {
            break;
        }
        planes.push((centre, normal));
    }
    let mut masks = vec![vec![false; window.grid.len()]; planes.len()];
    for &pixel in &pixels {
        let point = scene.point[pixel].as_dvec3();
        let distances = planes.iter().map(|(centre, normal)| normal.dot(point - *centre).abs()).enumerate();
        let nearest = distances.min_by(|a, b| a.1.total_cmp(&b.1));
        if let Some((plane, distance)) = nearest
            && distance < ON * f64::from(tolerance(pixel))
        {
            masks[plane][at(pixel)] = true;
        }
    }
    let eye = scene.camera.translation;
    let face = |((centre, normal), mask): ((DVec3, DVec3), Vec<bool>)| {
        let view = (eye - centre).normalize();
        let level = normal.z > LEVEL_COSINE;
        let ahead = scene.camera.transform_vector(DVec3::Z);
        let along = if level { ahead } else { DVec3::Z };
        let up = (along - normal * along.dot(normal)).try_normalize()?;
        // What crosses the face in one plane with its border, so that a thing in front of it leaves a hole.
        let on = |index: usize| {
            let pixel = window.pixel(index, scene.grid);
            let distance = normal.dot(scene.point[pixel].as_dvec3() - centre).abs();
            !distance.is_finite() || distance < ON * f64::from(tolerance(pixel))
        };
        (normal.dot(view) > LEAST_VIEW).then(|| Face {
            mask: filled(window.grid, &mask, on),
            window,
            origin: centre,
            right: up.cross(normal),
            up,
            normal,
            level,
            eye,
            camera: scene.camera,
            intrinsics: scene.scan.intrinsics,
        })
    };
    planes.into_iter().zip(masks).filter_map(face).collect()
}

/// The plane through most of the points, refined: a point on it and its normal towards the camera.
fn plane(scene: &Scene, pixels: &[usize], tolerance: f32, rng: &mut ChaCha8Rng) -> Option<(DVec3, DVec3)> {
    let stride = pixels.len().div_ceil(SAMPLES);
    let points: Vec<DVec3> = pixels.iter().step_by(stride).map(|&pixel| scene.point[pixel].as_dvec3()).collect();
    let tolerance = f64::from(tolerance);
    let mut best: Option<(usize, DVec3, DVec3)> = None;
    for _ in 0..DRAWS {
        let [a, b, c] = [0; 3].map(|_| points[rng.random_range(0..points.len())]);
        let Some(normal) = (b - a).cross(c - a).try_normalize() else { continue };
        let count = points.iter().filter(|p| normal.dot(**p - a).abs() < tolerance).count();
        if best.is_none_or(|(most, ..)| count > most) {
            best = Some((count, a, normal));
        }
    }
    let (_, mut centre, mut normal) = best?;
    for _ in 0..2 {
        let near: Vec<DVec3> = points.iter().copied().filter(|p| normal.dot(*p - centre).abs() < tolerance).collect();
        (centre, normal) = least_squares(&near)?;
    }
    let towards = normal.dot(scene.camera.translation - centre);
    Some((centre, if towards < 0.0 { -normal } else { normal }))
}

fn least_squares(points: &[DVec3]) -> Option<(DVec3, DVec3)> {
    if points.len() < 3 {
        return None;
    }
    let centre = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut scatter = Matrix3::zeros();
    for point in points {
        let d = *point - centre;
        let d = Vector3::new(d.x, d.y, d.z);
        scatter += d * d.transpose();
    }
    let eigen = SymmetricEigen::new(scatter);
    let least = eigen.eigenvalues.imin();
    let normal = eigen.eigenvectors.column(least);
    DVec3::new(normal[0], normal[1], normal[2]).try_normalize().map(|normal| (centre, normal))
}

/// A mask with the holes filled that do not reach the border of the grid and all of whose pixels `may` be filled.
pub(super) fn filled(grid: Grid, mask: &[bool], may: impl Fn(usize) -> bool) -> Vec<bool> {
    let outside: Vec<bool> = mask.iter().map(|set| !set).collect();
    let (labels, sizes) = grid.blobs(&outside);
    let mut open = vec![0usize; sizes.len()];
    let mut border = vec![false; sizes.len()];
    for (index, &label) in labels.iter().enumerate() {
        let Some(count) = open.get_mut(label as usize) else { continue };
        *count += usize::from(!may(index));
        let (column, row) = (grid.column(index), grid.row(index));
        border[label as usize] |= column == 0 || row == 0 || column + 1 == grid.width || row + 1 == grid.height;
    }
    let fill = |label: u32| {
        let label = label as usize;
        label >= sizes.len() || (!border[label] && open[label] * 10 <= sizes[label])
    };
    labels.iter().map(|&label| fill(label)).collect()
}
