//! `acm demo`: the first minute. One task that needs memory, told as it happens; then the same without memory.

use crate::{
    cli::{DemoArgs, Exit},
    episode::{EpisodeConfig, EpisodeResult, Runner},
    inject::{Faults, FrameTap, Injection},
    narrate::Narrator,
    perceive,
};
use acm_actors::{episode::WipeAt, message::Message, report::Ending};
use acm_concept::{literal::Evidence, object::Percepts};
use acm_memory::{
    AcmMemory, Memory,
    entry::PlaceCause,
    observation::Grounding,
    query::{PlaceReference, Recall},
};
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use acm_sim::Scenario;
use anyhow::Context;
use std::{
    io::Write,
    path::Path,
    sync::{Arc, Mutex, PoisonError},
    time::Instant,
};

const SCENARIO: &str = "put-back-block-jittered";
/// Further seeds are only run while this much of the minute is left.
const MORE_SEEDS_UNTIL_S: f64 = 35.0;
const MORE_SEEDS: u64 = 4;

/// Runs `acm demo`.
pub fn run(args: &DemoArgs) -> anyhow::Result<Exit> {
    let began = now();
    let runner = Runner::new()?;
    runner.end_on_ctrl_c();
    let scenario = Scenario::open(SCENARIO)?;
    let memory = fresh_memory(&args.out)?;
    let mut out = std::io::stdout();
    let adapter = runner.adapter();
    writeln!(out, "ACM demo   no GPU, no key, no network at run time   seed {}   {adapter}", args.seed)?;
    writeln!(out, "1 SEE, DECIDE, ACT, VERIFY   the robot gets noisy RGB-D frames and one instruction")?;
    let tap = FrameTap::first(1);
    let listener = Arc::new(Listener { narrator: Narrator::new(Box::new(std::io::stdout())), first: Mutex::default() });
    let config = EpisodeConfig {
        method: "acm".into(),
        memory: Some(memory.clone()),
        frames: Some(tap.clone()),
        ..EpisodeConfig::default()
    };
    let told = runner.run(&scenario, args.seed, &config, Arc::clone(&listener) as Arc<dyn Journal<Message>>)?;
    writeln!(out, "2 REMEMBER   read back from {}, as the next run would", memory.display())?;
    remembered(&runner, &memory, &mut out)?;
    let verdict = word(told.verdict.strict);
    writeln!(
        out,
        "3 JUDGE   the simulator's truth, never shown to the robot: {verdict}; {}",
        told.verdict.explanation
    )?;

    writeln!(out, "4 NOW WITHOUT MEMORY   same robot, eyes and planner; wiped after the first placing")?;
    let wiped = without_memory(&runner, &scenario, args.seed)?;
    let honest = matches!(wiped.report.ending, Ending::GaveUp { .. });
    writeln!(
        out,
        "          {}",
        if honest { "HONEST FAILURE: it says what it does not know, and stops" } else { "NOT HONEST" }
    )?;

    let picture = picture(&runner, &listener, &tap, &args.out)?;
    more_seeds(&runner, &scenario, args.seed, began, &mut out)?;
    if let Some(line) = perceive::sample::photograph(&args.out.join("real.png"))? {
        writeln!(out, "REAL CAMERA   one RGB-D photograph from a real sensor; {line}")?;
    }
    writeln!(out, "Look at {}   Next: acm run {SCENARIO} --seed {}", picture.display(), args.seed + 1)?;
    let exit = told.solved && honest;
    Ok(if exit { Exit::Success } else { Exit::Failed })
}

/// An empty folder for the demo's memory. Only a folder that a demo made is ever emptied.
fn fresh_memory(out: &Path) -> anyhow::Result<std::path::PathBuf> {
    let memory = out.join("memory");
    let mark = out.join("made-by-acm-demo");
    if memory.exists() {
        anyhow::ensure!(mark.exists(), "{} was not made by a demo; choose another folder with --out", out.display());
        std::fs::remove_dir_all(&memory).with_context(|| format!("{} cannot be emptied", memory.display()))?;
    }
    std::fs::create_dir_all(out).with_context(|| format!("the folder {} cannot be made", out.display()))?;
    std::fs::write(&mark, "acm demo empties the memory folder beside this file\n")?;
    Ok(memory)
}

fn without_memory(runner: &Runner, scenario: &Scenario, seed: u64) -> anyhow::Result<EpisodeResult> {
    let wipe = Injection::WipeMemory(WipeAt::FirstVerified("place".into()));
    let config = EpisodeConfig { method: "acm".into(), faults: Faults::new(&[wipe]), ..EpisodeConfig::default() };
    let narrator = Arc::new(Narrator::new(Box::new(std::io::stdout())).from_first_fault());
    runner.run(scenario, seed, &config, narrator)
}

/// What the memory folder says of the things that were moved, read as another process would.
fn remembered(runner: &Runner, memory: &Path, out: &mut impl Write) -> anyhow::Result<()> {
    let memory = AcmMemory::open(memory, Arc::clone(runner.library()))?;
    let view = memory.view();
    for object in view.objects().iter().filter(|object| was_moved(&object.history)) {
        let Recall::Known { value, confidence, evidence } = view.recall_place(object.id, PlaceReference::BeforeMoved)
        else {
            continue;
        };
        let at = value.pose.translation;
        let on = value.support.map_or(String::new(), |id| format!(" on {id}"));
        let grounds: Vec<String> = evidence.iter().map(evidence_words).collect();
        writeln!(
            out,
            "          {} came from ({:.2}, {:.2}){on}, {confidence:.2}, by {}; {} transitions kept",
            object.id,
            at.x,
            at.y,
            grounds.join(" and "),
            view.transitions().len()
        )?;
    }
    Ok(())
}

fn was_moved(history: &[acm_memory::entry::HistoryEntry]) -> bool {
    history.iter().any(|entry| matches!(entry.cause, PlaceCause::Own(_)))
}

fn evidence_words(evidence: &Evidence) -> String {
    match evidence {
        Evidence::Frame(frame) => format!("frame {frame}"),
        Evidence::Transition(transition) => format!("own move {transition}"),
        Evidence::Inferred(how) => how.clone(),
    }
}

/// Draws what the agent saw in its first frame.
fn picture(runner: &Runner, listener: &Listener, tap: &FrameTap, out: &Path) -> anyhow::Result<std::path::PathBuf> {
    let path = out.join("saw.png");
    let first = listener.first.lock().unwrap_or_else(PoisonError::into_inner);
    if let (Some(frame), Some(percepts)) = (tap.frames().first(), &first.percepts) {
        let of = |index| first.grounding.resolved.iter().find(|r| r.percept == index).map(|r| r.object.to_string());
        let names: Vec<Option<String>> = (0..percepts.objects.len()).map(of).collect();
        let image = acm_perception::overlay::draw(frame, percepts, &names, runner.library());
        image.save(&path).with_context(|| format!("the picture {} cannot be written", path.display()))?;
    }
    Ok(path)
}

fn more_seeds(
    runner: &Runner,
    scenario: &Scenario,
    seed: u64,
    began: Instant,
    out: &mut impl Write,
) -> anyhow::Result<()> {
    let (mut asked, mut with, mut without) = (0, 0, 0);
    for seed in seed + 1..=seed + MORE_SEEDS {
        if began.elapsed().as_secs_f64() > MORE_SEEDS_UNTIL_S {
            break;
        }
        let solved = |method: &str| -> anyhow::Result<usize> {
            let config = EpisodeConfig {
                method: method.into(),
                on_unknown: acm_concept::task::OnUnknown::Guess,
                ..EpisodeConfig::default()
            };
            let result = runner.run(scenario, seed, &config, Arc::new(acm_runtime::journal::NoJournal))?;
            Ok(usize::from(result.solved))
        };
        asked += 1;
        with += solved("acm")?;
        without += solved("reactive")?;
    }
    if asked > 0 {
        writeln!(
            out,
            "5 {asked} MORE SEEDS   with memory {with}/{asked}, last frame only and guessing {without}/{asked}"
        )?;
    }
    Ok(())
}

fn word(success: bool) -> &'static str {
    if success { "success" } else { "no success" }
}

/// Tells the story and keeps the first frame's percepts with their identities.
struct Listener {
    narrator: Narrator,
    first: Mutex<First>,
}

#[derive(Default)]
struct First {
    percepts: Option<Percepts>,
    grounding: Grounding,
    identified: bool,
}

impl Journal<Message> for Listener {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut first = self.first.lock().unwrap_or_else(PoisonError::into_inner);
        match &message.body {
            Message::Percepts { percepts, .. } if first.percepts.is_none() => {
                first.percepts = Some((**percepts).clone());
            }
            Message::Updated { grounding, .. } if !first.identified => {
                first.grounding = grounding.clone();
                first.identified = true;
            }
            _ => {}
        }
        drop(first);
        self.narrator.record(message)
    }
}

/// Wall time decides only how many further seeds are shown.
#[allow(clippy::disallowed_methods)]
fn now() -> Instant {
    Instant::now()
}
