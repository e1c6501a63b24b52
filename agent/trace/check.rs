//! `acm trace check`: rules that a run must keep, for tests that outlive the run.

use super::run_file::{Entry, RunFile};
use crate::cli::{Exit, trace::TraceCheckArgs};
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::{collections::BTreeMap, path::Path};

/// Largest file of rules that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Runs `acm trace check`.
pub fn run(args: &TraceCheckArgs) -> anyhow::Result<Exit> {
    let rules = Rules::read(&args.rules)?;
    let run = RunFile::read(&args.file)?;
    if let Some(cut) = &run.cut {
        bail!("{}: {cut}; rules are about whole runs, `acm trace repair` makes one of it", args.file.display());
    }
    let findings = rules.check(&run);
    if args.json {
        println!("{}", serde_json::to_string_pretty(&findings)?);
    } else {
        for finding in &findings {
            match &finding.broken {
                None => println!("ok      {}", finding.rule),
                Some(why) => println!("BROKEN  {}: {why}", finding.rule),
            }
        }
    }
    let broken = findings.iter().any(|finding| finding.broken.is_some());
    Ok(if broken { Exit::Failed } else { Exit::Success })
}

/// The rules of a file, `docs/trace.md`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rules {
    /// The rules.
    rule: Vec<Rule>,
}

/// One rule. It has one of `never`, `count` and `each`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Rule {
    name: String,
    /// No message is like this.
    never: Option<Selector>,
    /// So many messages are like this.
    count: Option<Selector>,
    at_least: Option<usize>,
    at_most: Option<usize>,
    /// After each message like this comes one like `then`, before the next one like it and within so many messages.
    each: Option<Selector>,
    then: Option<Selector>,
    within: Option<u64>,
}

/// Messages that are alike. What is not named may be anything.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Selector {
    kind: Option<String>,
    from: Option<String>,
    to: Option<String>,
    /// A word of its line.
    text: Option<String>,
    /// JSON pointers into the body and the values that stand there.
    #[serde(default)]
    body: BTreeMap<String, Value>,
}

/// What came of a rule.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// The rule's name.
    pub rule: String,
    /// How it is broken, if it is.
    pub broken: Option<String>,
}

impl Rules {
    /// Reads rules.
    ///
    /// # Errors
    /// The file cannot be read, or is malformed: what and where.
    pub fn read(path: &Path) -> anyhow::Result<Rules> {
        let name = path.display();
        let about = std::fs::metadata(path).with_context(|| format!("the rules {name} cannot be read"))?;
        if about.len() > MAX_BYTES {
            bail!("the rules {name} have {} bytes, at most {MAX_BYTES} are read", about.len());
        }
        let text = std::fs::read_to_string(path).with_context(|| format!("the rules {name} cannot be read"))?;
        Rules::parse(&text).with_context(|| format!("the rules {name} are malformed"))
    }

    fn parse(text: &str) -> anyhow::Result<Rules> {
        let rules: Rules = toml::from_str(text)?;
        if rules.rule.is_empty() {
            bail!("there is no `[[rule]]`");
        }
        rules.rule.iter().try_for_each(Rule::is_sound)?;
        Ok(rules)
    }

    /// Holds a run against the rules.
    pub fn check(&self, run: &RunFile) -> Vec<Finding> {
        self.rule.iter().map(|rule| Finding { rule: rule.name.clone(), broken: rule.broken(run) }).collect()
    }
}

impl Rule {
    fn is_sound(&self) -> anyhow::Result<()> {
        let (name, kinds) = (&self.name, [&self.never, &self.count, &self.each]);
        if kinds.into_iter().flatten().count() != 1 {
            bail!("the rule `{name}` needs one of `never`, `count` and `each`");
        }
        let (bounded, followed) = (self.at_least.is_some() || self.at_most.is_some(), self.then.is_some());
        if self.count.is_some() != bounded {
            bail!("the rule `{name}`: `count` goes with `at_least` or `at_most`");
        }
        if self.each.is_some() != followed || (self.within.is_some() && !followed) {
            bail!("the rule `{name}`: `each` goes with `then`, and `within` with both");
        }
        Ok(())
    }

    fn broken(&self, run: &RunFile) -> Option<String> {
        let at = |entry: &Entry| format!("message {} at {:.2} s: {}", entry.header.seq, entry.seconds(), entry.line);
        if let Some(never) = &self.never {
            return run.entries.iter().find(|entry| never.fits(entry)).map(at);
        }
        if let Some(count) = &self.count {
            let found = run.entries.iter().filter(|entry| count.fits(entry)).count();
            let (least, most) = (self.at_least.unwrap_or(0), self.at_most.unwrap_or(usize::MAX));
            return (!(least..=most).contains(&found)).then(|| match most {
                usize::MAX => format!("{found} messages, at least {least} are asked for"),
                _ => format!("{found} messages, {least} to {most} are asked for"),
            });
        }
        let (each, then) = (self.each.as_ref()?, self.then.as_ref()?);
        let firsts: Vec<usize> = (0..run.entries.len()).filter(|&index| each.fits(&run.entries[index])).collect();
        let ends = firsts.iter().skip(1).copied().chain([run.entries.len()]);
        firsts.iter().zip(ends).find_map(|(&first, end)| {
            let entry = run.entries.get(first)?;
            let last = self.within.map_or(u64::MAX, |within| entry.header.seq.saturating_add(within));
            let later = run.entries.get(first + 1..end).unwrap_or_default();
            let followed = later.iter().any(|later| later.header.seq <= last && then.fits(later));
            (!followed).then(|| format!("nothing follows {}", at(entry)))
        })
    }
}

impl Selector {
    fn fits(&self, entry: &Entry) -> bool {
        let header = &entry.header;
        let same = |wanted: &Option<String>, is: &str| wanted.as_ref().is_none_or(|wanted| wanted == is);
        let named = same(&self.kind, &header.kind) && same(&self.from, &header.from) && same(&self.to, &header.to);
        let worded = || self.text.as_ref().is_none_or(|word| entry.line.contains(word.as_str()));
        let holds = || {
            let Ok(record) = entry.record() else { return false };
            self.body.iter().all(|(pointer, value)| record.body.pointer(pointer) == Some(value))
        };
        named && worded() && (self.body.is_empty() || holds())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    fn run() -> RunFile {
        let line = |(seq, kind, body): (u64, &str, &str)| {
            let text = format!(
                r#"{{"seq":{seq},"cause":null,"episode":1,"from":"a","to":"b","kind":"{kind}","t":{seq},"body":{body}}}"#
            );
            Entry::parse(text.into_bytes()).unwrap()
        };
        let messages =
            [(1, "execute", r#"{"skill":"open"}"#), (2, "verdict", "{}"), (3, "execute", r#"{"skill":"pick"}"#)];
        RunFile { entries: messages.into_iter().map(line).collect(), ..RunFile::default() }
    }

    fn broken(rule: &str) -> Option<String> {
        let rules = Rules::parse(&format!("[[rule]]\nname = 'r'\n{rule}")).unwrap();
        rules.check(&run()).remove(0).broken
    }

    #[test]
    fn rules_hold_or_name_the_message() {
        assert_eq!(broken("never = { kind = 'execute', body = { '/skill' = 'press' } }"), None);
        assert!(broken("never = { body = { '/skill' = 'open' } }").unwrap().contains("message 1"));
        assert_eq!(broken("count = { kind = 'execute' }\nat_most = 2"), None);
        assert!(broken("count = { kind = 'execute' }\nat_least = 3").unwrap().contains("2 messages"));
        assert!(broken("each = { kind = 'execute' }\nthen = { kind = 'verdict' }").unwrap().contains("message 3"));
        assert_eq!(broken("each = { body = { '/skill' = 'open' } }\nthen = { kind = 'verdict' }\nwithin = 1"), None);
    }

    #[test]
    fn rules_that_say_nothing_are_refused() {
        for bad in ["", "never = {}\ncount = {}", "count = {}", "each = {}", "never = {}\nwithin = 2", "nevr = {}"] {
            assert!(Rules::parse(&format!("[[rule]]\nname = 'r'\n{bad}")).is_err(), "{bad}");
        }
        assert!(Rules::parse("rule = []").is_err());
    }
}
