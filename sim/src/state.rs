//! The judge's variables and their values.

use crate::{
    fluent,
    layout::Layout,
    oracle,
    scenario::{Scenario, WorldSpec},
    world::World,
};
use acm_concept::pose::wrap_angle;
use glam::DVec3;

/// Names of all variables, in the order in which [`fill`] writes their values.
pub(crate) fn names(scenario: &Scenario) -> Vec<String> {
    let spec = &scenario.world;
    let objects = spec.objects.iter().map(|o| (o.count.is_none().then_some(o.name.as_str()), o.model.button.is_some()));
    let places = spec.places.iter().flat_map(|place| ["x", "y", "z"].map(|axis| format!("{}_{axis}", place.name)));
    let scalars = spec.draws.iter().filter(|draw| draw.count.is_none()).map(|draw| draw.name.clone());
    let mut names = oracle::names(objects, &places.chain(scalars).collect::<Vec<_>>());
    let single: Vec<&str> = spec.objects.iter().filter(|o| o.count.is_none()).map(|o| o.name.as_str()).collect();
    let regions = spec.regions.iter().map(|region| region.name.as_str());
    names.extend(fluent::names(regions, spec.fluents.iter().map(|fluent| fluent.name.as_str()), &single));
    names
}

/// Values of places and plain draws.
pub(crate) fn constants(spec: &WorldSpec, layout: &Layout) -> Vec<f64> {
    let places = layout.places.iter().flat_map(|(_, point)| point.to_array());
    let scalar = |name: &str| layout.draws.scalars().find(|(known, _)| *known == name).map_or(f64::NAN, |(_, v)| v);
    let scalars = spec.draws.iter().filter(|draw| draw.count.is_none()).map(|draw| scalar(&draw.name));
    places.chain(scalars).collect()
}

/// Writes the values of all variables.
pub(crate) fn fill(world: &World, values: &mut Vec<f64>) {
    let physics = &world.physics;
    let tcp = world.robot.tcp(physics).translation;
    let moved = |index: &usize| {
        let body = &world.bodies[*index];
        body.pose(physics).translation.distance(body.start.translation)
    };
    values.clear();
    values.push(world.bystanders.iter().map(moved).fold(0.0, f64::max));
    values.push(world.robot.commanded_opening());
    values.push(world.contacts.pads_in_contact() as f64);
    values.extend([tcp.x, tcp.y, tcp.z, world.seconds()]);
    values.extend(&world.constants);
    for body in world.bodies.iter().filter(|body| !body.is_copy) {
        let pose = body.pose(physics);
        let (speed, spin) = body.speed(physics);
        let up = pose.transform_vector(DVec3::Z);
        values.extend(pose.translation.to_array());
        values.extend([speed, spin, up.z.clamp(-1.0, 1.0).acos(), pose.translation.distance(body.start.translation)]);
        values.push(wrap_angle(pose.yaw() - body.start.yaw()).abs());
        values.push(world.contacts.pads_touching(&body.colliders) as f64);
        if let Some(button) = &body.button {
            values.extend([f64::from(u8::from(button.pressed)), f64::from(button.presses), body.depth(physics)]);
        }
    }
    world.fluents.fill(world, values);
}
