//! The nearest things: a packed k-d tree over all positions, with what moved since it was built beside it.

use crate::{Id, cow::Run};
use bytemuck::{Pod, Zeroable};
use std::sync::Arc;

/// Points of a leaf.
const LEAF: usize = 16;

/// A position with its object.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Point {
    /// Metres.
    pub position: [f32; 3],
    /// The object.
    pub id: Id,
}

/// A plane that parts the points of a node.
#[derive(Debug, Clone, Copy, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Plane {
    value: f32,
    axis: u32,
}

/// A balanced tree in one array: node n has the children 2n + 1 and 2n + 2, and every leaf an equal share of the points.
#[derive(Debug, Clone, Default)]
pub struct Tree {
    /// Points, leaf by leaf.
    pub points: Run<Point>,
    /// Planes of the inner nodes.
    pub planes: Run<Plane>,
}

/// The first point of leaf `leaf` of `leaves`.
#[inline]
fn start(points: usize, leaf: usize, leaves: usize) -> usize {
    (points as u64 * leaf as u64 / leaves as u64) as usize
}

impl Tree {
    /// Builds the tree.
    pub fn build(mut points: Vec<Point>) -> Tree {
        let leaves = points.len().div_ceil(LEAF).next_power_of_two();
        let mut planes = vec![Plane::default(); leaves - 1];
        let total = points.len();
        split(&mut points, &mut planes, 0, (0, leaves), (total, leaves), 0);
        Tree { points: Run::Owned(points), planes: Run::Owned(planes) }
    }
    /// How many points it has.
    pub fn len(&self) -> usize {
        self.points.get().len()
    }
    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Offers the points near `at`, those of near leaves first, to `nearest`.
    pub fn search(&self, at: [f32; 3], nearest: &mut Nearest<'_>) {
        let (points, planes) = (self.points.get(), self.planes.get());
        if points.is_empty() {
            return;
        }
        // Nodes left aside: the node, and the squared distances of its cell along the axes.
        let mut stack: [(u32, [f32; 3]); 40] = [(0, [0.0; 3]); 40];
        let mut depth = 1usize;
        while let Some((node, offsets)) = depth.checked_sub(1).and_then(|top| stack.get(top).copied()) {
            depth -= 1;
            if offsets.iter().sum::<f32>() > nearest.limit {
                continue;
            }
            let mut node = node as usize;
            while let Some(plane) = planes.get(node) {
                let axis = plane.axis as usize % 3;
                let side = at[axis] - plane.value;
                let (near, far) = if side < 0.0 { (2 * node + 1, 2 * node + 2) } else { (2 * node + 2, 2 * node + 1) };
                let mut behind = offsets;
                behind[axis] = side * side;
                if let Some(slot) = stack.get_mut(depth)
                    && behind.iter().sum::<f32>() <= nearest.limit
                {
                    *slot = (far as u32, behind);
                    depth += 1;
                }
                node = near;
            }
            let leaf = node - planes.len();
            let (first, end) =
                (start(points.len(), leaf, planes.len() + 1), start(points.len(), leaf + 1, planes.len() + 1));
            for point in points.get(first..end).unwrap_or_default() {
                nearest.offer(point);
            }
        }
    }
}

fn split(
    points: &mut [Point],
    planes: &mut [Plane],
    node: usize,
    leaves: (usize, usize),
    all: (usize, usize),
    base: usize,
) {
    if leaves.1 - leaves.0 < 2 {
        return;
    }
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for point in points.iter() {
        for axis in 0..3 {
            low[axis] = low[axis].min(point.position[axis]);
            high[axis] = high[axis].max(point.position[axis]);
        }
    }
    let axis = (0..3).max_by(|&a, &b| (high[a] - low[a]).total_cmp(&(high[b] - low[b]))).unwrap_or(0);
    let middle = leaves.0 + (leaves.1 - leaves.0) / 2;
    let at = start(all.0, middle, all.1) - base;
    if at < points.len() {
        points.select_nth_unstable_by(at, |a, b| a.position[axis].total_cmp(&b.position[axis]));
    }
    let value = points.get(at).or(points.last()).map_or(0.0, |point| point.position[axis]);
    if let Some(plane) = planes.get_mut(node) {
        *plane = Plane { value, axis: axis as u32 };
    }
    let (left, right) = points.split_at_mut(at.min(points.len()));
    let split_at = base + left.len();
    split(left, planes, 2 * node + 1, (leaves.0, middle), all, base);
    split(right, planes, 2 * node + 2, (middle, leaves.1), all, split_at);
}

/// The nearest points so far.
pub struct Nearest<'a> {
    at: [f32; 3],
    most: usize,
    /// Squared distance from which on nothing is taken.
    limit: f32,
    found: Vec<(f32, Id)>,
    accept: &'a dyn Fn(&Point) -> bool,
}

impl<'a> Nearest<'a> {
    /// At most `most` points within `radius` metres that are accepted.
    pub fn new(at: [f32; 3], most: usize, radius: f32, accept: &'a dyn Fn(&Point) -> bool) -> Nearest<'a> {
        let limit = if radius.is_finite() { radius * radius } else { f32::MAX };
        Nearest { at, most, limit, found: Vec::with_capacity(most + 1), accept }
    }
    #[inline]
    fn offer(&mut self, point: &Point) {
        let [dx, dy, dz] =
            [point.position[0] - self.at[0], point.position[1] - self.at[1], point.position[2] - self.at[2]];
        let distance = dx * dx + dy * dy + dz * dz;
        if distance > self.limit || !(self.accept)(point) {
            return;
        }
        let entry = (distance, point.id);
        let place = self.found.partition_point(|other| (other.0, other.1) <= entry);
        if place >= self.most {
            return;
        }
        self.found.insert(place, entry);
        self.found.truncate(self.most);
        if self.found.len() == self.most
            && let Some(last) = self.found.last()
        {
            self.limit = last.0;
        }
    }
    /// Ids with distances in metres, nearest first.
    pub fn into_found(self) -> Vec<(Id, f32)> {
        self.found.into_iter().map(|(squared, id)| (id, squared.sqrt())).collect()
    }
}

/// All positions: a large tree, a small one of what moved since, and a short list of what moved last.
#[derive(Debug, Clone, Default)]
pub struct Space {
    large: Arc<Tree>,
    small: Arc<Tree>,
    last: Arc<Vec<Point>>,
}

/// Points of the short list.
const LAST: usize = 256;

impl Space {
    /// A space whose large tree is given.
    pub fn of(large: Tree) -> Space {
        Space { large: Arc::new(large), ..Space::default() }
    }
    /// The large tree; all there is right after [`Space::build`].
    pub fn large(&self) -> &Tree {
        &self.large
    }
    /// Sorts everything anew.
    pub fn build(points: Vec<Point>) -> Space {
        Space::of(Tree::build(points))
    }
    /// Takes in what moved, with the present position of any object by its id. `false`: too much moved, build anew.
    pub fn moved(&mut self, ids: &[Id], position: &dyn Fn(Id) -> Option<[f32; 3]>) -> bool {
        let mut loose: Vec<Id> = self.last.iter().map(|point| point.id).chain(ids.iter().copied()).collect();
        let point = |id: Id| position(id).map(|position| Point { position, id });
        if loose.len() > LAST {
            loose.extend(self.small.points.get().iter().map(|point| point.id));
            loose.sort_unstable();
            loose.dedup();
            if loose.len() > 4096.max(self.large.len() / 16) {
                return false;
            }
            self.small = Arc::new(Tree::build(loose.into_iter().filter_map(point).collect()));
            self.last = Arc::default();
        } else {
            loose.sort_unstable();
            loose.dedup();
            self.last = Arc::new(loose.into_iter().filter_map(point).collect());
        }
        true
    }
    /// The nearest objects. `accept` says whether a point is where its object is now, and is wanted.
    pub fn nearest(&self, at: [f32; 3], most: usize, radius: f32, accept: &dyn Fn(&Point) -> bool) -> Vec<(Id, f32)> {
        let mut seen: Vec<Id> = Vec::new();
        if !self.last.is_empty() || !self.small.is_empty() {
            // An object may have a point in each of the three that is still right: it counts once.
            let mut nearest = Nearest::new(at, 3 * most, radius, accept);
            self.last.iter().for_each(|point| nearest.offer(point));
            self.small.search(at, &mut nearest);
            self.large.search(at, &mut nearest);
            let mut found = nearest.into_found();
            found.retain(|(id, _)| {
                !seen.contains(id) && {
                    seen.push(*id);
                    true
                }
            });
            found.truncate(most);
            return found;
        }
        let mut nearest = Nearest::new(at, most, radius, accept);
        self.large.search(at, &mut nearest);
        nearest.into_found()
    }
    /// Bytes that it takes.
    pub fn bytes(&self) -> usize {
        let tree = |tree: &Tree| size_of_val(tree.points.get()) + size_of_val(tree.planes.get());
        tree(&self.large) + tree(&self.small) + size_of_val(self.last.as_slice())
    }
}
