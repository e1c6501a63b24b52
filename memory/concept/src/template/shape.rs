//! Solids as expressions over the parameters: their text and what it comes to.

use super::{TemplateError, Values, vector};
use crate::{
    expression::{Expression, ExpressionError},
    pose::Pose,
    solid::{PROFILE_CORNERS, PlacedSolid, Solid},
};
use glam::{DQuat, DVec2, DVec3};
use serde::Deserialize;
use std::f64::consts::FRAC_PI_2;

/// One `[[solid]]` of a template file. Which fields a shape needs is checked in [`SolidSpec::read`], so that an error can
/// name them.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawSolid {
    shape: RawShape,
    pub part: Option<String>,
    position: [String; 3],
    #[serde(default)]
    axis: RawAxis,
    yaw: Option<String>,
    tilt: Option<String>,
    roll: Option<String>,
    size: Option<[String; 3]>,
    radius: Option<String>,
    radius_bottom: Option<String>,
    radius_top: Option<String>,
    height: Option<String>,
    wall: Option<String>,
    profile: Option<Vec<[String; 2]>>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RawShape {
    Box,
    Cylinder,
    Cone,
    Ellipsoid,
    Revolved,
}

/// The axis of the part's frame along which the solid's own z axis lies.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RawAxis {
    X,
    Y,
    #[default]
    Z,
}

/// A solid as expressions over the parameters, in the frame of its part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct SolidSpec {
    /// Index of the part it belongs to.
    pub part: usize,
    shape: ShapeSpec,
    position: [Expression; 3],
    /// Takes z to the axis along which the solid lies.
    axis: DQuat,
    /// Yaw, tilt and roll; `None` where the file gives none of them.
    turn: Option<[Expression; 3]>,
}

#[derive(Debug, Clone, PartialEq)]
enum ShapeSpec {
    Box {
        size: [Expression; 3],
        wall: Option<Expression>,
    },
    Cylinder {
        radius: Expression,
        height: Expression,
    },
    /// A cone cut off, or a vessel with straight walls.
    Cone {
        radii: [Expression; 2],
        height: Expression,
        wall: Option<Expression>,
    },
    Ellipsoid {
        size: [Expression; 3],
    },
    Revolved {
        profile: Vec<[Expression; 2]>,
    },
}

impl SolidSpec {
    /// Reads a solid of the part with this index.
    pub fn read(
        raw: &RawSolid,
        part: usize,
        wrong: impl Fn(String) -> TemplateError,
        expression: impl Fn(&str) -> Result<Expression, TemplateError>,
    ) -> Result<SolidSpec, TemplateError> {
        let fields = [
            ("size", raw.size.is_some()),
            ("radius", raw.radius.is_some()),
            ("radius_bottom", raw.radius_bottom.is_some()),
            ("radius_top", raw.radius_top.is_some()),
            ("height", raw.height.is_some()),
            ("wall", raw.wall.is_some()),
            ("profile", raw.profile.is_some()),
        ];
        let allowed: &[&str] = match raw.shape {
            RawShape::Box => &["size", "wall"],
            RawShape::Cylinder => &["radius", "height", "wall"],
            RawShape::Cone => &["radius_bottom", "radius_top", "height", "wall"],
            RawShape::Ellipsoid => &["size"],
            RawShape::Revolved => &["profile"],
        };
        let shape = format!("{:?}", raw.shape).to_lowercase();
        if let Some((field, _)) = fields.iter().find(|(field, given)| *given && !allowed.contains(field)) {
            let allowed = allowed.join("`, `");
            return Err(wrong(format!("a solid of shape `{shape}` has no `{field}`; it has `{allowed}`")));
        }
        let missing = |field: &str| wrong(format!("a solid of shape `{shape}` needs `{field}`"));
        let number = |field: &str, text: &Option<String>| expression(text.as_deref().ok_or_else(|| missing(field))?);
        let triple = |[x, y, z]: &[String; 3]| Ok([expression(x)?, expression(y)?, expression(z)?]);
        let size = || triple(raw.size.as_ref().ok_or_else(|| missing("size"))?);
        let wall = raw.wall.as_deref().map(&expression).transpose()?;
        let shape = match (raw.shape, wall) {
            (RawShape::Box, wall) => ShapeSpec::Box { size: size()?, wall },
            (RawShape::Cylinder, None) => {
                let (radius, height) = (number("radius", &raw.radius)?, number("height", &raw.height)?);
                ShapeSpec::Cylinder { radius, height }
            }
            (RawShape::Cylinder, wall) => {
                let (radius, height) = (number("radius", &raw.radius)?, number("height", &raw.height)?);
                ShapeSpec::Cone { radii: [radius.clone(), radius], height, wall }
            }
            (RawShape::Cone, wall) => {
                let bottom = number("radius_bottom", &raw.radius_bottom)?;
                let radii = [bottom, number("radius_top", &raw.radius_top)?];
                ShapeSpec::Cone { radii, height: number("height", &raw.height)?, wall }
            }
            (RawShape::Ellipsoid, _) => ShapeSpec::Ellipsoid { size: size()? },
            (RawShape::Revolved, _) => {
                let corners = raw.profile.as_ref().ok_or_else(|| missing("profile"))?;
                let [fewest, most] = PROFILE_CORNERS;
                if !(fewest..=most).contains(&corners.len()) {
                    return Err(wrong(format!("a profile has {fewest} to {most} corners, not {}", corners.len())));
                }
                let corner = |[radius, height]: &[String; 2]| Ok([expression(radius)?, expression(height)?]);
                ShapeSpec::Revolved { profile: corners.iter().map(corner).collect::<Result<_, TemplateError>>()? }
            }
        };
        let turned = raw.yaw.is_some() || raw.tilt.is_some() || raw.roll.is_some();
        let angle = |text: &Option<String>| expression(text.as_deref().unwrap_or("0"));
        let turn = turned.then(|| Ok([angle(&raw.yaw)?, angle(&raw.tilt)?, angle(&raw.roll)?])).transpose()?;
        let axis = match raw.axis {
            RawAxis::X => DQuat::from_rotation_y(FRAC_PI_2),
            RawAxis::Y => DQuat::from_rotation_x(-FRAC_PI_2),
            RawAxis::Z => DQuat::IDENTITY,
        };
        Ok(SolidSpec { part, shape, position: triple(&raw.position)?, axis, turn })
    }

    /// Appends what the solid is at some values; a hollow box is five.
    pub fn evaluate(&self, values: &Values, solids: &mut Vec<PlacedSolid>) -> Result<(), ExpressionError> {
        let turn = match &self.turn {
            None => self.axis,
            Some([yaw, tilt, roll]) => {
                let yaw = DQuat::from_rotation_z(yaw.evaluate(values)?);
                let tilt = DQuat::from_rotation_y(tilt.evaluate(values)?);
                yaw * tilt * DQuat::from_rotation_x(roll.evaluate(values)?) * self.axis
            }
        };
        let pose = Pose::new(vector(&self.position, values)?, turn);
        let mut add = |solid: Solid, offset: DVec3| {
            let pose = if offset == DVec3::ZERO { pose } else { pose * Pose::from_translation(offset) };
            solids.push(PlacedSolid { solid, pose });
        };
        match &self.shape {
            ShapeSpec::Box { size, wall: None } => add(Solid::Box { size: vector(size, values)? }, DVec3::ZERO),
            ShapeSpec::Box { size, wall: Some(wall) } => {
                let (size, wall) = (vector(size, values)?, wall.evaluate(values)?);
                let off = 0.5 * (size - wall);
                add(Solid::Box { size: size.with_z(wall) }, DVec3::Z * -off.z);
                for side in [-1.0, 1.0] {
                    add(Solid::Box { size: size.with_x(wall) }, DVec3::X * (side * off.x));
                    add(Solid::Box { size: size.with_y(wall) }, DVec3::Y * (side * off.y));
                }
            }
            ShapeSpec::Cylinder { radius, height } => {
                add(
                    Solid::Cylinder { radius: radius.evaluate(values)?, height: height.evaluate(values)? },
                    DVec3::ZERO,
                );
            }
            ShapeSpec::Cone { radii: [bottom, top], height, wall } => {
                let (bottom, top, height) = (bottom.evaluate(values)?, top.evaluate(values)?, height.evaluate(values)?);
                match wall {
                    None => add(Solid::cone(bottom, top, height), DVec3::ZERO),
                    Some(wall) => add(vessel(bottom, top, height, wall.evaluate(values)?), DVec3::ZERO),
                }
            }
            ShapeSpec::Ellipsoid { size } => add(Solid::Ellipsoid { size: vector(size, values)? }, DVec3::ZERO),
            ShapeSpec::Revolved { profile } => {
                let corner = |[radius, height]: &[Expression; 2]| {
                    Ok(DVec2::new(radius.evaluate(values)?, height.evaluate(values)?))
                };
                let corners = profile.iter().map(corner).collect::<Result<Vec<_>, ExpressionError>>()?;
                // The number of corners was checked when the file was read.
                if let Some((solid, middle)) = Solid::revolved(&corners) {
                    add(solid, DVec3::Z * middle);
                }
            }
        }
        Ok(())
    }
}

/// A round vessel that is open above, about the middle of its height. Metres.
fn vessel(bottom: f64, top: f64, height: f64, wall: f64) -> Solid {
    let floor = wall.min(height);
    let inner_bottom = bottom + (top - bottom) * floor / height - wall;
    let corners = [
        DVec2::new(0.0, -0.5 * height),
        DVec2::new(bottom, -0.5 * height),
        DVec2::new(top, 0.5 * height),
        DVec2::new(top - wall, 0.5 * height),
        DVec2::new(inner_bottom, floor - 0.5 * height),
        DVec2::new(0.0, floor - 0.5 * height),
    ];
    Solid::revolved(&corners).map_or(Solid::Cylinder { radius: bottom, height }, |(solid, _)| solid)
}
