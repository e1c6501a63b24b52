//! The network learns, keeps what it learned, and says so when it cannot.
#![allow(clippy::unwrap_used)] // a failed step is a failed test

use crate::{
    cloud::{Cloud, group},
    config::{DESCRIPTION_FILE, Description, HeadSpec, Origin, SCHEMA, Shape, WEIGHTS_FILE},
    estimator::{EstimateError, Estimator},
    net::{Batch, Net},
    samples::{Sample, Samples},
    targets::{PartState, encode},
    train::{Plan, begin, loss, train},
};
use acm_concept::template::{Template, TemplateLibrary};
use glam::{DVec2, DVec3};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::ops::ControlFlow;

/// Two templates that share the encoder: one with a heading, one without.
fn library() -> TemplateLibrary {
    let template = |name: &str, lengths: &[&str], solid: &str, fold: u32| {
        let parameter = |name: &&str| {
            format!("[[parameter]]\nname = \"{name}\"\nunit = \"m\"\nmin = 0.005\nmax = 0.6\ninitial = \"extent_x\"\n")
        };
        let parameters: String = lengths.iter().map(parameter).collect();
        format!(
            "template = \"{name}\"\nseen_by = \"depth\"\naffordances = []\n[synopsis]\ndescription = \"d\"\naffordance = \"a\"\n\
             intended_use = \"u\"\nnouns = [{{ noun = \"{name}\" }}]\n{parameters}[[solid]]\n{solid}\n[[symmetry]]\nfold = {fold}\n"
        )
    };
    let brick =
        "shape = \"box\"\nsize = [\"length\", \"width\", \"height\"]\nposition = [\"0\", \"0\", \"height / 2\"]";
    let tube =
        "shape = \"cylinder\"\nradius = \"radius\"\nheight = \"height\"\nposition = [\"0\", \"0\", \"height / 2\"]";
    let files = [
        ("brick.toml", template("brick", &["length", "width", "height"], brick, 2)),
        ("tube.toml", template("tube", &["radius", "height"], tube, 0)),
    ];
    TemplateLibrary::parse(files.iter().map(|(name, text)| (*name, text.as_str()))).unwrap()
}

/// Points of the sides that a camera sees of a brick or a tube, with a little noise; and what is true of it.
fn seen(template: &Template, rng: &mut ChaCha8Rng) -> (Cloud, PartState) {
    let mut length = |least: f64, most: f64| rng.random_range(least..most);
    let (a, b, height) = (length(0.06, 0.2), length(0.03, 0.06), length(0.03, 0.15));
    let (yaw, place) = (length(-0.7, 0.7), DVec2::new(length(-0.2, 0.2), length(-0.2, 0.2)));
    let round = template.name == "tube";
    let values = if round { vec![b, height] } else { vec![a, b, height] };
    let point = |rng: &mut ChaCha8Rng| {
        let (u, v) = (rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5));
        let own = match (round, rng.random_range(0..3)) {
            (true, 0) => (DVec2::from_angle(6.2 * u) * b * (v + 0.5f64).sqrt()).extend(height),
            (true, _) => (DVec2::from_angle(std::f64::consts::PI * (1.0 + u)) * b).extend(height * (v + 0.5)),
            (false, 0) => DVec3::new(a * u, b * v, height),
            (false, 1) => DVec3::new(-0.5 * a, b * u, height * (v + 0.5)),
            (false, _) => DVec3::new(a * u, -0.5 * b, height * (v + 0.5)),
        };
        let turned = if round { own } else { DVec2::from_angle(yaw).rotate(own.truncate()).extend(own.z) };
        turned + place.extend(0.0) + DVec3::new(1.0, 1.0, 1.0) * rng.random_range(-0.0005..0.0005)
    };
    let points = (0..600).map(|_| point(rng)).collect();
    let camera = DVec3::new(-0.7, -0.2, 0.5);
    (Cloud { points, camera }, PartState { values, place, yaw: if round { 0.0 } else { yaw } })
}

fn samples(count: usize) -> Samples {
    let library = library();
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let templates: Vec<&Template> = library.iter().collect();
    let one = |at: usize| {
        let head = at % templates.len();
        let (cloud, truth) = seen(templates[head], &mut rng);
        let normal = cloud.normal().unwrap();
        Sample::new(&cloud, &normal, head, encode(templates[head], &normal, &truth))
    };
    let samples = (0..count).map(one).collect();
    Samples { heads: templates.iter().map(|t| HeadSpec::of(t)).collect(), scenes: [0, 0], samples }
}

fn estimator(net: Net, heads: Vec<HeadSpec>) -> Estimator {
    let description = Description { schema: SCHEMA.into(), shape: *net.shape(), origin: Origin::default(), heads };
    Estimator::new(description, net)
}

#[test]
fn every_weight_gets_a_gradient() {
    let samples = samples(8);
    for shape in [Shape::TINY, Shape { layers: 2, ..Shape::PAPER }] {
        let net = Net::drawn(shape, &samples.heads, 1).unwrap();
        let chosen: Vec<&Sample> = samples.samples.iter().collect();
        let loss = loss(&net, &chosen, &mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let gradients = loss.descended.backward().unwrap();
        let without: Vec<&str> = net
            .weights()
            .all()
            .filter(|(_, var)| {
                let length = |g: &candle_core::Tensor| g.sqr().unwrap().sum_all().unwrap().to_scalar::<f32>().unwrap();
                !gradients.get(var).is_some_and(|gradient| length(gradient) > 0.0)
            })
            .map(|(name, _)| name)
            .collect();
        assert_eq!(net.weights().all().count(), 28 + 15 * shape.layers);
        assert_eq!(without, Vec::<&str>::new());
    }
}

#[test]
fn sixteen_samples_are_learned_by_heart() {
    let samples = samples(16);
    let shape = Shape { points: 256, groups: 16, group_size: 16, token_width: 32, layers: 2, heads: 4, width: 64 };
    let net = Net::drawn(shape, &samples.heads, 1).unwrap();
    begin(&net, &samples).unwrap();
    let off = |net: &Net| {
        let mut worst = 0.0f32;
        for sample in &samples.samples {
            let groups = group(&sample.points, net.shape(), &mut ChaCha8Rng::seed_from_u64(9)).unwrap();
            let features = net.features(&Batch::new(&[(groups, sample.context)], net.shape()).unwrap()).unwrap();
            let mean = net.answer(sample.head, &features).unwrap().mean.flatten_all().unwrap();
            for (mean, target) in mean.to_vec1::<f32>().unwrap().iter().zip(&sample.targets) {
                worst = worst.max((mean - target).abs());
            }
        }
        worst
    };
    let before = off(&net);
    let plan = Plan { steps: 300, batch: 16, learning_rate: 2e-3, seed: 4 };
    let mut losses = Vec::new();
    train(&net, &samples, &plan, |progress| {
        losses.push(progress.nats);
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(losses.len(), plan.steps);
    assert!(losses.last() < losses.first());
    let after = off(&net);
    assert!(before > 0.5 && after < 0.12, "the worst of all outputs was off by {before}, and is by {after}");
}

#[test]
fn equal_seeds_give_equal_weights() {
    let samples = samples(6);
    let trained = || {
        let net = Net::drawn(Shape { layers: 1, ..Shape::TINY }, &samples.heads, 5).unwrap();
        let plan = Plan { steps: 3, batch: 4, learning_rate: 1e-3, seed: 6 };
        train(&net, &samples, &plan, |_| ControlFlow::Continue(())).unwrap();
        let numbers = |var: &candle_core::Var| var.flatten_all().unwrap().to_vec1::<f32>().unwrap();
        net.weights().all().flat_map(|(_, var)| numbers(var)).collect::<Vec<f32>>()
    };
    assert_eq!(trained(), trained());
}

#[test]
fn a_training_that_is_ended_leaves_a_network_that_can_be_used() {
    let samples = samples(4);
    let net = Net::drawn(Shape::TINY, &samples.heads, 5).unwrap();
    let plan = Plan { steps: 1000, batch: 2, learning_rate: 1e-3, seed: 6 };
    let mut steps = 0;
    train(&net, &samples, &plan, |progress| {
        steps = progress.step;
        if progress.step == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert_eq!(steps, 2);
    let library = library();
    let template = library.get("brick").unwrap();
    let (cloud, _) = seen(template, &mut ChaCha8Rng::seed_from_u64(8));
    assert!(estimator(net, samples.heads).estimate(&cloud, template).is_ok());
}

#[test]
fn the_papers_size_has_its_shapes() {
    let samples = samples(2);
    let net = Net::drawn(Shape::PAPER, &samples.heads, 1).unwrap();
    // Point-BERT's encoder of this size has 22 million weights with its own head.
    let millions = net.weights().count() as f64 / 1e6;
    assert!((21.0..24.0).contains(&millions), "{millions}");
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let clouds: Vec<_> =
        samples.samples.iter().map(|s| (group(&s.points, net.shape(), &mut rng).unwrap(), s.context)).collect();
    let batch = Batch::new(&clouds, net.shape()).unwrap();
    assert_eq!(batch.points.dims(), [2, 128, 32, 3]);
    let features = net.features(&batch).unwrap();
    assert_eq!(features.dims(), [2, 387]);
    let answer = net.answer(0, &features).unwrap();
    // Three lengths, two of the place, two of the heading.
    assert_eq!((answer.mean.dims(), answer.log_deviation.dims()), (&[2, 7][..], &[2, 7][..]));
    assert_eq!(net.answer(1, &features).unwrap().mean.dims(), [2, 4]);
    assert!(net.answer(2, &features).is_err());
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let samples = samples(5);
    samples.write(folder.path()).unwrap();
    assert_eq!(Samples::read(folder.path()).unwrap(), samples);
    let written = estimator(Net::drawn(Shape::TINY, &samples.heads, 5).unwrap(), samples.heads);
    written.write(folder.path()).unwrap();
    let read = Estimator::read(folder.path()).unwrap();
    assert_eq!(read.description(), written.description());
    let library = library();
    for template in library.iter() {
        let (cloud, _) = seen(template, &mut ChaCha8Rng::seed_from_u64(8));
        assert_eq!(read.estimate(&cloud, template).unwrap(), written.estimate(&cloud, template).unwrap());
    }
}

#[test]
fn a_bad_folder_is_told_in_a_line_that_names_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let error = || {
        let text = Estimator::read(path).unwrap_err().to_string();
        assert_eq!(text.lines().count(), 1, "{text}");
        text
    };
    assert!(error().contains(DESCRIPTION_FILE));
    let heads = samples(1).heads;
    let whole = estimator(Net::drawn(Shape::TINY, &heads, 5).unwrap(), heads.clone());
    whole.write(path).unwrap();
    std::fs::remove_file(path.join(WEIGHTS_FILE)).unwrap();
    assert!(error().contains(WEIGHTS_FILE));
    std::fs::write(path.join(WEIGHTS_FILE), "these are no weights").unwrap();
    assert!(error().contains(WEIGHTS_FILE));
    // Weights of another shape, with fewer layers and with more.
    let of_layers = |layers: usize| Net::drawn(Shape { layers, ..Shape::TINY }, &heads, 5).unwrap();
    of_layers(2).weights().write(&path.join(WEIGHTS_FILE)).unwrap();
    assert!(error().contains("there is no tensor `encoder.layer.2"));
    of_layers(4).weights().write(&path.join(WEIGHTS_FILE)).unwrap();
    assert!(error().contains("belongs to no layer"));
    let wide = Net::drawn(Shape { width: 48, ..Shape::TINY }, &heads, 5).unwrap();
    wide.weights().write(&path.join(WEIGHTS_FILE)).unwrap();
    assert!(error().contains("but must be"));
    let text = std::fs::read_to_string(path.join(DESCRIPTION_FILE)).unwrap();
    std::fs::write(path.join(DESCRIPTION_FILE), text.replace("heads = 4", "heads = 5")).unwrap();
    assert!(error().contains("shape.heads"));
    std::fs::write(path.join(DESCRIPTION_FILE), text.replace("groups", "grups")).unwrap();
    assert!(error().contains("grups"));
}

#[test]
fn what_was_not_learned_is_not_estimated() {
    let library = library();
    let (brick, tube) = (library.get("brick").unwrap(), library.get("tube").unwrap());
    let heads = vec![HeadSpec::of(brick)];
    let estimator = estimator(Net::drawn(Shape::TINY, &heads, 5).unwrap(), heads);
    let (cloud, _) = seen(tube, &mut ChaCha8Rng::seed_from_u64(8));
    assert!(matches!(estimator.estimate(&cloud, tube), Err(EstimateError::UnknownTemplate(name)) if name == "tube"));
    let few = Cloud { points: cloud.points[..10].to_vec(), ..cloud };
    assert!(matches!(estimator.estimate(&few, brick), Err(EstimateError::NoCloud { points: 10 })));
}
