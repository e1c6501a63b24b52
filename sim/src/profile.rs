//! The engine settings under which grasps hold and towers stand.

use rapier3d::prelude::{FrictionModel, IntegrationParameters, SpringCoefficients};

/// Settings of the physics engine that were measured to hold what the hand grips.
///
/// The engine's own defaults recycle contacts within 5 cm of relative drift and solve friction in one pass only;
/// with a hand of limited force both drop what is held. `acm bench world` measures what these ones hold, and what they
/// cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PhysicsProfile {
    /// Physics steps in one second.
    pub steps_per_second: u32,
}

impl PhysicsProfile {
    /// 250 steps a second, as in RMBench.
    pub const DEFAULT: PhysicsProfile = PhysicsProfile { steps_per_second: 250 };

    /// Length of one physics step, seconds.
    pub fn step_s(&self) -> f64 {
        1.0 / f64::from(self.steps_per_second)
    }

    pub(crate) fn parameters(&self) -> IntegrationParameters {
        // Softer contacts let 20 N of grip sink millimetres into a light object, stiffer ones rattle.
        let stiff = SpringCoefficients::new(180.0, 5.0);
        IntegrationParameters {
            dt: self.step_s() as f32,
            // An odd number of substeps: with an even one and light fingers a grip now and then rocks from step to
            // step, and what is set down is thrown off by millimetres. One inner iteration lets the grip creep, a
            // third one costs a sixth more and gains nothing.
            num_solver_iterations: SUBSTEPS,
            num_internal_pgs_iterations: 2,
            friction_in_bias_pass: true,
            friction_model: FrictionModel::Coulomb,
            contact_recycling: false,
            contact_softness: stiff,
            static_contact_softness: stiff,
            length_unit: 0.1,
            ..IntegrationParameters::default()
        }
    }
}

/// Solver substeps of one physics step: tangential contact impulses are reported for one of them.
pub(crate) const SUBSTEPS: usize = 5;
