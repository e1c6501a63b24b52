//! `acm learn`: labelled clouds, training of the learned estimator, and its comparison with the geometric one.
//!
//! | module | holds |
//! |---|---|
//! | [`data`] | labelled clouds of the suite's things |
//! | [`train`] | training, with checkpoints |
//! | [`compare`] | the learned and the geometric estimate of the same clouds |

pub mod compare;
pub mod data;
pub mod train;

use crate::cli::{Exit, learn::LearnCommand};
use acm_concept::{pose::Pose, template::Template};
use acm_learned::{
    cloud::Cloud,
    estimator::Estimator,
    targets::{self, PartState},
};
use acm_perception::given::{Estimate, GivenThing};
use glam::DVec3;
use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};
use tokio::runtime::Runtime;

/// Runs `acm learn`.
///
/// # Errors
/// Unusable input, or a file that cannot be written.
pub fn run(command: &LearnCommand) -> anyhow::Result<Exit> {
    match command {
        LearnCommand::Data(args) => data::run(args),
        LearnCommand::Train(args) => train::run(args),
        LearnCommand::Compare(args) => compare::run(args),
        LearnCommand::Export(args) => {
            acm_learned::onnx::write(&Estimator::read(&args.weights)?, &args.out)?;
            Ok(Exit::Success)
        }
    }
}

/// Says whether the process was interrupted from the keyboard.
struct Interrupt {
    pressed: Arc<AtomicBool>,
    /// Waits for the signal as long as it lives.
    _runtime: Runtime,
}

impl Interrupt {
    fn new() -> anyhow::Result<Interrupt> {
        let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        let pressed = Arc::new(AtomicBool::new(false));
        let flag = pressed.clone();
        // It only waits for the signal.
        runtime.spawn(async move {
            if tokio::signal::ctrl_c().await.is_ok() {
                flag.store(true, Ordering::Relaxed);
            }
        });
        Ok(Interrupt { pressed, _runtime: runtime })
    }
    fn is_pressed(&self) -> bool {
        self.pressed.load(Ordering::Relaxed)
    }
}

/// What is seen of a thing as the learned estimator takes it: over the height `base_m` on which it stands.
fn cloud(given: &GivenThing, base_m: f64) -> Cloud {
    let down = DVec3::Z * base_m;
    Cloud { points: given.points.iter().map(|point| *point - down).collect(), camera: given.camera.translation - down }
}

fn state(estimate: &Estimate, template: &Template) -> PartState {
    let turns = acm_learned::config::HeadSpec::of(template).fold > 0;
    let Pose { translation, .. } = estimate.pose;
    let yaw = if turns { estimate.pose.yaw() } else { 0.0 };
    PartState { values: estimate.values.clone(), place: translation.truncate(), yaw }
}

fn estimate(state: &PartState, base_m: f64) -> Estimate {
    Estimate { pose: targets::pose(state, base_m), values: state.values.clone() }
}
