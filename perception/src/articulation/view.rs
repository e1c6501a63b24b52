//! A frame as points in the world, with the noise of each.

use crate::{
    GrounderConfig,
    grid::Grid,
    scan::{Scan, Tint},
};
use acm_concept::{camera::RgbdFrame, object::Blindness, pose::Pose};
use glam::{DVec3, Vec3};

/// A step of depth between neighbours that is larger than this share of the depth is an edge, not a slope.
const EDGE_SHARE: f64 = 0.03;
/// Noise of a smoothed depth against that of one pixel; noise of neighbours is alike.
const SMOOTHED: f64 = 0.7;
/// A pixel samples the scene so far from its middle, pixels.
const LATERAL_PX: f64 = 0.7;

/// A surface's direction is taken over so many pixels to either side.
const SPAN_PX: isize = 5;

/// A frame whose pixels can be asked what they measured of a point of the world.
pub(super) struct View<'a> {
    pub scan: Scan,
    pub camera: Pose,
    /// World to camera.
    inverse: Pose,
    /// Standard deviation of each pixel's depth, metres; slopes count.
    pub sigma: Vec<f32>,
    /// Depths between which a pixel and its direct neighbours lie; nothing is free beyond the nearest.
    pub nearest: Vec<f32>,
    /// Direction of each pixel's surface in the world, towards the camera; zero where it is not known.
    pub normal: Vec<Vec3>,
    /// Colour of each pixel with the light taken out, averaged over its surroundings.
    pub tint: Vec<Tint>,
    asked: Option<&'a [bool]>,
}

/// What a view measured where a point should be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Sight {
    /// Behind the camera or beside the image.
    Outside,
    /// Nothing was measured there.
    Unmeasured,
    /// The measured depth is so many standard deviations (and metres) beyond the point's, at that pixel.
    Beyond { sigmas: f64, metres: f64, pixel: usize },
}

impl<'a> View<'a> {
    pub fn new(
        frame: &RgbdFrame,
        asked: Option<&'a [bool]>,
        config: &GrounderConfig,
    ) -> Result<View<'a>, (Blindness, f64)> {
        let scan = Scan::read(frame, config)?;
        let grid = scan.grid;
        let (mut sigma, mut nearest) = (vec![0f32; grid.len()], vec![0f32; grid.len()]);
        for index in 0..grid.len() {
            let z = f64::from(scan.smooth[index]);
            if z == 0.0 {
                continue;
            }
            let (mut slope, mut near) = (0f64, z);
            for other in grid.neighbours(index) {
                let there = f64::from(scan.smooth[other]);
                if there > 0.0 {
                    near = near.min(there);
                    if (there - z).abs() < EDGE_SHARE * z {
                        slope = slope.max((there - z).abs());
                    }
                }
            }
            let noise = SMOOTHED * config.depth_sigma_m(z);
            sigma[index] = noise.hypot(LATERAL_PX * slope).hypot(config.noise_floor_m) as f32;
            nearest[index] = near as f32;
        }
        let camera = frame.header.camera_pose;
        let asked = asked.filter(|mask| mask.len() == grid.len());
        let (normal, tint) = (normals(&scan, &camera), tints(&scan));
        Ok(View { scan, camera, inverse: camera.inverse(), sigma, nearest, normal, tint, asked })
    }

    pub fn grid(&self) -> Grid {
        self.scan.grid
    }

    /// Whether a pixel is asked for and was measured.
    pub fn takes(&self, pixel: usize) -> bool {
        self.scan.smooth[pixel] > 0.0 && self.asked.is_none_or(|mask| mask[pixel])
    }

    /// The point of the world that a pixel measured, metres.
    pub fn point(&self, pixel: usize) -> DVec3 {
        self.camera.transform_point(self.scan.ray(pixel) * f64::from(self.scan.smooth[pixel]))
    }

    /// The pixel that looks at a point, and the point's depth.
    pub fn pixel(&self, point: DVec3) -> Option<(usize, f64)> {
        let own = self.inverse.transform_point(point);
        let at = self.scan.intrinsics.project(own)?;
        let grid = self.grid();
        let (column, row) = (at.x.round(), at.y.round());
        let inside = column >= 0.0 && row >= 0.0 && column < grid.width as f64 && row < grid.height as f64;
        inside.then(|| (grid.index(column as usize, row as usize), own.z))
    }

    /// What was measured where a point should be.
    pub fn sight(&self, point: DVec3) -> Sight {
        let Some((pixel, depth)) = self.pixel(point) else { return Sight::Outside };
        let measured = f64::from(self.scan.smooth[pixel]);
        if measured == 0.0 {
            return Sight::Unmeasured;
        }
        let metres = measured - depth;
        Sight::Beyond { sigmas: metres / f64::from(self.sigma[pixel]), metres, pixel }
    }
}

/// Directions of surfaces, from points on either side of each pixel that lie on the same surface.
fn normals(scan: &Scan, camera: &Pose) -> Vec<Vec3> {
    let grid = scan.grid;
    let point = |pixel: usize| scan.ray(pixel) * f64::from(scan.smooth[pixel]);
    let across = |pixel: usize, dx: isize, dy: isize| -> Option<DVec3> {
        let z = f64::from(scan.smooth[pixel]);
        let near = |other: Option<usize>| {
            other.filter(|other| {
                let there = f64::from(scan.smooth[*other]);
                there > 0.0 && (there - z).abs() < EDGE_SHARE * z * SPAN_PX as f64
            })
        };
        match (near(grid.offset(pixel, dx, dy)), near(grid.offset(pixel, -dx, -dy))) {
            (Some(a), Some(b)) => Some(point(a) - point(b)),
            (Some(a), None) => Some(point(a) - point(pixel)),
            (None, Some(b)) => Some(point(pixel) - point(b)),
            (None, None) => None,
        }
    };
    let normal = |pixel: usize| -> Option<Vec3> {
        if scan.smooth[pixel] == 0.0 {
            return None;
        }
        // Down cross right looks towards the camera.
        let normal = across(pixel, 0, SPAN_PX)?.cross(across(pixel, SPAN_PX, 0)?).try_normalize()?;
        Some(camera.transform_vector(normal).as_vec3())
    };
    (0..grid.len()).map(|pixel| normal(pixel).unwrap_or(Vec3::ZERO)).collect()
}

/// Colours, averaged over neighbours on the same surface: of a dark pixel alone the tint is mostly noise.
fn tints(scan: &Scan) -> Vec<Tint> {
    let grid = scan.grid;
    let tint = |pixel: usize| {
        let z = scan.smooth[pixel];
        let (mut sum, mut count) = ([0f32; 3], 0f32);
        for (dx, dy) in [(0, 0), (2, 0), (-2, 0), (0, 2), (0, -2), (1, 1), (-1, 1), (1, -1), (-1, -1)] {
            let Some(other) = grid.offset(pixel, dx, dy) else { continue };
            if (scan.smooth[other] - z).abs() <= EDGE_SHARE as f32 * z {
                sum.iter_mut().zip(scan.lab[other]).for_each(|(sum, value)| *sum += value);
                count += 1.0;
            }
        }
        let [l, a, b] = sum.map(|sum| sum / count);
        Tint::new(l, a, b)
    };
    (0..grid.len()).map(tint).collect()
}
