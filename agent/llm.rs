//! `--llm`: which language model is asked, if any.

pub mod check;
pub mod list;

use acm_actors::settings::{Signal, Stage};
use acm_llm::{
    Backend, CallError, Cassette, ChatRequest, LlmConfig, Reply, Route, Script, Server,
    config::{DEFAULT, Limits, RULES, suggestion},
};
use anyhow::{Context, bail};
use std::{collections::BTreeMap, convert::Infallible, fmt, path::PathBuf, str::FromStr, sync::Arc};

/// What a model may be asked for.
pub const STAGES: [&str; 3] = [Stage::Parse.name(), Stage::Select.name(), Stage::Reflect.name()];
/// The variable that names a model where `--llm` does not.
const VARIABLE: &str = "ACM_LLM";

/// A model as `--llm` names it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum LlmId {
    /// None: the rules read instructions.
    #[default]
    Rules,
    /// One that answers by the rules of a file.
    Scripted(PathBuf),
    /// One that answers as was recorded in a cassette.
    Replay(PathBuf),
    /// A backend of the configuration.
    Backend(String),
}

impl fmt::Display for LlmId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            LlmId::Rules => f.write_str(RULES),
            LlmId::Scripted(file) => write!(f, "scripted={}", file.display()),
            LlmId::Replay(file) => write!(f, "replay={}", file.display()),
            LlmId::Backend(id) => f.write_str(id),
        }
    }
}

impl FromStr for LlmId {
    type Err = Infallible;
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(match text.split_once('=') {
            None if text == RULES => LlmId::Rules,
            Some(("scripted", file)) if !file.is_empty() => LlmId::Scripted(file.into()),
            Some(("replay", file)) if !file.is_empty() => LlmId::Replay(file.into()),
            // Whether there is such a one is for the configuration to say.
            _ => LlmId::Backend(text.into()),
        })
    }
}

/// Which model is asked: what the command line says, else the variable `ACM_LLM`, else the configuration.
pub fn chosen(said: Option<&LlmId>, config: &LlmConfig) -> LlmId {
    let read = |text: &str| text.parse::<LlmId>().unwrap_or_else(|never| match never {});
    let variable = || std::env::var(VARIABLE).ok().filter(|text| !text.is_empty()).map(|text| read(&text));
    said.cloned().or_else(variable).or_else(|| config.default.as_deref().map(read)).unwrap_or_default()
}

/// A model whose files are read. Each episode has one of its own, with nothing used up.
#[derive(Debug, Clone)]
pub enum Llm {
    /// See [`LlmId::Scripted`].
    Script(Arc<Script>),
    /// See [`LlmId::Replay`].
    Cassette(Arc<Cassette>),
    /// Servers of the configuration.
    Servers(Servers),
    /// Made anew for each episode.
    Made(Maker),
    /// A recorded one up to a signal, then another one; the rules alone if there is none.
    Fork {
        /// What was recorded.
        before: Arc<Cassette>,
        /// The other one.
        after: Option<Box<Llm>>,
        /// From when on.
        from: Signal,
    },
}

/// How a model is made.
#[derive(Clone)]
pub struct Maker(Arc<dyn Fn() -> Arc<dyn Backend> + Send + Sync>);

impl fmt::Debug for Maker {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Maker")
    }
}

/// Servers with the chain of each stage. What they learn is kept from one episode to the next, what is spent is not.
#[derive(Debug, Clone)]
pub struct Servers {
    servers: BTreeMap<String, Arc<Server>>,
    chains: BTreeMap<String, Vec<String>>,
    limits: Limits,
}

impl Llm {
    /// Reads a model's files, or the keys of its servers; `None` where the rules decide alone. `stages` are those at which
    /// a model is asked, if that is said; else the configuration says it.
    ///
    /// # Errors
    /// A file cannot be read or is not what it should be; the configuration has no such backend, or a key is missing.
    pub fn open(id: &LlmId, config: &LlmConfig, stages: Option<&[Stage]>) -> anyhow::Result<Option<Llm>> {
        let default = match id {
            LlmId::Scripted(file) => return Ok(Some(Llm::Script(Arc::new(Script::read(file)?)))),
            LlmId::Replay(file) => return Ok(Some(Llm::Cassette(Arc::new(Cassette::read(file)?)))),
            LlmId::Rules => None,
            LlmId::Backend(id) => Some(known(id, config)?),
        };
        let chains = chains(default, config, stages);
        if chains.is_empty() {
            return Ok(None);
        }
        let mut servers = BTreeMap::new();
        for id in chains.values().flatten() {
            if !servers.contains_key(id) {
                servers.insert(id.clone(), Arc::new(server(id, config)?));
            }
        }
        Ok(Some(Llm::Servers(Servers { servers, chains, limits: config.limits })))
    }

    /// A model that is made anew for each episode.
    pub fn made(make: impl Fn() -> Arc<dyn Backend> + Send + Sync + 'static) -> Llm {
        Llm::Made(Maker(Arc::new(make)))
    }

    /// The stages at which it is asked; files say nothing of them.
    pub fn stages(&self) -> Option<Vec<Stage>> {
        match self {
            Llm::Servers(servers) => {
                Some(Stage::ALL.into_iter().filter(|stage| servers.chains.contains_key(stage.name())).collect())
            }
            Llm::Script(_) | Llm::Cassette(_) | Llm::Made(_) | Llm::Fork { .. } => None,
        }
    }

    /// The name of the backend that is asked first, where it has one.
    pub fn first(&self) -> Option<String> {
        match self {
            Llm::Servers(servers) => servers.chains.values().flatten().next().cloned(),
            Llm::Script(_) | Llm::Cassette(_) | Llm::Made(_) | Llm::Fork { .. } => None,
        }
    }

    /// The model, for one episode.
    pub fn backend(&self) -> Arc<dyn Backend> {
        match self {
            Llm::Script(script) => Arc::new(script.backend()),
            Llm::Cassette(cassette) => Arc::new(cassette.backend()),
            Llm::Servers(servers) => Arc::new(servers.route()),
            Llm::Made(Maker(make)) => make(),
            Llm::Fork { before, after, from } => Arc::new(Forked {
                before: Arc::new(before.backend()),
                after: after.as_ref().map(|after| after.backend()),
                from: from.clone(),
            }),
        }
    }
}

impl Servers {
    fn route(&self) -> Route {
        let named = |id: &String| Some((id.clone(), Arc::clone(self.servers.get(id)?) as Arc<dyn Backend>));
        let chain = |ids: &Vec<String>| ids.iter().filter_map(named).collect();
        Route::new(self.chains.iter().map(|(stage, ids)| (stage.clone(), chain(ids))).collect(), self.limits)
    }
}

/// The name of a backend that is there.
fn known<'a>(id: &'a str, config: &LlmConfig) -> anyhow::Result<&'a str> {
    if config.backend.contains_key(id) {
        return Ok(id);
    }
    let names: Vec<&str> = config.backend.keys().map(String::as_str).collect();
    bail!(
        "there is no language model `{id}`{}; write rules, scripted=FILE, replay=FILE, or a backend of the \
         configuration (--config FILE, else ./acm.toml)",
        suggestion(id, &names)
    )
}

/// The backends of each stage that has one, in the order in which they are asked. `rules` ends a chain.
fn chains(default: Option<&str>, config: &LlmConfig, stages: Option<&[Stage]>) -> BTreeMap<String, Vec<String>> {
    let chain = |stage: Stage| {
        let named = config.stages.get(stage.name()).map(String::as_str);
        let wanted = match stages {
            Some(stages) => stages.contains(&stage),
            None => stage == Stage::Parse || named.is_some(),
        };
        let first = match named {
            _ if !wanted => None,
            Some(DEFAULT) | None => default,
            Some(RULES) => None,
            Some(id) => Some(id),
        }?;
        let rest = config.fallback.iter().map(String::as_str).take_while(|id| *id != RULES);
        let mut ids = vec![first.to_owned()];
        ids.extend(rest.filter(|id| *id != first).map(str::to_owned));
        Some((stage.name().to_owned(), ids))
    };
    Stage::ALL.into_iter().filter_map(chain).collect()
}

/// A server of the configuration, with its key.
///
/// # Errors
/// There is no such one, or its key is missing.
pub fn server(id: &str, config: &LlmConfig) -> anyhow::Result<Server> {
    let backend = config.backend.get(known(id, config)?).context("the backend was just there")?;
    let variables = |name: &str| std::env::var(name).ok();
    // Processes that were told to wait at the same moment do not come back at the same moment.
    let seed = u64::from(std::process::id());
    backend.open(&variables, config.limits.call(), seed).with_context(|| format!("the language model `{id}`"))
}

struct Forked {
    before: Arc<dyn Backend>,
    after: Option<Arc<dyn Backend>>,
    from: Signal,
}

impl Backend for Forked {
    fn chat<'a>(&'a self, request: &'a ChatRequest) -> Reply<'a> {
        match &self.after {
            _ if !self.from.is_given() => self.before.chat(request),
            Some(after) => after.chat(request),
            None => Box::pin(async {
                Err(CallError::Unreachable { reason: "the fork goes on with the rules alone".into() })
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed unwrap is the test's verdict
    use super::*;

    #[test]
    fn models_are_named_and_others_are_refused_with_a_list() {
        for text in ["rules", "scripted=a/b.toml", "replay=c=d.jsonl", "gpt"] {
            assert_eq!(text.parse::<LlmId>().unwrap().to_string(), text);
        }
        for text in ["", "gpt", "scripted", "scripted=", "rules=x"] {
            let error = Llm::open(&text.parse().unwrap(), &LlmConfig::default(), None).err().unwrap().to_string();
            assert!(error.contains("rules, scripted=FILE, replay=FILE"), "{error}");
        }
    }

    #[test]
    fn each_stage_has_its_chain() {
        let text = "default = 'a'\nfallback = ['b', 'a', 'rules']\n[backend.a]\nwire = 'ollama'\nmodel = 'm'\n\
            [backend.b]\nwire = 'ollama'\nmodel = 'm'\n";
        let config: LlmConfig = toml::from_str(text).unwrap();
        config.check(&STAGES).unwrap();
        let of = |default, config: &LlmConfig| chains(default, config, None).remove("parse");
        assert_eq!(of(Some("a"), &config), Some(vec!["a".into(), "b".into()]));
        assert_eq!(of(Some("b"), &config), Some(vec!["b".into(), "a".into()]));
        assert_eq!(of(None, &config), None);
        let stages = [("parse".to_owned(), "b".to_owned())].into();
        let named = LlmConfig { stages, ..config };
        assert_eq!(of(None, &named), Some(vec!["b".into(), "a".into()]));
        let stages = [("parse".to_owned(), RULES.to_owned()), ("select".to_owned(), DEFAULT.to_owned())].into();
        let named = LlmConfig { stages, ..named };
        assert_eq!(of(Some("a"), &named), None);
        let asked = |stages| chains(Some("a"), &named, stages).into_keys().collect::<Vec<_>>();
        assert_eq!(asked(None), ["select"]);
        assert_eq!(asked(Some(&[Stage::Parse, Stage::Reflect][..])), ["reflect"]);
    }
}
