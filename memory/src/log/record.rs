//! How one record of the log is framed.
//!
//! `length: u32 | crc: u32 | kind: u8 | body`, little endian. `length` counts kind and body; `crc` is the
//! CRC-32 (IEEE) of the length's four bytes, the kind and the body, so that a wrong length is found as well.

/// Largest kind and body of one record, bytes.
pub const MAX_RECORD_BYTES: usize = 4 * 1024 * 1024;
/// Bytes before the kind.
pub const HEAD_BYTES: usize = 8;
/// Bytes of a whole commit record.
pub const COMMIT_BYTES: usize = HEAD_BYTES + 1 + 8;

const EVENT: u8 = 1;
const COMMIT: u8 = 2;

/// One record, borrowed from the bytes of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Record<'a> {
    /// One event, as JSON.
    Event(&'a [u8]),
    /// The end of a batch: its number, from 0.
    Commit(u64),
}

/// Appends a record; `false` if it is larger than a record may be.
#[must_use]
pub fn write(record: Record<'_>, out: &mut Vec<u8>) -> bool {
    let number;
    let (kind, body): (u8, &[u8]) = match record {
        Record::Event(body) => (EVENT, body),
        Record::Commit(batch) => {
            number = batch.to_le_bytes();
            (COMMIT, &number)
        }
    };
    let Some(length) = u32::try_from(body.len() + 1).ok().filter(|&n| n as usize <= MAX_RECORD_BYTES) else {
        return false;
    };
    let length = length.to_le_bytes();
    out.extend(length);
    out.extend(checksum(length, kind, body).to_le_bytes());
    out.push(kind);
    out.extend(body);
    true
}

/// Reads the record at the beginning of `bytes` and says how many bytes it takes; `None` if there is no whole
/// record with a right checksum.
pub fn read(bytes: &[u8]) -> Option<(Record<'_>, usize)> {
    let length = bytes.first_chunk::<4>()?;
    let size = u32::from_le_bytes(*length) as usize;
    if size == 0 || size > MAX_RECORD_BYTES {
        return None;
    }
    let crc = u32::from_le_bytes(*bytes.get(4..)?.first_chunk::<4>()?);
    let (kind, body) = bytes.get(HEAD_BYTES..HEAD_BYTES + size)?.split_first()?;
    if crc != checksum(*length, *kind, body) {
        return None;
    }
    let record = match *kind {
        EVENT => Record::Event(body),
        COMMIT => Record::Commit(u64::from_le_bytes(body.try_into().ok()?)),
        _ => return None,
    };
    Some((record, HEAD_BYTES + size))
}

fn checksum(length: [u8; 4], kind: u8, body: &[u8]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&length);
    hasher.update(&[kind]);
    hasher.update(body);
    hasher.finalize()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn records_survive_and_no_flipped_bit_passes(
            body in prop::collection::vec(any::<u8>(), 0..200), batch in any::<u64>(), commit in any::<bool>(),
            place in any::<prop::sample::Index>(), bit in 0..8u32,
        ) {
            let record = if commit { Record::Commit(batch) } else { Record::Event(&body) };
            let mut bytes = Vec::new();
            prop_assert!(write(record, &mut bytes));
            prop_assert_eq!(read(&bytes), Some((record, bytes.len())));
            let cut = place.index(bytes.len());
            prop_assert_eq!(read(&bytes[..cut]), None);
            bytes[cut] ^= 1 << bit;
            prop_assert_eq!(read(&bytes), None);
        }
    }

    #[test]
    fn a_record_that_is_too_large_is_refused() {
        let mut out = Vec::new();
        assert!(!write(Record::Event(&vec![b' '; MAX_RECORD_BYTES]), &mut out));
        assert!(out.is_empty());
        assert_eq!(read(&u32::MAX.to_le_bytes()), None);
    }
}
