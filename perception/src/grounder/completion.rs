//! The pixels that an object explains beyond those that were cut out for it: holes of the depth image at its edges, and the
//! foot that no height tells from the surface.

use crate::{expected, raster, scene::Scene};
use acm_concept::{
    object::{GroundedObject, PixelSupport},
    pose::Pose,
    template::{SeenBy, TemplateLibrary},
};
use rayon::prelude::*;

/// A measured depth agrees with the predicted one within this, and so many standard deviations of the noise.
const AGREES_M: f64 = 0.004;
const AGREES_SIGMAS: f64 = 2.5;

/// Adds to each standing object the pixels next to its own in which its solids are the nearest and nothing speaks against
/// them: no depth was measured there, or the predicted one. No object loses a pixel.
pub(super) fn complete(scene: &Scene, camera_pose: &Pose, library: &TemplateLibrary, objects: &mut [GroundedObject]) {
    let mut owner: Vec<Option<usize>> = vec![None; scene.grid.len()];
    // Among those that share a pixel the one with fewer is in front or on top.
    let mut order: Vec<usize> = (0..objects.len()).collect();
    order.sort_by_key(|&at| std::cmp::Reverse(objects[at].support.count));
    for &at in &order {
        for pixel in objects[at].support.indices() {
            owner[pixel] = Some(at);
        }
    }
    let mut nearest: Vec<Option<(usize, f64)>> = vec![None; scene.grid.len()];
    let cast = |object: &GroundedObject| {
        let solids = if stands(object, library) { expected::solids(&object.parts, library) } else { Vec::new() };
        raster::cast(&scene.scan.intrinsics, scene.grid, camera_pose, &solids).hits
    };
    let casts: Vec<Vec<(usize, f64)>> = objects.par_iter().map(cast).collect();
    for (at, hits) in casts.into_iter().enumerate() {
        for (pixel, depth) in hits {
            if nearest[pixel].is_none_or(|(_, other)| depth < other) {
                nearest[pixel] = Some((at, depth));
            }
        }
    }
    let explains = |pixel: usize, at: usize| {
        let Some((_, depth)) = nearest[pixel].filter(|(nearest, _)| *nearest == at && !scene.own[pixel]) else {
            return false;
        };
        let measured = f64::from(scene.scan.depth[pixel]);
        let tolerance = AGREES_M + AGREES_SIGMAS * scene.noise_ratio * scene.config.depth_sigma_m(depth);
        measured <= 0.0 || (measured - depth).abs() < tolerance
    };
    let mut added = Vec::with_capacity(objects.len());
    for (at, object) in objects.iter().enumerate() {
        let (mut front, mut more) = (object.support.indices(), Vec::new());
        while let Some(pixel) = front.pop() {
            for next in scene.grid.neighbours(pixel) {
                if owner[next].is_none() && explains(next, at) {
                    owner[next] = Some(at);
                    front.push(next);
                    more.push(next);
                }
            }
        }
        added.push(more);
    }
    objects.par_iter_mut().zip(added).filter(|(_, more)| !more.is_empty()).for_each(|(object, more)| {
        let mut all = object.support.indices();
        all.extend(more);
        all.sort_unstable();
        if let Some(support) = PixelSupport::from_indices(&all, scene.grid.width, scene.grid.len()) {
            object.support = support;
        }
    });
}

fn stands(object: &GroundedObject, library: &TemplateLibrary) -> bool {
    let template = object.parts.first().and_then(|part| library.get(&part.template));
    template.is_some_and(|template| template.seen_by == SeenBy::Depth)
}
