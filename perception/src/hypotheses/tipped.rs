//! A known thing that was tipped over: a box on its side looks like an upright box of other sizes, and only memory can
//! tell which of the two it is.

use super::{Context, Hypothesis, score};
use crate::fit::{Evidence, Model, minimise, rough_cost};
use acm_concept::{
    pose::Pose,
    solid::PlacedSolid,
    template::{Rest, Template},
};
use glam::{DQuat, DVec2, DVec3};
use std::f64::consts::FRAC_PI_2;

/// Sizes agree within this, or within this share of the known one.
const AGREES_M: f64 = 0.012;
const AGREES_SHARE: f64 = 0.1;
/// The other reading may explain the evidence worse by this much (negative log likelihood).
const AS_GOOD: f64 = 3.0;

/// The best hypothesis, read as a part of memory's that is not in its place and now lies on another side.
/// `None` where no such part has the sizes, or one that has them stands upright as it was.
pub(super) fn read_anew<'a>(
    context: Context<'a>,
    best: &Hypothesis<'a>,
    evidence: &Evidence,
) -> Option<Hypothesis<'a>> {
    let (template, base) = (best.model.template, best.model.base);
    let seen = outer(template, &best.model.placement(&best.minimum.state).values, DQuat::IDENTITY)?;
    let mut nearest: Option<(f64, &Rest, Vec<f64>)> = None;
    for part in context.displaced.iter().filter(|part| part.template == template.name) {
        let values: Vec<f64> = template.parameters.iter().map(|p| part.value(&p.name)).collect::<Option<_>>()?;
        if mismatch(seen, outer(template, &values, DQuat::IDENTITY)?).is_some() {
            return None;
        }
        for rest in template.rests.iter().filter(|rest| rest.like_upright) {
            let Some(off) = mismatch(seen, outer(template, &values, rest.turn())?) else { continue };
            if nearest.as_ref().is_none_or(|(least, _, _)| off < *least) {
                nearest = Some((off, rest, values.clone()));
            }
        }
    }
    let (_, rest, values) = nearest?;
    let model = Model::new(template, values, base)?.lying(Some(rest));
    let place = best.model.placement(&best.minimum.state).pose;
    let at = |quarter: usize| {
        let start = model.start(place.translation.truncate(), place.yaw() + quarter as f64 * FRAC_PI_2);
        (rough_cost(&model, evidence, &start), start)
    };
    let (_, start) = [at(0), at(1)].into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    let minimum = minimise(&model, evidence, &start);
    if minimum.cost > best.minimum.cost + AS_GOOD {
        return None;
    }
    // As good a reading as the upright one; memory decides between them.
    let score = score(context, &best.model, &best.minimum, evidence) + context.config.memory_boost.ln();
    Some(Hypothesis { model, minimum, score, probability: 0.0, tracked: None })
}

/// Longer side, shorter side and height of what a part covers when it is turned by `turn`, metres.
fn outer(template: &Template, values: &[f64], turn: DQuat) -> Option<DVec3> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for solid in template.solids(&template.named(values)).ok()? {
        let turned = PlacedSolid { pose: Pose::new(DVec3::ZERO, turn) * solid.pose, ..solid };
        let half = turned.half_extents();
        (low, high) = (low.min(turned.pose.translation - half), high.max(turned.pose.translation + half));
    }
    let size = high - low;
    let plan = DVec2::new(size.x.max(size.y), size.x.min(size.y));
    size.is_finite().then(|| plan.extend(size.z))
}

/// How far sizes are apart, as a sum of shares of what is tolerated; `None` if one is apart too far.
fn mismatch(seen: DVec3, known: DVec3) -> Option<f64> {
    let off = (seen - known).abs() / (known * AGREES_SHARE).max(DVec3::splat(AGREES_M));
    (off.max_element() <= 1.0).then(|| off.element_sum())
}
