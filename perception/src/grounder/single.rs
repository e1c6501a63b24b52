//! One step of the pipeline by itself: the masks of a frame, and what one mask is. The geometric tools are made of this.

use super::{Grounder, assemble, bases::Bodies, beliefs, explained::Explained, rank_on};
use crate::{
    expected::Remembered,
    fit::Evidence,
    gather,
    hypotheses::Context,
    joins, parting,
    scene::Scene,
    segments::{self, NONE, Segments},
    tools::{Mask, ParamBelief, PoseBelief},
};
use acm_concept::{
    camera::RgbdFrame,
    expectation::Expectation,
    object::{Blindness, PixelSupport, SupportPlane},
    template::TemplateLibrary,
};
use glam::DVec2;

/// Why geometry says nothing of a mask.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Refusal {
    /// The frame shows nothing.
    Blind(Blindness),
    /// The mask is not one of the frame, or holds too few pixels that stand on the surface.
    Mask(String),
    /// No template of the library fits.
    NothingFits,
}

/// What geometry makes of one mask.
pub(crate) struct Single {
    /// Probability of each template that fits.
    pub odds: Vec<(String, f64)>,
    pub pose: PoseBelief,
    pub params: ParamBelief,
}

impl Grounder {
    /// The masks of what stands on the surface, before any template is chosen.
    pub(crate) fn masks(&self, frame: &RgbdFrame, nouns: &[String]) -> Result<Vec<Mask>, Blindness> {
        let expectation = Expectation { nouns: nouns.to_vec(), ..Expectation::default() };
        let cut = |scene: &Scene, support: &SupportPlane| {
            let remembered = Remembered::cast(scene, &frame.header.camera_pose, support, &expectation, &self.library);
            let context = self.context(nouns, &self.library);
            let segments = self.segments(scene, context, &remembered, &mut Vec::new());
            let mask = |pixels: Vec<usize>| {
                let evidence = Evidence::of_segment(scene, &segments, &pixels);
                let support = support_of(scene, &pixels)?;
                let whole = 1.0 - evidence.cut_share();
                Some(Mask { support, score: whole, evidence: Default::default() }.with("outline_own", whole))
            };
            segments.pixels().into_iter().filter_map(mask).collect()
        };
        self.in_scene(frame, &expectation, cut).map_err(|(blindness, _)| blindness)
    }

    /// What one mask is, by the templates of `library` alone. Nothing is known of its neighbours: it stands on the plane
    /// unless it visibly hangs free.
    pub(crate) fn single(
        &self,
        frame: &RgbdFrame,
        mask: &PixelSupport,
        library: &TemplateLibrary,
    ) -> Result<Single, Refusal> {
        Mask::from_runs(mask.runs.clone(), &frame.header.intrinsics, 1.0)
            .map_err(|error| Refusal::Mask(error.to_string()))?;
        let fit = |scene: &Scene, _: &SupportPlane| self.single_in(scene, mask, library);
        match self.in_scene(frame, &Expectation::default(), fit) {
            Ok(single) => single,
            Err((blindness, _)) => Err(Refusal::Blind(blindness)),
        }
    }

    fn single_in(&self, scene: &Scene, mask: &PixelSupport, library: &TemplateLibrary) -> Result<Single, Refusal> {
        let pixels: Vec<usize> = mask.indices().into_iter().filter(|&pixel| scene.rising[pixel]).collect();
        if pixels.len() < self.config.min_segment_px {
            let least = self.config.min_segment_px;
            return Err(Refusal::Mask(format!("has {} pixels that stand up, fewer than {least}", pixels.len())));
        }
        let mut segments =
            Segments { labels: vec![NONE; scene.grid.len()], count: 1, inner: vec![false; scene.grid.len()] };
        pixels.iter().for_each(|&pixel| segments.labels[pixel] = 0);
        let evidence = Evidence::of_segment(scene, &segments, &pixels);
        let plan: Vec<DVec2> = evidence.points.iter().map(|p| p.position.truncate()).collect();
        let base = Bodies::default().base_under(&plan, scene.lowest_m(&pixels), &evidence);
        let context = self.context(&[], library);
        let ranked = rank_on(context, &plan, &evidence, base);
        let best = ranked.first().ok_or(Refusal::NothingFits)?;
        let object = assemble::object(scene, context, std::slice::from_ref(best), &evidence, &pixels, 1.0);
        let object = object.ok_or(Refusal::NothingFits)?;
        let part = object.parts.first().ok_or(Refusal::NothingFits)?;
        let pose = beliefs::pose(best, part, &self.config);
        let params = beliefs::params(best, part, &evidence, object.support.count);
        let mut odds: Vec<(String, f64)> = Vec::new();
        for hypothesis in &ranked {
            let name = &hypothesis.model.template.name;
            match odds.iter_mut().find(|(known, _)| known == name) {
                Some((_, probability)) => *probability += hypothesis.probability,
                None => odds.push((name.clone(), hypothesis.probability)),
            }
        }
        odds.sort_by(|a, b| b.1.total_cmp(&a.1));
        Ok(Single { odds, pose, params })
    }

    fn context<'a>(&'a self, nouns: &'a [String], library: &'a TemplateLibrary) -> Context<'a> {
        Context { library, config: &self.config, nouns, lying: true, displaced: &[], remembered: None }
    }

    /// What stands on the plane, cut into things and put together again where two pieces are one. What is explained is a
    /// segment already, and no longer explained where a piece that is left beside it belongs to it.
    pub(super) fn segments(
        &self,
        scene: &Scene,
        unremembered: Context,
        remembered: &Remembered,
        explained: &mut Vec<Explained>,
    ) -> Segments {
        let mut open = scene.rising.clone();
        explained.iter().flat_map(|thing| &thing.pixels).for_each(|&pixel| open[pixel] = false);
        let mut segments = segments::split(scene, &open);
        crate::expected::split(scene, remembered, &mut segments);
        crate::expected::merge(remembered, &mut segments);
        let first = segments.count as u32;
        explained.iter_mut().for_each(|thing| thing.label = segments.lay(&thing.pixels));
        if first > 0 {
            let known = first..segments.count as u32;
            // What is hollow or cut in two is told by upright solids alone: they are many, and most are refused.
            let upright = Context { lying: false, displaced: &[], ..unremembered };
            let whole = gather::gather(scene, &mut segments, upright, &known);
            joins::join(scene, &mut segments, upright, known.clone(), &whole);
            parting::part(scene, &mut segments, upright, known);
            let pixels = segments.pixels();
            explained.retain(|thing| pixels[thing.label as usize].len() == thing.pixels.len());
        }
        segments
    }
}

fn support_of(scene: &Scene, pixels: &[usize]) -> Option<PixelSupport> {
    PixelSupport::from_indices(pixels, scene.grid.width, scene.grid.len())
}
