//! `acm run --llm`: a language model reads the instruction, all that it says is in the trace, and can be given again.

use crate::{acm, refuses, trace::prints};
use acm_planner::Planner;
use acm_runtime::trace::{Item, TraceReader};
use acm_sim::Scenario;
use serde_json::Value;
use std::{
    fs,
    io::{BufRead, BufReader},
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// Names of variables that hold keys of models.
const SECRETS: [&str; 6] =
    ["OPENAI_API_KEY", "ANTHROPIC_API_KEY", "GEMINI_API_KEY", "DASHSCOPE_API_KEY", "AWS_SECRET_ACCESS_KEY", "HF_TOKEN"];
const MARKER: &str = "key-that-must-not-be-seen";

/// The answer that a model would give which reads an instruction as the rules do.
pub fn answer(instruction: &str) -> String {
    let library = acm_memory::default_library().unwrap();
    let planner = Planner::new().unwrap();
    serde_json::to_string(&planner.answer(&planner.parse(instruction, &library).unwrap())).unwrap()
}

pub fn instruction() -> String {
    let text = crate::scenario_text();
    let line = text.lines().find_map(|line| line.strip_prefix("instruction = ")).unwrap();
    line.trim_matches('"').to_owned()
}

/// A script of TOML rules, in a file of this name.
fn script(dir: &Path, name: &str, rules: &str) -> String {
    let path = dir.join(name);
    fs::write(&path, format!("model = \"parrot-1\"\n{rules}")).unwrap();
    format!("scripted={}", path.display())
}

fn right(extra: &str) -> String {
    format!("[[rule]]\nstage = \"parse\"\ntext = '''{}'''\n{extra}\n", answer(&instruction()))
}

/// Runs with a model into a trace; what it printed, with its exit code.
fn run(llm: &str, trace: &Path, more: &[&str]) -> (String, Option<i32>) {
    let words = ["run", "put-back-block", "--seed", "3", "--llm", llm, "--trace"];
    let mut command = acm();
    for name in SECRETS {
        command.env(name, format!("{MARKER}-{name}"));
    }
    let output = command.args(words).arg(trace).args(more).output().unwrap();
    assert!(trace.exists(), "{}", String::from_utf8_lossy(&output.stderr));
    (String::from_utf8(output.stdout).unwrap(), output.status.code())
}

/// The messages of a trace, or those of one kind.
fn messages(trace: &Path, kind: &str) -> Vec<Value> {
    let all: Value = serde_json::from_str(&prints(&["trace", "show", trace.to_str().unwrap(), "--json"])).unwrap();
    let fits = |message: &&Value| kind.is_empty() || message["kind"] == kind;
    all["messages"].as_array().unwrap().iter().filter(fits).cloned().collect()
}

fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

#[test]
fn what_is_no_model_or_no_script_is_refused_in_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let bad = script(dir.path(), "bad.toml", "[[rule]]\nlats = ['x']\n");
    refuses(&["run", "put-back-block", "--llm", &bad], &["bad.toml", "line 3", "lats"]);
    refuses(&["run", "put-back-block", "--llm", "replay=no-such.jsonl"], &["no-such.jsonl"]);
    let output = acm().args(["run", "put-back-block", "--llm", "gpt"]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && told.contains("rules, scripted=FILE, replay=FILE"), "{told}");
}

#[test]
fn a_model_reads_the_instruction_and_all_it_says_can_be_shown_given_again_and_replayed_without_it() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (first, second, cassette) = (path("first.mcap"), path("second.mcap"), path("cassette.jsonl"));
    let extra =
        "reasoning = \"a cube, so a thing that can be moved\"\nusage = { input = 812, output = 97, reasoning = 11 }";
    let script = script(dir.path(), "right.toml", &right(extra));
    let (told, code) = run(&script, &first, &[]);
    assert!(told.contains("read      read by the model parrot-1 (scripted); 1 call, 812 tokens in, 97 out"), "{told}");
    assert_eq!(code, Some(0), "{told}");

    // Prompt and reply for a person.
    let asked = &messages(&first, "ask-llm")[0];
    let shown = prints(&["trace", "show", text(&first), "--seq", &asked["seq"].to_string()]);
    for part in ["prompt parse v2", "- cube: pick, place", &instruction()] {
        assert!(shown.contains(part), "no `{part}` in: {shown}");
    }
    let replied = &messages(&first, "llm-replied")[0];
    let shown = prints(&["trace", "show", text(&first), "--seq", &replied["seq"].to_string()]);
    for part in ["parrot-1 (scripted)", "| a cube, so a thing", "\"phrase\": \"the cube\"", "ended: Complete"] {
        assert!(shown.contains(part), "no `{part}` in: {shown}");
    }
    let why = prints(&["trace", "why", text(&first), "--step", "1"]);
    assert!(why.contains("prompt parse v2") && why.contains("parrot-1"), "{why}");
    assert!(prints(&["trace", "export", text(&first), "--html", "-"]).contains("a thing that can be moved"));

    // No key is anywhere in it.
    let (mut reader, mut bytes) = (TraceReader::open(&first).unwrap(), Vec::new());
    while let Some(item) = reader.next_item() {
        match item {
            Item::Message(message) => bytes.extend(message.data),
            Item::Attachment { name, data, .. } => bytes.extend([name.into_bytes(), data].concat()),
            Item::Metadata { values, .. } => bytes.extend(format!("{values:?}").into_bytes()),
        }
    }
    let holds = |words: &str| bytes.windows(words.len()).any(|window| window == words.as_bytes());
    assert!(holds("a thing that can be moved"), "what was read is what was written");
    assert!(!holds(MARKER));

    // The same answers from a cassette give the same run.
    prints(&["trace", "export", text(&first), "--cassette", text(&cassette)]);
    run(&format!("replay={}", cassette.display()), &second, &[]);
    assert_eq!(prints(&["trace", "diff", text(&first), text(&second)]), "equal\n");

    // A replay needs neither of the files.
    fs::remove_file(path("right.toml")).unwrap();
    fs::remove_file(&cassette).unwrap();
    assert!(prints(&["trace", "replay", text(&first), "--resim"]).starts_with("identical: "));
}

#[test]
fn a_wrong_answer_is_repaired_and_another_model_goes_on_from_a_fork() {
    let dir = tempfile::tempdir().unwrap();
    let (trace, forked) = (dir.path().join("run.mcap"), dir.path().join("forked.mcap"));
    let walrus = answer(&instruction()).replacen("the cube", "the walrus", 1);
    let rules = format!(
        "[[rule]]\nonce = true\ntext = 'Sure! I would'\n[[rule]]\nlast = ['no JSON']\ntext = '''{walrus}'''\n{}",
        right("last = [\"does not say \\\"the walrus\\\"\"]")
    );
    let (told, _) = run(&script(dir.path(), "repair.toml", &rules), &trace, &["--no-motion", "--trace-frames", "full"]);
    assert!(told.contains("read by the model parrot-1 (scripted); 3 calls"), "{told}");
    let asked = messages(&trace, "ask-llm");
    let turns = |at: usize| asked[at]["body"]["request"]["turns"].as_array().unwrap().len();
    assert_eq!((asked.len(), turns(0), turns(1), turns(2)), (3, 1, 3, 5));
    // Between two calls the planner keeps the question under way, which a keyframe tells.
    let second = messages(&trace, "llm-replied")[1]["seq"].to_string();
    let shown = prints(&["trace", "show", text(&trace), "--seq", &second]);
    assert!(shown.contains("planner kept before: ") && shown.contains("asks_the_model"), "{shown}");
    let reading = &messages(&trace, "parsed")[0]["body"]["reading"];
    assert_eq!((&reading["calls"], &reading["faults"][1]["kind"]), (&3.into(), &"ungrounded".into()));
    assert!(prints(&["trace", "replay", text(&trace)]).starts_with("identical: "));

    // Another one answers the last question otherwise.
    let other = format!("[[rule]]\ntext = '''{}'''\n", answer("Press the button."));
    let other = other.replace("Press the button", "press the button");
    let fork = asked[2]["seq"].to_string();
    let llm = script(dir.path(), "other.toml", &other);
    let words = ["trace", "replay", text(&trace), "--fork", &fork, "--llm", &llm, "--trace", text(&forked)];
    let output = acm().args(words).output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(told.starts_with(&format!("as recorded up to message {fork}, then live")), "{told}");
    let goals = |path: &Path| messages(path, "parsed")[0]["body"]["Ok"]["subtasks"].as_array().unwrap().len();
    assert_eq!((goals(&trace), goals(&forked)), (3, 1));
    assert_eq!(messages(&forked, "ask-llm"), asked);
    // And the rules alone may go on.
    let words = ["trace", "replay", text(&trace), "--fork", &fork, "--llm", "rules", "--trace", text(&forked)];
    acm().args(words).output().unwrap();
    let reading = &messages(&forked, "parsed")[0]["body"]["reading"];
    assert!(reading["fallback"].as_str().unwrap().contains("the rules alone"), "{reading}");
}

#[test]
fn a_model_that_fails_is_replaced_by_the_rules_and_that_is_said() {
    let dir = tempfile::tempdir().unwrap();
    let trace = dir.path().join("run.mcap");
    for (rules, why) in [
        ("[[rule]]\nerror = { kind = 'overloaded' }\n", "the model is overloaded"),
        ("[[rule]]\ntext = 'no'\nend = 'refused'\n", "the model declined to answer"),
        ("[[rule]]\njson = { things = 1 }\n", "the answer is not of the schema: at /"),
        ("[[rule]]\nstage = 'other'\ntext = 'x'\n", "no rule of"),
    ] {
        let llm = script(dir.path(), "s.toml", rules);
        let (told, _) = run(&llm, &trace, &["--no-motion", "--until", "instruction"]);
        assert!(!told.contains("MODEL"), "nothing is asked before the instruction: {told}");
        let (told, _) = run(&llm, &trace, &["--no-motion"]);
        assert!(told.contains("READ BY RULES INSTEAD OF THE MODEL") && told.contains(why), "{why}: {told}");
        let parsed = &messages(&trace, "parsed")[0]["body"];
        assert!(parsed["reading"]["fallback"].as_str().unwrap().contains(why), "{parsed}");
        assert_eq!(parsed["Ok"]["subtasks"].as_array().unwrap().len(), 3, "the rules read it all the same");
    }
}

#[test]
fn after_a_failure_the_model_says_how_to_go_on_and_cannot_choose_what_is_not_there() {
    let dir = tempfile::tempdir().unwrap();
    let trace = dir.path().join("run.mcap");
    let reflects = |way: &str| {
        let answer = format!("{{ diagnosis = 'It was refused.', reason = 'Nothing moves.', way = '{way}' }}");
        let rules = format!("{}[[rule]]\nstage = \"reflect\"\njson = {answer}\n", right(""));
        script(dir.path(), &format!("{way}.toml"), &rules)
    };
    let more = ["--no-motion", "--llm-stages", "parse,select,reflect", "--trace-frames", "full"];
    let (told, code) = run(&reflects("give-up"), &trace, &more);
    let chosen = "asked     reflect: chosen by the model parrot-1 (scripted): It was refused. Nothing moves.";
    assert!(told.contains(chosen) && told.contains("after a failure: It was refused."), "{told}");
    assert_eq!(code, Some(3), "the agent gives up");
    assert!(prints(&["trace", "replay", text(&trace)]).starts_with("identical: "));
    let asked = &messages(&trace, "ask-llm")[1]["body"]["request"];
    assert_eq!((&asked["stage"], &asked["prompt"]["id"]), (&"reflect".into(), &"reflect".into()));
    // Trying again is the planner's own way here; what is not offered is refused, and the planner decides.
    let (told, _) = run(&reflects("W1"), &trace, &more);
    assert!(told.contains("reflect: chosen by the model parrot-1"), "{told}");
    let (told, _) = run(&reflects("W9"), &trace, &more);
    assert!(
        told.contains("reflect: DECIDED BY THE PLANNER INSTEAD OF THE MODEL: the answer is not of the schema"),
        "{told}"
    );
    let counsel = messages(&trace, "decided").iter().find_map(|m| m["body"].get("counsel").cloned()).unwrap();
    assert_eq!((&counsel["stage"], &counsel["calls"]), (&"reflect".into(), &3.into()));
    // What is not asked for is not asked.
    let (told, _) = run(&reflects("give-up"), &trace, &["--no-motion"]);
    assert!(!told.contains("reflect:"), "{told}");
}

#[test]
fn a_port_or_a_planner_that_crashes_is_replaced_and_the_question_asked_anew() {
    let dir = tempfile::tempdir().unwrap();
    let trace = dir.path().join("run.mcap");
    let llm = script(dir.path(), "s.toml", &right(""));
    for fault in ["panic@llm:1", "panic@planner:1", "panic@planner:2"] {
        let (told, _) = run(&llm, &trace, &["--no-motion", "--inject", fault, "--trace-frames", "full"]);
        assert!(told.contains("failed (") && told.contains("read by the model parrot-1"), "{fault}: {told}");
        assert!(prints(&["trace", "replay", text(&trace)]).starts_with("identical: "), "{fault}");
    }
}

#[test]
fn an_interrupt_ends_a_call_that_is_under_way() {
    let dir = tempfile::tempdir().unwrap();
    let trace: PathBuf = dir.path().join("run.mcap");
    let llm = script(dir.path(), "slow.toml", "[[rule]]\ntext = 'x'\ndelay_ms = 3600000\n");
    let mut child = Command::new(assert_cmd::cargo::cargo_bin!("acm"))
        .args(["run", "put-back-block", "--seed", "3", "--llm", &llm, "--trace", text(&trace)])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    // The instruction is told just before the model is asked.
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.any(|line| line.unwrap().starts_with("told")), "the run ended before its instruction");
    let sent = Command::new("sh").args(["-c", &format!("kill -INT {}", child.id())]).status().unwrap();
    assert!(sent.success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    // Had the call gone on to its limit, its lateness would have been told to the planner.
    assert!(messages(&trace, "llm-replied").is_empty());
    assert!(messages(&trace, "ended")[0]["body"].to_string().contains("interrupted"));
}

#[test]
fn an_address_with_a_password_is_refused_and_leaves_no_trace() {
    let dir = tempfile::tempdir().unwrap();
    let trace = dir.path().join("run.mcap");
    let words = ["run", "--robot", "tcp://user:secret@127.0.0.1:7400", "--trace", text(&trace)];
    let output = acm().args(words).output().unwrap();
    let told = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.code() == Some(2) && told.contains("a user or a password"), "{told}");
    assert!(!trace.exists());
}

/// Wordings that the grammar was not written to.
const UNSEEN: &str = include_str!("paraphrases_unseen.txt");

#[test]
fn ten_wordings_of_each_scenarios_instruction_ask_for_the_same() {
    let (planner, library) = (Planner::new().unwrap(), acm_memory::whole_library().unwrap());
    let outline = |text: &str| planner.parse(text, &library).unwrap_or_else(|e| panic!("{text}: {e}")).outline();
    let (mut missed, mut alike) = (Vec::new(), 0);
    for name in Scenario::names() {
        let scenario = Scenario::open(&name).unwrap();
        let instruction = scenario.instruction().to_owned();
        let unseen: Vec<&str> = UNSEEN
            .lines()
            .skip_while(|line| line.strip_suffix(':') != Some(instruction.as_str()))
            .skip(1)
            .take_while(|line| !line.ends_with(':'))
            .collect();
        assert!(scenario.paraphrases().len() >= 7 && unseen.len() >= 3, "{name}");
        for text in scenario.paraphrases() {
            assert_eq!(outline(text), outline(&instruction), "{name}: {text}");
        }
        for text in unseen {
            match planner.parse(text, &library) {
                Ok(task) => {
                    assert_eq!(task.outline(), outline(&instruction), "{name}: {text}");
                    alike += 1;
                }
                Err(error) => missed.push(format!("{text}: {error}")),
            }
        }
    }
    // What the grammar was not written to may be refused, though less often than not; it is never read as another task.
    assert!(missed.len() <= alike, "{alike} alike, {} refused:\n{}", missed.len(), missed.join("\n"));
}

#[test]
fn the_planners_tests_say_what_the_scenarios_say() {
    let wordings: toml::Table = toml::from_str(include_str!("../../llm/planner/tests/wordings.toml")).unwrap();
    for (task, wordings) in &wordings {
        for variant in [task.clone(), format!("{task}-jittered")] {
            let scenario = Scenario::open(&format!("rmbench/{variant}")).unwrap();
            let said: Vec<&str> =
                [scenario.instruction()].into_iter().chain(scenario.paraphrases().iter().map(String::as_str)).collect();
            let told: Vec<&str> = wordings.as_array().unwrap().iter().filter_map(toml::Value::as_str).collect();
            assert_eq!(said, told, "{variant}");
        }
    }
}

#[test]
fn every_instruction_of_a_scenario_fits_the_form_in_which_a_model_answers() {
    let (planner, library) = (Planner::new().unwrap(), acm_memory::whole_library().unwrap());
    let mut read = 0;
    for name in Scenario::names() {
        let scenario = Scenario::open(&name).unwrap();
        for text in scenario.paraphrases() {
            let task = planner.parse(text, &library).unwrap();
            let prompt = planner.prompt(text, &library).unwrap();
            let answer = serde_json::to_value(planner.answer(&task)).unwrap();
            let reply = acm_llm::ChatReply::new(answer.to_string(), "test", "test");
            let request = acm_llm::ChatRequest {
                stage: "parse".into(),
                prompt: acm_llm::PromptId { id: prompt.id, version: prompt.version },
                system: prompt.system,
                turns: vec![acm_llm::Turn::user(prompt.user)],
                schema: prompt.schema,
                parameters: acm_llm::Parameters { max_output_tokens: prompt.max_output_tokens },
            };
            let mut dialogue = acm_llm::Dialogue::new(request, 0).unwrap();
            let understood =
                dialogue.take(&acm_llm::Answer::Reply(reply), |json| planner.understand(text, &library, json));
            assert_eq!(understood, acm_llm::Next::Accepted(task), "{name}: {text}");
            read += 1;
        }
    }
    assert!(read > 5, "{read} paraphrases");
}
