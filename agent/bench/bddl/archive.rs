//! The archives that the outside data comes in.

use anyhow::{Context, bail};
use lzma_rust2::XzReader;
use std::{
    collections::BTreeMap,
    fs::File,
    io::{BufReader, Read},
    path::{Path, PathBuf},
};

/// Most that is unpacked of one archive, bytes.
const MAX_UNPACKED: u64 = 64 * 1024 * 1024;
/// Most files of one archive.
const MAX_FILES: usize = 4096;

/// The archive below the folder of outside data, or why there is none, in words.
pub fn find(name: &str) -> Result<PathBuf, String> {
    let data = std::env::var_os("ACM_DATA").map(PathBuf::from);
    data.map(|data| data.join(name))
        .filter(|path| path.is_file())
        .ok_or_else(|| format!("no data: the variable ACM_DATA names no folder that holds {name}"))
}

/// The texts of a `.tar.xz` archive whose names end in `ending`, by their names.
///
/// # Errors
/// The archive cannot be read, is larger than is unpacked, or holds something other than text.
pub fn texts(archive: &Path, ending: &str) -> anyhow::Result<BTreeMap<String, String>> {
    let unread = || format!("the archive {} cannot be read", archive.display());
    let unpacked = XzReader::new(BufReader::new(File::open(archive).with_context(unread)?), false);
    let mut texts = BTreeMap::new();
    for entry in tar::Archive::new(unpacked.take(MAX_UNPACKED)).entries().with_context(unread)? {
        let mut entry = entry.with_context(|| {
            format!("the archive {} ends early, or holds more than {MAX_UNPACKED} bytes", archive.display())
        })?;
        let name = entry.path().with_context(unread)?.display().to_string();
        if !name.ends_with(ending) {
            continue;
        }
        if texts.len() == MAX_FILES {
            bail!("the archive {} holds more than {MAX_FILES} files", archive.display());
        }
        let mut text = String::new();
        entry.read_to_string(&mut text).with_context(|| format!("{name} in {} is no text", archive.display()))?;
        texts.insert(name, text);
    }
    Ok(texts)
}
