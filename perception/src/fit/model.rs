//! A template as a function from a state vector to residuals against evidence.

use super::evidence::{Evidence, OutlineKind};
use crate::scene::{Outline, convex_hull};
use acm_concept::{
    pose::Pose,
    solid::{PlacedSolid, Solid},
    template::{Rest, Template, YawSymmetry},
};
use glam::{DAffine3, DVec2, DVec3};

/// What the part stands on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Base {
    /// On a surface at this height above the plane, metres.
    At(f64),
    /// On nothing that is seen: the height is fitted, beginning here.
    Free(f64),
}

/// A template whose free quantities are laid out in a state vector:
/// x, y, heading (unless any heading looks the same), base height (if free), fitted parameters.
///
/// Of an upright part x and y are those of its base frame. In another rest they are the middle of what it covers, and the
/// base height is that of its lowest point: the base frame itself moves when sizes change.
#[derive(Debug, Clone)]
pub(crate) struct Model<'a> {
    pub template: &'a Template,
    /// Whether the heading is fitted.
    pub turns: bool,
    /// Whether half a turn makes a difference, and whether a quarter turn does.
    two_ends: bool,
    two_sides: bool,
    pub base: Base,
    /// How it lies; `None` for upright.
    pub rest: Option<&'a Rest>,
    /// Indices of the fitted parameters.
    free: Vec<usize>,
    /// All parameter values; those of fitted parameters are replaced by the state.
    initial: Vec<f64>,
}

/// A state read back.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Placement {
    /// Pose of the part's base frame in the support frame.
    pub pose: Pose,
    /// All parameter values, in the template's order.
    pub values: Vec<f64>,
}

/// Circle points that stand for the rim of what is round in its outline.
const RIM: usize = 24;
/// Level slices that an ellipsoid's outline is made of.
const SLICES: usize = 8;

impl<'a> Model<'a> {
    /// A model whose parameters begin at `initial`; `None` if the template's symmetry cannot be evaluated.
    pub fn new(template: &'a Template, initial: Vec<f64>, base: Base) -> Option<Model<'a>> {
        let symmetry = template.yaw_symmetry(&template.named(&initial)).ok()?;
        let free = (0..template.parameters.len()).filter(|&i| !template.parameters[i].fixed).collect();
        let two_ends = matches!(symmetry, YawSymmetry::Fold(fold) if fold % 2 == 1);
        let two_sides = matches!(symmetry, YawSymmetry::Fold(fold) if fold % 4 != 0);
        Some(Model {
            template,
            turns: symmetry != YawSymmetry::Continuous,
            two_ends,
            two_sides,
            base,
            rest: None,
            free,
            initial,
        })
    }
    /// The model in another rest.
    pub fn lying(self, rest: Option<&'a Rest>) -> Model<'a> {
        let Some(rest) = rest else { return self };
        Model { rest: Some(rest), turns: rest.symmetry != YawSymmetry::Continuous, ..self }
    }
    /// The model with its parameters as they are: only its place is fitted.
    pub fn rigid(self) -> Model<'a> {
        Model { free: Vec::new(), ..self }
    }
    /// Whether half a turn makes a difference.
    pub fn has_two_ends(&self) -> bool {
        self.two_ends
    }
    /// Whether a quarter turn makes a difference.
    pub fn has_two_sides(&self) -> bool {
        self.two_sides
    }
    /// Index of the heading in the state.
    pub fn yaw_index(&self) -> Option<usize> {
        self.turns.then_some(2)
    }
    /// Index of the base height in the state.
    pub fn base_index(&self) -> Option<usize> {
        matches!(self.base, Base::Free(_)).then_some(2 + usize::from(self.turns))
    }
    /// Index in the state of a template parameter, if it is fitted.
    pub fn parameter_index(&self, parameter: usize) -> Option<usize> {
        let place = self.free.iter().position(|&i| i == parameter)?;
        Some(2 + usize::from(self.turns) + usize::from(self.base_index().is_some()) + place)
    }
    /// The state at a place and heading with the initial parameters.
    pub fn start(&self, position: DVec2, yaw: f64) -> Vec<f64> {
        let mut state = vec![position.x, position.y];
        if self.turns {
            state.push(yaw);
        }
        if let Base::Free(height) = self.base {
            state.push(height);
        }
        state.extend(self.free.iter().map(|&i| self.initial[i]));
        state
    }
    /// Reads a state.
    pub fn placement(&self, state: &[f64]) -> Placement {
        let yaw = self.yaw_index().map_or(0.0, |i| state[i]);
        let height = match self.base {
            Base::At(height) => height,
            Base::Free(_) => self.base_index().map_or(0.0, |i| state[i]),
        };
        let mut values = self.initial.clone();
        for &parameter in &self.free {
            if let Some(i) = self.parameter_index(parameter) {
                values[parameter] = state[i];
            }
        }
        let upright = Pose::from_yaw(DVec3::new(state[0], state[1], height), yaw);
        let pose = self.rest.map_or(upright, |rest| upright * self.laid_down(rest, &values));
        Placement { pose, values }
    }
    /// The base frame of a part in a rest, seen from the middle of what it covers on its support.
    fn laid_down(&self, rest: &Rest, values: &[f64]) -> Pose {
        let turn = Pose::new(DVec3::ZERO, rest.turn());
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for solid in self.template.solids(&self.template.named(values)).unwrap_or_default() {
            let turned = PlacedSolid { solid: solid.solid, pose: turn * solid.pose };
            let ends = turned.bounds();
            (low, high) = (low.min(ends.0), high.max(ends.1));
        }
        if !(low.is_finite() && high.is_finite()) {
            return turn;
        }
        let middle = (low + high) * 0.5;
        Pose::new(-middle.with_z(low.z), turn.rotation)
    }
    /// Moves fitted parameters into their ranges.
    pub fn clamp(&self, state: &mut [f64]) {
        for &parameter in &self.free {
            let spec = &self.template.parameters[parameter];
            if let Some(i) = self.parameter_index(parameter) {
                state[i] = state[i].clamp(spec.min, spec.max);
            }
        }
    }
    /// The solids at a state, in the support frame; empty if the template's expressions cannot be evaluated.
    pub fn solids(&self, state: &[f64]) -> Vec<PlacedSolid> {
        let placement = self.placement(state);
        let solids = self.template.solids(&self.template.named(&placement.values)).unwrap_or_default();
        solids.into_iter().map(|s| PlacedSolid { solid: s.solid, pose: placement.pose * s.pose }).collect()
    }

    /// Fills `residuals` with one number per surface point and per outline point, in standard deviations.
    pub fn residuals(&self, state: &[f64], evidence: &Evidence, residuals: &mut Vec<f64>) {
        residuals.clear();
        let solids = self.solids(state);
        let local: Vec<(DAffine3, Solid)> = solids.iter().map(|s| (affine(&s.pose.inverse()), s.solid)).collect();
        for point in &evidence.points {
            let distance =
                |(inverse, solid): &(DAffine3, Solid)| solid.signed_distance(inverse.transform_point3(point.position));
            let nearest = local.iter().map(distance).fold(f64::INFINITY, f64::min);
            residuals.push(if nearest.is_finite() { nearest / point.sigma_m } else { 1e3 });
        }
        let to_camera = evidence.camera.inverse();
        let polygons = solids.iter().flat_map(|s| image_outlines(s, &to_camera, evidence));
        let outlines: Vec<Outline> = polygons.filter(|polygon| polygon.len() > 2).map(|p| Outline::of(&p)).collect();
        for point in &evidence.outline {
            let distance = |outline: &Outline| outline.distance_outside(point.pixel);
            let outside = outlines.iter().map(distance).fold(f64::INFINITY, f64::min);
            let outside = if outside.is_finite() { outside } else { 1e3 };
            let outside = if point.kind == OutlineKind::Own { outside } else { outside.max(0.0) };
            residuals.push(outside / point.sigma_px);
        }
    }
}

/// A pose as a matrix, which moves many points faster.
fn affine(pose: &Pose) -> DAffine3 {
    DAffine3::from_rotation_translation(pose.rotation, pose.translation)
}

/// The outlines in the image of the convex pieces of a solid: together they cover what it does. The mouth of a vessel is
/// covered as well; behind it lies the vessel's own inside.
fn image_outlines(solid: &PlacedSolid, to_camera: &Pose, evidence: &Evidence) -> Vec<Vec<DVec2>> {
    let pose = affine(&(*to_camera * solid.pose));
    let project = |corner: DVec3| evidence.intrinsics.project(pose.transform_point3(corner));
    let pieces = corners(&solid.solid);
    let pieces = if matches!(solid.solid, Solid::Ellipsoid { .. }) { vec![pieces.concat()] } else { pieces };
    pieces.into_iter().map(|piece| convex_hull(piece.into_iter().filter_map(project).collect())).collect()
}

/// Corners of the convex pieces of a solid, in its frame: of a box, or points of both rims, in turn, of a cylinder and of
/// each slice of what is round otherwise. Metres.
pub(crate) fn corners(solid: &Solid) -> Vec<Vec<DVec3>> {
    match *solid {
        Solid::Box { size } => {
            let half = size * 0.5;
            let sign = |bit: usize| if bit == 0 { -1.0 } else { 1.0 };
            vec![(0..8).map(|i| half * DVec3::new(sign(i & 1), sign(i & 2), sign(i & 4))).collect()]
        }
        Solid::Cylinder { radius, height } => {
            vec![slice([DVec2::new(radius, -height * 0.5), DVec2::new(radius, height * 0.5)])]
        }
        // What falls along the profile is the inside of a vessel, and covers nothing.
        Solid::Revolved { profile } => profile.edges().filter(|[a, b]| b.y > a.y).map(slice).collect(),
        Solid::Ellipsoid { size } => {
            let at = |step: usize| 0.5 * DVec2::from_angle(std::f64::consts::PI * (step as f64 / SLICES as f64 - 0.5));
            let scaled = |piece: Vec<DVec3>| piece.into_iter().map(|point| point * size).collect();
            (0..SLICES).map(|step| scaled(slice([at(step), at(step + 1)]))).collect()
        }
    }
}

/// Points of the lower and the upper rim, in turn, of what an edge (radius, height) sweeps about z.
fn slice(edge: [DVec2; 2]) -> Vec<DVec3> {
    // The polygon's mean radius, not its corners', equals the circle's.
    let angle = std::f64::consts::TAU / RIM as f64;
    let reach = 1.0 + angle * angle / 24.0;
    let point = |i: usize| {
        let end = edge[i % 2];
        (DVec2::from_angle(angle * (i / 2) as f64) * (end.x * reach)).extend(end.y)
    };
    (0..2 * RIM).map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::camera::Intrinsics;
    use glam::DQuat;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]
        #[test]
        fn outlines_cover_the_pixels_whose_rays_meet_the_solid(
            kind in 0..5usize, turn in prop::array::uniform3(-3.0..3.0f64), column in 60.0..260.0f64, row in 20.0..220.0f64,
        ) {
            let corners = |points: &[(f64, f64)]| points.iter().map(|(r, z)| DVec2::new(*r, *z)).collect::<Vec<_>>();
            // A spinning top: none of its slices alone covers it, nor is it convex.
            let top = Solid::revolved(&corners(&[(0.0, 0.0), (0.03, 0.0), (0.01, 0.05), (0.06, 0.09), (0.0, 0.12)])).unwrap().0;
            let solid = [
                Solid::Box { size: DVec3::new(0.14, 0.08, 0.05) },
                Solid::Cylinder { radius: 0.04, height: 0.1 },
                Solid::Ellipsoid { size: DVec3::new(0.14, 0.09, 0.05) },
                Solid::cone(0.06, 0.02, 0.12),
                top,
            ][kind];
            let intrinsics = Intrinsics::from_vertical_fov(320, 240, 0.5);
            let pose = Pose::new(DVec3::new(0.01, 0.02, 0.5), DQuat::from_scaled_axis(turn.into()));
            let evidence = Evidence {
                camera: Pose::IDENTITY, intrinsics, points: Vec::new(), point_weight: 1.0, outline: Vec::new(), outline_weight: 1.0,
            };
            let placed = PlacedSolid { solid, pose };
            let outlines = image_outlines(&placed, &Pose::IDENTITY, &evidence);
            let pixel = DVec2::new(column, row);
            let outside = outlines.iter().map(|o| Outline::of(o).distance_outside(pixel)).fold(f64::INFINITY, f64::min);
            let meets = placed.intersect_ray(DVec3::ZERO, intrinsics.ray(column, row)).is_some();
            // Polygons with 24 corners stand for circles.
            prop_assert!(if meets { outside < 1.2 } else { outside > -1.2 }, "{solid:?}: {meets}, {outside} px outside");
        }
    }
}
