//! `--config FILE`: what the agent goes by and which language models there are, as a file.

use crate::{
    cli::{ConfigCommand, Exit},
    llm::STAGES,
};
use acm_actors::{settings::Settings, tools::ToolSettings};
use acm_concept::{suggest::suggest, task::OnUnknown};
use acm_llm::LlmConfig;
use acm_perception::GrounderConfig;
use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};
use std::{
    fs::File,
    io::{Read, Write},
    path::{Path, PathBuf},
};

/// The file that is taken where none is named, if it is there.
pub const FILE: &str = "acm.toml";
/// Longest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// What a file says.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Config {
    /// What the agent goes by.
    pub settings: Settings,
    /// Language models.
    pub llm: LlmConfig,
}

/// A file as it is written.
#[derive(Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
struct Raw {
    on_unknown: OnUnknown,
    perception: GrounderConfig,
    tools: ToolSettings,
    llm: LlmConfig,
}

/// Reads the file that is named, else `acm.toml` of the working folder if there is one; with the file's name.
///
/// # Errors
/// As [`read`].
pub fn open(named: Option<&Path>) -> anyhow::Result<(Option<PathBuf>, Config)> {
    let file = named.map(Path::to_path_buf).or_else(|| Path::new(FILE).is_file().then(|| FILE.into()));
    let config = file.as_deref().map(read).transpose()?.unwrap_or_default();
    Ok((file, config))
}

/// Reads a file; what it leaves out keeps its default.
///
/// # Errors
/// The file cannot be read, is no TOML, or names something that is no setting or has a value out of its range.
pub fn read(path: &Path) -> anyhow::Result<Config> {
    read_over(&Settings::default().perception, path)
}

/// Reads a file; what it leaves out of `[perception]` is as in `perception`, the rest keeps its default.
///
/// # Errors
/// As [`read`].
pub fn read_over(perception: &GrounderConfig, path: &Path) -> anyhow::Result<Config> {
    let name = path.display();
    let file = File::open(path).with_context(|| format!("{name} cannot be read"))?;
    let mut text = String::new();
    file.take(MAX_BYTES + 1).read_to_string(&mut text).with_context(|| format!("{name} cannot be read"))?;
    if text.len() as u64 > MAX_BYTES {
        bail!("{name} is longer than {MAX_BYTES} bytes: no settings are");
    }
    let raw: Raw = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| 1 + text.get(..span.start).unwrap_or_default().matches('\n').count());
        anyhow::anyhow!("{name}, line {line}: {}", suggest(error.message().replace('\n', " ")))
    })?;
    let mut merged = toml::Table::try_from(perception)?;
    if let Some(toml::Value::Table(given)) = toml::from_str::<toml::Table>(&text)?.remove("perception") {
        merged.extend(given);
    }
    let Raw { on_unknown, perception: _, tools, llm } = raw;
    let settings = Settings { on_unknown, perception: merged.try_into()?, tools };
    settings.perception.check().map_err(|reason| anyhow::anyhow!("{name}: perception.{reason}"))?;
    settings.tools.check().map_err(|reason| anyhow::anyhow!("{name}: tools.{reason}"))?;
    llm.check(&STAGES).map_err(|reason| anyhow::anyhow!("{name}: llm.{reason}"))?;
    Ok(Config { settings, llm })
}

/// Runs `acm config`.
///
/// # Errors
/// The file cannot be used.
pub fn run(command: &ConfigCommand) -> anyhow::Result<Exit> {
    let mut out = std::io::stdout().lock();
    match command {
        ConfigCommand::Check { file } => {
            let (file, config) = open(file.as_deref())?;
            let Some(file) = file else { bail!("there is no file to check: name one, or write {FILE}") };
            let missing = config.llm.backend.iter().filter_map(|(id, backend)| {
                let name = backend.key_env.as_ref().filter(|name| std::env::var_os(name).is_none())?;
                Some(format!("llm.backend.{id}: the variable {name} is not set"))
            });
            writeln!(out, "{}: sound, {} language models", file.display(), config.llm.backend.len())?;
            for line in missing {
                writeln!(out, "  {line}")?;
            }
        }
        ConfigCommand::Show { config } => {
            let (file, Config { settings, llm }) = open(config.as_deref())?;
            let from = file.map_or_else(|| format!("defaults alone: there is no {FILE}"), |f| f.display().to_string());
            writeln!(out, "# {from}; all that holds, defaults included")?;
            write!(out, "{}", toml::to_string_pretty(&Shown { settings: &settings, llm: &llm })?)?;
        }
    }
    Ok(Exit::Success)
}

#[derive(Serialize)]
struct Shown<'a> {
    #[serde(flatten)]
    settings: &'a Settings,
    llm: &'a LlmConfig,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> anyhow::Result<Config> {
        let dir = tempfile::tempdir()?;
        let path = dir.path().join(FILE);
        std::fs::write(&path, text)?;
        read(&path)
    }

    #[test]
    fn what_is_left_out_keeps_its_default() {
        assert_eq!(read_text("").unwrap(), Config::default());
        let settings = read_text("on_unknown = \"guess\"\n[perception]\nmin_confidence = 0.4\n").unwrap().settings;
        assert_eq!((settings.on_unknown, settings.perception.min_confidence), (OnUnknown::Guess, 0.4));
        let (dir, unknown) = (tempfile::tempdir().unwrap(), GrounderConfig::of_unknown_camera());
        let path = dir.path().join(FILE);
        std::fs::write(&path, "[perception]\nmin_confidence = 0.4\n").unwrap();
        let expected = GrounderConfig { min_confidence: 0.4, ..unknown.clone() };
        assert_eq!(read_over(&unknown, &path).unwrap().settings.perception, expected);
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (text, parts) in [
            (
                "[perception]\nmin_confidense = 0.4\n",
                &["line 2", "min_confidense", "did you mean `min_confidence`"][..],
            ),
            ("on_unknown = \"dice\"\n", &["line 1", "dice", "guess"]),
            ("[perception]\nmin_confidence = 1.5\n", &["perception.min_confidence", "1.5"]),
            ("[perception]\ndepth_min_m = nan\n", &["perception.depth_min_m"]),
            ("[perception\n", &["line 1"]),
            ("[tools]\nsegmentor = 'http://a.b'\n", &["line 2", "segmentor", "segmenter"]),
            ("[tools]\ndeadline_ms = 0\n", &["tools.deadline_ms", "0"]),
            ("[tools]\ndetector = 'http://a.b'\n", &["tools.detector", "segmenter"]),
            ("[lmm]\n", &["line 1", "did you mean `llm`"]),
            ("[llm.backend.a]\nwire = 'ollama'\nmodle = 'm'\n", &["line 3", "did you mean `model`"]),
            ("[llm]\ndefault = 'gpt'\n", &["llm.default", "`gpt`"]),
        ] {
            let error = format!("{:#}", read_text(text).unwrap_err());
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
    }

    #[test]
    fn the_example_is_sound_and_what_is_shown_of_it_says_the_same() {
        let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("acm.example.toml");
        let config = read(&example).unwrap();
        assert!(config.llm.backend.len() >= 5, "every wire format has its example");
        // What is a comment in it is sound too.
        let text = std::fs::read_to_string(&example).unwrap();
        let bare = |line: &str| line.strip_prefix("#: ").unwrap_or(line).to_owned();
        let all: Vec<String> = text.lines().map(bare).collect();
        assert_ne!(read_text(&all.join("\n")).unwrap(), config);
        let shown = toml::to_string_pretty(&Shown { settings: &config.settings, llm: &config.llm }).unwrap();
        assert_eq!(read_text(&shown).unwrap(), config);
    }
}
