//! Power failures, torn writes, damage, kills, forgetting, and the format as a reader in another language sees it.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)] // a failed step is a failed test

use acm_store::{
    Event, Id, Op, Store, StoreError,
    forget::Forget,
    testing::{
        Draw,
        crash::{self, digest},
        faults::FaultDisk,
        worlds::World,
    },
};
use std::{
    io::{BufRead, BufReader},
    path::Path,
    process::{Command, Stdio},
};

#[test]
fn after_a_power_failure_anywhere_what_was_acknowledged_is_there() {
    let outcome = crash::run(600, 1, || ());
    assert_eq!((outcome.lost, outcome.refused), (0, 0), "{:?}", outcome.first);
}

#[test]
fn a_flipped_bit_is_never_read_as_something_else() {
    let mut draw = Draw::new(5);
    let (mut found, mut harmless) = (0, 0);
    for round in 0..300 {
        let disk = FaultDisk::default();
        let (mut store, _) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap();
        let (mut world, words) = World::new(round, 4, 6);
        store.commit(&[words], 0).unwrap();
        for batch in 0..4u32 {
            let puts: Vec<Event> = (0..3).map(|n| world.put(3 * batch + n, 1 + u64::from(batch))).collect();
            store.commit(&puts, 1 + u64::from(batch)).unwrap();
        }
        let with_snapshot = round % 2 == 1;
        if with_snapshot {
            store.snapshot(b"").unwrap();
        }
        let wanted = digest(store.state());
        drop(store);
        let name = if with_snapshot { "00000001.snapshot" } else { "log-00000000" };
        let mut length = 0;
        disk.overwrite(name, |bytes| length = bytes.len());
        disk.flip(name, draw.below(length), draw.below(8) as u8);
        match Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())) {
            Err(StoreError::Damaged { .. }) => found += 1,
            Err(other) => panic!("{other}"),
            // Zeros between batches and sections hold nothing.
            Ok((store, _)) => {
                assert_eq!(digest(store.state()), wanted);
                harmless += 1;
            }
        }
    }
    assert!(found > 150 && harmless < 150, "{found} of 300 found, {harmless} hit nothing");
}

#[test]
fn a_snapshot_of_another_layout_is_passed_over() {
    let disk = FaultDisk::default();
    let (mut store, _) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap();
    let (mut world, words) = World::new(2, 4, 6);
    store.commit(&[words], 0).unwrap();
    store.commit(&[world.put(1, 1)], 1).unwrap();
    store.snapshot(b"document").unwrap();
    store.commit(&[world.put(2, 2)], 2).unwrap();
    let wanted = digest(store.state());
    drop(store);
    disk.overwrite("00000001.snapshot", |bytes| bytes[7] = b'2');
    let (mut store, document) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap();
    assert_eq!((digest(store.state()), document), (wanted, None));
    store.snapshot(b"again").unwrap();
    drop(store);
    let (store, document) = Store::open_on(Box::new(disk), |_, _, _| Ok(())).unwrap();
    assert_eq!((digest(store.state()), document.as_deref()), (wanted, Some(b"again".as_slice())));
}

#[test]
fn records_in_another_order_are_damage() {
    let disk = FaultDisk::default();
    let (mut store, _) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap();
    let (mut world, words) = World::new(1, 4, 6);
    store.commit(&[words], 0).unwrap();
    let put = world.put(1, 1);
    let moved = |x: f32| Event::new(1, world.words.source, 1.0, vec![Op::Move(1, [x, 0.0, 0.0], [0.0; 3])]);
    store.commit(&[put, moved(1.0), moved(2.0)], 1).unwrap();
    drop(store);
    disk.overwrite("log-00000000", |bytes| {
        let find = |x: f32| {
            let place = bytes.windows(4).rposition(|window| window == x.to_le_bytes()).unwrap();
            // Head of the record, the event's head, the operation's tag and id.
            place - 9 - 16 - 5
        };
        let (a, b) = (find(1.0), find(2.0));
        let length = b - a;
        let first = bytes[a..b].to_vec();
        bytes.copy_within(b..b + length, a);
        bytes[b..b + length].copy_from_slice(&first);
    });
    let error = Store::open_on(Box::new(disk), |_, _, _| Ok(())).unwrap_err();
    assert!(matches!(error, StoreError::Damaged { .. }), "{error}");
}

#[test]
fn a_killed_writer_loses_nothing_that_it_acknowledged() {
    let folder = tempfile::tempdir().unwrap();
    let mut sure = 0;
    for round in 0..6u64 {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["the_writer_that_is_killed", "--exact", "--ignored", "--nocapture"])
            .env("STORE", folder.path())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        for _ in 0..40 + 17 * round {
            let Some(line) = lines.next() else { break };
            if let Some(number) = line.unwrap().split("acknowledged ").nth(1) {
                sure = number.parse().unwrap();
            }
        }
        child.kill().unwrap();
        child.wait().unwrap();
        // What it said before it died was acknowledged too.
        for line in lines.map_while(Result::ok) {
            if let Some(number) = line.split("acknowledged ").nth(1).and_then(|n| n.trim().parse::<u64>().ok()) {
                sure = number;
            }
        }
        let store = Store::open(folder.path()).unwrap();
        assert!(sure > 0 && store.state().next >= sure, "{} events, {sure} were acknowledged", store.state().next);
        // Each batch puts an object and moves it: neither is there without the other.
        for id in store.state().ids() {
            assert_eq!(store.state().position(id).unwrap()[2], 77.0);
        }
    }
}

/// Not a test of its own: the process that the one above kills.
#[test]
#[ignore = "the test above starts it"]
fn the_writer_that_is_killed() {
    let Some(folder) = std::env::var_os("STORE") else { return };
    let mut store = Store::open(Path::new(&folder)).unwrap();
    let (mut world, words) = World::new(9, 4, 6);
    if store.state().next == 0 {
        store.commit(&[words], 0).unwrap();
    }
    let first = store.state().ids().last().map_or(0, |id| id + 1);
    for id in first..first + 4000 {
        let time = store.state().now + 1;
        let put = world.put(id, time);
        let moved = Event::new(time, world.words.source, 1.0, vec![Op::Move(id, [0.0, 0.0, 77.0], [0.0; 3])]);
        store.commit(&[put, moved], time).unwrap();
        println!("acknowledged {}", store.state().next);
        if id % 64 == 63 {
            store.snapshot(b"").unwrap();
        }
    }
}

#[test]
fn what_is_forgotten_is_in_no_byte_of_the_folder() {
    let (mut world, words) = World::new(8, 4, 6);
    let disk = FaultDisk::default();
    let (mut store, _) = Store::open_on(Box::new(disk.clone()), |_, _, _| Ok(())).unwrap();
    store.commit(&[words], 0).unwrap();
    let secret = Op::Define(acm_store::Kind::Source, "the-guest".into());
    let guest = store.state().symbols.next();
    store.commit(&[Event::new(0, 0, 1.0, vec![secret])], 0).unwrap();
    let place = [123.456f32, 654.321, 77.25];
    for id in 0..40 {
        store.commit(&[world.put(id, 1)], 1).unwrap();
    }
    let other = [9.876f32, 5.4321, 1.2345];
    let mut hidden = Event::new(2, world.words.source, 1.0, vec![Op::Move(7, place, [0.0; 3])]);
    hidden.document = b"the diary of O7".to_vec();
    let said = Event::new(2, guest, 1.0, vec![Op::Move(8, other, [0.0; 3])]);
    store.commit(&[hidden, said], 2).unwrap();
    store.snapshot(b"").unwrap();
    let find = |bytes: &[u8], needle: &[u8]| bytes.windows(needle.len()).any(|window| window == needle);
    for needle in [b"diary".as_slice(), b"the-guest", &place[0].to_le_bytes(), &other[1].to_le_bytes()] {
        assert!(find(&disk.bytes(), needle));
    }
    let region = world.words.regions[1];
    let in_region: Vec<Id> =
        store.state().ids().filter(|id| store.state().as_of(*id, 9, 9).unwrap().region == region).collect();
    assert!(!in_region.is_empty());
    let place_there = store.state().position(in_region[0]).unwrap();
    let what = Forget { objects: vec![7], regions: vec![region], sources: vec![guest] };
    store.forget(&what, |_, _| None).unwrap();
    for needle in [
        b"diary".as_slice(),
        b"the-guest",
        b"room-1",
        &place[0].to_le_bytes(),
        &other[1].to_le_bytes(),
        &place_there[0].to_le_bytes(),
    ] {
        assert!(!find(&disk.bytes(), needle), "{:?}", String::from_utf8_lossy(needle));
    }
    assert!(store.state().row(7).is_none() && store.state().row(8).is_some());
    store.snapshot(b"").unwrap();
    assert!(!find(&disk.bytes(), &place[0].to_le_bytes()) && !find(&disk.bytes(), b"the-guest"));
    let kept = digest(store.state());
    drop(store);
    assert_eq!(digest(Store::open_on(Box::new(disk), |_, _, _| Ok(())).unwrap().0.state()), kept);
}

#[test]
fn a_reader_of_a_hundred_lines_in_python_reads_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let mut store = Store::open(folder.path()).unwrap();
    let (mut world, words) = World::new(12, 4, 6);
    store.commit(&[words], 0).unwrap();
    for id in 0..50 {
        store.enqueue(&[world.put(id, 5)], 5 + u64::from(id)).unwrap();
    }
    store.flush().unwrap();
    for step in 0..200 {
        store.commit(&[world.change(50, 1000 + step)], 1000 + step).unwrap();
    }
    store.snapshot(b"").unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_log.py");
    let output = Command::new("python3").arg(script).arg(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(found["events"], store.state().next);
    for id in store.state().ids() {
        let object = store.state().object(id).unwrap();
        let told = &found["objects"][id.to_string()];
        let floats: Vec<f32> =
            told["position"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap() as f32).collect();
        assert_eq!(floats, object.position);
        assert_eq!(told["category"], store.state().symbols.word(object.category));
        assert_eq!(told["parts"], object.parts.len());
        let mut states: Vec<&str> = object.states.iter().map(|state| store.state().symbols.word(*state)).collect();
        states.sort_unstable();
        assert_eq!(told["states"], serde_json::json!(states));
    }
}
