//! The file `FORMAT`: which format a folder has, and which of its files count. It is replaced as a whole, so that a
//! folder goes from one set of files to the next in one step.

use crate::{disk::Disk, log};
use std::io;

/// Name of the file.
pub const NAME: &str = "FORMAT";
/// The format that is read and written.
pub const FORMAT: u32 = 2;

/// Which files count.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Manifest {
    /// Number of the first segment.
    pub first: u64,
    /// Number of the newest snapshot, and of the segment that begins behind it.
    pub snapshot: Option<u64>,
}

/// What a folder says of itself.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Found {
    /// Nothing is there.
    Nothing,
    /// A folder of this format.
    Known(Manifest),
    /// A folder of another format.
    Other(u32),
    /// The file is there, but is not what it should be.
    Damaged(String),
}

impl Manifest {
    fn text(&self) -> String {
        let mut text = format!("acm-memory {FORMAT}\nfirst {}\n", self.first);
        if let Some(snapshot) = self.snapshot {
            text += &format!("snapshot {snapshot}\n");
        }
        let check = crc32c::crc32c(text.as_bytes());
        text + &format!("check {check:08x}\n")
    }
    /// Reads it.
    pub fn read(disk: &dyn Disk) -> io::Result<Found> {
        let names = disk.list()?;
        if !names.iter().any(|name| name == NAME) {
            let orphan = names.iter().find(|name| name.as_str() == "events.log" || log::number(name).is_some());
            return Ok(match orphan {
                Some(name) => Found::Damaged(format!("the file is missing beside {name}: its format is not known")),
                None => Found::Nothing,
            });
        }
        let map = disk.map(NAME)?;
        let text = String::from_utf8_lossy(map.bytes().get(..256).unwrap_or(map.bytes())).into_owned();
        Ok(parse(&text))
    }
    /// Puts it in the old one's place, durably.
    pub fn write(&self, disk: &mut dyn Disk) -> io::Result<()> {
        let fresh = "FORMAT.new";
        disk.create(fresh)?;
        disk.append(fresh, self.text().as_bytes())?;
        disk.sync(fresh)?;
        disk.rename(fresh, NAME)?;
        disk.sync_folder()
    }
}

fn parse(text: &str) -> Found {
    let wrong = || Found::Damaged(format!("should begin `acm-memory {FORMAT}`, reads `{}`", text.trim()));
    let mut lines = text.lines();
    let format = lines.next().and_then(|line| line.strip_prefix("acm-memory ")?.trim().parse::<u32>().ok());
    match format {
        Some(FORMAT) => {}
        Some(other) => return Found::Other(other),
        None => return wrong(),
    }
    let mut manifest = Manifest::default();
    for line in lines {
        let number = |rest: &str| rest.trim().parse::<u64>().ok();
        match line.split_once(' ') {
            Some(("first", rest)) => manifest.first = number(rest).unwrap_or_default(),
            Some(("snapshot", rest)) => manifest.snapshot = number(rest),
            Some(("check", _)) => {}
            _ => return wrong(),
        }
    }
    if manifest.text() == text { Found::Known(manifest) } else { wrong() }
}
