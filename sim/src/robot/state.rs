//! What a robot changes while the world runs, apart from its bodies.

use super::{Aim, Grip, Hand, Limb, Robot, cup::Seal, links::Press};
use crate::contact::TickForces;
use serde::{Deserialize, Serialize};

/// All of a robot that a snapshot holds.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct RobotState {
    limbs: Vec<LimbState>,
    active: usize,
    stopped: Option<String>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct LimbState {
    from: Aim,
    to: Aim,
    at: Aim,
    before: Aim,
    grip: Grip,
    forces: TickForces,
    hand: HandState,
    links: Option<Vec<Press>>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
enum HandState {
    Fingers { setpoint: f64 },
    Cup { vacuum: f64, seal: Option<Seal> },
}

impl Robot {
    pub(crate) fn state(&self) -> RobotState {
        let limbs = self.limbs.iter().map(Limb::state).collect();
        RobotState { limbs, active: self.active, stopped: self.stopped.clone() }
    }
    pub(crate) fn set_state(&mut self, state: RobotState) {
        (self.active, self.stopped) = (state.active, state.stopped);
        for (limb, saved) in self.limbs.iter_mut().zip(state.limbs) {
            limb.set_state(saved);
        }
    }
}

impl RobotState {
    /// Whether it can be the state of this robot.
    pub(crate) fn fits(&self, robot: &Robot) -> bool {
        self.limbs.len() == robot.limbs.len() && self.active < self.limbs.len().max(1)
    }
}

impl Limb {
    fn state(&self) -> LimbState {
        let hand = match &self.hand {
            Hand::Fingers(fingers) => HandState::Fingers { setpoint: fingers.setpoint },
            Hand::Cup(cup) => HandState::Cup { vacuum: cup.vacuum, seal: cup.seal.clone() },
        };
        let Limb { from, to, at, before, grip, .. } = *self;
        let links = self.links.as_ref().map(|links| links.state());
        LimbState { from, to, at, before, grip, forces: self.forces.clone(), hand, links }
    }

    fn set_state(&mut self, state: LimbState) {
        (self.from, self.to, self.at, self.before) = (state.from, state.to, state.at, state.before);
        (self.grip, self.forces) = (state.grip, state.forces);
        match (&mut self.hand, state.hand) {
            (Hand::Fingers(fingers), HandState::Fingers { setpoint }) => fingers.setpoint = setpoint,
            (Hand::Cup(cup), HandState::Cup { vacuum, seal }) => (cup.vacuum, cup.seal) = (vacuum, seal),
            // Another kind of hand is another world.
            _ => {}
        }
        if let (Some(links), Some(saved)) = (&mut self.links, state.links) {
            links.set_state(saved);
        }
    }
}
