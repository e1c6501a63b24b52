//! Where the shadow map looks: as tightly as possible round what the camera sees.

use crate::{projection::side_planes, scene::Sun};
use acm_concept::camera::CameraModel;
use glam::{DMat3, DMat4, DVec3};

/// Shadows are cast on surfaces up to this depth, metres. Beyond, everything is lit: one far wall must not
/// coarsen the shadows on the table.
const SHADOW_DISTANCE_M: f64 = 4.0;
/// The map's borders move in steps of this length, metres, so that shadows do not crawl when something small moves.
const STEP_M: f64 = 0.1;

/// The eight corners of a box round an instance, in the camera frame: bit k of the index chooses the end of axis k.
pub(crate) type Corners = [DVec3; 8];

const FACES: [[usize; 4]; 6] = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];

/// The view of the sun.
pub(crate) struct ShadowView {
    /// The map's clip space from the camera frame.
    pub clip_from_camera: DMat4,
    /// Edge of a texel, metres; the longer one.
    pub texel_m: f64,
}

/// The view that covers every surface in `boxes` that the camera sees, or `None` if it sees none.
pub(crate) fn fit(boxes: &[Corners], camera: &CameraModel, sun: &Sun) -> Option<ShadowView> {
    let sun_from_camera = sun_frame(sun) * DMat3::from_quat(camera.pose.rotation);
    let origin = sun_frame(sun) * camera.pose.translation;
    let to_sun = |point: DVec3| sun_from_camera * point + origin;

    let mut low = DVec3::INFINITY;
    let mut high = DVec3::NEG_INFINITY;
    let planes = side_planes(&camera.intrinsics);
    for corners in boxes {
        for face in FACES {
            for point in clipped(face.map(|corner| corners[corner]), &planes) {
                low = low.min(to_sun(point));
                high = high.max(to_sun(point));
            }
        }
    }
    if !(low.is_finite() && high.is_finite()) {
        return None;
    }
    let snapped = |value: f64, outward: f64| (value / STEP_M + outward).round() * STEP_M;
    low = low.map(|value| snapped(value, -0.5 - 1e-6));
    high = high.map(|value| snapped(value, 0.5 + 1e-6));
    // What stands between the sun and the seen surfaces casts shadows wherever it is.
    for point in boxes.iter().flatten() {
        low.z = low.z.min(to_sun(*point).z - STEP_M);
    }

    let span = (high - low).max(DVec3::splat(STEP_M));
    let scale = DVec3::new(2.0 / span.x, 2.0 / span.y, 1.0 / span.z);
    let shift = DVec3::new(-(low.x + high.x) / span.x, -(low.y + high.y) / span.y, -low.z / span.z);
    let clip_from_sun = DMat4::from_translation(shift) * DMat4::from_scale(scale);
    let clip_from_camera = clip_from_sun * DMat4::from_translation(origin) * DMat4::from_mat3(sun_from_camera);
    Some(ShadowView { clip_from_camera, texel_m: span.x.max(span.y) / f64::from(sun.shadow_map.max(1)) })
}

/// Rotation from the world to a frame whose z runs with the light.
fn sun_frame(sun: &Sun) -> DMat3 {
    let z = sun.direction.normalize();
    let (x, y) = z.any_orthonormal_pair();
    DMat3::from_cols(x, y, z).transpose()
}

/// The part of a face that lies inside the planes through the origin and nearer than the shadow distance.
fn clipped(face: [DVec3; 4], planes: &[DVec3; 4]) -> Vec<DVec3> {
    let far = |point: DVec3| SHADOW_DISTANCE_M - point.z;
    let mut polygon = cut(&face, far);
    for plane in planes {
        polygon = cut(&polygon, |point| plane.dot(point));
    }
    polygon
}

/// One step of polygon clipping: keeps what has a non-negative signed distance.
fn cut(polygon: &[DVec3], distance: impl Fn(DVec3) -> f64) -> Vec<DVec3> {
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    let Some(mut previous) = polygon.last().copied() else { return kept };
    for &point in polygon {
        let (before, here) = (distance(previous), distance(point));
        if (before < 0.0) != (here < 0.0) {
            kept.push(previous.lerp(point, before / (before - here)));
        }
        if here >= 0.0 {
            kept.push(point);
        }
        previous = point;
    }
    kept
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;
    use acm_concept::{camera::Intrinsics, pose::Pose};
    use glam::DQuat;

    fn camera() -> CameraModel {
        CameraModel {
            name: "head".into(),
            intrinsics: Intrinsics::from_vertical_fov(320, 240, 0.8),
            // One metre above the ground, looking down.
            pose: Pose::new(DVec3::Z, DQuat::from_rotation_x(std::f64::consts::PI)),
            depth_min_m: 0.1,
            depth_max_m: 6.0,
            mount: Default::default(),
        }
    }

    fn sun() -> Sun {
        Sun { direction: DVec3::new(0.0, 0.5, -1.0), intensity: 1.0, shadow_map: 512 }
    }

    fn ground(camera: &CameraModel, half: f64) -> Corners {
        let inverse = camera.pose.inverse();
        std::array::from_fn(|k| {
            let side = |bit: usize| if k >> bit & 1 == 1 { half } else { -half };
            inverse.transform_point(DVec3::new(side(0), side(1), if k >> 2 & 1 == 1 { 0.0 } else { -0.1 }))
        })
    }

    #[test]
    fn a_large_ground_is_covered_only_where_it_is_seen() {
        let camera = camera();
        let view = fit(&[ground(&camera, 50.0)], &camera, &sun()).unwrap();
        // The image covers 0.85 m x 1.13 m of the ground.
        assert!(view.texel_m < 1.6 / 512.0, "{}", view.texel_m);
        for (column, row) in [(-0.4, -0.4), (319.4, 239.4), (160.0, 0.0)] {
            let ray = camera.intrinsics.ray(column, row);
            let clip = view.clip_from_camera.project_point3(ray);
            assert!(clip.x.abs() <= 1.0 && clip.y.abs() <= 1.0 && (0.0..=1.0).contains(&clip.z), "{clip}");
        }
    }

    #[test]
    fn what_is_not_seen_needs_no_map() {
        let camera = camera();
        let behind = ground(&camera, 0.1).map(|point| point - 3.0 * DVec3::Z);
        assert!(fit(&[behind], &camera, &sun()).is_none());
        assert!(fit(&[], &camera, &sun()).is_none());
    }
}
