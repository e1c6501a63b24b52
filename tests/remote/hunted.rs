//! A host within the test that kills its agent at one of the agent's questions.

use crate::host::{now, runner, signal};
use acm::serve;
use acm_actors::remote::{Address, FrameMode, Host, HostEvent, RobotServer, Stopper};
use acm_concept::{
    camera::{CameraError, CameraModel, CameraSource, RgbdFrame},
    embodiment::{Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
};
use acm_sim::{Scenario, SimOptions, Simulation};
use std::{
    path::{Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
    thread::JoinHandle,
    time::{Duration, Instant},
};

/// A served simulation whose robot and camera count questions, and kill the agent at one of them.
pub struct Hunted {
    pub address: Address,
    pub hunter: Hunter,
    log: Arc<Mutex<Vec<(HostEvent, Instant)>>>,
    stopper: Stopper,
    thread: Option<JoinHandle<()>>,
}

/// Shared by all handles of one host.
#[derive(Clone, Default)]
pub struct Hunter(pub Arc<Mutex<Hunt>>);

/// What is hunted, and what came of it.
#[derive(Default)]
pub struct Hunt {
    /// Questions until the kill.
    pub left: u64,
    /// How long the agent may still go on after the question.
    pub grace: Duration,
    pub victim: u32,
    pub memory: PathBuf,
    /// The log as it was at the question, when nothing was being written.
    pub acknowledged: Option<Vec<u8>>,
    pub killed: Option<Instant>,
}

impl Hunter {
    #[allow(clippy::disallowed_methods)] // the kill comes from outside, while the agent goes on
    fn question(&self) {
        let mut hunt = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        hunt.left = hunt.left.wrapping_sub(1);
        if hunt.left != 0 || hunt.victim == 0 {
            return;
        }
        hunt.acknowledged = Some(std::fs::read(hunt.memory.join("log-00000000")).unwrap_or_default());
        if hunt.grace.is_zero() {
            signal(hunt.victim, "KILL");
            hunt.killed = Some(now());
            return;
        }
        let (own, victim, grace) = (self.clone(), hunt.victim, hunt.grace);
        std::thread::spawn(move || {
            std::thread::sleep(grace);
            signal(victim, "KILL");
            own.0.lock().unwrap_or_else(PoisonError::into_inner).killed = Some(now());
        });
    }
}

struct HuntedRobot(Box<dyn Embodiment>, Hunter);

impl Embodiment for HuntedRobot {
    fn description(&self) -> &RobotDescription {
        self.0.description()
    }
    fn feedback(&self) -> Feedback {
        self.0.feedback()
    }
    fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError> {
        self.1.question();
        self.0.command(command)
    }
    fn stop(&mut self) {
        self.0.stop();
    }
}

struct HuntedCameras(Box<dyn CameraSource>, Hunter);

impl CameraSource for HuntedCameras {
    fn cameras(&self) -> &[CameraModel] {
        self.0.cameras()
    }
    fn capture(&mut self, camera: &str) -> Result<RgbdFrame, CameraError> {
        self.1.question();
        self.0.capture(camera)
    }
}

impl Hunted {
    #[allow(clippy::disallowed_methods)] // the host's own process, were this not a test
    pub fn serve(scenario: &str, seed: u64, socket: &Path) -> Hunted {
        let options = SimOptions { seed, motion: true, ..SimOptions::default() };
        let simulation =
            Simulation::new(&Scenario::open(scenario).unwrap(), &options, runner().renderer().unwrap()).unwrap();
        let (hunter, host) = (Hunter::default(), serve::host(&Arc::new(simulation)));
        let host = Host {
            embodiment: Box::new(HuntedRobot(host.embodiment, hunter.clone())),
            cameras: Box::new(HuntedCameras(host.cameras, hunter.clone())),
            ..host
        };
        let server = RobotServer::bind(&Address::Unix(socket.into()), FrameMode::Auto).unwrap();
        let log: Arc<Mutex<Vec<(HostEvent, Instant)>>> = Arc::default();
        let (address, stopper, told) = (server.address().clone(), server.stopper(), Arc::clone(&log));
        let thread = std::thread::spawn(move || {
            server.serve(host, |event| told.lock().unwrap().push((event, now())));
        });
        Hunted { address, hunter, log, stopper, thread: Some(thread) }
    }

    /// When the last agent was found to be gone.
    pub fn left(&self) -> Option<Instant> {
        let log = self.log.lock().unwrap();
        log.iter().rev().find(|(event, _)| matches!(event, HostEvent::Left { .. })).map(|(_, at)| *at)
    }
}

impl Drop for Hunted {
    fn drop(&mut self) {
        self.stopper.stop();
        self.thread.take().unwrap().join().unwrap();
    }
}
