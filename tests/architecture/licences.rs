//! Everything we build on fits Apache-2.0 OR MIT.

use super::metadata;
use anyhow::Result;

/// Licences under which a dependency may be had. None of them asks more of us than to keep its notice.
const ALLOWED: [&str; 14] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    // Of a list of certificates, which is data: for platforms without one of their own.
    "CDLA-Permissive-2.0",
    "ISC",
    "MIT",
    "MIT-0",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Whether an SPDX expression can be met with allowed licences alone; `None` if it cannot be read. The slash of old
/// manifests means OR.
fn fits(expression: &str) -> Option<bool> {
    let spaced = expression.replace('(', " ( ").replace(')', " ) ").replace('/', " OR ");
    let mut words: Vec<&str> = spaced.split_whitespace().rev().collect();
    let value = alternatives(&mut words)?;
    words.is_empty().then_some(value)
}

// One function a level of precedence: OR binds loosest, then AND, then WITH. `words` is a stack, the next word last.
fn alternatives(words: &mut Vec<&str>) -> Option<bool> {
    let mut value = requirements(words)?;
    while words.pop_if(|word| *word == "OR").is_some() {
        value |= requirements(words)?;
    }
    Some(value)
}

fn requirements(words: &mut Vec<&str>) -> Option<bool> {
    let mut value = licence(words)?;
    while words.pop_if(|word| *word == "AND").is_some() {
        value &= licence(words)?;
    }
    Some(value)
}

fn licence(words: &mut Vec<&str>) -> Option<bool> {
    let word = words.pop()?;
    if word == "(" {
        let value = alternatives(words)?;
        return (words.pop()? == ")").then_some(value);
    }
    if ["OR", "AND", "WITH", ")"].contains(&word) {
        return None;
    }
    if words.pop_if(|word| *word == "WITH").is_some() {
        let exception = words.pop()?;
        return Some(ALLOWED.contains(&format!("{word} WITH {exception}").as_str()));
    }
    Some(ALLOWED.contains(&word))
}

#[test]
fn every_dependency_may_be_used_under_our_licence() -> Result<()> {
    let metadata = metadata()?;
    let judged = metadata.packages.iter().map(|package| {
        let licence = package.license.as_deref().unwrap_or("");
        (format!("{} {} is under `{licence}`", package.name, package.version), fits(licence))
    });
    let refused: Vec<String> = judged.filter(|(_, fits)| *fits != Some(true)).map(|(text, _)| text).collect();
    assert!(metadata.packages.len() > 50, "cargo metadata told of {} packages only", metadata.packages.len());
    assert_eq!(refused, Vec::<String>::new(), "choose another crate, or add the licence to ALLOWED if it fits");
    Ok(())
}

#[test]
fn expressions_are_judged_as_spdx_means_them() {
    let fitting = [
        "MIT",
        "MIT/Apache-2.0",
        "MIT OR Apache-2.0 OR LGPL-2.1-or-later",
        "(MIT OR Apache-2.0) AND Unicode-3.0",
        "GPL-3.0-only OR Apache-2.0 WITH LLVM-exception",
        "GPL-3.0-only AND MPL-2.0 OR MIT",
    ];
    for expression in fitting {
        assert_eq!(fits(expression), Some(true), "{expression}");
    }
    let others = [
        "AGPL-3.0-only",
        "MPL-2.0",
        "MIT AND GPL-3.0-only",
        "(MIT OR Apache-2.0) AND CC-BY-NC-4.0",
        "GPL-2.0-only WITH Classpath-exception-2.0",
        "Apache-2.0 WITH Commons-Clause",
    ];
    for expression in others {
        assert_eq!(fits(expression), Some(false), "{expression}");
    }
    for nonsense in ["", "MIT OR", "(MIT", "MIT)", "MIT Apache-2.0", "AND MIT"] {
        assert_eq!(fits(nonsense), None, "{nonsense}");
    }
}
