//! `--config FILE`: what the agent goes by, as a file.

use acm_actors::settings::Settings;
use acm_perception::GrounderConfig;
use anyhow::{Context, bail};
use std::{fs::File, io::Read, path::Path};

/// Longest file that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// Reads settings; what the file leaves out keeps its default.
///
/// # Errors
/// The file cannot be read, is no TOML, or names something that is no setting or has a value out of its range.
pub fn read(path: &Path) -> anyhow::Result<Settings> {
    read_over(&GrounderConfig::default(), path)
}

/// Reads settings; what the file leaves out of `[perception]` is as in `perception`, the rest keeps its default.
///
/// # Errors
/// As [`read`].
pub fn read_over(perception: &GrounderConfig, path: &Path) -> anyhow::Result<Settings> {
    let name = path.display();
    let file = File::open(path).with_context(|| format!("{name} cannot be read"))?;
    let mut text = String::new();
    file.take(MAX_BYTES + 1).read_to_string(&mut text).with_context(|| format!("{name} cannot be read"))?;
    if text.len() as u64 > MAX_BYTES {
        bail!("{name} is longer than {MAX_BYTES} bytes: no settings are");
    }
    let mut settings: Settings = toml::from_str(&text).map_err(|error| {
        let line = error.span().map_or(1, |span| 1 + text.get(..span.start).unwrap_or_default().matches('\n').count());
        anyhow::anyhow!("{name}, line {line}: {}", error.message().replace('\n', " "))
    })?;
    let mut merged = toml::Table::try_from(perception)?;
    if let Some(toml::Value::Table(given)) = toml::from_str::<toml::Table>(&text)?.remove("perception") {
        merged.extend(given);
    }
    settings.perception = merged.try_into()?;
    settings.perception.check().map_err(|reason| anyhow::anyhow!("{name}: perception.{reason}"))?;
    settings.tools.check().map_err(|reason| anyhow::anyhow!("{name}: tools.{reason}"))?;
    Ok(settings)
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::task::OnUnknown;

    fn read_text(text: &str) -> anyhow::Result<Settings> {
        let dir = tempfile::tempdir()?;
        let path = dir.path().join("acm.toml");
        std::fs::write(&path, text)?;
        read(&path)
    }

    #[test]
    fn what_is_left_out_keeps_its_default() {
        assert_eq!(read_text("").unwrap(), Settings::default());
        let settings = read_text("on_unknown = \"guess\"\n[perception]\nmin_confidence = 0.4\n").unwrap();
        assert_eq!((settings.on_unknown, settings.perception.min_confidence), (OnUnknown::Guess, 0.4));
        let (dir, unknown) = (tempfile::tempdir().unwrap(), GrounderConfig::of_unknown_camera());
        let path = dir.path().join("acm.toml");
        std::fs::write(&path, "[perception]\nmin_confidence = 0.4\n").unwrap();
        let expected = GrounderConfig { min_confidence: 0.4, ..unknown.clone() };
        assert_eq!(read_over(&unknown, &path).unwrap().perception, expected);
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (text, parts) in [
            ("[perception]\nmin_confidense = 0.4\n", &["line 2", "min_confidense", "min_confidence"][..]),
            ("on_unknown = \"dice\"\n", &["line 1", "dice", "guess"]),
            ("[perception]\nmin_confidence = 1.5\n", &["perception.min_confidence", "1.5"]),
            ("[perception]\ndepth_min_m = nan\n", &["perception.depth_min_m"]),
            ("[perception\n", &["line 1"]),
            ("[tools]\nsegmentor = 'http://a.b'\n", &["line 2", "segmentor", "segmenter"]),
            ("[tools]\ndeadline_ms = 0\n", &["tools.deadline_ms", "0"]),
            ("[tools]\ndetector = 'http://a.b'\n", &["tools.detector", "segmenter"]),
        ] {
            let error = format!("{:#}", read_text(text).unwrap_err());
            assert!(parts.iter().all(|part| error.contains(part)), "{error}");
        }
    }
}
