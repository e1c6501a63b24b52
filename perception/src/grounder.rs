//! The pipeline: frame and expectation in, percepts out.

mod assemble;
mod assisted;
mod bases;
mod beliefs;
mod completion;
mod explained;
mod put;
mod single;

pub use assisted::{Assisted, AssistedGrounder};
pub(crate) use single::{Refusal, Single};

use crate::{
    config::GrounderConfig,
    expected::{self, Remembered},
    fit::{Base, Evidence},
    frozen::LastPictures,
    gather,
    hypotheses::{self, Context, Hypothesis, Measured},
    own, patches, reading,
    scan::Scan,
    scene::Scene,
    segments::NONE,
    support::{self, Plane, Upright},
};
use acm_concept::{
    camera::RgbdFrame,
    expectation::Expectation,
    object::{Blindness, GroundedObject, Percepts, SupportPlane},
    template::{SeenBy, TemplateLibrary},
};
use assisted::Aid;
use bases::Bodies;
use explained::Explained;
use glam::{DVec2, DVec3};
use rayon::prelude::*;
use std::sync::Arc;

/// Grounds frames into analytic concepts.
///
/// ```
/// # use acm_concept::{camera::*, expectation::Expectation, ids::FrameId, object::Blindness, pose::Pose, template::TemplateLibrary, time::Time};
/// # use acm_perception::{Grounder, GrounderConfig};
/// let grounder = Grounder::new(TemplateLibrary::default().into(), GrounderConfig::default());
/// let intrinsics = Intrinsics::from_vertical_fov(64, 48, 1.0);
/// let header = FrameHeader { id: FrameId(0), camera: "head".into(), time: Time::ZERO, intrinsics, camera_pose: Pose::IDENTITY };
/// let black = RgbdFrame::new(header, vec![0; 3 * 64 * 48].into(), vec![0.0; 64 * 48].into()).unwrap();
/// let percepts = grounder.ground(&black, &Expectation::default());
/// assert_eq!(percepts.blindness, Some(Blindness::NoDepth));
/// ```
#[derive(Debug, Clone)]
pub struct Grounder {
    library: Arc<TemplateLibrary>,
    config: GrounderConfig,
}

impl Grounder {
    /// A grounder that fits the templates of `library`.
    pub fn new(library: Arc<TemplateLibrary>, config: GrounderConfig) -> Grounder {
        Grounder { library, config }
    }

    /// Says what a frame shows. Never fails: a frame that shows nothing is answered with its
    /// [`Blindness`] and without objects. The same frame and expectation always give the same answer.
    ///
    /// Poses are in the world of the frame's nominal camera pose, metres; heights are over the plane that is found,
    /// not over a nominal one.
    pub fn ground(&self, frame: &RgbdFrame, expectation: &Expectation) -> Percepts {
        self.ground_with(frame, expectation, &mut Aid::none())
    }

    /// Says what the next frame of a live camera shows: as [`Grounder::ground`] does, and nothing where the camera gives its
    /// last picture again.
    pub fn ground_next(&self, last: &mut LastPictures, frame: &RgbdFrame, expectation: &Expectation) -> Percepts {
        let percepts = self.ground(frame, expectation);
        if last.repeats(frame, &percepts) {
            return self.blind(frame, expectation, Blindness::Frozen, percepts.depth_fraction);
        }
        percepts
    }

    fn ground_with(&self, frame: &RgbdFrame, expectation: &Expectation, aid: &mut Aid) -> Percepts {
        let read = |scene: &Scene, support: &SupportPlane| {
            let camera_pose = &frame.header.camera_pose;
            let remembered = Remembered::cast(scene, camera_pose, support, expectation, &self.library);
            let mut objects = self.objects(scene, expectation, &remembered, aid);
            objects.retain(|object| object.confidence >= self.config.min_confidence);
            completion::complete(scene, camera_pose, &self.library, &mut objects);
            objects.sort_by(|a, b| b.support.count.cmp(&a.support.count).then(a.support.runs.cmp(&b.support.runs)));
            objects.truncate(self.config.max_objects);
            expected::hint(&remembered, &mut objects, &self.library);
            if self.config.read {
                let white = reading::white(scene);
                objects
                    .par_iter_mut()
                    .for_each(|object| object.readings = reading::read(scene, white, &object.support));
                reading::part(&mut objects);
            }
            Percepts {
                frame: frame.header.clone(),
                support: Some(*support),
                objects,
                expected: expected::views(&remembered),
                blindness: None,
                depth_fraction: scene.scan.depth_fraction,
            }
        };
        self.in_scene(frame, expectation, read)
            .unwrap_or_else(|(blindness, depth_fraction)| self.blind(frame, expectation, blindness, depth_fraction))
    }

    /// Reads a frame up to the surface on which things stand; of a frame that shows none its blindness and the share of
    /// its pixels with a depth.
    fn in_scene<R>(
        &self,
        frame: &RgbdFrame,
        expectation: &Expectation,
        read: impl FnOnce(&Scene, &SupportPlane) -> R,
    ) -> Result<R, (Blindness, f64)> {
        let scan = Scan::read(frame, &self.config)?;
        let own = own::pixels(&scan, &frame.header.camera_pose, &expectation.robot, &self.config);
        let up = frame.header.camera_pose.rotation.inverse() * DVec3::Z;
        let upright = Upright { up, max_angle_rad: self.config.max_support_tilt_rad };
        let known = expectation.support.map(|support| Plane::of(&support, &frame.header.camera_pose));
        let plane = support::find(&scan, &own, upright, known, &self.config)
            .ok_or((Blindness::NoSupport, scan.depth_fraction))?;
        let scene = Scene::new(&scan, &plane, &frame.header.camera_pose, own, &self.config);
        let support = support_plane(&scene, &plane);
        Ok(read(&scene, &support))
    }

    fn blind(
        &self,
        frame: &RgbdFrame,
        expectation: &Expectation,
        blindness: Blindness,
        depth_fraction: f64,
    ) -> Percepts {
        Percepts {
            frame: frame.header.clone(),
            support: None,
            objects: Vec::new(),
            expected: expected::unseen(expectation),
            blindness: Some(blindness),
            depth_fraction,
        }
    }

    fn objects(
        &self,
        scene: &Scene,
        expectation: &Expectation,
        remembered: &Remembered,
        aid: &mut Aid,
    ) -> Vec<GroundedObject> {
        let unremembered = Context {
            library: &self.library,
            config: &self.config,
            nouns: &expectation.nouns,
            lying: true,
            displaced: &remembered.displaced,
            remembered: None,
        };
        // A tool that segments is asked about all that stands there.
        let mut explained = Vec::new();
        if aid.is_none() {
            explained = explained::find(scene, unremembered, remembered);
            explained.append(&mut put::find(scene, unremembered, remembered, &explained));
        }
        let mut segments = self.segments(scene, unremembered, remembered, &mut explained);
        aid.cut(scene, &expectation.nouns, &mut segments);
        let standing: Vec<bool> = segments.labels.iter().map(|label| *label != NONE).collect();
        let context = |remembered| Context { remembered, ..unremembered };
        let as_expected = |thing: &Explained| {
            let context = Context { remembered: Some(thing.known), ..unremembered };
            assemble::object(scene, context, std::slice::from_ref(&thing.fit), &thing.evidence, &thing.pixels, 1.0)
        };
        let (patches, expected): (_, Vec<GroundedObject>) =
            rayon::join(|| patches::find(scene, &standing), || explained.par_iter().filter_map(as_expected).collect());
        let (mut objects, mut bodies) = (Vec::new(), Bodies::default());
        for patch in patches {
            let measured = Measured { plan: patch.plan, height_m: 0.0, base: Base::At(0.0), seen_by: SeenBy::Color };
            let context = context(remembered.at(&patch.pixels, SeenBy::Color));
            let ranked = hypotheses::rank(context, &measured, &patch.evidence);
            if let Some(object) = assemble::object(scene, context, &ranked, &patch.evidence, &patch.pixels, patch.fill)
            {
                bodies.add(&ranked);
                objects.push(object);
            }
        }
        objects.extend(expected);
        explained.iter().for_each(|thing| bodies.add(std::slice::from_ref(&thing.fit)));
        let mut open = segments.pixels();
        explained.iter().for_each(|thing| open[thing.label as usize].clear());
        let measure = |pixels: Vec<usize>| {
            let evidence = Evidence::of_segment(scene, &segments, &pixels);
            (scene.lowest_m(&pixels), pixels, evidence)
        };
        let mut pieces: Vec<_> = open.into_par_iter().filter(|pixels| !pixels.is_empty()).map(measure).collect();
        // From below, so that what stands on another thing finds it.
        pieces.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (lowest_m, pixels, evidence) in pieces {
            let plan: Vec<DVec2> = evidence.points.iter().map(|p| p.position.truncate()).collect();
            let context = context(remembered.at(&pixels, SeenBy::Depth));
            let base = bodies.base_under(&plan, lowest_m, &evidence);
            let mut ranked = rank_on(context, &plan, &evidence, base);
            gather::drop_empty(scene, &mut ranked);
            aid.advise(scene, context, &evidence, &pixels, &mut ranked);
            if let Some(object) = assemble::object(scene, context, &ranked, &evidence, &pixels, 1.0) {
                bodies.add(&ranked);
                objects.push(object);
            }
        }
        objects
    }
}

/// The templates that can explain a segment on a base. What seems to hang in the air may hide what it stands on, and is
/// tried on the plane too.
fn rank_on<'a>(context: Context<'a>, plan: &[DVec2], evidence: &Evidence, base: Base) -> Vec<Hypothesis<'a>> {
    let rank = |base: Base| {
        let (Base::At(bottom) | Base::Free(bottom)) = base;
        let height_m = evidence.top_m() - bottom;
        let measured = Measured { plan: plan.to_vec(), height_m, base, seen_by: SeenBy::Depth };
        hypotheses::rank(context, &measured, evidence)
    };
    match base {
        free @ Base::Free(_) => better(rank(free), rank(Base::At(0.0))),
        base => rank(base),
    }
}

/// The ranking whose best hypothesis is the more probable.
fn better<'a>(a: Vec<Hypothesis<'a>>, b: Vec<Hypothesis<'a>>) -> Vec<Hypothesis<'a>> {
    let best = |ranked: &[Hypothesis]| ranked.first().map_or(f64::NEG_INFINITY, |first| first.score);
    if best(&b) > best(&a) { b } else { a }
}

fn support_plane(scene: &Scene, plane: &Plane) -> SupportPlane {
    let pixels: Vec<usize> = (0..scene.grid.len()).step_by(3).filter(|&i| scene.in_plane[i]).collect();
    let normal = scene.world.transform_vector(DVec3::Z);
    SupportPlane {
        normal,
        offset_m: normal.dot(scene.world.translation),
        residual_m: plane.residual_m,
        appearance: scene.scan.appearance(&pixels),
    }
}
