//! One suite for every bus, then what only the shared-memory bus has: another process, limits, leftovers.

use super::*;
use std::{
    process::{Command, Stdio},
    time::Duration,
};

/// Frames that every bus of the suite holds.
const CAPACITY: u64 = 3;
/// Set in the process that the two-process test starts.
const CHILD: &str = "ACM_TEST_FRAME_BUS";
const LIMITS: BusLimits = BusLimits { readers: 2, frames: CAPACITY as usize, views: 2 };
/// Only against a test that hangs.
const PATIENCE: Duration = Duration::from_secs(60);

fn frame(number: u64) -> Arc<ByteFrame> {
    let plane = |bytes: usize| Bytes::from(vec![number as u8; bytes]);
    Arc::new(ByteFrame {
        size: [8, 4],
        header: Bytes::from(format!("header {number}")),
        planes: vec![plane(8 * 4 * 3), plane(8 * 4 * 4)],
    })
}

fn name() -> String {
    format!("acm/test/{}", run_id())
}

fn shared() -> SharedMemoryBus {
    SharedMemoryBus::create(&name(), LIMITS, frame(0).bytes()).unwrap()
}

fn buses() -> Vec<(&'static str, Arc<dyn FrameBus<ByteFrame>>)> {
    vec![("in-process", Arc::new(InProcessBus::new(CAPACITY as usize))), ("shared-memory", Arc::new(shared()))]
}

fn lost(bus: &dyn FrameBus<ByteFrame>, number: u64) -> String {
    match bus.get(number) {
        Err(FrameError::Lost(lost)) => lost.to_string(),
        other => panic!("frame {number} should be lost: {other:?}"),
    }
}

#[test]
fn a_frame_is_taken_as_it_was_published_any_number_of_times() {
    for (kind, bus) in buses() {
        bus.publish(7, frame(7)).unwrap();
        for _ in 0..2 * LIMITS.places() {
            assert_eq!(bus.get(7).unwrap(), frame(7), "{kind}");
        }
    }
}

#[test]
fn the_oldest_frame_goes_first_and_its_loss_is_said() {
    for (kind, bus) in buses() {
        assert!(lost(&*bus, 0).contains("holds none"), "{kind}");
        for number in 0..=CAPACITY {
            bus.publish(number, frame(number)).unwrap();
        }
        let expected =
            "frame 0 is not on the bus, which holds 1 to 3: it was overwritten by newer frames or never published";
        assert_eq!(lost(&*bus, 0), expected, "{kind}");
        for number in (1..=CAPACITY).rev() {
            assert_eq!(bus.get(number).unwrap(), frame(number), "{kind}");
        }
        assert!(lost(&*bus, CAPACITY + 1).contains("holds 1 to 3"), "{kind}");
    }
}

#[test]
fn numbers_must_rise() {
    for (kind, bus) in buses() {
        bus.publish(4, frame(4)).unwrap();
        for number in [4, 3] {
            let refused = bus.publish(number, frame(number));
            assert_eq!(refused, Err(PublishError::NotRising { number, last: 4 }), "{kind}");
        }
        assert_eq!(bus.get(4).unwrap(), frame(4), "{kind}");
    }
}

#[test]
fn a_frame_that_is_held_stays_as_it_was() {
    for (kind, bus) in buses() {
        let held: Vec<Arc<ByteFrame>> = (0..20)
            .map(|number| {
                bus.publish(number, frame(number)).unwrap();
                bus.get(number).unwrap()
            })
            .collect();
        for (number, held) in (0..).zip(held) {
            assert_eq!(held, frame(number), "{kind}");
        }
        bus.publish(20, frame(20)).unwrap();
        assert_eq!(bus.get(20).unwrap(), frame(20), "{kind}");
    }
}

#[test]
fn sizes_may_change_from_frame_to_frame() {
    for (kind, bus) in buses() {
        for (number, side) in (0..).zip([8usize, 64, 4, 256]) {
            let plane = Bytes::from(vec![side as u8; side * side]);
            let frame = ByteFrame { size: [side as u32; 2], header: Bytes::new(), planes: vec![plane] };
            bus.publish(number, Arc::new(frame.clone())).unwrap();
            assert_eq!(*bus.get(number).unwrap(), frame, "{kind}");
        }
    }
}

#[test]
fn producer_and_consumer_may_be_different_threads() {
    for (kind, bus) in buses() {
        let (ready, wait) = std::sync::mpsc::sync_channel(1);
        std::thread::scope(|threads| {
            let producer = Arc::clone(&bus);
            threads.spawn(move || {
                for number in 0..200 {
                    producer.publish(number, frame(number)).unwrap();
                    ready.send(number).unwrap();
                }
            });
            // One message waits and one is on its way, so that the frame asked for is at most three behind.
            for number in wait {
                assert_eq!(bus.get(number).unwrap(), frame(number), "{kind}");
            }
        });
    }
}

#[test]
fn frames_in_shared_memory_are_views_until_too_many_are_held() {
    let bus = shared();
    let places: Vec<Arc<ByteFrame>> = (0..8)
        .map(|number| {
            bus.publish(number, frame(number)).unwrap();
            bus.get(number).unwrap()
        })
        .collect();
    // A frame in shared memory begins at its alignment; the heap gives that only by chance.
    let aligned = places.iter().flat_map(|frame| &frame.planes).filter(|plane| plane.as_ptr().addr() % 64 == 0);
    assert!(aligned.count() >= 2 * (LIMITS.frames + LIMITS.views));
    let (first, again) = (bus.get(7).unwrap(), bus.get(7).unwrap());
    assert_eq!(first.planes[0].as_ptr(), again.planes[0].as_ptr());
}

#[test]
fn every_reader_has_its_own_place_and_no_more() {
    let bus = shared();
    let second = SharedMemoryReader::open(bus.name(), LIMITS).unwrap();
    bus.publish(1, frame(1)).unwrap();
    assert!(second.wait(PATIENCE).unwrap());
    assert_eq!((second.newest(), second.get(1).unwrap()), (Ok(Some(1)), frame(1)));
    let third = SharedMemoryReader::open(bus.name(), LIMITS).map_err(|e| e.to_string());
    assert!(third.as_ref().is_err_and(|e| e.contains("cannot be joined")), "{third:?}");
    drop(second);
    SharedMemoryReader::open(bus.name(), LIMITS).unwrap();
}

#[test]
fn what_cannot_be_joined_created_or_published_says_why() {
    let reason = |outcome: Result<(), BusError>| outcome.unwrap_err().to_string();
    let missing = name();
    assert!(reason(SharedMemoryReader::open(&missing, LIMITS).map(drop)).contains(&missing));
    let bus = shared();
    assert!(reason(SharedMemoryWriter::create(bus.name(), LIMITS, 64).map(drop)).contains("created"));
    assert!(reason(SharedMemoryWriter::create("", LIMITS, 64).map(drop)).contains("cannot name"));
    let full = reason(SharedMemoryWriter::create(&name(), LIMITS, 1 << 50).map(drop));
    assert!(full.contains("MB free") && full.contains("inline"), "{full}");
    let many = ByteFrame { planes: vec![Bytes::new(); MAX_PLANES + 1], ..(*frame(0)).clone() };
    assert!(matches!(bus.publish(0, Arc::new(many)), Err(PublishError::TooLarge { planes: 5, .. })));
}

#[test]
fn a_frame_goes_from_one_process_to_another_and_a_killed_reader_leaves_its_place() {
    if let Ok(name) = std::env::var(CHILD) {
        return child(&name);
    }
    let limits = BusLimits { readers: 1, ..LIMITS };
    let name = name();
    let writer = SharedMemoryWriter::create(&name, limits, frame(0).bytes()).unwrap();
    for round in 0..2 {
        let mut reader = start_child(&name);
        // The child says `ready` when it has joined, and then the number of each frame that it found in order.
        let mut lines = std::io::BufRead::lines(std::io::BufReader::new(reader.stdout.take().unwrap()));
        let mut said = || lines.find_map(|line| line.unwrap().strip_prefix("child ").map(str::to_string)).unwrap();
        assert_eq!(said(), "ready");
        for number in 10 * round..10 * round + 5 {
            writer.publish(number, &frame(number)).unwrap();
            assert_eq!(said(), format!("has {number}"));
        }
        // It dies with frames in its hands; the next one must find the only place free.
        reader.kill().unwrap();
        reader.wait().unwrap();
    }
}

/// This test binary once more, running the test above as the reader.
fn start_child(name: &str) -> std::process::Child {
    let test = "frame_bus::tests::a_frame_goes_from_one_process_to_another_and_a_killed_reader_leaves_its_place";
    Command::new(std::env::current_exe().unwrap())
        .args(["--exact", test, "--nocapture"])
        .env(CHILD, name)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap()
}

fn child(name: &str) {
    let reader = SharedMemoryReader::open(name, BusLimits { readers: 1, ..LIMITS }).unwrap();
    // On a line of its own: the test harness has begun one.
    println!("\nchild ready");
    let (mut held, mut last) = (Vec::new(), None);
    while reader.wait(PATIENCE).unwrap() {
        let Some(number) = reader.newest().unwrap().filter(|number| last != Some(*number)) else { continue };
        let found = reader.get(number).unwrap();
        assert_eq!(found, frame(number));
        held.push(found);
        last = Some(number);
        println!("child has {number}");
    }
}
