//! Fits against evidence made from solids by hand.
#![allow(clippy::unwrap_used, clippy::expect_used)] // A failed unwrap is a failed test.

use super::*;
use acm_concept::{
    camera::Intrinsics,
    object::Observability,
    pose::Pose,
    solid::{PlacedSolid, Solid},
    template::{Template, Unit},
};
use glam::{DMat3, DQuat, DVec2, DVec3};
use proptest::prelude::{ProptestConfig, prop_assert, proptest};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

const BOX: &str = include_str!("../../../memory/library/box.toml");
const CYLINDER: &str = include_str!("../../../memory/library/cylinder.toml");
const CUP: &str = include_str!("../../../memory/library/tableware/cup.toml");

/// A camera that looks at the origin, `pitch` below the horizon, from 0.8 m.
fn camera(pitch: f64) -> Pose {
    let forward = DVec3::new(0.0, pitch.cos(), -pitch.sin());
    let down = forward.cross(DVec3::X);
    Pose::new(-forward * 0.8, DQuat::from_mat3(&DMat3::from_cols(DVec3::X, down, forward)).normalize())
}

/// What a camera sees of one solid on the plane: noisy points and the outline, its foot in contact with the plane.
fn evidence(solid: &PlacedSolid, camera: Pose, sigma_m: f64) -> Evidence {
    let intrinsics = Intrinsics::from_vertical_fov(320, 240, 0.6);
    let mut random = ChaCha8Rng::seed_from_u64(9);
    let depth = |column: i64, row: i64| {
        let ray = camera.transform_vector(intrinsics.ray(column as f64, row as f64));
        solid.intersect_ray(camera.translation, ray).map(|(enter, _)| camera.translation + ray * enter)
    };
    let (mut points, mut outline) = (Vec::new(), Vec::new());
    for (column, row) in (0..320i64).flat_map(|c| (0..240i64).map(move |r| (c, r))) {
        let Some(at) = depth(column, row) else { continue };
        if (column + row) % 5 == 0 {
            let noise = (at - camera.translation).normalize() * sigma_m * random.random_range(-1.7..1.7);
            points.push(SurfacePoint { position: at + noise, sigma_m });
        }
        for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            if depth(column + dx, row + dy).is_none() {
                let kind = if at.z < 0.012 { OutlineKind::Contact } else { OutlineKind::Own };
                let pixel = DVec2::new(column as f64 + 0.5 * dx as f64, row as f64 + 0.5 * dy as f64);
                outline.push(OutlinePoint {
                    pixel,
                    sigma_px: 1.5,
                    kind,
                    falls_off: kind == OutlineKind::Own,
                    beyond: u32::MAX,
                });
            }
        }
    }
    Evidence { camera, intrinsics, points, point_weight: 0.3, outline, outline_weight: 0.3 }
}

fn upright_box(size: DVec3, at: DVec2, yaw: f64) -> PlacedSolid {
    PlacedSolid { solid: Solid::Box { size }, pose: Pose::from_yaw(at.extend(size.z * 0.5), yaw) }
}

fn fit<'a>(template: &'a Template, initial: &[f64], at: DVec2, yaw: f64, evidence: &Evidence) -> (Model<'a>, Minimum) {
    let model = Model::new(template, initial.to_vec(), Base::At(0.0)).unwrap();
    let start = approach(&model, evidence, &model.start(at, yaw));
    let minimum = minimise(&model, evidence, &start);
    (model, minimum)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(10))]
    #[test]
    fn a_box_is_recovered_from_a_rough_start(
        length in 0.06..0.2f64, share in 0.4..0.9f64, height in 0.04..0.15f64, yaw in -0.6..0.6f64, off in -0.012..0.012f64,
    ) {
        let (template, size) = (Template::parse("box.toml", BOX).unwrap(), DVec3::new(length, length * share, height));
        let evidence = evidence(&upright_box(size, DVec2::new(0.02, -0.01), yaw), camera(0.8), 0.002);
        let rough = [length * 1.1, length * share * 0.88, height + 0.5 * off];
        let (model, minimum) = fit(&template, &rough, DVec2::new(0.02 + off, -0.01 - off), yaw + 0.1, &evidence);
        let found = model.placement(&minimum.state);
        for (value, truth) in found.values.iter().zip(size.to_array()) {
            prop_assert!((value - truth).abs() < 0.003, "{:?} for {size}", found.values);
        }
        prop_assert!((found.pose.yaw() - yaw).abs() < 0.03 && found.pose.translation.truncate().distance(DVec2::new(0.02, -0.01)) < 0.003);
    }

    #[test]
    fn a_cylinder_is_recovered_from_a_rough_start(radius in 0.02..0.1f64, height in 0.03..0.15f64, off in -0.012..0.012f64) {
        let template = Template::parse("cylinder.toml", CYLINDER).unwrap();
        let solid = PlacedSolid { solid: Solid::Cylinder { radius, height }, pose: Pose::from_translation(DVec3::Z * height * 0.5) };
        let evidence = evidence(&solid, camera(0.8), 0.002);
        let (model, minimum) = fit(&template, &[radius * 1.15, height * 0.9], DVec2::new(off, -off), 0.0, &evidence);
        let values = model.placement(&minimum.state).values;
        prop_assert!(!model.turns && minimum.state.len() == 4);
        prop_assert!((values[0] - radius).abs() < 0.003 && (values[1] - height).abs() < 0.003, "{values:?}");
    }
}

#[test]
fn a_depth_that_nobody_sees_is_an_interval() {
    let template = Template::parse("box.toml", BOX).unwrap();
    let size = DVec3::new(0.16, 0.06, 0.12);
    // Level with the box, only its front is seen; from above all of it.
    let seen = |pitch: f64| {
        let evidence = evidence(&upright_box(size, DVec2::ZERO, 0.0), camera(pitch), 0.002);
        let (model, minimum) = fit(&template, &size.to_array(), DVec2::ZERO, 0.0, &evidence);
        profile(&model, &evidence, &minimum)
    };
    let from_above = seen(0.9);
    assert!(from_above.parameters.iter().all(|o| *o == Observability::Observed), "{from_above:?}");
    assert_eq!(from_above.drift_m, DVec2::ZERO);
    let level = seen(0.02);
    assert!(level.drift_m.y > 0.02 && level.drift_m.x < 0.01, "{level:?}");
    let level = level.parameters;
    assert_eq!((level[0], level[2]), (Observability::Observed, Observability::Observed));
    assert!(matches!(level[1], Observability::Interval { low, high } if low < 0.05 && high > 0.1), "{level:?}");
}

#[test]
fn the_state_maps_onto_the_parameters() {
    let template = Template::parse("box.toml", BOX).unwrap();
    assert!(template.parameters.iter().all(|p| p.unit == Unit::M && !p.fixed));
    let model = Model::new(&template, vec![0.2, 0.1, 0.05], Base::Free(0.3)).unwrap();
    let state = model.start(DVec2::new(1.0, 2.0), 0.5);
    assert_eq!(state, [1.0, 2.0, 0.5, 0.3, 0.2, 0.1, 0.05]);
    assert_eq!((model.yaw_index(), model.base_index(), model.parameter_index(2)), (Some(2), Some(3), Some(6)));
    let placement = model.placement(&state);
    assert!(placement.pose.translation.distance(DVec3::new(1.0, 2.0, 0.3)) < 1e-12);
    let rigid = Model::new(&template, vec![0.2, 0.1, 0.05], Base::At(0.0)).unwrap().rigid();
    assert_eq!(rigid.start(DVec2::ZERO, 0.5).len(), 3);
    assert_eq!(rigid.placement(&[0.0, 0.0, 0.0]).values, [0.2, 0.1, 0.05]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn a_can_on_its_side_is_recovered_from_a_rough_start(
        radius in 0.03..0.1f64, height in 0.05..0.15f64, yaw in -0.9..0.9f64, off in -0.01..0.01f64,
    ) {
        let template = Template::parse("cylinder.toml", CYLINDER).unwrap();
        let rest = &template.rests[0];
        let rotation = DQuat::from_rotation_z(yaw) * rest.turn();
        let solid = PlacedSolid {
            solid: Solid::Cylinder { radius, height },
            pose: Pose::new(DVec3::new(0.02, -0.01, radius), rotation),
        };
        let evidence = evidence(&solid, camera(0.8), 0.002);
        let model = Model::new(&template, vec![radius * 1.1, height * 0.9], Base::At(0.0)).unwrap().lying(Some(rest));
        let start = approach(&model, &evidence, &model.start(DVec2::new(0.02 + off, -0.01 - off), yaw + 0.15));
        let minimum = minimise(&model, &evidence, &start);
        let found = model.placement(&minimum.state);
        prop_assert!((found.values[0] - radius).abs() < 0.003 && (found.values[1] - height).abs() < 0.004, "{:?}", found.values);
        // It lies on the plane, and the base frame is where its bottom is: at one end of the axis.
        let [placed] = model.solids(&minimum.state)[..] else { panic!("one solid") };
        prop_assert!(placed.pose.translation.distance(solid.pose.translation) < 0.004, "{placed:?}");
        let end = solid.pose.transform_point(DVec3::new(0.0, 0.0, -height / 2.0));
        prop_assert!(found.pose.translation.distance(end) < 0.006, "{} for {end}", found.pose.translation);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]
    #[test]
    fn a_cup_is_recovered_from_a_rough_start(
        bottom in 0.02..0.035f64, flare in 1.2..1.6f64, height in 0.06..0.12f64, off in -0.01..0.01f64,
    ) {
        let template = Template::parse("cup.toml", CUP).unwrap();
        let truth = [bottom, bottom * flare, height];
        let [solid] = template.solids(&template.named(&truth)).unwrap()[..] else { panic!("one solid") };
        let evidence = evidence(&solid, camera(0.7), 0.002);
        let rough = [bottom * 1.15, bottom * flare * 0.9, height * 1.1];
        let (model, minimum) = fit(&template, &rough, DVec2::new(off, -off), 0.0, &evidence);
        for (value, truth) in model.placement(&minimum.state).values.iter().zip(truth) {
            prop_assert!((value - truth).abs() < 0.004, "{value} for {truth}");
        }
    }
}
