//! Counts and errors of many scenes, and the figures that they make.

use super::score::Fate;
use crate::statistics::median_and;
use glam::DVec3;
use std::collections::BTreeMap;

/// How often something held of how often it could have.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Share {
    /// Held.
    pub held: usize,
    /// Could have.
    pub of: usize,
}

impl Share {
    /// Counts one more.
    pub fn count(&mut self, held: bool) {
        self.held += usize::from(held);
        self.of += 1;
    }
    fn add(&mut self, other: Share) {
        self.held += other.held;
        self.of += other.of;
    }
    fn value(self) -> Option<f64> {
        (self.of > 0).then(|| self.held as f64 / self.of as f64)
    }
}

/// Sums over scenes. Errors are lists, so that tallies can be put together before medians are taken.
#[derive(Debug, Clone, Default)]
pub struct Tally {
    /// Scenes.
    pub scenes: usize,
    /// Found of the things that stand apart.
    pub spaced: Share,
    /// Found of the things that touch another.
    pub touching: Share,
    /// Objects that were reported.
    pub reported: usize,
    /// Those of them that are none: background, or a further piece of a thing.
    pub false_objects: usize,
    /// Errors of observed dimensions.
    pub dimension_mm: Vec<f64>,
    /// Errors of the differences between places of larger things of a scene.
    pub relative_mm: Vec<f64>,
    /// As `relative_mm`, of things of any size.
    pub small_relative_mm: Vec<f64>,
    /// Errors of places in the world.
    pub absolute_mm: Vec<f64>,
    /// Errors of headings, modulo the symmetry.
    pub yaw_deg: Vec<f64>,
    /// Things that were drawn from a template, found or not.
    pub templated: usize,
    /// Hinges of such things.
    pub hinges: usize,
    /// Right templates of the things that were found.
    pub template: Share,
    /// Shared volume of the parts of things that were found, the frame's common error of place taken off, without what
    /// colour alone shows.
    pub part_iou: Vec<f64>,
    /// The same of all of them as they stand in the world.
    pub world_part_iou: Vec<f64>,
    /// Observed dimensions whose 90 % interval holds the truth.
    pub interval: Share,
    /// Widths of those intervals.
    pub interval_mm: Vec<f64>,
    /// Dimensions that are said to be bounded only, and lie within their bounds.
    pub bounded: Share,
    /// Dimensions of which nothing is said to be seen.
    pub unseen: usize,
    /// Angles of hinges that are right, of the things that were found.
    pub opening: Share,
    /// What became of the things.
    pub fates: BTreeMap<Fate, usize>,
    /// Found and true places of the scene at hand.
    pub(super) all_places: Vec<(DVec3, DVec3)>,
}

impl Tally {
    /// Takes another one in.
    pub fn add(&mut self, other: &Tally) {
        self.scenes += other.scenes;
        self.reported += other.reported;
        self.false_objects += other.false_objects;
        self.unseen += other.unseen;
        self.templated += other.templated;
        self.hinges += other.hinges;
        let shares = [
            (&mut self.spaced, other.spaced),
            (&mut self.touching, other.touching),
            (&mut self.template, other.template),
            (&mut self.interval, other.interval),
            (&mut self.bounded, other.bounded),
            (&mut self.opening, other.opening),
        ];
        shares.into_iter().for_each(|(own, other)| own.add(other));
        let lists = [
            (&mut self.dimension_mm, &other.dimension_mm),
            (&mut self.relative_mm, &other.relative_mm),
            (&mut self.small_relative_mm, &other.small_relative_mm),
            (&mut self.absolute_mm, &other.absolute_mm),
            (&mut self.yaw_deg, &other.yaw_deg),
            (&mut self.part_iou, &other.part_iou),
            (&mut self.world_part_iou, &other.world_part_iou),
            (&mut self.interval_mm, &other.interval_mm),
        ];
        lists.into_iter().for_each(|(own, other)| own.extend(other));
        for (fate, count) in &other.fates {
            *self.fates.entry(*fate).or_default() += count;
        }
    }

    /// The figures, by the names of the targets. What has no truth here is left out; what could have been found and was
    /// not makes a share of 0.
    pub fn figures(&self) -> Vec<(&'static str, f64)> {
        let median = |values: &[f64]| (!values.is_empty()).then(|| median_and(0.5, values).0);
        // Where there is a truth and nothing was found of it, nothing is right.
        let or_none = |value: Option<f64>, truths: usize| value.or((truths > 0).then_some(0.0));
        let parts = self.part_iou.len();
        let mean = (parts > 0).then(|| self.part_iou.iter().sum::<f64>() / parts as f64);
        let error = median(&self.dimension_mm).filter(|error| *error > 0.0);
        let width = median(&self.interval_mm).zip(error).map(|(width, error)| width / error);
        let false_share = (self.scenes > 0).then(|| self.false_objects as f64 / self.reported.max(1) as f64);
        let figures = [
            ("found_spaced", self.spaced.value()),
            ("found_touching", self.touching.value()),
            ("false_objects", false_share),
            ("dimension_error_p50_mm", median(&self.dimension_mm)),
            ("dimension_error_p90_mm", median(&self.dimension_mm).map(|_| median_and(0.9, &self.dimension_mm).1)),
            ("relative_position_error_p50_mm", median(&self.relative_mm)),
            ("absolute_position_error_p50_mm", median(&self.absolute_mm)),
            ("yaw_error_p50_deg", median(&self.yaw_deg)),
            ("template_accuracy", or_none(self.template.value(), self.templated)),
            ("part_iou", or_none(mean, self.templated)),
            ("interval90_coverage", or_none(self.interval.value(), self.templated)),
            ("interval_width_over_median_error", width),
            ("opening_angle_within_5deg", or_none(self.opening.value(), self.hinges)),
        ];
        figures.into_iter().filter_map(|(name, value)| Some((name, value?))).collect()
    }

    /// The figures of the small cubes: their names are their own.
    pub fn small_cube_figures(&self) -> Vec<(&'static str, f64)> {
        let figures = [
            ("small_cube_position_error_p50_mm", &self.small_relative_mm),
            ("small_cube_yaw_error_p50_deg", &self.yaw_deg),
        ];
        figures.into_iter().filter(|(_, v)| !v.is_empty()).map(|(name, v)| (name, median_and(0.5, v).0)).collect()
    }

    /// What became of the things, and what else is counted.
    pub fn counts(&self) -> Vec<(&'static str, f64)> {
        let fates = Fate::ALL.map(|fate| (fate.name(), self.fates.get(&fate).copied().unwrap_or(0) as f64));
        let parts = self.world_part_iou.len().max(1) as f64;
        let other = [
            ("scenes", self.scenes as f64),
            ("things", self.things() as f64),
            ("reported", self.reported as f64),
            ("false", self.false_objects as f64),
            ("dimensions_observed", self.dimension_mm.len() as f64),
            ("dimensions_bounded", self.bounded.of as f64),
            ("dimensions_within_bounds", self.bounded.held as f64),
            ("dimensions_unseen", self.unseen as f64),
            ("part_iou_in_the_world", self.world_part_iou.iter().sum::<f64>() / parts),
        ];
        fates.into_iter().chain(other).collect()
    }

    fn things(&self) -> usize {
        self.spaced.of + self.touching.of
    }
}
