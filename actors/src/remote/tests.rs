//! A host and an agent in one process, over real sockets.

use super::{
    robot::RemoteError,
    server::{Host, HostEvent, RobotServer, Stopper},
    *,
};
use acm_concept::{
    camera::{CameraError, CameraModel, CameraSource, FrameHeader, Intrinsics, Mount, RgbdFrame},
    embodiment::{Clock, Command, Embodiment, EmbodimentError, Feedback, RobotDescription},
    ids::FrameId,
    pose::Pose,
    task::{Budgets, TaskSpec},
    time::Time,
};
use glam::DVec3;
use std::{
    io::{BufRead, BufReader, Read, Write},
    os::unix::net::{UnixListener, UnixStream},
    sync::{Arc, Mutex},
    thread::JoinHandle,
};

/// A world without physics: the hand is where it was told to be, and time is a number.
#[derive(Debug)]
struct Toy {
    feedback: Feedback,
    stopped: bool,
    frames: u64,
}

#[derive(Clone)]
struct Handle(Arc<Mutex<Toy>>);

fn camera() -> CameraModel {
    CameraModel {
        name: "head".into(),
        intrinsics: Intrinsics::from_vertical_fov(32, 24, 1.0),
        pose: Pose::IDENTITY,
        depth_min_m: 0.1,
        depth_max_m: 3.0,
        mount: Mount::World,
    }
}

fn description() -> &'static RobotDescription {
    static ROBOT: std::sync::OnceLock<RobotDescription> = std::sync::OnceLock::new();
    ROBOT.get_or_init(|| RobotDescription {
        name: "toy".into(),
        hand: vec![],
        finger: vec![],
        max_opening_m: 0.08,
        max_grip_force_n: 30.0,
        pad_half_length_m: 0.01,
        workspace_min: DVec3::splat(-1.0),
        workspace_max: DVec3::splat(1.0),
        max_speed_m_s: 0.5,
        max_turn_rad_s: 2.0,
        tick_s: 0.02,
        home: Pose::IDENTITY,
        ..RobotDescription::default()
    })
}

impl Embodiment for Handle {
    fn description(&self) -> &RobotDescription {
        description()
    }
    fn feedback(&self) -> Feedback {
        self.0.lock().unwrap().feedback.clone()
    }
    fn command(&mut self, command: &Command) -> Result<Feedback, EmbodimentError> {
        let mut toy = self.0.lock().unwrap();
        if toy.stopped {
            return Err(EmbodimentError::Stopped);
        }
        if !description().reaches(command.tcp.translation) {
            return Err(EmbodimentError::Refused { reason: "too far".into() });
        }
        toy.feedback.time = toy.feedback.time + 0.02;
        toy.feedback.tcp = command.tcp;
        Ok(toy.feedback.clone())
    }
    fn stop(&mut self) {
        self.0.lock().unwrap().stopped = true;
    }
}

impl Clock for Handle {
    fn now(&self) -> Time {
        self.0.lock().unwrap().feedback.time
    }
    fn wait_until(&mut self, moment: Time) -> Result<Time, EmbodimentError> {
        if moment > Time::from_seconds(3600.0) {
            return Err(EmbodimentError::Refused { reason: "too long".into() });
        }
        let mut toy = self.0.lock().unwrap();
        toy.feedback.time = toy.feedback.time.max(moment);
        Ok(toy.feedback.time)
    }
}

impl CameraSource for Handle {
    fn cameras(&self) -> &[CameraModel] {
        &[]
    }
    fn capture(&mut self, name: &str) -> Result<RgbdFrame, CameraError> {
        let mut toy = self.0.lock().unwrap();
        toy.frames += 1;
        picture(toy.frames - 1, name, toy.feedback.time)
            .map_err(|reason| CameraError::Failed { name: name.into(), reason })
    }
}

fn picture(number: u64, name: &str, time: Time) -> Result<RgbdFrame, String> {
    let CameraModel { intrinsics, pose: camera_pose, .. } = camera();
    let header = FrameHeader { id: FrameId(number), camera: name.into(), time, intrinsics, camera_pose };
    let color: Vec<u8> = (0..3 * intrinsics.pixels()).map(|i| (i as u64 * 7 + number) as u8).collect();
    let depth: Vec<f32> = (0..intrinsics.pixels()).map(|i| 0.1 * i as f32 + number as f32).collect();
    RgbdFrame::new(header, color.into(), depth.into()).map_err(|e| e.to_string())
}

fn task() -> TaskSpec {
    TaskSpec {
        instruction: "Wave.".into(),
        instruction_at_s: 0.25,
        budgets: Budgets { seconds: 10.0, skills: 3, frames: 30 },
        cameras: vec![camera()],
        then: vec![],
    }
}

fn toy() -> Host {
    let feedback = Feedback {
        time: Time(123_456_789),
        tcp: Pose::IDENTITY,
        joints: vec![0.1 + 0.2],
        opening_m: 0.08,
        commanded_opening_m: 0.08,
        pad_force_n: [DVec3::ZERO; 2],
        wrist_force_n: DVec3::new(1.0 / 3.0, -0.0, 1e-300),
        ..Feedback::default()
    };
    let toy = Handle(Arc::new(Mutex::new(Toy { feedback, stopped: false, frames: 0 })));
    let again = toy.clone();
    Host {
        name: "toy world".into(),
        task: task(),
        embodiment: Box::new(toy.clone()),
        cameras: Box::new(toy.clone()),
        clock: Box::new(toy),
        judge: Box::new(|report| {
            Some(HostVerdict {
                strict: report["ending"] == "done",
                explanation: "as told".into(),
                ..HostVerdict::default()
            })
        }),
        on_agent: Box::new(move || again.0.lock().unwrap().stopped = false),
    }
}

/// A served host with its log. Ends with the test.
struct Served {
    address: Address,
    stopper: Stopper,
    log: Arc<Mutex<Vec<HostEvent>>>,
    thread: Option<JoinHandle<()>>,
    _dir: tempfile::TempDir,
}

impl Served {
    #[allow(clippy::disallowed_methods)] // the host's own process, were this not a test
    fn start(address: Option<&str>, mode: FrameMode, host: Host) -> Served {
        let dir = tempfile::tempdir().unwrap();
        let address = address.map_or(Address::Unix(dir.path().join("robot.sock")), |text| text.parse().unwrap());
        let server = RobotServer::bind(&address, mode).unwrap();
        let log: Arc<Mutex<Vec<HostEvent>>> = Arc::default();
        let (address, stopper, kept) = (server.address().clone(), server.stopper(), Arc::clone(&log));
        let thread = std::thread::spawn(move || {
            server.serve(host, |event| kept.lock().unwrap().push(event));
        });
        Served { address, stopper, log, thread: Some(thread), _dir: dir }
    }
    fn connect(&self, mode: FrameMode) -> Result<RemoteRobot, RemoteError> {
        RemoteRobot::connect(&self.address, "tester", mode)
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        self.stopper.stop();
        self.thread.take().unwrap().join().unwrap();
    }
}

fn to(x: f64) -> Command {
    Command::hand(Pose::from_translation(DVec3::new(x, 0.1, 0.2)), 0.05, 7.0)
}

#[test]
fn the_three_traits_are_the_same_over_every_socket_and_carrier() {
    for address in [None, Some("tcp://127.0.0.1:0")] {
        for (mode, carrier) in [(FrameMode::Auto, Carrier::SharedMemory), (FrameMode::Inline, Carrier::Inline)] {
            let served = Served::start(address, FrameMode::Auto, toy());
            let remote = served.connect(mode).unwrap();
            let local = toy();
            assert_eq!((remote.host(), remote.carrier(), remote.fallback()), ("toy world", carrier, None));
            assert_eq!((remote.task(), remote.embodiment().description()), (&task(), description()));
            same(remote, local);
        }
    }
}

/// Drives a remote world and a local one alike and compares all that comes back.
fn same(remote: RemoteRobot, mut local: Host) {
    let (mut robot, mut cameras, mut clock) = (remote.embodiment(), remote.camera(), remote.clock());
    for step in 0..30 {
        let command = to(0.1 * f64::from(step));
        assert_eq!(robot.command(&command), local.embodiment.command(&command));
        assert_eq!(clock.now(), local.clock.now());
        assert_eq!(cameras.capture("head"), local.cameras.capture("head"));
        assert_eq!(robot.feedback(), local.embodiment.feedback());
        let moment = clock.now() + 0.125;
        assert_eq!(clock.wait_until(moment), local.clock.wait_until(moment));
    }
    let never = Time::from_seconds(1e6);
    assert_eq!(clock.wait_until(never), local.clock.wait_until(never));
    assert!(matches!(cameras.capture("tail"), Err(CameraError::UnknownCamera { known, .. }) if known == "head"));
    robot.stop();
    assert_eq!(robot.command(&to(0.0)), Err(EmbodimentError::Stopped));
    assert!(remote.done(&serde_json::json!({"ending": "done"})).unwrap().unwrap().strict);
    assert!(!remote.done(&serde_json::json!({"ending": "lost"})).unwrap().unwrap().strict);
}

#[test]
fn frames_by_number_are_views_into_shared_memory() {
    let served = Served::start(None, FrameMode::Auto, toy());
    let mut cameras = served.connect(FrameMode::SharedMemory).unwrap().camera();
    let frames: Vec<RgbdFrame> = (0..6).map(|_| cameras.capture("head").unwrap()).collect();
    for (number, frame) in (0..).zip(&frames) {
        assert_eq!(frame, &picture(number, "head", frame.header.time).unwrap());
        // Planes on the bus begin at multiples of 64 bytes, each in its own place.
        assert_eq!((frame.color.as_ptr().addr() % 64, frame.depth.as_ptr().addr() % 64), (0, 0));
    }
}

#[test]
fn one_agent_at_a_time_and_the_world_stays_for_the_next() {
    let served = Served::start(None, FrameMode::Auto, toy());
    let first = served.connect(FrameMode::Auto).unwrap();
    first.embodiment().command(&to(0.5)).unwrap();
    first.camera().capture("head").unwrap();
    let second = served.connect(FrameMode::Auto).unwrap_err().to_string();
    assert!(second.contains("another agent is connected"), "{second}");
    first.embodiment().stop();
    drop(first);
    let third = served.connect(FrameMode::Auto).unwrap();
    assert_eq!(third.embodiment().feedback().tcp, to(0.5).tcp);
    assert_eq!(third.camera().capture("head").unwrap().header.id, FrameId(1));
    third.embodiment().command(&to(0.6)).unwrap();
    drop(third);
    let left = |event: &HostEvent| matches!(event, HostEvent::Left { .. });
    drop(served.connect(FrameMode::Auto).unwrap());
    assert!(served.log.lock().unwrap().iter().filter(|event| left(event)).count() >= 2);
}

#[test]
fn a_host_that_ends_is_said_to_be_lost_by_every_trait() {
    let served = Served::start(None, FrameMode::Auto, toy());
    let remote = served.connect(FrameMode::Auto).unwrap();
    let (mut robot, mut cameras, mut clock) = (remote.embodiment(), remote.camera(), remote.clock());
    let last = robot.command(&to(0.3)).unwrap();
    drop(served);
    let lost = |text: String| assert!(text.contains("is lost: the other end closed the connection"), "{text}");
    lost(robot.command(&to(0.4)).unwrap_err().to_string());
    lost(cameras.capture("head").unwrap_err().to_string());
    lost(clock.wait_until(Time::from_seconds(9.0)).unwrap_err().to_string());
    lost(remote.done(&()).unwrap_err().to_string());
    assert_eq!((robot.feedback(), clock.now()), (last.clone(), last.time));
}

#[test]
fn modes_that_do_not_meet_are_refused() {
    let served = Served::start(None, FrameMode::Inline, toy());
    assert_eq!(served.connect(FrameMode::Auto).unwrap().carrier(), Carrier::Inline);
    let refused = served.connect(FrameMode::SharedMemory).unwrap_err().to_string();
    assert!(refused.contains("refuses") && refused.contains("SharedMemory"), "{refused}");
}

#[test]
fn nobody_there_says_what_to_start() {
    let dir = tempfile::tempdir().unwrap();
    let address = Address::Unix(dir.path().join("nobody.sock"));
    let error = RemoteRobot::connect(&address, "tester", FrameMode::Auto).unwrap_err().to_string();
    assert!(error.contains("nobody.sock") && error.contains("acm sim serve"), "{error}");
}

#[test]
fn an_agent_that_speaks_nonsense_is_told_so_and_the_host_goes_on() {
    let served = Served::start(None, FrameMode::Auto, toy());
    let Address::Unix(path) = &served.address else { unreachable!() };
    let hello = r#"{"ask":"hello","protocol":1,"agent":"x","frames":["inline"]}"#;
    let cases = [
        ("GET / HTTP/1.1\r\n".to_string(), "no message of the robot protocol"),
        (r#"{"ask":"hello","protocol":9,"agent":"x","frames":["inline"]}"#.to_string() + "\n", "version 9"),
        (r#"{"ask":"stop"}"#.to_string() + "\n", "hello first"),
        (format!("{hello}\n{{\"ask\":\"dance\"}}\n"), "unknown variant `dance`"),
        (format!("{hello}\n{{\"ask\":\"feedback\",\"bytes\":5}}\n"), "raw bytes"),
        (format!("{hello}\n{hello}\n"), "second hello"),
    ];
    for (sent, part) in cases {
        let mut stream = UnixStream::connect(path).unwrap();
        stream.write_all(sent.as_bytes()).unwrap();
        let mut answers = String::new();
        stream.read_to_string(&mut answers).unwrap();
        let last = answers.lines().last().unwrap();
        assert!(last.contains(r#""answer":"error""#) && last.contains(part), "{last}");
    }
    served.connect(FrameMode::Auto).unwrap().embodiment().command(&to(0.1)).unwrap();
}

/// A host that answers hello rightly but for one change, then the given lines to whatever is asked.
#[allow(clippy::disallowed_methods)] // the host's own process, were this not a test
fn liar(change: (&str, &str), then: &'static [&'static str]) -> (tempfile::TempDir, Address) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("liar.sock");
    let listener = UnixListener::bind(&path).unwrap();
    let welcome = serde_json::json!({
        "answer": "hello", "protocol": 1, "host": "liar", "robot": description(), "task": task(), "time": 0,
        "feedback": toy().embodiment.feedback(), "frames": "inline",
    });
    let text = welcome.to_string();
    assert!(text.contains(change.0), "{text}");
    let text = text.replacen(change.0, change.1, 1);
    std::thread::spawn(move || {
        let (stream, _) = listener.accept().unwrap();
        let mut lines = BufReader::new(stream.try_clone().unwrap()).lines();
        let mut stream = stream;
        for answer in [text.as_str()].iter().chain(then) {
            lines.next();
            if writeln!(stream, "{answer}").is_err() {
                return;
            }
        }
        lines.next();
    });
    (dir, Address::Unix(path))
}

const JOINT: &str = r#"{"name":"elbow","frame":{"translation":[0,0,0],"rotation":[0,0,0,1]},"axis":[0,0,1],"min_rad":-2,
    "max_rad":2,"max_speed_rad_s":1,"max_acceleration_rad_s2":1,"max_torque_nm":1}"#;

/// The fields of a robot that say that it has an arm.
fn arm(home: &str, joints: &str) -> String {
    let here = r#"{"translation":[0,0,0],"rotation":[0,0,0,1]}"#;
    let arm = format!(r#"{{"base":{here},"tool":{here},"home":{home},"joints":{joints},"capsules":[],"hand":[]}}"#);
    // A message is one line.
    format!(r#""tick_s":0.02,"arm":{arm}"#).replace('\n', "")
}

#[test]
fn what_a_host_tells_of_itself_is_checked() {
    let (second, two) = (serde_json::to_string(description()).unwrap(), format!("[{JOINT},{JOINT}]"));
    for (from, to, part) in [
        (r#""protocol":1"#, r#""protocol":2"#, "version 2"),
        (r#""width":32"#, r#""width":4000000000"#, "intrinsics"),
        (r#""width":32"#, r#""width":0"#, "intrinsics"),
        (r#""tick_s":0.02"#, r#""tick_s":0.0"#, "tick"),
        (r#""seconds":10.0"#, r#""seconds":-1.0"#, "budget"),
        (r#""answer":"hello""#, r#""answer":"stopped""#, "stopped to hello"),
        (r#""robot""#, r#""rowboat""#, "missing field `robot`"),
        (r#""tick_s":0.02"#, &arm("[0.0]", "[]"), "an arm of 0 joints with 1 home positions"),
        (
            r#""tick_s":0.02"#,
            &arm("[3.0]", &format!("[{JOINT}]")),
            "an arm's home is beyond its limits: elbow at 3.0000 rad",
        ),
        (r#""tick_s":0.02"#, &arm("[1.0,1.0]", &two), "its feedback has 1 joints for the 2 of arm 0"),
        (r#""tick_s":0.02"#, &format!(r#""tick_s":0.02,"others":[{second}]"#), "its feedback says nothing of arm 1"),
    ] {
        let (_dir, address) = liar((from, to), &[]);
        let outcome = RemoteRobot::connect(&address, "tester", FrameMode::Auto);
        let error = outcome.unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn frames_that_do_not_fit_are_refused_and_end_the_connection() {
    let header = |name: &'static str, rest: &str| {
        let text = format!(
            r#"{{"answer":"frame","header":{{"id":"F1","camera":"{name}","time":1,"intrinsics":{{"width":32,"height":24,"fx":9.0,"fy":9.0,"cx":1.0,"cy":1.0}},"camera_pose":{{"translation":[0.0,0.0,0.0],"rotation":[0.0,0.0,0.0,1.0]}}}}{rest}}}"#
        );
        &*Box::leak(text.into_boxed_str())
    };
    for (answer, part) in [
        (header("head", ""), "shared memory that was not agreed"),
        (header("tail", r#","bytes":0"#), "`head` was asked for"),
        (header("head", r#","bytes":0"#), "needs 2304 colour values"),
        (header("head", r#","bytes":99999999"#), "raw bytes are announced"),
        (r#"{"answer":"time","time":5}"#, "time to capture"),
        ("[1,2", "no message"),
    ] {
        let answers: &'static [&'static str] = Box::leak(Box::new([answer, r#"{"answer":"stopped"}"#]));
        let (_dir, address) = liar(("liar", "liar"), answers);
        let robot = RemoteRobot::connect(&address, "tester", FrameMode::Auto).unwrap();
        let error = robot.camera().capture("head").unwrap_err().to_string();
        assert!(error.contains(part), "{error}");
        let again = robot.clock().wait_until(Time(9)).unwrap_err().to_string();
        assert!(again.contains(part), "{again}");
    }
}
