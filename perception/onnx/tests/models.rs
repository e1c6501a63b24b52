//! Models that a script makes, through ONNX Runtime. Needs `ORT_DYLIB_PATH` and a Python with `onnx` and `numpy`
//! (`ACM_ONNX_PYTHON`, or python3); says so and ends without them.
#![cfg(feature = "runtime")]
#![allow(clippy::unwrap_used, clippy::expect_used)] // A failed unwrap is a failed test.

use acm_onnx::{OnnxParamEstimator, OnnxSegmenter};
use acm_perception::tools::{
    Outcome, PartView, Request, Tools,
    conformance::{self, Fault, Trial},
};
use std::{
    path::{Path, PathBuf},
    process::Command,
    sync::Arc,
};

/// A folder with the models; `None`, said aloud, where they cannot be made or run.
fn models() -> Option<tempfile::TempDir> {
    if std::env::var_os("ORT_DYLIB_PATH").is_none() {
        eprintln!("skipped: ORT_DYLIB_PATH names no ONNX Runtime");
        return None;
    }
    let folder = tempfile::tempdir().unwrap();
    let python = std::env::var_os("ACM_ONNX_PYTHON").unwrap_or_else(|| "python3".into());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/make_models.py");
    match Command::new(python).arg(script).arg(folder.path()).output() {
        Ok(made) if made.status.success() => Some(folder),
        Ok(made) if String::from_utf8_lossy(&made.stderr).contains("ModuleNotFoundError") => {
            eprintln!("skipped: this Python has no `onnx`; name one that has in ACM_ONNX_PYTHON");
            None
        }
        Ok(made) => panic!("{}", String::from_utf8_lossy(&made.stderr)),
        Err(error) => {
            eprintln!("skipped: no Python ({error})");
            None
        }
    }
}

fn path(folder: &tempfile::TempDir, name: &str) -> PathBuf {
    folder.path().join(format!("{name}.onnx"))
}

fn tools(folder: &tempfile::TempDir, segmenter: &str) -> Tools {
    let segmenter = OnnxSegmenter::open(&path(folder, segmenter)).unwrap();
    Tools { segmenter: Some(Arc::new(segmenter)), ..Tools::default() }
}

#[test]
fn sound_models_conform_and_help() {
    let Some(folder) = models() else { return };
    let trial = Trial::new().unwrap();
    let estimator = Arc::new(OnnxParamEstimator::open(&path(&folder, "block")).unwrap());
    let tools = Tools { param_estimator: Some(estimator), ..tools(&folder, "segmenter") };
    let told = conformance::answers(&tools, &trial).unwrap();
    let words: Vec<(&str, &str)> = told.iter().map(|told| (told.asked, told.outcome.word())).collect();
    assert_eq!(words, [("segment", "ok"), ("params", "ok"), ("params", "abstain")]);
    conformance::unfit_requests(&tools, &trial).unwrap();
    let assisted = conformance::grounder(&trial).with_tools(tools).ground(&trial.frame, &Default::default());
    assert_eq!(assisted.percepts.objects.len(), 2);
    assert!(assisted.calls.iter().all(|call| call.meta.identity.model_digest.is_some()));
    assert!(assisted.calls.iter().all(|call| call.meta.identity.version == "3"));
}

#[test]
fn every_fault_of_a_model_ends_in_a_typed_outcome() {
    let Some(folder) = models() else { return };
    let trial = Trial::new().unwrap();
    for (model, fault) in [("nothing", Fault::Empty), ("nan", Fault::NotANumber), ("transposed", Fault::WrongSize)] {
        conformance::withstands(&tools(&folder, model), &trial, fault).unwrap();
    }
    // A model for images of one size says so itself.
    let request = Request { id: 1, frame: &trial.frame, limit: Tools::DEFAULT_LIMIT };
    let answer = tools(&folder, "fixed").segment(&request, &Default::default()).unwrap();
    assert!(matches!(answer.outcome, Outcome::Failed(_)), "{:?}", answer.outcome);
    let short = OnnxParamEstimator::open(&path(&folder, "short")).unwrap();
    let short = Tools { param_estimator: Some(Arc::new(short)), ..Tools::default() };
    let thing = &trial.things[0];
    let part = PartView { mask: &thing.mask, template: trial.template(thing), values: &thing.values };
    let answer = short.params(&request, &part, None).unwrap();
    assert!(answer.outcome.remark().unwrap().contains("sigmas"), "{:?}", answer.outcome);
}

#[test]
fn what_is_no_model_is_refused_in_a_line() {
    let Some(folder) = models() else { return };
    for (model, word) in
        [("garbage", "garbage.onnx"), ("truncated", "truncated.onnx"), ("none", "none.onnx"), ("block", "image")]
    {
        let error = OnnxSegmenter::open(&path(&folder, model)).err().unwrap().to_string();
        assert!(error.contains(word) && !error.contains('\n'), "{error}");
    }
    let error = OnnxParamEstimator::open(&path(&folder, "nameless")).err().unwrap().to_string();
    assert!(error.contains("names no template"), "{error}");
}

/// Set in the process that a test starts of itself.
const INNER: &str = "ACM_ONNX_INNER";

#[test]
fn a_missing_library_is_told_in_a_line() {
    if let Some(model) = std::env::var_os(INNER) {
        let error = OnnxSegmenter::open(Path::new(&model)).err().unwrap();
        println!("told: {error}");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let model = path(&folder, "any");
    std::fs::write(&model, b"any").unwrap();
    for (library, word) in [("", "ORT_DYLIB_PATH is not set"), ("/no/such/lib.so", "/no/such/lib.so")] {
        let mut inner = Command::new(std::env::current_exe().unwrap());
        inner.args(["--exact", "a_missing_library_is_told_in_a_line", "--nocapture"]);
        let output = inner.env(INNER, &model).env("ORT_DYLIB_PATH", library).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        let told = text.lines().find(|line| line.contains("told: ")).unwrap_or_else(|| panic!("{text}"));
        assert!(output.status.success() && told.contains(word), "{text}");
    }
}
