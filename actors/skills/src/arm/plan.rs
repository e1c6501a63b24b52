//! Ways through joint space: RRT-Connect, then shortcuts.
//!
//! After J. Kuffner and S. LaValle, "RRT-Connect: an efficient approach to single-query path planning" (2000).

use super::{kinematics::random, scene::Scene};
use acm_concept::arm::Joints;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Longest step of a tree, and the distance between configurations that are checked along it: largest joint, radians.
const STEP_RAD: f64 = 0.4;
const CHECK_RAD: f64 = 0.04;
/// Samples after which the search gives up.
const SAMPLES: usize = 3000;
/// Shortcuts that are tried.
const SHORTCUTS: usize = 80;

/// A way from one configuration to another that is clear by `margin_m` all along: its corners, both ends included.
/// `None` where none was found. Equal questions get equal answers.
pub(crate) fn connect(scene: &Scene, from: &Joints, to: &Joints, margin_m: f64) -> Option<Vec<Joints>> {
    if is_clear_between(scene, from, to, margin_m) {
        return Some(vec![*from, *to]);
    }
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let way = grow(scene, from, to, margin_m, &mut rng)?;
    Some(shorten(scene, way, margin_m, &mut rng))
}

/// Whether every configuration on the straight line is clear. The first end is taken to be.
fn is_clear_between(scene: &Scene, from: &Joints, to: &Joints, margin_m: f64) -> bool {
    let count = (from.farthest(to) / CHECK_RAD).ceil().max(1.0);
    (1..=count as u32).all(|step| scene.is_clear(&from.lerp(to, f64::from(step) / count), margin_m))
}

/// Configurations with the index of the one each was reached from.
struct Tree(Vec<(Joints, usize)>);

impl Tree {
    fn nearest(&self, to: &Joints) -> usize {
        let distance = |known: &Joints| known.iter().zip(to.iter()).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let distances = self.0.iter().map(|(known, _)| distance(known)).enumerate();
        distances.min_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(index, _)| index)
    }
    /// One step towards a configuration: the index reached, and whether it is there.
    fn extend(&mut self, scene: &Scene, to: &Joints, margin_m: f64) -> Option<(usize, bool)> {
        let nearest = self.nearest(to);
        let (from, _) = *self.0.get(nearest)?;
        let share = STEP_RAD / from.farthest(to).max(1e-9);
        let next = if share >= 1.0 { *to } else { from.lerp(to, share) };
        if !is_clear_between(scene, &from, &next, margin_m) {
            return None;
        }
        self.0.push((next, nearest));
        Some((self.0.len() - 1, share >= 1.0))
    }
    /// From the root to an index.
    fn branch(&self, mut index: usize) -> Vec<Joints> {
        let mut branch = Vec::new();
        while let Some((joints, parent)) = self.0.get(index) {
            branch.push(*joints);
            if *parent == index {
                break;
            }
            index = *parent;
        }
        branch.reverse();
        branch
    }
}

fn grow(scene: &Scene, from: &Joints, to: &Joints, margin_m: f64, rng: &mut ChaCha8Rng) -> Option<Vec<Joints>> {
    let (mut here, mut there) = (Tree(vec![(*from, 0)]), Tree(vec![(*to, 0)]));
    let mut swapped = false;
    for _ in 0..SAMPLES {
        let sample = random(scene.arm(), rng);
        if let Some((index, _)) = here.extend(scene, &sample, margin_m) {
            let (reached, _) = *here.0.get(index)?;
            while let Some((other, met)) = there.extend(scene, &reached, margin_m) {
                if met {
                    let (mut way, mut rest) = (here.branch(index), there.branch(other));
                    if swapped {
                        std::mem::swap(&mut way, &mut rest);
                    }
                    rest.reverse();
                    way.extend(rest.into_iter().skip(1));
                    return Some(way);
                }
            }
        }
        std::mem::swap(&mut here, &mut there);
        swapped = !swapped;
    }
    None
}

fn shorten(scene: &Scene, mut way: Vec<Joints>, margin_m: f64, rng: &mut ChaCha8Rng) -> Vec<Joints> {
    for _ in 0..SHORTCUTS {
        if way.len() < 3 {
            break;
        }
        let from = rng.random_range(0..way.len() - 2);
        let to = rng.random_range(from + 2..way.len());
        if let (Some(a), Some(b)) = (way.get(from), way.get(to))
            && is_clear_between(scene, a, b, margin_m)
        {
            way.drain(from + 1..to);
        }
    }
    way
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arm::scene::tests::{panda, robot};
    use acm_concept::{
        pose::Pose,
        solid::{PlacedSolid, Solid},
    };
    use glam::DVec3;

    /// A wall between the two sides of the arm, with room above it.
    fn walled() -> Scene {
        let wall = PlacedSolid {
            solid: Solid::Box { size: DVec3::new(0.5, 0.02, 0.5) },
            pose: Pose::from_translation(DVec3::new(0.5, 0.0, 0.25)),
        };
        Scene::new(&robot(), &panda(), 0.08, &[], &[wall])
    }

    #[test]
    fn a_way_round_a_wall_is_clear_and_always_the_same() {
        let (scene, arm) = (walled(), panda());
        let side = |turn: f64| Joints::new(&[turn, 0.3, 0.0, -2.2, 0.0, 2.5, 0.785]).unwrap();
        let (from, to) = (side(-0.6), side(0.6));
        assert!(scene.is_clear(&from, 0.01) && scene.is_clear(&to, 0.01));
        assert!(!is_clear_between(&scene, &from, &to, 0.01), "the wall is in the way");
        let way = connect(&scene, &from, &to, 0.01).unwrap();
        assert!(way.len() > 2 && way[0] == from && way[way.len() - 1] == to);
        for pair in way.windows(2) {
            for share in 0..=100 {
                let between = pair[0].lerp(&pair[1], f64::from(share) / 100.0);
                assert!(scene.clearance(&between) > 0.005 && arm.limit_broken(&between, 0.0).is_none());
            }
        }
        assert_eq!(connect(&scene, &from, &to, 0.01).unwrap(), way);
    }

    #[test]
    fn there_is_no_way_into_a_wall() {
        let scene = walled();
        let from = Joints::new(&[-0.6, 0.3, 0.0, -2.2, 0.0, 2.5, 0.785]).unwrap();
        let inside = Joints::new(&[0.0, 0.3, 0.0, -2.2, 0.0, 2.5, 0.785]).unwrap();
        assert!(scene.clearance(&inside) < 0.0);
        assert!(connect(&scene, &from, &inside, 0.01).is_none());
    }
}
