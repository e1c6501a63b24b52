//! `acm learn data`: labelled clouds of the suite's things.

use super::{Interrupt, cloud, state};
use crate::{
    bench::perception::suite::labelled::{Labelled, Studio, Views},
    bench::progress,
    cli::{Exit, learn::LearnDataArgs},
};
use acm_learned::{
    config::HeadSpec,
    samples::{Sample, Samples},
    targets::encode,
};

/// Draws samples and writes them. An interrupt keeps those that there are.
///
/// # Errors
/// There is no renderer, or the folder cannot be written.
pub fn run(args: &LearnDataArgs) -> anyhow::Result<Exit> {
    let interrupt = Interrupt::new()?;
    let mut studio = Studio::new()?;
    let heads: Vec<HeadSpec> = studio.templates().into_iter().map(HeadSpec::of).collect();
    let mut samples = Samples { heads, scenes: [args.seeds.first, args.seeds.last], samples: Vec::new() };
    let bar = progress("scenes", args.seeds.last - args.seeds.first + 1);
    for seed in args.seeds.first..=args.seeds.last {
        for labelled in studio.scene(seed, Views::Any)? {
            samples.samples.extend(sample(&labelled, &studio, &samples.heads));
        }
        bar.inc(1);
        if interrupt.is_pressed() {
            samples.scenes = [args.seeds.first, seed];
            break;
        }
    }
    bar.finish_and_clear();
    samples.write(&args.out)?;
    println!(
        "{} samples of the scenes {} to {} in {}",
        samples.samples.len(),
        samples.scenes[0],
        samples.scenes[1],
        args.out.display()
    );
    for (at, head) in samples.heads.iter().enumerate() {
        let count = samples.samples.iter().filter(|sample| sample.head == at).count();
        println!("  {:<16} {count}", head.template);
    }
    Ok(if interrupt.is_pressed() { Exit::Interrupted } else { Exit::Success })
}

/// A thing as a sample; `None` where too little is seen of it.
fn sample(labelled: &Labelled, studio: &Studio, heads: &[HeadSpec]) -> Option<Sample> {
    let template = studio.library().get(&labelled.template)?;
    let head = heads.iter().position(|head| head.template == labelled.template)?;
    let base_m = labelled.truth.pose.translation.z;
    let cloud = cloud(&labelled.given, base_m);
    let normal = cloud.normal()?;
    let targets = encode(template, &normal, &state(&labelled.truth, template));
    Some(Sample::new(&cloud, &normal, head, targets))
}
