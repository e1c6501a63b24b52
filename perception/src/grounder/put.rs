//! What is looked for where memory expects it by its own solids and colour, also where it stands in something, or touches what
//! memory does not explain: what the robot itself put there, whose identity and sizes are in no doubt, and what only memory or
//! the instruction calls for.

use super::explained::{Explained, has_its_colors};
use crate::{
    expected::{self, Ghost, Known, Remembered},
    fit::{Base, Evidence, minimise},
    hypotheses::{self, Context, Hypothesis, Measured},
    raster,
    scan::Tint,
    scene::Scene,
    segments::{NONE, Segments},
};
use acm_concept::template::SeenBy;

/// Lower than this, its foot is that of a thing on the plane, metres.
const ON_THE_PLANE_M: f64 = 0.004;
/// It is not farther than this from where it is expected, metres and radians.
const MOST_SHIFT_M: f64 = 0.025;
const MOST_TURN_RAD: f64 = 0.35;
/// It explains these shares of the surface and of the outline that are taken for its own, and so much of what the camera
/// would see of it is there.
const ON_SURFACE: f64 = 0.9;
const ON_OUTLINE: f64 = 0.7;
const THERE: f64 = 0.9;
/// At first a pixel is its own up to this tint from its mean, with so many times its spread on top.
const ALIKE: f32 = 14.0;
const SPREADS: f32 = 2.0;
/// It is fitted so often, each time to what the last fit says are its pixels, and those round them.
const ROUNDS: usize = 3;
const FRINGE_PX: isize = 2;
/// A measured pixel is of the fitted solids within this, beyond noise, metres.
const ON_IT_M: f64 = 0.004;

/// What was put where it is expected and is found there, of what is not explained yet.
pub(super) fn find<'a>(
    scene: &Scene,
    context: Context<'a>,
    remembered: &'a Remembered,
    explained: &[Explained],
) -> Vec<Explained<'a>> {
    let mut taken = vec![false; scene.grid.len()];
    explained.iter().flat_map(|thing| &thing.pixels).for_each(|&pixel| taken[pixel] = true);
    let is_left = |ghost: &&Ghost| !explained.iter().any(|thing| thing.id == ghost.id);
    let on_call = |ghost: &Ghost| {
        let template = ghost.known().and_then(|known| context.library.get(&known.part.template));
        template.is_some_and(|template| template.on_call)
    };
    let looked_for =
        |ghost: &&Ghost| !ghost.held && !ghost.flat && (ghost.was_put || on_call(ghost) && ghost.is_seen());
    // What was put into something is found before that.
    let (first, then): (Vec<&Ghost>, Vec<&Ghost>) =
        remembered.ghosts.iter().filter(looked_for).filter(is_left).partition(|ghost| ghost.was_put);
    let mut found = Vec::new();
    for ghost in first.into_iter().chain(then) {
        if let Some(thing) = of(scene, context, ghost, &remembered.ghosts, &taken) {
            thing.pixels.iter().for_each(|&pixel| taken[pixel] = true);
            found.push(thing);
        }
    }
    found
}

fn of<'a>(
    scene: &Scene,
    context: Context<'a>,
    ghost: &'a Ghost,
    ghosts: &[Ghost],
    taken: &[bool],
) -> Option<Explained<'a>> {
    let known @ Known { part, .. } = ghost.known()?;
    let foot_m = scene.world.inverse().transform_point(part.pose.pose.translation).z;
    let base = if foot_m < ON_THE_PLANE_M { Base::At(0.0) } else { Base::Free(foot_m) };
    let measured = Measured { plan: Vec::new(), height_m: 0.0, base, seen_by: SeenBy::Depth };
    let (model, (at, yaw)) = hypotheses::as_remembered(context, part, &measured)?;
    let model = model.rigid();
    let start = model.start(at, yaw);
    let own = Tint::of(&ghost.appearance.mean);
    let alike = |pixel: usize| scene.scan.tint(pixel).distance(&own) < ALIKE + SPREADS * ghost.appearance.spread as f32;
    let free = |pixel: usize| scene.rising[pixel] && !scene.own[pixel] && !taken[pixel];
    // At first what is nearer to it than to anything else that is expected.
    let nearest = |pixel: usize| {
        let point = scene.world.transform_point(scene.point[pixel].as_dvec3());
        let distance = ghost.distance_m(point).abs();
        let tolerance = expected::tolerance_m(scene, f64::from(scene.scan.smooth[pixel]), false);
        let others = ghosts.iter().filter(|other| other.id != ghost.id && !other.flat);
        distance < tolerance && others.map(|other| other.distance_m(point).abs()).all(|other| distance <= other)
    };
    let mut pixels: Vec<usize> =
        (0..scene.grid.len()).filter(|&pixel| free(pixel) && alike(pixel) && nearest(pixel)).collect();
    let mut state = start.clone();
    let mut last = None;
    for _ in 0..ROUNDS {
        if pixels.len() < scene.min_segment_px() {
            return None;
        }
        let evidence = evidence(scene, &pixels);
        let minimum = minimise(&model, &evidence, &state);
        state.clone_from(&minimum.state);
        let hits = raster::cast(&scene.scan.intrinsics, scene.grid, &scene.camera, &model.solids(&state)).hits;
        let tolerance = |pixel: usize| {
            ON_IT_M + 2.5 * scene.noise_ratio * scene.config.depth_sigma_m(f64::from(scene.scan.smooth[pixel]))
        };
        let off = |&(pixel, depth): &(usize, f64)| f64::from(scene.scan.smooth[pixel]) - depth;
        let shown = hits.iter().filter(|hit| scene.is_known(hit.0) && !scene.own[hit.0]);
        let (on, behind) = shown.fold((0usize, 0usize), |(on, behind), hit| {
            let (off, tolerance) = (off(hit), tolerance(hit.0));
            (on + usize::from(off.abs() < tolerance), behind + usize::from(off >= tolerance))
        });
        let there = on as f64 / (on + behind).max(1) as f64;
        last = Some((evidence, minimum, pixels, there));
        let hit: Vec<usize> =
            hits.iter().filter(|hit| free(hit.0) && off(hit).abs() < tolerance(hit.0)).map(|hit| hit.0).collect();
        let mut own = vec![false; scene.grid.len()];
        hit.iter().for_each(|&pixel| own[pixel] = true);
        for &pixel in &hit {
            for (dx, dy) in (-FRINGE_PX..=FRINGE_PX).flat_map(|dy| (-FRINGE_PX..=FRINGE_PX).map(move |dx| (dx, dy))) {
                let near = scene.grid.offset(pixel, dx, dy).filter(|&near| free(near) && alike(near));
                let level =
                    |near: &usize| f64::from((scene.scan.smooth[*near] - scene.scan.smooth[pixel]).abs()) < ON_IT_M;
                if let Some(near) = near.filter(level) {
                    own[near] = true;
                }
            }
        }
        pixels = (0..own.len()).filter(|&pixel| own[pixel]).collect();
    }
    let (evidence, minimum, pixels, there) = last?;
    let moved_m = (minimum.state[0] - start[0]).hypot(minimum.state[1] - start[1]);
    let turned = model.yaw_index().map_or(0.0, |yaw| (minimum.state[yaw] - start[yaw]).abs());
    let score = hypotheses::score(context, &model, &minimum, &evidence);
    let fit = Hypothesis { model, minimum, score, probability: 1.0, tracked: Some(part) };
    let (on_surface, on_outline) = fit.explained(&evidence);
    let is_it = moved_m < MOST_SHIFT_M
        && turned < MOST_TURN_RAD
        && there > THERE
        && on_surface > ON_SURFACE
        && on_outline > ON_OUTLINE
        && has_its_colors(scene, ghost, &pixels);
    is_it.then_some(Explained { id: ghost.id, known, label: NONE, pixels, evidence, fit })
}

/// What some pixels offer to a fit, all else that stands being something else.
fn evidence(scene: &Scene, pixels: &[usize]) -> Evidence {
    let labels = scene.grid.map(|pixel| if scene.rising[pixel] { 1 } else { NONE });
    let inner = vec![false; labels.len()];
    let mut segments = Segments { labels, count: 2, inner };
    segments.lay(pixels);
    Evidence::of_segment(scene, &segments, pixels)
}
