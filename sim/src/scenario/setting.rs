//! Changes to a scenario from the command line: `robot.model=panda`.

use super::ScenarioError;
use std::{fmt, str::FromStr};
use toml::{Table, Value};

/// Most names in a path.
const MAX_DEPTH: usize = 8;

/// One field of a scenario file and the value that it gets instead of its own.
///
/// ```
/// # use acm_sim::{Scenario, Setting};
/// let panda: Setting = "robot.model=panda".parse().unwrap();
/// assert!(Scenario::open_with("put-back-block", &[panda]).is_ok());
/// let wrong: Setting = "robot.modl=panda".parse().unwrap();
/// assert!(Scenario::open_with("put-back-block", &[wrong]).unwrap_err().to_string().contains("modl"));
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    path: Vec<String>,
    value: Value,
}

impl fmt::Display for Setting {
    /// `PATH=VALUE`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.path.join("."), self.value)
    }
}

impl FromStr for Setting {
    type Err = String;
    /// `PATH=VALUE`: names joined by dots, a number for an item of a list; the value as in a scenario file, quotes round
    /// plain words left out.
    fn from_str(text: &str) -> Result<Setting, String> {
        let usage = || format!("`{text}` is no setting: write PATH=VALUE, as in robot.model=panda");
        let (path, value) = text.split_once('=').ok_or_else(usage)?;
        let path: Vec<String> = path.trim().split('.').map(String::from).collect();
        if path.len() > MAX_DEPTH || path.iter().any(String::is_empty) {
            return Err(usage());
        }
        let parsed =
            toml::from_str::<Table>(&format!("value = {value}")).ok().and_then(|mut table| table.remove("value"));
        Ok(Setting { path, value: parsed.unwrap_or_else(|| Value::String(value.into())) })
    }
}

/// The text of a scenario file with settings applied.
pub(super) fn apply(file: &str, text: &str, settings: &[Setting]) -> Result<String, ScenarioError> {
    let wrong = |reason: String| ScenarioError::Format { file: file.into(), reason };
    let mut root = Value::Table(toml::from_str::<Table>(text).map_err(|error| wrong(error.to_string()))?);
    for setting in settings {
        put(&mut root, setting)
            .map_err(|reason| wrong(format!("{} cannot be set: {reason}", setting.path.join("."))))?;
    }
    toml::to_string(&root).map_err(|error| wrong(error.to_string()))
}

fn put(root: &mut Value, setting: &Setting) -> Result<(), String> {
    let mut at = root;
    for name in &setting.path {
        at = match at {
            Value::Table(table) => table.entry(name.as_str()).or_insert_with(|| Value::Table(Table::new())),
            Value::Array(items) => {
                let count = items.len();
                let item = name.parse::<usize>().ok().and_then(|index| items.get_mut(index));
                item.ok_or_else(|| format!("`{name}` is no number below {count}"))?
            }
            _ => return Err(format!("there is nothing in it that could be called `{name}`")),
        };
    }
    *at = setting.value.clone();
    Ok(())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    fn set(text: &str, setting: &str) -> Result<String, ScenarioError> {
        apply("s.toml", text, &[setting.parse().unwrap()])
    }

    #[test]
    fn fields_are_added_replaced_and_found_in_lists() {
        let text = "a = 1\n[[camera]]\nname = \"head\"\nsize = [1, 2]\n";
        assert!(set(text, "robot.model=panda").unwrap().contains("[robot]\nmodel = \"panda\""));
        assert!(set(text, "a=2.5").unwrap().contains("a = 2.5"));
        assert!(set(text, "camera.0.size=[3, 4]").unwrap().contains("size = [3, 4]"));
    }

    #[test]
    fn what_is_no_setting_or_leads_nowhere_is_told() {
        assert!("robot.model".parse::<Setting>().unwrap_err().contains("write PATH=VALUE"));
        assert!("robot..model=1".parse::<Setting>().is_err());
        let told = |setting: &str| set("a = 1\nlist = [1]\n", setting).unwrap_err().to_string();
        assert!(told("list.3=1").contains("list.3 cannot be set: `3` is no number below 1"));
        assert!(told("a.b=1").contains("nothing in it that could be called `b`"));
    }
}
