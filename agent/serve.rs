//! `acm sim serve`: the simulator in a process of its own, as a robot for `acm run --robot`.

use crate::{
    cli::{Exit, ServeArgs},
    inject::Faults,
};
use acm_actors::remote::{Carrier, Host, HostEvent, HostVerdict, RobotServer};
use acm_sim::{OracleVerdict, Scenario, SimOptions, Simulation};
use anyhow::{Context, ensure};
use std::{
    io::Write,
    sync::{Arc, Mutex},
};

/// Serves a scenario's world until the process is interrupted.
pub fn run(args: &ServeArgs) -> anyhow::Result<Exit> {
    let scenario = Scenario::open_with(&args.scenario, &args.set)?;
    let faults = Faults::new(&args.inject);
    ensure!(
        faults == Faults { slip_at: faults.slip_at, drop_at: faults.drop_at, ..Faults::default() },
        "only slip@N and drop@N happen in the world: give the other faults to `acm run`"
    );
    // The address is taken first: one that is in use must not cost the start of the renderer.
    let server = RobotServer::bind(&args.listen, args.frames)?;
    let options = SimOptions {
        seed: args.seed,
        slip_at: faults.slip_at,
        drop_at: faults.drop_at,
        sensor: args.sensor.clone(),
        motion: !args.no_motion,
        camera_size: None,
    };
    let renderer = Arc::new(Mutex::new(acm_render::Renderer::new()?));
    let simulation = Arc::new(Simulation::new(&scenario, &options, renderer).context("the world cannot be built")?);
    // The first picture takes longest; no agent shall wait for it.
    simulation.preview(None)?;
    say(&format!("listening on {}", server.address()));
    serve(server, host(&simulation))?;
    say("ended");
    Ok(Exit::Success)
}

/// The world as a robot. Its name says nothing of the scenario: the agent gets the task alone.
pub fn host(simulation: &Arc<Simulation>) -> Host {
    let (judged, resumed) = (Arc::clone(simulation), Arc::clone(simulation));
    Host {
        name: concat!("acm sim ", env!("CARGO_PKG_VERSION")).into(),
        task: simulation.task(),
        embodiment: simulation.embodiment(),
        cameras: simulation.camera(),
        clock: simulation.clock(),
        judge: Box::new(move |_| Some(verdict_of(judged.verdict()))),
        on_agent: Box::new(move || resumed.resume()),
    }
}

fn verdict_of(verdict: OracleVerdict) -> HostVerdict {
    let OracleVerdict { strict, faithful, stages, violations, explanation } = verdict;
    HostVerdict { strict, faithful, stages, violations, explanation }
}

/// Serves until Ctrl-C or a request to terminate.
fn serve(server: RobotServer, host: Host) -> anyhow::Result<()> {
    let signals = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let stopper = server.stopper();
    std::thread::scope(|threads| {
        threads.spawn(move || server.serve(host, |event| say(&words(&event))));
        let ended = signals.block_on(async {
            let mut terminate = tokio::signal::unix::signal(tokio::signal::unix::SignalKind::terminate())?;
            tokio::select! {
                ended = tokio::signal::ctrl_c() => ended,
                _ = terminate.recv() => Ok(()),
            }
        });
        stopper.stop();
        ended
    })?;
    Ok(())
}

fn words(event: &HostEvent) -> String {
    match event {
        HostEvent::Connected { agent, frames, fallback } => {
            let way = match frames {
                Carrier::SharedMemory => "through shared memory",
                Carrier::Inline => "inline",
            };
            let why = fallback.as_ref().map(|reason| format!(" ({reason})")).unwrap_or_default();
            format!("agent `{agent}` is connected, frames go {way}{why}")
        }
        HostEvent::Inline { reason } => format!("frames go inline from now on: {reason}"),
        HostEvent::TurnedAway { reason } => format!("turned away: {reason}"),
        HostEvent::Left { reason } => format!("the agent is gone: {reason}"),
    }
}

/// A log that nobody reads is no reason to end.
fn say(line: &str) {
    let mut out = std::io::stdout().lock();
    if writeln!(out, "{line}").and_then(|()| out.flush()).is_err() {
        // Standard output is closed.
    }
}
