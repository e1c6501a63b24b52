//! `acm learn compare`: the learned and the geometric estimate of the same clouds.

mod table;

use super::{Interrupt, cloud, estimate};
use crate::{
    bench::{
        BenchResult, Row,
        perception::suite::labelled::{Labelled, Studio, Views},
        progress, write_json,
    },
    cli::{Exit, learn::LearnCompareArgs},
};
use acm_concept::template::{Template, Unit, YawSymmetry};
use acm_learned::estimator::{Estimated, Estimator};
use acm_perception::given::Estimate;
use anyhow::bail;
use std::{collections::BTreeMap, io};
use table::{Quantity, Table, Way};

/// Half of a 90 % interval in standard deviations.
const SIGMAS_90: f64 = 1.645;

/// Measures both, prints the table and says which is better.
///
/// # Errors
/// The weights cannot be used, or were learned from scenes that are asked for.
pub fn run(args: &LearnCompareArgs) -> anyhow::Result<Exit> {
    let estimator = Estimator::read(&args.weights)?;
    let [first, last] = estimator.description().origin.scenes;
    if args.seeds.first <= last && first <= args.seeds.last {
        bail!("--seeds {}..{}: {first}..{last} were learned from; take others", args.seeds.first, args.seeds.last);
    }
    let interrupt = Interrupt::new()?;
    let mut studio = Studio::new()?;
    let mut table = Table::default();
    let bar = progress("scenes", args.seeds.last - args.seeds.first + 1);
    let mut seeds = args.seeds.first..=args.seeds.last;
    let mut ended = None;
    while let Some(seed) = seeds.next().filter(|_| ended.is_none()) {
        for labelled in studio.scene(seed, Views::Judged)? {
            if let Some(template) = studio.library().get(&labelled.template) {
                add(&estimator, &labelled, template, &mut table)?;
            }
        }
        bar.inc(1);
        ended = interrupt.is_pressed().then_some(seed);
    }
    bar.finish_and_clear();
    let seeds = [args.seeds.first, ended.unwrap_or(args.seeds.last)];
    table.print(seeds, estimator.description(), &mut io::stdout().lock())?;
    if let Some(path) = &args.json {
        write_json(path, &result(&table, seeds))?;
    }
    Ok(if ended.is_some() { Exit::Interrupted } else { Exit::Success })
}

fn result(table: &Table, seeds: [u64; 2]) -> BenchResult {
    let mut result = BenchResult::new("learned", "d435");
    result.seeds = seeds.to_vec();
    let row = |(name, values): (String, Vec<(&'static str, f64)>)| Row::new(name, values);
    result.rows = table.rows().map(row).collect();
    result.notes = table.verdicts();
    result
}

/// Adds the errors of one thing.
fn add(estimator: &Estimator, labelled: &Labelled, template: &Template, table: &mut Table) -> anyhow::Result<()> {
    let Labelled { given, truth, .. } = labelled;
    let base_m = truth.pose.translation.z;
    let learned = estimator.estimate(&cloud(given, base_m), template)?;
    let start = estimate(&learned.state, base_m);
    let learned_fit = given.fit_from(template, &start);
    let geometric_fit = given.fit(template);
    // What a user of both would keep: it needs no truth.
    let cost = |fit: &&Estimate| given.cost(template, fit).unwrap_or(f64::INFINITY);
    let both = [&learned_fit, &geometric_fit].into_iter().flatten();
    let better = both.min_by(|a, b| cost(a).total_cmp(&cost(b))).cloned();
    let estimates = BTreeMap::from([
        (Way::Learned, Some(start)),
        (Way::Geometric, given.guess(template)),
        (Way::LearnedFit, learned_fit),
        (Way::GeometricFit, geometric_fit),
        (Way::BetterFit, better),
    ]);
    for quantity in quantities(template, truth, &learned) {
        let error = |estimate: &Option<Estimate>| estimate.as_ref().map_or(f64::INFINITY, &quantity.error);
        let errors = estimates.iter().map(|(way, estimate)| (*way, error(estimate))).collect();
        table.add(&template.name, quantity.name, quantity.unit, errors, quantity.half_interval);
    }
    Ok(())
}

/// What is compared of a template's estimates: its fitted parameters, the place of its base and its heading.
fn quantities<'a>(template: &'a Template, truth: &'a Estimate, learned: &Estimated) -> Vec<Quantity<'a>> {
    let values = truth.values.iter().zip(&learned.deviations.values);
    let fitted = template.parameters.iter().zip(values).enumerate().filter(|(_, (spec, _))| !spec.fixed);
    let mut quantities: Vec<Quantity> = fitted
        .map(|(at, (spec, (value, deviation)))| {
            let (unit, scale) = match spec.unit {
                Unit::M => ("mm", 1e3),
                Unit::Rad => ("deg", 1f64.to_degrees()),
                Unit::One => ("", 1.0),
            };
            let error = move |found: &Estimate| {
                found.values.get(at).map_or(f64::INFINITY, |found| scale * (found - value).abs())
            };
            let half_interval = Some(SIGMAS_90 * scale * deviation);
            Quantity { name: &spec.name, unit, error: Box::new(error), half_interval }
        })
        .collect();
    let place = |found: &Estimate| 1e3 * (found.pose.translation - truth.pose.translation).truncate().length();
    quantities.push(Quantity { name: "place", unit: "mm", error: Box::new(place), half_interval: None });
    let symmetry = template.yaw_symmetry(&template.named(&truth.values)).unwrap_or(YawSymmetry::Fold(1));
    if symmetry != YawSymmetry::Continuous {
        let heading = move |found: &Estimate| symmetry.difference(found.pose.yaw(), truth.pose.yaw()).to_degrees();
        quantities.push(Quantity { name: "heading", unit: "deg", error: Box::new(heading), half_interval: None });
    }
    quantities
}
