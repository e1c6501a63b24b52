//! The judge's variables and their values.

use crate::{
    derived, fluent,
    layout::Layout,
    oracle::{self, Watch},
    scenario::{ObjectSpec, Scenario, WorldSpec},
    world::World,
};

/// Names of all variables, in the order in which [`fill`] writes their values.
pub(crate) fn names(scenario: &Scenario) -> Vec<String> {
    let spec = &scenario.world;
    let objects = spec.objects.iter().map(|o| (o.count.is_none().then_some(o.name.as_str()), &*o.model));
    let places = spec.places.iter().flat_map(|place| ["x", "y", "z"].map(|axis| format!("{}_{axis}", place.name)));
    let scalars = spec.draws.iter().flat_map(|draw| draw.scalars());
    let mut names = oracle::names(objects, &places.chain(scalars).collect::<Vec<_>>());
    let single: Vec<&str> = spec.objects.iter().filter(|o| o.count.is_none()).map(|o| o.name.as_str()).collect();
    let regions = spec.regions.iter().map(|region| region.name.as_str());
    names.extend(fluent::names(regions, spec.fluents.iter().map(|fluent| fluent.name.as_str()), &single));
    let points = spec.points.iter().map(|point| point.name.as_str());
    names.extend(derived::names(points, spec.derived.iter().map(|number| number.name.as_str())));
    names
}

/// Values of places and plain draws.
pub(crate) fn constants(spec: &WorldSpec, layout: &Layout) -> Vec<f64> {
    let places = layout.places.iter().flat_map(|(_, point)| point.to_array());
    let scalar = |name: &str| layout.draws.scalars().find(|(known, _)| *known == name).map_or(f64::NAN, |(_, v)| v);
    let scalars = spec.draws.iter().flat_map(|draw| draw.scalars()).map(|name| scalar(&name));
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
    let hands = world.robot.hands(physics).zip(&world.hands_start);
    let hands_moved = hands.map(|(hand, start)| hand.at.distance(*start)).fold(0.0, f64::max);
    values.extend([tcp.x, tcp.y, tcp.z, hands_moved, world.seconds()]);
    values.extend(&world.constants);
    for body in world.bodies.iter().filter(|body| !body.is_copy) {
        body.values(physics, &world.contacts, values);
    }
    world.fluents.fill(world, values);
    world.derived.fill(world, values);
}

/// What an object's lamps and gauges show. Copies have no variables of their own, so that theirs show only what the
/// scenario says.
pub(crate) fn shows(spec: &ObjectSpec, names: &[String]) -> Vec<(String, Watch)> {
    let own = |text: &str| Watch::of_object(text, &spec.name, &spec.model, names);
    let shown = spec.model.shows().filter_map(|(name, text)| {
        let given = spec.shows.iter().find(|(known, _)| known == name);
        let watch = match given {
            Some((_, expression)) => Watch::new(expression, names),
            None if spec.count.is_some() => return None,
            None => own(text?)?,
        };
        Some((name.to_string(), watch))
    });
    shown.collect()
}
