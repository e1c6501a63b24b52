//! The tools behind HTTP against servers in another process: the example server, and one that is broken in every way.
#![allow(clippy::unwrap_used, clippy::expect_used)] // A failed unwrap is a failed test.

use acm_actors::tools::{HttpTool, WallStopwatch};
use acm_perception::tools::{
    Outcome, Tools,
    conformance::{self, Fault, Trial},
};
use std::{
    io::{BufRead, BufReader},
    net::TcpListener,
    path::Path,
    process::{Child, Command, Stdio},
    sync::Arc,
    time::Duration,
};

/// Long enough for a busy machine; answers that are to come in time have this long.
const PATIENT: Duration = Duration::from_secs(60);

/// A server that ends with the test.
struct Server {
    process: Child,
    address: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        self.process.kill().ok();
        self.process.wait().ok();
    }
}

/// Starts a Python server and reads where it listens; `None`, said aloud, on a machine without Python.
fn start(script: &str, arguments: &[&str]) -> Option<Server> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(script);
    let started = Command::new("python3").arg(path).args(arguments).stdout(Stdio::piped()).spawn();
    let Ok(mut process) = started else {
        eprintln!("skipped: there is no python3 on this machine");
        return None;
    };
    let mut line = String::new();
    BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listening on ").unwrap().to_owned();
    Some(Server { process, address })
}

fn tools(address: &str, limit: Duration) -> Tools {
    let tool = || Arc::new(HttpTool::new(address).unwrap());
    Tools {
        detector: Some(tool()),
        segmenter: Some(tool()),
        part_recogniser: Some(tool()),
        pose_estimator: Some(tool()),
        param_estimator: Some(tool()),
        limit,
        stopwatch: Arc::new(WallStopwatch::default()),
    }
}

#[test]
fn the_example_server_conforms_and_its_masks_reach_the_percepts() {
    let Some(server) = start("../examples/perception_tool_server.py", &["0"]) else { return };
    let trial = Trial::new().unwrap();
    let tools = tools(&server.address, PATIENT);
    let told = conformance::answers(&tools, &trial).unwrap();
    let of = |asked: &str| -> Vec<_> { told.iter().filter(|told| told.asked == asked).collect() };
    assert!(of("segment").iter().all(|told| told.outcome == Outcome::Ok(())), "{told:?}");
    assert!(of("segment")[0].tool.starts_with("by-colour at http://127.0.0.1:"), "{told:?}");
    for asked in ["detect", "recognise", "pose", "params"] {
        assert!(of(asked).iter().all(|told| matches!(told.outcome, Outcome::Abstain(_))), "{told:?}");
    }
    conformance::unfit_requests(&tools, &trial).unwrap();
    let assisted = conformance::grounder(&trial).with_tools(tools).ground(&trial.frame, &Default::default());
    let mut found: Vec<&str> = assisted.percepts.objects.iter().map(|object| object.category.as_str()).collect();
    found.sort_unstable();
    assert_eq!(found, ["block", "can"]);
    let cut = assisted.calls.iter().find(|call| call.asked == "segment").unwrap();
    assert_eq!((cut.outcome, cut.made.as_str()), ("ok", "2 of 2 masks, those that stand on the surface"));
}

#[test]
fn every_fault_of_a_server_ends_in_a_typed_outcome() {
    let Some(server) = start("tests/faulty_tool_server.py", &[]) else { return };
    let trial = Trial::new().unwrap();
    for fault in Fault::ALL {
        let (address, limit) = match fault {
            Fault::Late => (format!("{}/late", server.address), Duration::from_millis(100)),
            // Nobody listens at a port that was just given back.
            Fault::Refused => {
                (format!("http://{}", TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()), PATIENT)
            }
            _ => (format!("{}/{}", server.address, fault.name()), PATIENT),
        };
        let told = conformance::withstands(&tools(&address, limit), &trial, fault).unwrap();
        assert_eq!(told.len(), 2 + 3 * trial.things.len(), "{fault:?}");
    }
}

#[test]
fn a_sound_answer_to_every_question_is_taken_and_a_refusal_is_told_in_its_own_words() {
    let Some(server) = start("tests/faulty_tool_server.py", &[]) else { return };
    let trial = Trial::new().unwrap();
    let ground = |path: &str| {
        let tools = tools(&format!("{}/{path}", server.address), PATIENT);
        conformance::grounder(&trial).with_tools(tools).ground(&trial.frame, &Default::default())
    };
    let assisted = ground("none");
    assert!(assisted.calls.iter().all(|call| call.outcome == "ok"), "{:?}", assisted.calls);
    assert_eq!(assisted.percepts.objects.len(), 2);
    // The server's pose is 0.7 m before the camera whatever it is asked about: geometry's fit stands.
    let placed: Vec<&str> =
        assisted.calls.iter().filter(|call| call.asked == "pose").map(|call| call.made.as_str()).collect();
    assert!(placed.iter().all(|made| *made != "a better fit") && placed.len() == 2, "{placed:?}");
    for (path, word) in [("refusing", "status 500"), ("endless", "longer than")] {
        let calls = ground(path).calls;
        assert!(calls.iter().all(|call| call.remark.as_ref().is_some_and(|it| it.contains(word))), "{calls:?}");
    }
}

#[test]
fn addresses_are_read_before_anybody_is_asked() {
    for wrong in ["127.0.0.1:80", "https://a.b", "http://", "http://me:pw@a.b", "file:///x", ""] {
        assert!(HttpTool::new(wrong).is_err_and(|error| error.contains("http://HOST:PORT")), "{wrong}");
    }
}
