//! `acm run --robot`: an episode on a robot in another process.

use crate::{
    cli::{Exit, RunArgs},
    episode::Runner,
    live::Live,
    run::{Source, exit_of, filmed, listener, prepare, tell_result, traced},
    video::VideoFile,
};
use acm_actors::{
    remote::{Carrier, RemoteRobot},
    report::Ending,
};
use anyhow::{Context, ensure};

/// The name under which the agent says hello.
const AGENT: &str = concat!("acm ", env!("CARGO_PKG_VERSION"));

/// What a trace in a folder is named after: an address is no name of a file.
const FILE_STEM: &str = "robot";

/// Runs one episode on the robot that `args` names.
pub fn run(args: &RunArgs) -> anyhow::Result<Exit> {
    let address = args.robot.as_ref().context("no robot is named")?;
    ensure!(!args.seed.range, "a robot has one world at a time: give one seed, not a range");
    let video = args.video.as_deref().map(|path| VideoFile::create(path, false)).transpose()?;
    let (config, library) = prepare(args)?;
    let config = traced(FILE_STEM, args, &config, args.seed.first);
    ensure!(
        config.faults.slip_at.or(config.faults.drop_at).is_none(),
        "slip@N and drop@N happen in the world: give them to its host, such as `acm sim serve --inject slip@N`"
    );
    let robot = RemoteRobot::connect(address, AGENT, args.frames)?;
    let runner = Runner::without_renderer(library)?;
    runner.end_on_ctrl_c();
    if let Some(reason) = robot.fallback() {
        eprintln!("acm: frames come inline: {reason}");
    }
    let frames = match robot.carrier() {
        Carrier::SharedMemory => "through shared memory",
        Carrier::Inline => "inline",
    };
    let live = args.live.then(|| Live::new(args.json));
    let journal = listener(args, live.as_ref(), &format!("{} at {address}, frames {frames}", robot.host()))?;
    let on_unknown = config.settings.on_unknown;
    let result = filmed(&runner, video, config, journal, |config, journal| {
        runner.run_remote(&robot, args.seed.first, config, journal)
    })?;
    drop(live);
    tell_result(&Source { name: &address.to_string(), sensor: "the host's", on_unknown }, args, &result)?;
    if let Ending::Broken { reason } = &result.report.ending {
        eprintln!("acm: the run broke off: {reason}");
    }
    Ok(exit_of(&result))
}
