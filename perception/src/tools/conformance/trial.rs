//! A plain scene with known truth: a block and a can apart from each other on a level table, without noise.

use crate::tools::Mask;
use acm_concept::{
    camera::{FrameHeader, Intrinsics, RgbdFrame},
    ids::FrameId,
    object::PixelSupport,
    pose::Pose,
    solid::PlacedSolid,
    template::{Template, TemplateError, TemplateLibrary},
    time::Time,
};
use glam::{DMat3, DQuat, DVec3};
use std::sync::Arc;

/// One thing of the trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Thing {
    /// Its template.
    pub template: &'static str,
    /// Its parameters in the template's order.
    pub values: Vec<f64>,
    /// Pose of its base frame in the world.
    pub pose: Pose,
    /// Its visible pixels.
    pub mask: PixelSupport,
}

/// A frame, its templates and its truth.
#[derive(Debug, Clone)]
pub struct Trial {
    /// The templates that the things are of.
    pub library: Arc<TemplateLibrary>,
    /// 320 x 240 pixels from about 0.7 m.
    pub frame: RgbdFrame,
    /// What stands on the table.
    pub things: Vec<Thing>,
}

/// Two templates of the trial's own, so that it does not change with the library that ships.
const TEMPLATES: [(&str, &str); 2] =
    [("block.toml", include_str!("block.toml")), ("can.toml", include_str!("can.toml"))];
const SIZE: (u32, u32) = (320, 240);
const TABLE: [u8; 3] = [150, 148, 140];

impl Trial {
    /// The trial; it is the same each time.
    ///
    /// # Errors
    /// The trial's own templates cannot be read, or its frame shows none of its things.
    pub fn new() -> Result<Trial, TemplateError> {
        let library = Arc::new(TemplateLibrary::parse(TEMPLATES)?);
        let eye = DVec3::new(0.0, -0.5, 0.5);
        let forward = (DVec3::new(0.0, 0.0, 0.03) - eye).normalize();
        let right = forward.cross(DVec3::Z).normalize();
        let rotation = DQuat::from_mat3(&DMat3::from_cols(right, forward.cross(right), forward));
        let header = FrameHeader {
            id: FrameId(7),
            camera: "trial".into(),
            time: Time::ZERO,
            intrinsics: Intrinsics::from_vertical_fov(SIZE.0, SIZE.1, 45f64.to_radians()),
            camera_pose: Pose::new(eye, rotation),
        };
        let block = Pose::from_yaw(DVec3::new(-0.09, 0.02, 0.0), 0.3);
        let can = Pose::from_translation(DVec3::new(0.1, -0.01, 0.0));
        let things =
            [("block", vec![0.1, 0.06, 0.07], block, [180, 40, 35]), ("can", vec![0.035, 0.1], can, [40, 60, 170])];
        let mut bodies: Vec<(Vec<PlacedSolid>, [u8; 3])> = Vec::new();
        for (name, values, pose, color) in &things {
            let solids = library.get(name).map_or(Ok(Vec::new()), |t| t.solids(&t.named(values))).unwrap_or_default();
            let placed = solids.into_iter().map(|s| PlacedSolid { solid: s.solid, pose: *pose * s.pose }).collect();
            bodies.push((placed, *color));
        }
        let (frame, owners) = render(&header, &bodies);
        let mut found = Vec::new();
        for (index, (template, values, pose, _)) in things.into_iter().enumerate() {
            let set: Vec<bool> = owners.iter().map(|owner| *owner == Some(index)).collect();
            let mask = PixelSupport::from_mask(&set, SIZE.0 as usize);
            found.extend(mask.map(|mask| Thing { template, values, pose, mask }));
        }
        Ok(Trial { library, frame, things: found })
    }

    /// The template of a thing.
    ///
    /// # Panics
    /// Never of the trial's own things.
    #[expect(clippy::expect_used, reason = "the trial's things are made of the trial's templates")]
    pub fn template(&self, thing: &Thing) -> &Template {
        self.library.get(thing.template).expect("a template of the trial")
    }

    /// Frames that show nothing: without depth, with depths that are no numbers, in millimetres, without colour.
    pub fn blind_frames(&self) -> Vec<RgbdFrame> {
        let depth = |change: fn(f32) -> f32| {
            let depth: Vec<f32> = self.frame.depth.iter().map(|z| change(*z)).collect();
            RgbdFrame { depth: depth.into(), ..self.frame.clone() }
        };
        let black = RgbdFrame { color: vec![0; self.frame.color.len()].into(), ..self.frame.clone() };
        vec![depth(|_| 0.0), depth(|_| f32::NAN), depth(|z| 1000.0 * z), black]
    }

    /// Masks that are none of the frame: without pixels, too long, too short.
    pub fn unfit_masks(&self) -> Vec<PixelSupport> {
        let pixels = SIZE.0 * SIZE.1;
        let with = |runs| PixelSupport { count: 50, bounds: [0, 0, 49, 0], runs };
        vec![
            PixelSupport { count: 0, bounds: [0; 4], runs: vec![pixels] },
            with(vec![0, 50, u32::MAX]),
            with(vec![10, 50]),
        ]
    }

    /// Whether every thing is covered by a mask, and by another one each.
    pub fn covered(&self, masks: &[Mask], overlap: f64) -> Result<(), String> {
        for thing in &self.things {
            let truth = thing.mask.indices();
            let best = masks.iter().map(|mask| intersection_over_union(&truth, &mask.support.indices()));
            let best = best.fold(0.0, f64::max);
            if best < overlap {
                return Err(format!("no mask covers the {}: the best overlaps by {best:.2}", thing.template));
            }
        }
        Ok(())
    }

    /// Whether every thing has a box whose middle lies in the box of its pixels.
    pub fn boxed(&self, boxes: &[[u32; 4]]) -> Result<(), String> {
        let holds = |[left, top, right, bottom]: [u32; 4], [l, t, r, b]: &[u32; 4]| {
            (2 * left..=2 * right).contains(&(l + r)) && (2 * top..=2 * bottom).contains(&(t + b))
        };
        match self.things.iter().find(|thing| !boxes.iter().any(|found| holds(thing.mask.bounds, found))) {
            Some(thing) => Err(format!("no box is of the {}", thing.template)),
            None => Ok(()),
        }
    }
}

/// Of two ascending lists.
fn intersection_over_union(a: &[usize], b: &[usize]) -> f64 {
    let both = a.iter().filter(|pixel| b.binary_search(pixel).is_ok()).count();
    both as f64 / (a.len() + b.len() - both).max(1) as f64
}

/// Casts a ray through every pixel; also says whose pixel it is.
fn render(header: &FrameHeader, bodies: &[(Vec<PlacedSolid>, [u8; 3])]) -> (RgbdFrame, Vec<Option<usize>>) {
    let (eye, intrinsics) = (header.camera_pose.translation, header.intrinsics);
    let (mut color, mut depth, mut owners) = (Vec::new(), Vec::new(), Vec::new());
    for row in 0..intrinsics.height {
        for column in 0..intrinsics.width {
            // Distances are in multiples of a ray whose z is 1, so they are depths.
            let ray = header.camera_pose.transform_vector(intrinsics.ray(f64::from(column), f64::from(row)));
            let table = if ray.z < 0.0 { -eye.z / ray.z } else { f64::INFINITY };
            let (mut nearest, mut owner) = (table, None);
            for (index, (solids, _)) in bodies.iter().enumerate() {
                for (enter, _) in solids.iter().filter_map(|solid| solid.intersect_ray(eye, ray)) {
                    if enter > 0.0 && enter < nearest {
                        (nearest, owner) = (enter, Some(index));
                    }
                }
            }
            let paint = owner.and_then(|index| bodies.get(index)).map_or(TABLE, |(_, paint)| *paint);
            color.extend(paint);
            depth.push(if nearest.is_finite() { nearest as f32 } else { 0.0 });
            owners.push(owner);
        }
    }
    let frame = RgbdFrame { header: header.clone(), color: color.into(), depth: depth.into() };
    (frame, owners)
}
