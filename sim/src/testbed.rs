//! A table with one thing on it, and a force along its joints: for tests of objects.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use crate::{Scenario, SimOptions, TrueJoint, TrueObject, convert::vector, world::World};
use acm_concept::time::Time;

/// A table with nothing on it but what is given.
pub(crate) fn world(objects: &str) -> World {
    world_with(objects, "time < 0")
}
pub(crate) fn world_with(objects: &str, when: &str) -> World {
    let scenario = Scenario::parse("joints.toml", &scenario(objects, when)).unwrap();
    World::new(&scenario, &SimOptions::default()).unwrap()
}
/// A scenario with these objects whose camera sees all of a thing as large as a wardrobe.
pub(crate) fn object_text(objects: &str) -> String {
    scenario(objects, "time < 0")
}
fn scenario(objects: &str, when: &str) -> String {
    format!(
        "scenario = 'joints'\nsummary = ''\n[task]\ninstruction = 'x'\n[task.budgets]\nseconds = 60.0\nskills = 1\n\
         frames = 1\n[[surface]]\nname = 'table'\nsize = [8, 8, 0.05]\nposition = [0, 0, 0.715]\ncolor = '#ffffff'\n\
         support = true\n[[camera]]\nname = 'head'\nposition = [2.6, -1.8, 2.6]\nforward = [-2.6, 1.8, -1.4]\n\
         left = [-1.8, -2.6, 0]\nfov_y_deg = 50\nwidth = 320\nheight = 240\n\
         [robot]\nhome = [-2.5, 0.3, 1.3]\nworkspace = [[-3, -1, 0], [1, 1, 2]]\n{objects}\n\
         [judge]\n[[judge.strict.stage]]\nname = 'never'\nwhen = '{when}'\n"
    )
}
pub(crate) fn object(model: &str) -> String {
    format!("[[object]]\nname = 'thing'\nmodel = '{model}'\nposition = [0, 0, 0.74]\n")
}
pub(crate) fn truth(world: &World) -> TrueObject {
    world.truth().into_iter().find(|object| object.name == "thing").unwrap()
}
pub(crate) fn joint(world: &World, name: &str) -> TrueJoint {
    truth(world).links.into_iter().find(|link| link.name == name).unwrap().joint.unwrap()
}
pub(crate) fn run(world: &mut World, seconds: f64) {
    let until = Time::from_seconds(world.seconds() + seconds);
    world.wait_until(until).unwrap();
}
/// Pushes a link for some time with a force or torque along its joint's axis.
pub(crate) fn push(world: &mut World, name: &str, force: f64, seconds: f64) {
    let body = world.bodies.iter().find(|body| body.placed.name == "thing").unwrap();
    let at = body.placed.links.iter().position(|link| link.name == name).unwrap();
    // What is pushed here is pushed against its parent, so that a free object stays where it is.
    let handles = [(body.carrier(at), 1.0), (body.carrier(body.placed.links[at].parent), -1.0)];
    let rest = |world: &mut World| {
        for (handle, _) in handles {
            let part = world.physics.bodies.get_mut(handle).unwrap();
            part.reset_forces(true);
            part.reset_torques(true);
        }
    };
    let ticks = (seconds / 0.02).round() as u32;
    for _ in 0..ticks {
        let joint = joint(world, name);
        rest(world);
        for (handle, sign) in handles {
            let along = vector(joint.axis * (sign * force));
            let part = world.physics.bodies.get_mut(handle).unwrap();
            if joint.is_hinge { part.add_torque(along, true) } else { part.add_force(along, true) }
        }
        run(world, 0.02);
    }
    rest(world);
}
