//! A scripted expert: it reads the truth and acts only through the robot's commands.

use acm_concept::{
    embodiment::{Command, Embodiment, EmbodimentError, Feedback},
    pose::Pose,
};
use acm_sim::{Simulation, TrueObject};
use glam::{DQuat, DVec3};

/// Grip force of the expert, newtons.
pub const GRIP_N: f64 = 20.0;

/// The hand with a plan of its own. Every command is kept, so that another engine can be given the same ones.
pub struct Expert {
    robot: Box<dyn Embodiment>,
    tcp: Pose,
    opening_m: f64,
    /// Every command so far, one a control tick.
    pub commands: Vec<Command>,
}

/// The hand looks down and closes its fingers along the heading `yaw`, radians.
pub fn down(position: DVec3, yaw: f64) -> Pose {
    Pose::new(position, DQuat::from_rotation_z(yaw) * DQuat::from_rotation_x(std::f64::consts::PI))
}

impl Expert {
    /// The expert at its robot's home, fingers open.
    pub fn new(simulation: &Simulation) -> Expert {
        let robot = simulation.embodiment();
        let (tcp, opening_m) = (robot.description().home, robot.description().max_opening_m);
        Expert { robot, tcp, opening_m, commands: Vec::new() }
    }

    /// Pose of an object's base frame in the hand.
    pub fn in_hand(&self, object: &TrueObject) -> Pose {
        self.robot.feedback().tcp.inverse() * object.pose
    }

    /// One control tick towards a pose.
    fn tick(&mut self, tcp: Pose) -> Result<Feedback, EmbodimentError> {
        self.tcp = tcp;
        let command = Command::hand(tcp, self.opening_m, GRIP_N);
        self.commands.push(command);
        self.robot.command(&command)
    }

    /// Holds still for a while.
    pub fn wait(&mut self, seconds: f64) -> Result<(), EmbodimentError> {
        self.over(self.tcp, seconds)
    }

    /// Straight to a pose within `seconds`, slow at both ends.
    pub fn over(&mut self, to: Pose, seconds: f64) -> Result<(), EmbodimentError> {
        let from = self.tcp;
        let ticks = (seconds / self.robot.description().tick_s).round().max(1.0) as u32;
        for tick in 1..=ticks {
            let share = f64::from(tick) / f64::from(ticks);
            self.tick(from.interpolate(&to, share * share * (3.0 - 2.0 * share)))?;
        }
        Ok(())
    }

    /// Straight to a pose, its fastest moment at `speed` metres per second.
    pub fn go(&mut self, to: Pose, speed: f64) -> Result<(), EmbodimentError> {
        // Turning by a radian takes as long as moving 0.15 m.
        let way = self.tcp.translation.distance(to.translation).max(0.15 * self.tcp.angle_to(&to));
        self.over(to, 1.5 * way / speed)
    }

    /// Straight up or down to a height, then level to a point, with a heading.
    pub fn above(&mut self, at: DVec3, yaw: f64, speed: f64) -> Result<(), EmbodimentError> {
        self.go(Pose { translation: self.tcp.translation.with_z(at.z), ..self.tcp }, speed)?;
        self.go(down(at, yaw), speed)
    }

    /// Opens or closes the fingers and waits for them.
    pub fn fingers(&mut self, opening_m: f64) -> Result<(), EmbodimentError> {
        self.opening_m = opening_m;
        self.wait(0.5)
    }
}
