#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
use crate::{
    Scenario,
    convert::vector,
    testbed::{joint, object, object_text, push, run, truth, world, world_with},
    world::World,
};
use glam::DVec3;

/// A slab of 1 kg on a joint, on a heavy base.
fn slab(joint: &str) -> String {
    format!(
        "[[model]]\nmodel = 'slab'\nsummary = ''\nfixed = true\n[[model.solid]]\nshape = 'box'\n\
         size = [0.2, 0.2, 0.02]\nposition = [0, 0, 0.01]\ncolor = '#808080'\n[[model.link]]\nname = 'part'\n\
         mass_kg = 1.0\n[[model.link.solid]]\nshape = 'box'\nsize = [0.4, 0.02, 0.1]\nposition = [0.2, 0, 0.2]\n\
         color = '#404040'\n[model.link.joint]\n{joint}\n{}",
        object("slab")
    )
}

#[test]
fn dry_friction_holds_below_its_force_and_yields_above() {
    let hinge = "kind = 'hinge'\naxis = [0, 0, 1]\nrange = [-1.5, 1.5]\nfriction = 1.0";
    let slider = "kind = 'slider'\naxis = [1, 0, 0]\nrange = [-0.3, 0.3]\nfriction = 6.0";
    for (text, friction, far) in [(hinge, 1.0, 0.3), (slider, 6.0, 0.05)] {
        let mut world = world(&slab(text));
        push(&mut world, "part", 0.9 * friction, 2.0);
        let held = joint(&world, "part").position;
        push(&mut world, "part", -1.2 * friction, 1.0);
        let moved = joint(&world, "part").position;
        run(&mut world, 1.0);
        let rest = joint(&world, "part");
        println!("{friction}: {held:.6}, then {moved:.4}, rests at {:.4}", rest.position);
        assert!(held.abs() < 0.0005, "it crept to {held}");
        assert!(moved < -0.2 * far, "it did not move: {moved}");
        assert!(rest.speed.abs() < 1e-3 && (rest.position - moved).abs() < 0.2, "{rest:?}");
    }
}

/// A dial of 2 g whose friction could stop it at once.
#[test]
fn a_light_knob_comes_to_rest() {
    let dial = slab("kind = 'hinge'\naxis = [0, 0, 1]\nfriction = 0.2")
        .replace("size = [0.4, 0.02, 0.1]", "size = [0.03, 0.03, 0.02]")
        .replace("position = [0.2, 0, 0.2]", "position = [0, 0, 0.2]")
        .replace("mass_kg = 1.0", "mass_kg = 0.002");
    let mut world = world(&dial);
    push(&mut world, "part", 0.22, 0.1);
    let pushed = joint(&world, "part");
    run(&mut world, 0.5);
    let rest = joint(&world, "part");
    println!("{:.3} at {:.3}/s, then {:.3} at {:.5}/s", pushed.position, pushed.speed, rest.position, rest.speed);
    assert!(pushed.position > 0.2, "{pushed:?}");
    assert!(rest.speed.abs() < 0.1, "{rest:?}");
}

#[test]
fn a_joint_ends_at_its_range_and_stays_on_its_axis() {
    for (text, force, ends) in [
        ("kind = 'hinge'\naxis = [0, 0, 1]\nrange = [-2.5, 2.9]\ndamping = 0.5", 3.0, [-2.5, 2.9]),
        ("kind = 'slider'\naxis = [1, 0, 0]\nrange = [-0.1, 0.3]\ndamping = 20.0", 60.0, [-0.1, 0.3]),
    ] {
        let mut world = world(&slab(text));
        for (sign, end) in [(1.0, ends[1]), (-1.0, ends[0])] {
            push(&mut world, "part", sign * force, 6.0);
            let at = joint(&world, "part").position;
            assert!((at - end).abs() < 0.005, "{text}: {at} instead of {end}");
            assert!((joint(&world, "part").opened - end.abs() / ends[1]).abs() < 0.01);
        }
        // 60 N across the axis at the far end.
        let body = world.bodies.iter().find(|body| body.placed.name == "thing").unwrap();
        let part = world.physics.bodies.get_mut(body.carrier(1)).unwrap();
        let far = part.position().transform_point(vector(DVec3::new(0.4, 0.0, 0.2)));
        part.add_force_at_point(vector(DVec3::NEG_Z * 60.0), far, true);
        run(&mut world, 1.0);
        // Where the loaded point is, and where it would be on an axis that does not give.
        let thing = truth(&world);
        let (_, made) = &world.bodies[0].joints[0];
        let ideal = thing.pose * made.joint.motion(made.position);
        let loaded = DVec3::new(0.4, 0.0, 0.2);
        let off = thing.links[1].pose.transform_point(loaded) - ideal.transform_point(loaded);
        println!("{text}: {:.4} mm off its axis under 60 N", 1e3 * off.length());
        assert!(off.length() < 5e-4, "{off}");
    }
}

#[test]
fn a_free_turn_is_counted_on() {
    let mut world = world(&slab("kind = 'hinge'\naxis = [0, 0, 1]\ndamping = 0.5\nstart = 0.5"));
    assert!((joint(&world, "part").position - 0.5).abs() < 1e-3);
    push(&mut world, "part", 2.0, 4.0);
    let turned = joint(&world, "part");
    assert!(turned.position > 9.0 && turned.position < 17.0 && turned.opened == 0.0, "{turned:?}");
}

#[test]
fn a_latch_holds_lets_go_and_catches_again() {
    let latch =
        "kind = 'hinge'\naxis = [0, 0, 1]\nrange = [0, 1.5]\nfriction = 0.1\nlatch = { force = 1.0, within = 0.05 }";
    let mut world = world_with(&slab(latch), "thing_part_latched > 0 && thing_part_open < 0.02");
    push(&mut world, "part", 0.9, 2.0);
    let held = joint(&world, "part").position;
    assert!(held < 0.02, "it opened to {held}");
    push(&mut world, "part", 1.4, 1.0);
    let open = joint(&world, "part").position;
    assert!(open > 0.3, "it stays at {open}");
    // Left just inside of the reach it is drawn in.
    push(&mut world, "part", -0.5, 1.0);
    for _ in 0..200 {
        if joint(&world, "part").position < 0.045 {
            break;
        }
        push(&mut world, "part", -0.2, 0.02);
    }
    run(&mut world, 2.0);
    let back = joint(&world, "part").position;
    assert!(back < 0.012, "it stays at {back}");
    assert!(world.verdict().strict);
}

#[test]
fn a_knob_rests_in_its_detents() {
    let knob = "kind = 'hinge'\naxis = [0, 0, 1]\nrange = [0, 3]\nfriction = 0.05\ndamping = 0.05\n\
                detents = { force = 0.3, every = 0.5 }";
    let mut world = world(&slab(knob));
    push(&mut world, "part", 0.25, 2.0);
    assert!(joint(&world, "part").position < 0.12);
    // Let go halfway, it falls into the nearest.
    for _ in 0..400 {
        if joint(&world, "part").position > 0.8 {
            break;
        }
        push(&mut world, "part", 0.6, 0.02);
    }
    run(&mut world, 3.0);
    let rest = joint(&world, "part").position;
    let off = (rest / 0.5 - (rest / 0.5).round()).abs() * 0.5;
    assert!(rest > 0.4 && off < 0.03, "{rest}");
}

#[test]
fn a_press_is_counted_once_a_stroke_and_its_lamp_lights() {
    let mut world = world_with(&object("bar-microwave"), "thing_button_presses > 1 && thing_presses > 1");
    for _ in 0..2 {
        push(&mut world, "button", 6.0, 0.3);
        run(&mut world, 0.3);
    }
    assert_eq!(joint(&world, "button").presses, Some(2));
    assert!(world.verdict().strict);
    let lamp = |world: &World| {
        let body = &world.bodies[0];
        let piece = body.placed.links[0].pieces.iter().find(|piece| piece.lamp.is_some()).unwrap();
        body.color(piece, &world.state)
    };
    let dark = lamp(&world);
    push(&mut world, "door", 4.0, 1.0);
    assert_ne!(lamp(&world), dark, "the door is open at {:?}", joint(&world, "door"));
}

#[test]
fn a_needle_shows_what_it_is_told() {
    let gauge = format!("{}shows = {{ needle = '0.5 * time' }}\n", object("round-gauge"));
    let mut world = world(&gauge);
    for seconds in [1.0, 1.0, 1.0] {
        run(&mut world, seconds);
        let (shown, wanted) = (joint(&world, "needle").position, 0.5 * world.seconds());
        assert!((shown - wanted).abs() < 0.05, "{shown} instead of {wanted}");
    }
    let wrong = Scenario::parse("x.toml", &gauge.replace("needle", "nedle")).unwrap_err().to_string();
    assert!(!wrong.is_empty());
}

#[test]
fn the_scenario_says_how_far_it_stands_open() {
    let open = |at: f64| format!("{}joints = {{ door = \"{at}\" }}\n", object("bar-microwave"));
    assert!((joint(&world(&open(0.8)), "door").position - 0.8).abs() < 0.01);
    let text = open(2.5);
    let result = std::panic::catch_unwind(|| world(&text));
    assert!(result.is_err(), "beyond its range");
}

#[test]
fn a_carried_object_takes_its_parts_along() {
    let event = "[[event]]\nname = 'x'\ncarry = { object = 'thing' }\nto = [0.6, 0.2, 0.74]\nyaw = 0.7\n";
    let mut world = world(&format!("{}{event}", object("lidded-box")));
    run(&mut world, 0.6);
    let lid = |world: &World| {
        let thing = truth(world);
        thing.pose.inverse() * thing.links[1].pose
    };
    assert!(lid(&world).translation.length() < 0.002, "{:?}", lid(&world));
    run(&mut world, 1.0);
    assert!(truth(&world).pose.translation.distance(DVec3::new(0.6, 0.2, 0.74)) < 0.002);
    assert!(lid(&world).translation.length() < 0.001, "{:?}", lid(&world));
}

#[test]
fn a_look_ahead_changes_nothing_in_joints() {
    let hash = |look: bool| {
        let mut world = world(&object("bar-microwave"));
        for at in 0..6 {
            push(&mut world, "door", if at < 3 { 4.0 } else { -3.0 }, 0.2);
            push(&mut world, "button", 6.0, 0.1);
            if look {
                // It goes on with a copy of the physics and comes back.
                world.verdict();
            }
        }
        (crate::scene::state_hash(&world), joint(&world, "button").presses, joint(&world, "door").position.to_bits())
    };
    assert_eq!(hash(true), hash(false));
}

/// Every joint of every model that ships is driven through its range and back.
#[test]
fn the_shipped_joints_move_through_their_ranges() {
    let library = crate::model::ModelLibrary::embedded().unwrap();
    let mut moved = 0;
    for name in library.names() {
        let model = library.get(name).unwrap();
        for (link, spec) in model.joints() {
            let Some([low, high]) = spec.range else { continue };
            if spec.follows.is_some() {
                continue;
            }
            let mut world = world(&object(name));
            let link = &model.links[link].name;
            let against = |part: f64| part + spec.latch.map_or(0.0, |latch| latch.force);
            let spring = spec.spring.map_or(0.0, |spring| spring.preload + spring.stiffness * spec.stroke());
            let force = if model.fixed { 2.0 } else { 0.3 }
                + against(spec.friction + spring + spec.detents.as_ref().map_or(0.0, |d| 2.0 * d.force));
            let far = if (high - spec.closed).abs() > (spec.closed - low).abs() { 1.0 } else { -1.0 };
            push(&mut world, link, far * force, 2.0);
            let opened = joint(&world, link);
            assert!(opened.opened > 0.95, "{name} {link} opens to {:.2} only, {force} N", opened.opened);
            push(&mut world, link, -far * force, 2.0);
            let closed = joint(&world, link);
            assert!(closed.opened < 0.05, "{name} {link} closes to {:.2} only", closed.opened);
            let pose = truth(&world).pose.translation;
            assert!(pose.distance(DVec3::Z * 0.74) < if model.fixed { 1e-6 } else { 1.0 }, "{name} went to {pose}");
            moved += 1;
        }
    }
    assert!(moved > 15, "{moved} joints");
}

#[test]
fn a_jammed_joint_stays_where_it_is_until_it_is_let_go() {
    let jam = "[[event]]\nname = 'it sticks'\nafter_s = 0.2\nover_s = 1.0\n\
               jam = { object = 'thing', joint = 'JOINT' }\n";
    let cabinet = object("drawer-cabinet");
    let name = joint_names(&world(&cabinet)).remove(0);
    let mut world = world(&format!("{cabinet}{}", jam.replace("JOINT", &name)));
    run(&mut world, 0.3);
    push(&mut world, &name, 40.0, 0.6);
    assert!(joint(&world, &name).opened < 0.02, "{:?}", joint(&world, &name));
    run(&mut world, 0.5);
    push(&mut world, &name, 40.0, 0.6);
    assert!(joint(&world, &name).opened > 0.2, "{:?}", joint(&world, &name));
    assert_eq!(world.audit.report().violations, 0, "{:?}", world.audit.report());
    let wrong = object_text(&format!("{cabinet}{}", jam.replace("JOINT", "dor")));
    let error = Scenario::parse("t.toml", &wrong).unwrap_err().to_string();
    assert!(error.contains("no joint `dor`"), "{error}");
}

fn joint_names(world: &World) -> Vec<String> {
    truth(world).links.into_iter().filter(|link| link.joint.is_some()).map(|link| link.name).collect()
}
