//! The pixels that an object explains beyond those that were cut out for it: holes of the depth image at its edges, and the
//! foot that no height tells from the surface.

use crate::{expected, raster, scene::Scene};
use acm_concept::{
    object::{GroundedObject, PixelSupport},
    pose::Pose,
    template::{SeenBy, TemplateLibrary},
};

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
    for (at, object) in objects.iter().enumerate().filter(|(_, object)| stands(object, library)) {
        let solids = expected::solids(&object.parts, library);
        for (pixel, depth) in raster::cast(&scene.scan.intrinsics, scene.grid, camera_pose, &solids).hits {
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
    for (at, object) in objects.iter_mut().enumerate() {
        let own = object.support.indices();
        let mut mask = vec![false; scene.grid.len()];
        own.iter().for_each(|&pixel| mask[pixel] = true);
        let mut front = own;
        while let Some(pixel) = front.pop() {
            for next in scene.grid.neighbours(pixel) {
                if !mask[next] && owner[next].is_none() && explains(next, at) {
                    (mask[next], owner[next]) = (true, Some(at));
                    front.push(next);
                }
            }
        }
        if let Some(support) = PixelSupport::from_mask(&mask, scene.grid.width) {
            object.support = support;
        }
    }
}

fn stands(object: &GroundedObject, library: &TemplateLibrary) -> bool {
    let template = object.parts.first().and_then(|part| library.get(&part.template));
    template.is_some_and(|template| template.seen_by == SeenBy::Depth)
}
