//! A backend that answers by the rules of a file: for tests, and for faults that no real model makes on demand.

use crate::{
    backend::{Backend, Reply},
    chat::{CallError, ChatReply, ChatRequest, EndReason, Turn, Usage, shortened},
    file::{self, FileError},
};
use serde::Deserialize;
use serde_json::Value;
use std::{
    path::Path,
    sync::{Arc, Mutex, PoisonError},
    time::Duration,
};

/// Most rules of a script.
const MAX_RULES: usize = 10_000;
/// Longest delay of an answer.
const MAX_DELAY_MS: u64 = 3_600_000;
/// How much of a request is told where no rule fits, characters.
const MAX_TOLD: usize = 80;

/// The rules of a file.
#[derive(Debug, PartialEq)]
pub struct Script {
    name: String,
    model: String,
    rules: Vec<Rule>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawScript {
    #[serde(default = "unnamed")]
    model: String,
    #[serde(default)]
    rule: Vec<RawRule>,
}

fn unnamed() -> String {
    "scripted".into()
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRule {
    stage: Option<String>,
    #[serde(default)]
    last: Vec<String>,
    #[serde(default)]
    any: Vec<String>,
    #[serde(default)]
    once: bool,
    text: Option<String>,
    json: Option<Value>,
    error: Option<CallError>,
    reasoning: Option<String>,
    #[serde(default)]
    usage: Usage,
    #[serde(default)]
    end: EndReason,
    #[serde(default)]
    delay_ms: u64,
}

/// One rule.
#[derive(Debug, Clone, PartialEq)]
struct Rule {
    stage: Option<String>,
    /// Texts that must all stand in the last turn, in lower case.
    last: Vec<String>,
    /// Texts each of which must stand in some turn, in lower case.
    any: Vec<String>,
    once: bool,
    delay: Duration,
    answer: Result<ChatReply, CallError>,
}

impl Script {
    /// Reads a script: JSON lines, a rule each, where the file's name ends in `.jsonl`, else TOML.
    ///
    /// # Errors
    /// The file cannot be read or is no script.
    pub fn read(path: &Path) -> Result<Script, FileError> {
        Script::parse(&path.display().to_string(), &file::read(path)?)
    }

    /// A script from the text of a file of this name.
    ///
    /// # Errors
    /// The text is no script.
    pub fn parse(name: &str, text: &str) -> Result<Script, FileError> {
        let (model, raw) = if name.ends_with(".jsonl") {
            let rule = |(line, text)| match serde_json::from_str::<RawRule>(text) {
                Ok(rule) => Ok((Some(line), rule)),
                Err(error) => Err(FileError::new(name, Some(line), error)),
            };
            (unnamed(), file::lines(text).take(MAX_RULES + 1).map(rule).collect::<Result<Vec<_>, _>>()?)
        } else {
            let line = |at: usize| 1 + text.get(..at).map_or(0, |before| before.matches('\n').count());
            let failed = |error: toml::de::Error| {
                FileError::new(name, error.span().map(|span| line(span.start)), error.message())
            };
            let raw: RawScript = toml::from_str(text).map_err(failed)?;
            (raw.model, raw.rule.into_iter().map(|rule| (None, rule)).collect())
        };
        if raw.is_empty() || raw.len() > MAX_RULES {
            return Err(FileError::new(name, None, format!("a script has 1 to {MAX_RULES} rules")));
        }
        let rules = raw.into_iter().zip(1..).map(|((line, raw), number)| {
            raw.rule(&model).map_err(|reason| FileError::new(name, line, format!("rule {number}: {reason}")))
        });
        Ok(Script { name: name.into(), rules: rules.collect::<Result<_, _>>()?, model })
    }

    /// A model that answers by these rules, none of them used yet.
    pub fn backend(self: &Arc<Self>) -> Scripted {
        Scripted { used: Mutex::new(vec![false; self.rules.len()]), script: Arc::clone(self) }
    }
}

impl RawRule {
    fn rule(self, model: &str) -> Result<Rule, String> {
        if self.delay_ms > MAX_DELAY_MS {
            return Err(format!("`delay_ms` = {} is more than {MAX_DELAY_MS}", self.delay_ms));
        }
        let text = match (self.text, self.json, &self.error) {
            (Some(text), None, None) => Some(text),
            (None, Some(json), None) => Some(json.to_string()),
            (None, None, Some(_)) => None,
            _ => return Err("it needs one of `text`, `json` and `error`".into()),
        };
        let answer = match (text, self.error) {
            (Some(text), _) => Ok(ChatReply {
                reasoning: self.reasoning,
                usage: self.usage,
                end: self.end,
                ..ChatReply::new(text, "scripted", model)
            }),
            (None, Some(error)) => Err(error),
            (None, None) => return Err("it has no answer".into()),
        };
        let lower = |texts: Vec<String>| texts.into_iter().map(|text| text.to_lowercase()).collect();
        Ok(Rule {
            stage: self.stage,
            last: lower(self.last),
            any: lower(self.any),
            once: self.once,
            delay: Duration::from_millis(self.delay_ms),
            answer,
        })
    }
}

impl Rule {
    fn fits(&self, request: &ChatRequest) -> bool {
        let text = |turn: &Turn| turn.text().to_lowercase();
        let last = request.turns.last().map(text).unwrap_or_default();
        self.stage.as_ref().is_none_or(|stage| *stage == request.stage)
            && self.last.iter().all(|wanted| last.contains(wanted))
            && self.any.iter().all(|wanted| request.turns.iter().any(|turn| text(turn).contains(wanted)))
    }
}

/// A model that answers by rules. The first rule that fits and is not used up answers.
#[derive(Debug)]
pub struct Scripted {
    script: Arc<Script>,
    used: Mutex<Vec<bool>>,
}

impl Scripted {
    fn choose(&self, request: &ChatRequest) -> Result<Rule, CallError> {
        let mut used = self.used.lock().unwrap_or_else(PoisonError::into_inner);
        let mut rules = self.script.rules.iter().zip(used.iter_mut());
        match rules.find(|(rule, used)| !(rule.once && **used) && rule.fits(request)) {
            Some((rule, used)) => {
                *used = true;
                Ok(rule.clone())
            }
            None => Err(CallError::NoRule {
                script: self.script.name.clone(),
                stage: request.stage.clone(),
                last: shortened(&request.turns.last().map(Turn::text).unwrap_or_default(), MAX_TOLD),
            }),
        }
    }
}

impl Backend for Scripted {
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        Box::pin(async move {
            let rule = self.choose(request)?;
            if !rule.delay.is_zero() {
                tokio::time::sleep(rule.delay).await;
            }
            rule.answer
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chat::tests::request;

    fn asked(backend: &Scripted, words: &str) -> Result<String, CallError> {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        runtime.block_on(backend.chat(&request(words))).map(|reply| reply.text)
    }

    fn script(name: &str, text: &str) -> Arc<Script> {
        Arc::new(Script::parse(name, text).unwrap())
    }

    #[test]
    fn the_first_rule_that_fits_answers_and_a_used_one_does_not() {
        let toml = "model = 'm'\n[[rule]]\nlast = ['Cube']\nonce = true\ntext = 'first'\n\
            [[rule]]\nstage = 'parse'\nlast = ['cube']\njson = { a = [1] }\n\
            [[rule]]\nstage = 'other'\ntext = 'never'\n";
        let lines = "{\"last\": [\"cube\"], \"once\": true, \"text\": \"first\"}\n\n{\"json\": {\"a\": [1]}, \"any\": [\"CUBE\"]}";
        for script in [script("a.toml", toml), script("a.jsonl", lines)] {
            let backend = script.backend();
            assert_eq!(asked(&backend, "take the cube"), Ok("first".into()));
            assert_eq!(asked(&backend, "take the cube"), Ok("{\"a\":[1]}".into()));
            let missed = asked(&backend, "press").unwrap_err();
            assert!(matches!(&missed, CallError::NoRule { last, .. } if last == "press"), "{missed}");
            // Another one begins with all rules unused.
            assert_eq!(asked(&script.backend(), "take the cube"), Ok("first".into()));
        }
    }

    #[test]
    fn an_error_can_be_scripted() {
        let text = "[[rule]]\nerror = { kind = 'rate-limited', retry_after_ms = 5 }\n";
        let error = asked(&script("a.toml", text).backend(), "x").unwrap_err();
        assert_eq!(error, CallError::RateLimited { retry_after_ms: Some(5) });
    }

    #[test]
    fn what_is_no_script_is_told_in_one_line_with_its_place() {
        for (name, text, parts) in [
            ("a.toml", "[[rule]]\ntext = 'x'\nlats = ['y']\n", &["a.toml", "line 3", "lats"][..]),
            ("a.toml", "[[rule]]\ntext = 'x'\njson = 1\n", &["a.toml", "rule 1", "`text`, `json` and `error`"]),
            ("a.toml", "", &["a.toml", "1 to"]),
            ("a.toml", "[[rule]]\ntext = 'x'\ndelay_ms = 99999999\n", &["rule 1", "delay_ms"]),
            ("a.jsonl", "{\"text\": \"x\"}\n{\"text\": 1}\n", &["a.jsonl", "line 2"]),
            ("a.jsonl", "\n{\"once\": true}\n", &["a.jsonl", "line 2", "`text`"]),
        ] {
            let error = Script::parse(name, text).unwrap_err().to_string();
            assert!(parts.iter().all(|part| error.contains(part)) && error.lines().count() == 1, "{error}");
        }
        assert!(Script::read(Path::new("no-such.toml")).unwrap_err().to_string().contains("no-such.toml"));
    }
}
