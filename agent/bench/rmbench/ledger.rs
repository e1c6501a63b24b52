//! The file of results: one JSON line an episode, appended as soon as it ended.

use super::{
    plan::{Job, Plan},
    record::Record,
};
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::{
    collections::BTreeMap,
    fs::{File, OpenOptions, TryLockError},
    io::{Read, Seek, SeekFrom, Write},
    path::{Path, PathBuf},
};

/// Largest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 30;
/// What the first line says of the file's form.
const SCHEMA: &str = "acm.rmbench/1";

/// The first line: by what the records were made.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    schema: String,
    program: String,
    sensor: String,
    robot: Option<String>,
}

/// The records of a folder. One process at a time writes them.
#[derive(Debug)]
pub struct Ledger {
    path: PathBuf,
    file: File,
    records: BTreeMap<Job, Record>,
}

impl Ledger {
    /// Opens or begins the records of a folder. A last line that was not finished is dropped, which is said.
    ///
    /// # Errors
    /// They were made by another program, with another robot or sensor, or from another scenario file than this one's; the
    /// file is damaged; or another process writes it.
    pub fn open(dir: &Path, plan: &Plan) -> anyhow::Result<Ledger> {
        let path = dir.join("results.jsonl");
        let shown = path.display().to_string();
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(&path).context(shown.clone())?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                bail!("{shown}: another process writes it; wait for it or give another --out")
            }
            Err(TryLockError::Error(error)) => return Err(error).context(shown),
        }
        if file.metadata()?.len() > MAX_BYTES {
            bail!("{shown}: larger than {MAX_BYTES} bytes; give another --out");
        }
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).context(shown.clone())?;
        let whole = bytes.iter().rposition(|byte| *byte == b'\n').map_or(0, |at| at + 1);
        if whole < bytes.len() {
            eprintln!("{shown}: the last line was not finished and is dropped; its episode is run again");
            file.set_len(whole as u64).context(shown.clone())?;
            file.seek(SeekFrom::End(0))?;
        }
        let head = Head {
            schema: SCHEMA.into(),
            program: plan.program.clone(),
            sensor: plan.sensor.clone(),
            robot: plan.robot.clone(),
        };
        let mut ledger = Ledger { path, file, records: BTreeMap::new() };
        let text =
            std::str::from_utf8(&bytes[..whole]).with_context(|| format!("{shown} is no text; give another --out"))?;
        let mut lines = text.lines().zip(1u32..);
        match lines.next() {
            None => ledger.write(&head)?,
            Some((line, _)) => {
                ledger.check(&serde_json::from_str(line).with_context(|| format!("{shown}, line 1"))?, &head)?
            }
        }
        for (line, number) in lines {
            let record: Record = serde_json::from_str(line).with_context(|| format!("{shown}, line {number}"))?;
            if let Some((_, digest)) = plan.scenario(&record.scenario).filter(|(_, digest)| *digest != record.digest) {
                bail!(
                    "{shown}, line {number}: {} was {} then and is {digest} now: the scenario has changed, give another --out",
                    record.scenario,
                    record.digest
                );
            }
            ledger.records.insert(record.job(), record);
        }
        Ok(ledger)
    }

    fn check(&self, found: &Head, wanted: &Head) -> anyhow::Result<()> {
        let none = || "the tasks' own".to_owned();
        let settings = [
            ("format", found.schema.clone(), wanted.schema.clone()),
            ("program", found.program.clone(), wanted.program.clone()),
            ("sensor", found.sensor.clone(), wanted.sensor.clone()),
            ("robot", found.robot.clone().unwrap_or_else(none), wanted.robot.clone().unwrap_or_else(none)),
        ];
        if let Some((what, then, now)) = settings.into_iter().find(|(_, then, now)| then != now) {
            let path = self.path.display();
            bail!("{path}: its {what} was `{then}` and is `{now}` now: results are not mixed, give another --out");
        }
        Ok(())
    }

    /// All records, those that this plan does not ask for among them.
    pub fn records(&self) -> &BTreeMap<Job, Record> {
        &self.records
    }
    /// How many of the episodes that are asked for were run.
    pub fn run_of(&self, plan: &Plan) -> usize {
        plan.asked().iter().filter(|job| self.records.contains_key(job)).count()
    }
    /// Keeps a record: it is in the file before this returns.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn add(&mut self, record: Record) -> anyhow::Result<()> {
        self.write(&record)?;
        self.records.insert(record.job(), record);
        Ok(())
    }

    fn write(&mut self, line: &impl Serialize) -> anyhow::Result<()> {
        let mut text = serde_json::to_string(line)?;
        text.push('\n');
        let written = self.file.write_all(text.as_bytes()).and_then(|()| self.file.sync_data());
        written.with_context(|| format!("{} cannot be written", self.path.display()))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, reason = "a failed step is a failed test")]
    use super::*;
    use crate::cli::{BenchCommand, Cli, Command, RmbenchArgs};
    use clap::Parser;

    fn plan(more: &[&str]) -> Plan {
        let words = ["acm", "bench", "rmbench", "--tasks", "put-back-block", "--memories", "acm", "--seeds", "2"];
        let cli = Cli::try_parse_from(words.iter().chain(more)).unwrap();
        let Command::Bench(BenchCommand::Rmbench(args)) = cli.command else { panic!("{words:?}") };
        let args: RmbenchArgs = args;
        Plan::new(&args).unwrap()
    }
    fn crash(plan: &Plan, number: usize) -> Record {
        let job = &plan.asked()[number];
        Record::new(job, plan.scenario(&job.scenario).unwrap().1, Err("a test has no world".into()))
    }
    fn refusal(dir: &Path, plan: &Plan) -> String {
        format!("{:#}", Ledger::open(dir, plan).expect_err("it must be refused"))
    }

    #[test]
    fn what_was_run_is_there_again_and_a_torn_line_is_dropped() {
        let (dir, plan) = (tempfile::tempdir().unwrap(), plan(&[]));
        let mut ledger = Ledger::open(dir.path(), &plan).unwrap();
        ledger.add(crash(&plan, 0)).unwrap();
        ledger.add(crash(&plan, 1)).unwrap();
        assert!(refusal(dir.path(), &plan).contains("another process"));
        drop(ledger);
        let path = dir.path().join("results.jsonl");
        let text = std::fs::read_to_string(&path).unwrap();
        for cut in [text.len() - 1, text.len() - 40] {
            std::fs::write(&path, &text[..cut]).unwrap();
            let mut ledger = Ledger::open(dir.path(), &plan).unwrap();
            assert_eq!(ledger.run_of(&plan), 1, "cut at {cut}");
            ledger.add(crash(&plan, 1)).unwrap();
            drop(ledger);
            assert_eq!(std::fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(Ledger::open(dir.path(), &plan).unwrap().run_of(&plan), 2);
    }

    #[test]
    fn results_of_other_settings_are_refused_in_a_sentence() {
        let (dir, own) = (tempfile::tempdir().unwrap(), plan(&[]));
        let mut ledger = Ledger::open(dir.path(), &own).unwrap();
        ledger.add(Record { digest: "0123".into(), ..crash(&own, 0) }).unwrap();
        drop(ledger);
        assert!(
            refusal(dir.path(), &plan(&["--robot", "panda"]))
                .contains("its robot was `the tasks' own` and is `panda` now")
        );
        assert!(refusal(dir.path(), &plan(&["--sensor", "none"])).contains("its sensor was `d435`"));
        let mut later = plan(&[]);
        later.program = "9.9".into();
        assert!(refusal(dir.path(), &later).contains("its program was"));
        assert!(refusal(dir.path(), &own).contains("the scenario has changed"));
        std::fs::write(dir.path().join("results.jsonl"), "no json\n").unwrap();
        assert!(refusal(dir.path(), &own).contains("line 1"));
    }
}
