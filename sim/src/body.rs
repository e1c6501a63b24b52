//! Objects as bodies of the engine, and the one mechanism there is so far: a cap on a spring.

use crate::{
    convert::{from_engine, to_engine, vector},
    layout::{BuiltSolid, Placed, shape},
    model::ButtonModel,
    report::TrueObject,
    world::World,
};
use acm_concept::pose::Pose;
use glam::DVec3;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

/// An object in the engine. The body's frame is the object's base frame.
#[derive(Debug, Clone)]
pub(crate) struct Body {
    pub(crate) placed: Placed,
    pub(crate) handle: RigidBodyHandle,
    pub(crate) colliders: Vec<ColliderHandle>,
    pub(crate) button: Option<Button>,
    /// Whether it is one of several copies, which the judge cannot name.
    pub(crate) is_copy: bool,
    /// Where it stood when the episode began.
    pub(crate) start: Pose,
}

/// A cap that goes down against a spring and is counted as pressed once per stroke.
#[derive(Debug, Clone)]
pub(crate) struct Button {
    model: ButtonModel,
    pub(crate) cap: RigidBodyHandle,
    pub(crate) pressed: bool,
    pub(crate) presses: u32,
    armed: bool,
}

impl Body {
    pub(crate) fn insert(world: &mut PhysicsWorld, placed: Placed, is_copy: bool) -> Body {
        let pose = to_engine(&placed.pose);
        let builder = if placed.fixed { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
        let handle = world.insert_body(builder.pose(pose));
        let mut colliders = insert_solids(world, &placed.solids, handle, &placed, Weight::Density(placed.density));
        let button = placed.button.clone().map(|model| {
            let (button, caps) = Button::insert(world, &placed, handle, model);
            colliders.extend(caps);
            button
        });
        let start = placed.pose;
        Body { placed, handle, colliders, button, is_copy, start }
    }

    /// Pose of its base frame.
    pub(crate) fn pose(&self, world: &PhysicsWorld) -> Pose {
        world.bodies.get(self.handle).map_or(self.placed.pose, |body| from_engine(body.position()))
    }
    /// Pose in which its cap's solids are.
    pub(crate) fn cap_pose(&self, world: &PhysicsWorld) -> Option<Pose> {
        let button = self.button.as_ref()?;
        world.bodies.get(button.cap).map(|body| from_engine(body.position()))
    }
    /// Speed in metres per second and spin in radians per second.
    pub(crate) fn speed(&self, world: &PhysicsWorld) -> (f64, f64) {
        let Some(body) = world.bodies.get(self.handle) else { return (0.0, 0.0) };
        (f64::from(body.linvel().length()), f64::from(body.angvel().length()))
    }
    /// How deep its cap is, metres; 0 without one.
    pub(crate) fn depth(&self, world: &PhysicsWorld) -> f64 {
        let Some(cap) = self.cap_pose(world) else { return 0.0 };
        -(self.pose(world).inverse() * cap).translation.z
    }

    /// Counts a press when the cap has gone down far enough since it was last up.
    pub(crate) fn count_presses(&mut self, world: &PhysicsWorld) {
        let depth = self.depth(world);
        let Some(button) = &mut self.button else { return };
        if button.armed && depth > button.model.pressed_m {
            button.armed = false;
            button.pressed = true;
            button.presses += 1;
        } else if depth < button.model.rearmed_m {
            button.armed = true;
            button.pressed = false;
        }
    }
}

/// What an object changes while the world runs, apart from its body.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct BodyState {
    start: Pose,
    /// Pressed, presses, armed.
    button: Option<(bool, u32, bool)>,
}

impl Body {
    pub(crate) fn state(&self) -> BodyState {
        let button = self.button.as_ref().map(|button| (button.pressed, button.presses, button.armed));
        BodyState { start: self.start, button }
    }
    pub(crate) fn set_state(&mut self, state: BodyState) {
        self.start = state.start;
        if let (Some(button), Some(saved)) = (&mut self.button, state.button) {
            (button.pressed, button.presses, button.armed) = saved;
        }
    }
}

impl Button {
    fn insert(
        world: &mut PhysicsWorld,
        placed: &Placed,
        base: RigidBodyHandle,
        model: ButtonModel,
    ) -> (Button, Vec<ColliderHandle>) {
        let builder = RigidBodyBuilder::dynamic().pose(to_engine(&placed.pose)).can_sleep(false);
        let cap = world.insert_body(builder);
        let weight = Weight::Mass(model.mass_kg / placed.cap.len().max(1) as f64);
        let colliders = insert_solids(world, &placed.cap, cap, placed, weight);
        // The spring's rest position lies above the stop: that is its preload. Its damping lets a free cap come
        // back at the given speed.
        let rest = model.preload_n / model.stiffness_n_m;
        let mid_force = model.preload_n + 0.5 * model.stiffness_n_m * model.travel_m;
        let joint = PrismaticJointBuilder::new(vector(DVec3::Z))
            .limits([-model.travel_m as f32, 0.0])
            .contacts_enabled(false)
            .motor_model(MotorModel::ForceBased)
            .motor_position(rest as f32, model.stiffness_n_m as f32, (mid_force / model.return_speed_m_s) as f32);
        world.insert_impulse_joint(base, cap, joint);
        (Button { model, cap, pressed: false, presses: 0, armed: true }, colliders)
    }
}

#[derive(Clone, Copy)]
enum Weight {
    Density(f64),
    Mass(f64),
}

fn insert_solids(
    world: &mut PhysicsWorld,
    solids: &[BuiltSolid],
    body: RigidBodyHandle,
    placed: &Placed,
    weight: Weight,
) -> Vec<ColliderHandle> {
    let insert = |built: &BuiltSolid| {
        let (turn, shape) = shape(&built.placed.solid, built.bevel_m);
        let collider = ColliderBuilder::new(shape)
            .position(to_engine(&(built.placed.pose * turn)))
            .friction(placed.friction as f32);
        let collider = match weight {
            Weight::Density(density) => collider.density(density as f32),
            Weight::Mass(mass) => collider.mass(mass as f32),
        };
        world.insert_collider(collider, Some(body))
    };
    solids.iter().map(insert).collect()
}

/// The true state of all objects.
pub(crate) fn true_objects(world: &World) -> Vec<TrueObject> {
    let object = |body: &Body| TrueObject {
        name: body.placed.name.clone(),
        model: body.placed.model.clone(),
        pose: body.pose(&world.physics),
        size_m: body.placed.size(),
        color: body.placed.solids.first().map_or([0; 3], |solid| solid.color),
        held: world.contacts.pads_touching(&body.colliders) == 2,
    };
    world.bodies.iter().map(object).collect()
}
