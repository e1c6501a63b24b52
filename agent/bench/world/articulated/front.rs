//! What a person would see of a shut door or drawer, taken from the truth: the box of its handle, the flat of its front,
//! its bare edges, the axis of its hinge.

use acm_concept::pose::Pose;
use acm_sim::{TrueLink, TrueObject, TruePiece, TrueShape};
use glam::{DMat3, DQuat, DVec2, DVec3};

/// A door's or drawer's front is at least so wide and high, metres; it goes at least so far, radians or metres.
const FRONT_M: f64 = 0.07;
const LEAST_TURN_RAD: f64 = 0.7;
const LEAST_SLIDE_M: f64 = 0.08;
/// Shortest handle along the fingers' width, and how near pieces of one handle are, metres.
const NARROWEST_M: f64 = 0.006;
const TOUCHING_M: f64 = 0.002;
/// Widest handle, metres.
const WIDEST_M: f64 = 0.0735;
/// Pieces whose front is this near to the foremost one are handles, if they stand out from the front by so much; metres.
const FOREMOST_M: f64 = 0.02;
const STANDS_OUT_M: f64 = 0.008;
/// Half of the flat that closed finger tips need, metres.
const FOOTPRINT_M: f64 = 0.014;
/// Thickness of a finger with what it needs to open, and how deep it reaches beside a handle, metres.
const FINGER_M: f64 = 0.018;
/// How far finger tips reach beyond the tool centre point, and what they keep from what a handle stands out from; metres.
const TIPS_M: f64 = 0.016;
/// Half of the palm's sides, metres; and how far the fingers reach beyond it.
const PALM_M: DVec2 = DVec2::new(0.108, 0.038);
const FINGERS_M: f64 = 0.04;

/// A box, aligned with the thing's axes when all is shut, in coordinates along right, up and out of a front.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Piece {
    low: DVec3,
    high: DVec3,
}

impl Piece {
    fn size(&self) -> DVec3 {
        self.high - self.low
    }
    fn middle(&self) -> DVec3 {
        0.5 * (self.low + self.high)
    }
    fn touches(&self, other: &Piece) -> bool {
        let apart = (self.low - other.high).max(other.low - self.high);
        apart.max_element() < TOUCHING_M
    }
    /// The box round some points; `None` without any.
    fn round(points: impl Iterator<Item = DVec3>) -> Option<Piece> {
        points.fold(None, |all: Option<Piece>, at| {
            let Piece { low, high } = all.unwrap_or(Piece { low: at, high: at });
            Some(Piece { low: low.min(at), high: high.max(at) })
        })
    }
    /// The direction of its narrow side: right or up.
    fn across(&self) -> DVec3 {
        if self.size().x <= self.size().y { DVec3::X } else { DVec3::Y }
    }
    fn area(&self) -> f64 {
        self.size().x * self.size().y
    }
    fn covers(&self, right: f64, up: f64) -> bool {
        (self.low.x..=self.high.x).contains(&right) && (self.low.y..=self.high.y).contains(&up)
    }
}

/// What stands out from a front, and the hulls that it is made of.
#[derive(Debug, Clone)]
struct Handle {
    bounds: Piece,
    hulls: Vec<Vec<DVec3>>,
}

impl Handle {
    /// What of it lies between the fingers at places along it, the one in its middle first: as broad as a finger.
    fn stations(&self) -> Vec<Piece> {
        const SHARES: [f64; 9] = [0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8, 0.1, 0.9];
        let along = DVec3::ONE.with_z(0.0) - self.bounds.across();
        let (low, length) = (self.bounds.low.dot(along), self.bounds.size().dot(along));
        let station = |share: f64| {
            let at = low + share * length;
            Piece::round(self.hulls.iter().flat_map(|hull| cut(hull, along, at - FOOTPRINT_M, at + FOOTPRINT_M)))
        };
        SHARES.into_iter().filter_map(station).collect()
    }
}

/// A part that opens, seen from before it.
#[derive(Debug, Clone)]
pub struct Front {
    /// Number of the link that moves.
    pub link: usize,
    /// Whether it turns.
    pub is_hinge: bool,
    /// How far it goes, radians or metres.
    pub way: f64,
    /// The link's pose when it is shut, world frame.
    pub closed: Pose,
    /// Columns: right, up, out; world frame.
    pub axes: DMat3,
    /// A point of the hinge; world frame.
    origin: DVec3,
    /// The direction about which, or along which, it opens; world frame.
    pub axis: DVec3,
    /// The boxes round its pieces, along right, up and out.
    pieces: Vec<Piece>,
    /// The boxes round the pieces of other parts, all shut.
    others: Vec<Piece>,
    /// Points whose convex hulls its pieces are, in the same coordinates and order.
    hulls: Vec<Vec<DVec3>>,
}

impl Front {
    /// A link as a front; `None` if it is no door or drawer.
    pub fn of(thing: &TrueObject, index: usize) -> Option<Front> {
        let link = thing.links.get(index)?;
        let joint = link.joint.as_ref()?;
        let [low, high] = joint.range?;
        let sense = if high - joint.closed >= joint.closed - low { 1.0 } else { -1.0 };
        let way = (high - joint.closed).max(joint.closed - low);
        let hangs_on_base = hanger(thing, link.parent);
        if !hangs_on_base || way < if joint.is_hinge { LEAST_TURN_RAD } else { LEAST_SLIDE_M } {
            return None;
        }
        let own: Vec<&TrueLink> = (0..thing.links.len())
            .filter(|at| carrier(thing, *at) == index)
            .filter_map(|at| thing.links.get(at))
            .collect();
        let corners: Vec<(Pose, DVec3, DVec3)> =
            own.iter().flat_map(|link| link.pieces.iter().map(|piece| (link.pose, piece.low, piece.high))).collect();
        let count = corners.len().max(1) as f64;
        let middle =
            corners.iter().map(|(pose, low, high)| pose.transform_point(0.5 * (*low + *high))).sum::<DVec3>() / count;
        let axis = sense * joint.axis;
        // Models look along +x; a door of an oven or of a chest may open to another side.
        let ahead = thing.pose.transform_vector(DVec3::X);
        let out = if joint.is_hinge { snapped(axis.cross(middle - joint.origin), thing.pose.rotation) } else { ahead };
        let up = if out.z.abs() > 0.5 { snapped(DVec3::X, thing.pose.rotation) } else { DVec3::Z };
        let axes = DMat3::from_cols(up.cross(out), up, out);
        let foreign = (0..thing.links.len()).filter(|at| carrier(thing, *at) != index);
        let foreign = foreign.filter_map(|at| thing.links.get(at));
        let boxes = |link: &TrueLink| {
            let boxes = link.pieces.iter().map(|piece| seen(&link.pose, piece.low, piece.high, &axes));
            boxes.collect::<Vec<Piece>>()
        };
        let others = foreign.flat_map(boxes).collect();
        let own_pieces = own.iter().flat_map(|link| link.pieces.iter().map(|piece| (link.pose, piece)));
        let hulls = own_pieces.map(|(pose, piece)| hull(&pose, piece, &axes)).collect();
        let pieces = corners.iter().map(|(pose, low, high)| seen(pose, *low, *high, &axes)).collect();
        let front = Front {
            link: index,
            is_hinge: joint.is_hinge,
            way,
            closed: link.pose,
            axes,
            origin: joint.origin,
            axis,
            pieces,
            others,
            hulls,
        };
        let size = front.bounds().size();
        (size.x.min(size.y) >= FRONT_M).then_some(front)
    }

    fn bounds(&self) -> Piece {
        let start = Piece { low: DVec3::MAX, high: DVec3::MIN };
        self.pieces
            .iter()
            .fold(start, |all, piece| Piece { low: all.low.min(piece.low), high: all.high.max(piece.high) })
    }

    /// Whether it opens downwards.
    pub fn drops(&self) -> bool {
        self.is_hinge && self.axis.z.abs() < 0.5 && self.origin.z < (self.axes * self.bounds().middle()).z
    }

    /// The share of another part's front that this one stands before.
    pub fn hides(&self, other: &Front) -> f64 {
        let (mine, theirs) = (self.bounds(), other.bounds());
        let before = self.link != other.link
            && (self.axes.z_axis - other.axes.z_axis).length() < 0.1
            && mine.middle().z > theirs.high.z - FOREMOST_M;
        let shared = (mine.high.min(theirs.high) - mine.low.max(theirs.low)).max(DVec3::ZERO);
        if before { shared.x * shared.y / theirs.area().max(1e-9) } else { 0.0 }
    }

    /// How far a place is from the hinge, seen from before it; for a slide how near it is to the middle.
    fn merit(&self, right: f64, up: f64) -> f64 {
        let middle = self.bounds().middle();
        if !self.is_hinge {
            return -(right - middle.x).hypot(up - middle.y);
        }
        let at = self.axes * DVec3::new(right, up, middle.z);
        (at - self.origin).reject_from_normalized(self.axis).length()
    }

    /// What stands out beyond a level: what touches each other together makes a handle.
    fn standing_out(&self, level: f64) -> Vec<Handle> {
        let mut handles: Vec<Handle> = Vec::new();
        for hull in &self.hulls {
            let points = cut(hull, DVec3::Z, level, level + FRONT_M);
            let Some(bounds) = Piece::round(points.iter().copied()) else { continue };
            let mut joined = Handle { bounds, hulls: vec![points] };
            // Those that the new one touches become one with it.
            let (touched, apart): (Vec<Handle>, Vec<Handle>) =
                handles.into_iter().partition(|other| joined.bounds.touches(&other.bounds));
            for other in touched {
                let (low, high) = (joined.bounds.low.min(other.bounds.low), joined.bounds.high.max(other.bounds.high));
                joined.bounds = Piece { low, high };
                joined.hulls.extend(other.hulls);
            }
            handles = apart;
            handles.push(joined);
        }
        handles
    }

    /// The frame in which the handle is taken, and its width: near the middle of what stands out, where it is narrow enough.
    pub fn handle(&self) -> Option<(Pose, f64)> {
        let foremost = self.bounds().high.z;
        let least = self.panel() + STANDS_OUT_M;
        // A low level shows all of a handle; a higher one parts it from a frame that stands out as well.
        let levels = [least, foremost - FOREMOST_M, foremost - 0.6 * FOREMOST_M];
        let (taken, across) = levels.into_iter().filter(|level| *level >= least).find_map(|level| self.grip(level))?;
        let (size, middle) = (taken.size(), taken.middle());
        let tips = taken.high.z - self.ground(&taken, across) - TIPS_M;
        let deep = (0.5 * size.z).min(0.015).min(tips).max(0.003);
        let at = self.axes * DVec3::new(middle.x, middle.y, taken.high.z - deep);
        Some((framed(at, self.axes * across, self.axes.z_axis), size.dot(across)))
    }

    /// What is taken of what stands out beyond a level, and across what the fingers close: the longest handle far from the
    /// hinge first.
    fn grip(&self, level: f64) -> Option<(Piece, DVec3)> {
        let foremost = self.bounds().high.z;
        let merit = |handle: &Handle| {
            let (size, middle) = (handle.bounds.size(), handle.bounds.middle());
            size.x.max(size.y) + 0.2 * self.merit(middle.x, middle.y)
        };
        let mut handles = self.standing_out(level);
        handles.sort_by(|a, b| merit(b).total_cmp(&merit(a)));
        handles.into_iter().find_map(|handle| {
            let narrow = handle.bounds.across();
            // Across its narrow side, or where that leaves the fingers no room, as between two doors, along it.
            let takes = [narrow, DVec3::ONE.with_z(0.0) - narrow].map(|across| {
                let stands = |piece: &&Piece| {
                    let size = piece.size();
                    piece.high.z > foremost - FOREMOST_M
                        && size.x.max(size.y) > NARROWEST_M
                        && size.dot(across) < WIDEST_M
                        && self.leaves_room(piece, across)
                };
                let whole = if across == narrow { handle.stations() } else { vec![handle.bounds] };
                whole.iter().find(stands).map(|piece| (*piece, across))
            });
            takes.into_iter().flatten().next()
        })
    }

    /// Where the two fingers come to be beside a handle.
    fn beside(&self, handle: &Piece, across: DVec3) -> [Piece; 2] {
        let along = DVec3::ONE.with_z(0.0) - across;
        let reach_m = 0.5 * handle.size().dot(across) + 0.5 * FINGER_M;
        [-1.0, 1.0].map(|side| {
            let at = handle.middle() + side * reach_m * across;
            let half = 0.5 * FINGER_M * across + FOOTPRINT_M * along;
            Piece { low: (at - half).with_z(handle.high.z - FINGER_M), high: (at + half).with_z(handle.high.z) }
        })
    }

    /// Whether no other part stands where the fingers come to be.
    fn leaves_room(&self, handle: &Piece, across: DVec3) -> bool {
        !self.beside(handle, across).iter().any(|finger| {
            self.others.iter().any(|other| {
                let shared = other.high.min(finger.high) - other.low.max(finger.low);
                shared.min_element() > 0.0
            })
        })
    }

    /// How far out the front is beside a handle.
    fn ground(&self, handle: &Piece, across: DVec3) -> f64 {
        let lower = self.pieces.iter().filter(|piece| piece.high.z < handle.high.z - NARROWEST_M);
        let spread =
            |finger: Piece| Piece { low: finger.low - FINGER_M * across, high: finger.high + FINGER_M * across };
        let fingers = self.beside(handle, across).map(spread);
        let under = |piece: &&Piece| {
            let shares = |finger: &Piece| piece.high.min(finger.high) - piece.low.max(finger.low);
            // What is under the handle itself is in nobody's way.
            let aside = piece.low.dot(across) < handle.low.dot(across) - TOUCHING_M
                || piece.high.dot(across) > handle.high.dot(across) + TOUCHING_M;
            aside && fingers.iter().map(shares).any(|shared| shared.x.min(shared.y) > TOUCHING_M)
        };
        lower.filter(under).map(|piece| piece.high.z).fold(self.panel(), f64::max)
    }

    /// The frame on a narrow face at an edge, far from the hinge, where nothing else is before that face.
    pub fn edge(&self) -> Option<Pose> {
        const SHARES: [f64; 5] = [0.5, 0.35, 0.65, 0.2, 0.8];
        let sides = [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y].into_iter().filter(|_| self.is_hinge);
        let rims = sides.flat_map(|side| SHARES.into_iter().filter_map(move |share| self.rim(side, share)));
        let far = |(at, _): &(DVec3, DVec3)| self.merit(at.x, at.y);
        // Of equally far ones the first, in the middle of its edge.
        let farther = |best: Option<(DVec3, DVec3)>, rim| match best {
            Some(best) if far(&best) >= far(&rim) - TOUCHING_M => Some(best),
            _ => Some(rim),
        };
        let (at, side) = rims.filter(|(at, side)| self.is_bare(*at, *side)).fold(None, farther)?;
        Some(framed(self.axes * at, self.axes.z_axis, self.axes * side))
    }

    /// The middle of the narrow face on a side, at a share of its length; and the side.
    fn rim(&self, side: DVec3, share: f64) -> Option<(DVec3, DVec3)> {
        const RIM_M: f64 = 0.006;
        let bounds = self.bounds();
        let (middle, half) = (bounds.middle(), 0.5 * bounds.size().with_z(0.0));
        let along = DVec3::ONE.with_z(0.0) - side.abs();
        let at = middle + side * half + (2.0 * share - 1.0) * along * half;
        // What of the part there is just inside its edge.
        let inside = |hull: &Vec<DVec3>| {
            let outer = cut(hull, side, at.dot(side) - RIM_M, at.dot(side) + RIM_M);
            cut(&outer, along, at.dot(along) - FOOTPRINT_M, at.dot(along) + FOOTPRINT_M)
        };
        let inside = Piece::round(self.hulls.iter().flat_map(inside))?;
        Some((at.with_z(inside.middle().z), side))
    }

    /// Whether finger tips that come to a place on an edge meet nothing else beyond it.
    fn is_bare(&self, at: DVec3, side: DVec3) -> bool {
        let along = DVec3::ONE.with_z(0.0) - side.abs();
        let reach = at + side * FINGERS_M;
        let margin = FOOTPRINT_M * along + 0.5 * NARROWEST_M * DVec3::Z;
        let tip = Piece { low: at.min(reach) - margin, high: at.max(reach) + margin };
        let beyond = |other: &Piece| (other.high - at).dot(side).max((other.low - at).dot(side)) > TOUCHING_M;
        !self.others.iter().any(|other| other.touches(&tip) && beyond(other))
    }

    /// The pieces of the shut thing that stand out from this front: link and number.
    pub fn handles(&self, thing: &TrueObject) -> Vec<(usize, usize)> {
        let panel = self.panel();
        let own = thing.links.iter().enumerate().filter(|(at, _)| carrier(thing, *at) == self.link);
        let stands_out = |(at, link): (usize, &TrueLink)| -> Vec<(usize, usize)> {
            let pieces = link.pieces.iter().enumerate();
            let out = pieces
                .filter(|(_, piece)| seen(&link.pose, piece.low, piece.high, &self.axes).high.z > panel + STANDS_OUT_M);
            out.map(|(index, _)| (at, index)).collect()
        };
        own.flat_map(stands_out).collect()
    }

    /// How far out the front's largest piece reaches.
    fn panel(&self) -> f64 {
        self.pieces.iter().max_by(|a, b| a.area().total_cmp(&b.area())).map_or(0.0, |piece| piece.high.z)
    }

    /// How far out the front is at a place.
    fn height(&self, right: f64, up: f64) -> Option<f64> {
        let there = self.pieces.iter().filter(|piece| piece.covers(right, up)).map(|piece| piece.high.z);
        there.max_by(f64::total_cmp)
    }

    /// A frame on a flat of the front, far from the hinge, where the palm meets no handle; else on the handle.
    pub fn flat(&self) -> Option<Pose> {
        const GRID: i32 = 24;
        const AROUND: [(f64, f64); 8] =
            [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0), (0.0, 1.7), (1.7, 0.0), (0.0, -1.7), (-1.7, 0.0)];
        let bounds = self.bounds();
        let (low, size, middle) = (bounds.low, bounds.size(), bounds.middle());
        let mut best: Option<(f64, DVec3, DVec3)> = None;
        for (i, j) in (1..GRID).flat_map(|i| (1..GRID).map(move |j| (i, j))) {
            let right = low.x + size.x * f64::from(i) / f64::from(GRID);
            let up = low.y + size.y * f64::from(j) / f64::from(GRID);
            let Some(height) = self.height(right, up) else { continue };
            let level = AROUND.iter().all(|(x, y)| {
                let there = self.height(right + x * FOOTPRINT_M, up + y * FOOTPRINT_M);
                there.is_some_and(|there| (there - height).abs() < 0.002)
            });
            let along = [(PALM_M, self.axes.x_axis), (DVec2::new(PALM_M.y, PALM_M.x), self.axes.y_axis)];
            let Some((_, palm)) = along.into_iter().find(|(half, _)| self.room(right, up, height, *half)) else {
                continue;
            };
            // Far from the hinge, and not at an end of it.
            let aside = if self.axis.dot(self.axes.y_axis).abs() > 0.5 { up - middle.y } else { right - middle.x };
            let merit = self.merit(right, up) - if self.is_hinge { 0.5 * aside.abs() } else { 0.0 };
            if level && best.is_none_or(|(most, _, _)| merit > most) {
                best = Some((merit, DVec3::new(right, up, height), palm));
            }
        }
        let free = best.map(|(_, at, palm)| framed(self.axes * at, palm, self.axes.z_axis));
        free.or_else(|| {
            let (frame, _) = self.handle()?;
            let (at, foremost) = (self.axes.transpose() * frame.translation, bounds.high.z);
            Some(Pose::new(self.axes * at.with_z(foremost), frame.rotation))
        })
    }

    /// Whether nothing stands out so far beside a place that the palm would meet it before the tips are there.
    fn room(&self, right: f64, up: f64, height: f64, half: DVec2) -> bool {
        let beside = |piece: &Piece| {
            piece.low.x < right + half.x
                && piece.high.x > right - half.x
                && piece.low.y < up + half.y
                && piece.high.y > up - half.y
        };
        !self.pieces.iter().any(|piece| beside(piece) && piece.high.z > height + FINGERS_M)
    }

    /// The joint as arguments of a function, in a frame of the closed part.
    pub fn joint_in(&self, frame: &Pose) -> Vec<(&'static str, f64)> {
        let inverse = frame.inverse();
        let (axis, point) = (inverse.transform_vector(self.axis), inverse.transform_point(self.origin));
        let mut arguments = vec![("axis_x", axis.x), ("axis_y", axis.y), ("axis_z", axis.z)];
        if self.is_hinge {
            arguments.extend([("hinge_x", point.x), ("hinge_y", point.y), ("hinge_z", point.z)]);
        }
        arguments
    }
}

/// Whether a link is the base, or fixed to it.
fn hanger(thing: &TrueObject, index: usize) -> bool {
    carrier(thing, index) == 0
}

/// The link with a joint, or the base, that a link is fixed to.
fn carrier(thing: &TrueObject, index: usize) -> usize {
    let mut at = index;
    for _ in 0..thing.links.len() {
        match thing.links.get(at) {
            Some(link) if link.joint.is_none() && at != 0 => at = link.parent,
            _ => break,
        }
    }
    at
}

/// The axis of a frame that is nearest to a direction.
fn snapped(direction: DVec3, frame: DQuat) -> DVec3 {
    let axes = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| frame * axis);
    let nearest = axes.into_iter().max_by(|a, b| a.dot(direction).abs().total_cmp(&b.dot(direction).abs()));
    nearest.map_or(direction, |axis| axis * axis.dot(direction).signum())
}

/// A box of a link, seen along other axes.
fn seen(pose: &Pose, low: DVec3, high: DVec3, axes: &DMat3) -> Piece {
    let corners = (0..8u8).map(|i| {
        let pick = |bit: u8, low: f64, high: f64| if i & bit == 0 { low } else { high };
        let corner = DVec3::new(pick(1, low.x, high.x), pick(2, low.y, high.y), pick(4, low.z, high.z));
        axes.transpose() * pose.transform_point(corner)
    });
    let start = Piece { low: DVec3::MAX, high: DVec3::MIN };
    corners.fold(start, |all, corner| Piece { low: all.low.min(corner), high: all.high.max(corner) })
}

/// The points whose convex hull a piece is, seen along other axes.
fn hull(pose: &Pose, piece: &TruePiece, axes: &DMat3) -> Vec<DVec3> {
    let place = |at: DVec3| axes.transpose() * pose.transform_point(at);
    match &piece.shape {
        TrueShape::Hull { points } => {
            points.iter().map(|point| place(piece.pose.transform_point(point.as_dvec3()))).collect()
        }
        _ => {
            let pick = |from_high: bool, low: f64, high: f64| if from_high { high } else { low };
            let corner = |i: u8| {
                let [x, y, z] = [i & 1 > 0, i & 2 > 0, i & 4 > 0];
                let (low, high) = (piece.low, piece.high);
                place(DVec3::new(pick(x, low.x, high.x), pick(y, low.y, high.y), pick(z, low.z, high.z)))
            };
            (0..8).map(corner).collect()
        }
    }
}

/// Points whose convex hull is what of a hull lies between two places along an axis: its own points there, and where the
/// lines between its points enter and leave.
fn cut(hull: &[DVec3], along: DVec3, from: f64, to: f64) -> Vec<DVec3> {
    let mut points: Vec<DVec3> = hull.iter().copied().filter(|at| (from..=to).contains(&at.dot(along))).collect();
    for (index, a) in hull.iter().enumerate() {
        for b in hull.iter().skip(index + 1) {
            for plane in [from, to] {
                let (below, above) = (a.dot(along) - plane, b.dot(along) - plane);
                if below * above < 0.0 {
                    points.push(a.lerp(*b, below / (below - above)));
                }
            }
        }
    }
    points
}

/// The frame with this origin, y and z.
fn framed(at: DVec3, y: DVec3, z: DVec3) -> Pose {
    Pose::new(at, DQuat::from_mat3(&DMat3::from_cols(y.cross(z), y, z)).normalize())
}
