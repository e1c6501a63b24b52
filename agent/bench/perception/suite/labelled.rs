//! Clouds of the suite's things with what is true of them: what estimators learn from and are compared on.

use super::{Plan, RowKind, Scene, Wanted, Workshop, draw, scene::TABLE_M, thing, view, view::Eye, view::View};
use acm_concept::template::{SeenBy, Template, TemplateLibrary};
use acm_perception::{
    GrounderConfig,
    given::{Estimate, GivenThing, things},
};
use acm_render::Renderer;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use std::sync::Arc;

/// Every so many seeds things touch.
const TOUCHING: u64 = 3;

/// What is seen of a thing that was made of a template, and what is true of it.
#[derive(Debug, Clone)]
pub struct Labelled {
    /// What is seen.
    pub given: GivenThing,
    /// The template's type.
    pub template: String,
    /// The truth, in the support frame. The camera's errors of calibration are taken off: no estimator can know them.
    pub truth: Estimate,
}

/// Draws labelled things.
pub struct Studio {
    plan: Plan,
    library: Arc<TemplateLibrary>,
    foreign: thing::Foreign,
    eye: Eye,
    config: GrounderConfig,
}

/// Which views are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Views {
    /// Any: what is cut off by the image's border is left out.
    Any,
    /// Those that the suite would judge.
    Judged,
}

impl Studio {
    /// One for the suite that ships.
    ///
    /// # Errors
    /// There is no renderer.
    pub fn new() -> anyhow::Result<Studio> {
        let library = Arc::new(acm_memory::default_library()?);
        let plan = Plan::own(&library)?;
        let eye = Eye::new(Renderer::new()?);
        Ok(Studio { plan, library, foreign: thing::Foreign::default(), eye, config: GrounderConfig::default() })
    }

    /// The library that things are made of.
    pub fn library(&self) -> &TemplateLibrary {
        &self.library
    }
    /// The templates that things are drawn from and that depth shows.
    pub fn templates(&self) -> Vec<&Template> {
        let named = self.plan.templates.iter().filter_map(|template| self.library.get(&template.name));
        named.filter(|template| template.seen_by == SeenBy::Depth).collect()
    }

    /// The things of a scene: exact ones for even seeds, perturbed ones for odd. Where perception finds no plane there are
    /// none.
    ///
    /// # Errors
    /// The renderer fails, or no scene can be drawn.
    pub fn scene(&mut self, seed: u64, views: Views) -> anyhow::Result<Vec<Labelled>> {
        let kind = if seed.is_multiple_of(2) { RowKind::Exact } else { RowKind::Perturbed };
        let wanted = Wanted { kind, touching: seed.is_multiple_of(TOUCHING) };
        let (scene, view) = match views {
            Views::Judged => draw(&self.plan, &self.library, &mut self.foreign, &mut self.eye, wanted, seed)?,
            Views::Any => self.any(wanted, seed)?,
        };
        let (sensor, _) = view::sensor(&self.plan, seed)?;
        let camera = sensor.true_camera(&scene.camera).pose;
        let frame = &view.frames[0];
        let bases: Vec<f64> = scene.things.iter().map(|thing| thing.pose.translation.z - TABLE_M).collect();
        let least = self.plan.layout.least_pixels;
        let labels = whole(&view.labels, frame.header.intrinsics.width as usize, bases.len(), least);
        let Ok(given) = things(frame, &labels, &bases, &self.config) else { return Ok(Vec::new()) };
        let labelled = scene.things.iter().zip(given).filter_map(|(thing, given)| {
            let (given, made) = (given?, thing.template.as_ref()?);
            self.library.get(&made.template).filter(|template| template.seen_by == SeenBy::Depth)?;
            let pose = given.camera * camera.inverse() * thing.pose;
            let truth = Estimate { pose, values: made.values.clone() };
            Some(Labelled { given, template: made.template.clone(), truth })
        });
        Ok(labelled.collect())
    }

    /// The first scene of a seed for which there is room, and a view of it.
    fn any(&mut self, wanted: Wanted, seed: u64) -> anyhow::Result<(Scene, View)> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut workshop = Workshop::new(&self.plan, &self.library, &mut self.foreign);
        for _ in 0..self.plan.attempts {
            if let Some(scene) = Scene::draw(&self.plan, wanted, &mut workshop, &mut rng)?
                && let Some(view) = self.eye.view(&self.plan, &scene, None, seed)?
            {
                return Ok((scene, view));
            }
        }
        anyhow::bail!("seed {seed}: there was no room for its things in {} attempts", self.plan.attempts)
    }
}

/// Labels without those of things that the image's border cuts off or that have few pixels.
fn whole(labels: &[u16], width: usize, things: usize, least_pixels: usize) -> Vec<u16> {
    let height = labels.len() / width.max(1);
    let mut pixels = vec![0usize; things + 1];
    let mut cut = vec![false; things + 1];
    for (index, label) in labels.iter().enumerate() {
        let (column, row) = (index % width, index / width);
        if let (Some(pixels), Some(cut)) = (pixels.get_mut(usize::from(*label)), cut.get_mut(usize::from(*label))) {
            *pixels += 1;
            *cut |= column == 0 || row == 0 || column + 1 == width || row + 1 == height;
        }
    }
    let kept = |label: &u16| {
        let at = usize::from(*label);
        pixels.get(at).is_some_and(|count| *count >= least_pixels) && cut.get(at) == Some(&false)
    };
    labels.iter().map(|label| if kept(label) { *label } else { 0 }).collect()
}
