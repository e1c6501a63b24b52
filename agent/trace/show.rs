//! `acm trace show`: the messages of a run.

use super::{
    calls, decision,
    run_file::{Entry, RunFile},
};
use crate::cli::{Exit, trace::TraceShowArgs};
use anyhow::bail;
use std::{
    collections::{BTreeMap, BTreeSet},
    io::{self, Write},
};

/// Width of the table, columns.
const WIDTH: usize = 100;
/// From this length on, a series of two messages that take turns is one line.
pub(super) const FOLD_FROM: usize = 8;

/// Runs `acm trace show`.
pub fn run(args: &TraceShowArgs) -> anyhow::Result<Exit> {
    let run = RunFile::read(&args.file)?;
    let out = &mut std::io::stdout().lock();
    if let Some(seq) = args.seq {
        one(&run, seq, args.json, out)?;
        return Ok(Exit::Success);
    }
    let chosen = chosen(&run, args)?;
    if args.json {
        json(&run, &chosen, out)?;
        return Ok(Exit::Success);
    }
    title(&run, out)?;
    match args.step {
        Some(step) => decision::show(&run, step, out)?,
        None => table(&chosen, out)?,
    }
    if let Some(reason) = &run.cut {
        writeln!(out, "CUT: {reason}; what stands before is shown")?;
    }
    Ok(Exit::Success)
}

fn title(run: &RunFile, out: &mut impl Write) -> io::Result<()> {
    let about = |name| run.about(name);
    writeln!(
        out,
        "{} seed {}, {}, sensor {}   acm {} ({})   {} messages, {} bytes: {}",
        about("scenario"),
        about("seed"),
        about("method"),
        about("sensor"),
        about("version"),
        about("commit"),
        run.entries.len(),
        run.bytes,
        run.ending()
    )
}

/// The messages that the arguments ask for. A name that no message has is a mistake, and the known ones are told.
fn chosen<'a>(run: &'a RunFile, args: &TraceShowArgs) -> anyhow::Result<Vec<&'a Entry>> {
    let known = |what: &str, wanted: &Option<String>, names: BTreeSet<&str>| -> anyhow::Result<()> {
        let Some(wanted) = wanted else { return Ok(()) };
        if !names.contains(wanted.as_str()) && !run.entries.is_empty() {
            let names: Vec<&str> = names.into_iter().collect();
            bail!("no message of this run has {what} `{wanted}`; there are: {}", names.join(", "));
        }
        Ok(())
    };
    let ends = |entry: &'a Entry| [entry.header.from.as_str(), entry.header.to.as_str()];
    known("actor", &args.actor, run.entries.iter().flat_map(ends).collect())?;
    known("kind", &args.kind, run.entries.iter().map(|entry| entry.header.kind.as_str()).collect())?;
    let word = args.text.as_ref().map(|word| word.to_lowercase());
    let fits = |entry: &&Entry| {
        let header = &entry.header;
        args.actor.as_ref().is_none_or(|actor| *actor == header.from || *actor == header.to)
            && args.kind.as_ref().is_none_or(|kind| *kind == header.kind)
            && word.as_ref().is_none_or(|word| {
                entry.line.to_lowercase().contains(word)
                    || String::from_utf8_lossy(entry.raw()).to_lowercase().contains(word)
            })
    };
    Ok(run.entries.iter().filter(fits).collect())
}

/// The table. Long series of two messages that take turns, such as command and report, are one line.
fn table(entries: &[&Entry], out: &mut impl Write) -> io::Result<()> {
    writeln!(out, "{:>6} {:>8}  {:<22} {:<12} what", "seq", "t (s)", "from > to", "kind")?;
    let mut at = 0;
    while let Some(entry) = entries.get(at) {
        let length = series(entries.get(at..).unwrap_or_default());
        if length < FOLD_FROM {
            row(entry, out)?;
            at += 1;
            continue;
        }
        let last = entries.get(at + length - 1).unwrap_or(entry);
        folded(entry, entries.get(at + 1).unwrap_or(entry), last, length, out)?;
        at += length;
    }
    Ok(())
}

/// How many entries from the first one on follow each other and take turns in two forms.
pub(super) fn series(entries: &[&Entry]) -> usize {
    let form = |entry: &Entry| (entry.header.from.clone(), entry.header.to.clone(), entry.header.kind.clone());
    let follows = |at: usize| match (entries.get(at.wrapping_sub(1)), entries.get(at)) {
        (Some(before), Some(entry)) => entry.header.seq == before.header.seq + 1,
        _ => false,
    };
    let mut length = 1;
    while follows(length) {
        let again = match (entries.get(length.wrapping_sub(2)), entries.get(length)) {
            (Some(before), Some(entry)) => entry.header.kind == before.header.kind && form(entry) == form(before),
            _ => true,
        };
        if !again {
            break;
        }
        length += 1;
    }
    length
}

fn row(entry: &Entry, out: &mut impl Write) -> io::Result<()> {
    let header = &entry.header;
    let ends = format!("{} > {}", header.from, header.to);
    let text = format!("{:>6} {:>8.2}  {ends:<22} {:<12} {}", header.seq, entry.seconds(), header.kind, entry.line);
    writeln!(out, "{}", fitted(&text))
}

fn folded(first: &Entry, second: &Entry, last: &Entry, length: usize, out: &mut impl Write) -> io::Result<()> {
    let header = &first.header;
    let ends = format!("{} <> {}", header.from, header.to);
    let kinds = if header.kind == second.header.kind {
        header.kind.clone()
    } else {
        format!("{}, {}", header.kind, second.header.kind)
    };
    let text = format!(
        "{:>6} {:>8.2}  {ends:<22} {kinds}: {length} messages up to {} at {:.2} s; {}",
        header.seq,
        first.seconds(),
        last.header.seq,
        last.seconds(),
        last.line
    );
    writeln!(out, "{}", fitted(&text))
}

/// A line that fits the table: control characters become blanks, what is too long ends in dots.
fn fitted(text: &str) -> String {
    let plain = text.chars().map(|sign| if sign.is_control() { ' ' } else { sign });
    if text.chars().count() <= WIDTH {
        return plain.collect();
    }
    plain.take(WIDTH - 3).chain("...".chars()).collect()
}

/// One message in full, with what it changed in memory.
fn one(run: &RunFile, seq: u64, json: bool, out: &mut impl Write) -> anyhow::Result<()> {
    let entry = run.asked(seq)?;
    let record = entry.record()?;
    let deltas: Vec<_> = run.deltas.iter().filter(|delta| delta.seq == seq).collect();
    let states = run.states_before(seq);
    if json {
        let states: BTreeMap<_, _> = states.iter().map(|(actor, state)| (actor, &state.state)).collect();
        let all = serde_json::json!({
            "schema": "acm.trace-message/1", "message": record, "memory": deltas, "states_before": states
        });
        serde_json::to_writer_pretty(&mut *out, &all).map_err(io::Error::from)?;
        writeln!(out)?;
        return Ok(());
    }
    let cause = record.cause.map_or_else(|| "outside".into(), |cause| format!("message {cause}"));
    writeln!(
        out,
        "message {seq}: {} > {} {}   t {:.3} s, caused by {cause}",
        record.from,
        record.to,
        record.kind,
        entry.seconds()
    )?;
    writeln!(out, "{}", entry.line)?;
    for words in deltas.iter().filter_map(|delta| decision::delta_words(delta)) {
        writeln!(out, "memory: {words}")?;
    }
    for (actor, state) in states {
        let told = if actor == record.to { "kept before" } else { "kept" };
        writeln!(out, "{actor} {told}: {}", decision::shortened(&state.state))?;
    }
    if calls::tell(entry, out)? {
        return Ok(());
    }
    serde_json::to_writer_pretty(&mut *out, &record.body).map_err(io::Error::from)?;
    writeln!(out)?;
    Ok(())
}

fn json(run: &RunFile, entries: &[&Entry], out: &mut impl Write) -> anyhow::Result<()> {
    let messages: Vec<_> = entries.iter().map(|entry| entry.record()).collect::<Result<_, _>>()?;
    let all = serde_json::json!({
        "schema": "acm.trace/1",
        "run": run.about,
        "result": run.result,
        "cut": run.cut,
        "messages": messages,
    });
    serde_json::to_writer(&mut *out, &all).map_err(io::Error::from)?;
    writeln!(out)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(seq: u64, kind: &str) -> Entry {
        let record = serde_json::json!({
            "seq": seq, "cause": null, "episode": 1, "from": "a", "to": "b", "kind": kind, "t": seq, "body": null
        });
        Entry::parse(record.to_string().into_bytes()).expect("a record")
    }

    fn printed(kinds: &[&str]) -> Vec<String> {
        let entries: Vec<Entry> = kinds.iter().zip(1..).map(|(kind, seq)| entry(seq, kind)).collect();
        let mut out = Vec::new();
        table(&entries.iter().collect::<Vec<_>>(), &mut out).expect("memory takes everything");
        String::from_utf8_lossy(&out).lines().skip(1).map(str::to_owned).collect()
    }

    #[test]
    fn long_series_are_one_line_and_short_ones_are_not() {
        assert_eq!(printed(&["x"]).len(), 1);
        assert_eq!(printed(&["x", "y", "x", "y", "x", "y"]).len(), 6);
        let ticks = ["tick"; 40].iter().zip(["tock"; 40].iter()).flat_map(|(a, b)| [*a, *b]);
        let kinds: Vec<&str> = ["begin"].into_iter().chain(ticks).chain(["end"]).collect();
        let lines = printed(&kinds);
        assert_eq!(lines.len(), 3, "{lines:#?}");
        assert!(lines[1].contains("80 messages up to 81"), "{}", lines[1]);
    }

    #[test]
    fn lines_fit_the_table_and_hold_no_control_characters() {
        assert_eq!(fitted("a\u{1b}[2Jb"), "a [2Jb");
        let long = fitted(&"ä".repeat(200));
        assert!(long.chars().count() == WIDTH && long.ends_with("..."));
    }
}
