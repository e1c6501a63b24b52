//! Keys: known by the name of a variable, held where nothing prints them.

use std::fmt;
use thiserror::Error;

/// Shortest text that is taken for a secret in what a server sends. Shorter ones stand for "no key is needed", and would be
/// found in the middle of words.
const MIN_SECRET_CHARS: usize = 8;

/// Why a variable gives no key. Its value is never told.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
pub enum KeyError {
    /// The variable is not there, or is empty.
    #[error("the variable {0} is not set: it is to hold the key")]
    Missing(String),
    /// Its value cannot be sent in a header.
    #[error("the variable {0} holds no key: a key is one word of visible ASCII letters")]
    Unusable(String),
}

/// A key. It has no text of its own, in no form.
#[derive(Clone, PartialEq, Eq)]
pub struct Key(String);

impl Key {
    /// The key in `variable`, given what is in it.
    ///
    /// # Errors
    /// There is none.
    pub fn new(variable: &str, value: Option<String>) -> Result<Key, KeyError> {
        let value = value.map(|value| value.trim().to_owned()).filter(|value| !value.is_empty());
        let value = value.ok_or_else(|| KeyError::Missing(variable.into()))?;
        if !value.bytes().all(|byte| byte.is_ascii_graphic()) {
            return Err(KeyError::Unusable(variable.into()));
        }
        Ok(Key(value))
    }

    pub(super) fn reveal(&self) -> &str {
        &self.0
    }

    /// What a server sent, without the key wherever it repeats it.
    pub(super) fn removed_from(&self, body: Vec<u8>) -> Vec<u8> {
        let secret = self.0.as_bytes();
        if secret.len() < MIN_SECRET_CHARS || !body.windows(secret.len()).any(|window| window == secret) {
            return body;
        }
        let mut kept = Vec::with_capacity(body.len());
        let mut rest = body.as_slice();
        while let Some(byte) = rest.first() {
            match rest.strip_prefix(secret) {
                Some(after) => {
                    kept.extend_from_slice(b"***");
                    rest = after;
                }
                None => {
                    kept.push(*byte);
                    rest = rest.get(1..).unwrap_or_default();
                }
            }
        }
        kept
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key(***)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_is_never_told() {
        let secret = "sk-0123456789";
        let key = Key::new("K", Some(format!(" {secret}\n"))).unwrap();
        assert_eq!((format!("{key:?}").as_str(), key.reveal()), ("Key(***)", secret));
        let body = format!("no {secret}{secret}.").into_bytes();
        assert_eq!(key.removed_from(body), b"no ******.");
        assert_eq!(Key::new("K", None), Err(KeyError::Missing("K".into())));
        let unusable = Key::new("K", Some("two words".into())).unwrap_err();
        assert!(!unusable.to_string().contains("two") && unusable.to_string().contains('K'));
        // A word that stands for no key is left in its sentences.
        assert_eq!(Key::new("K", Some("x".into())).unwrap().removed_from(b"exact".to_vec()), b"exact");
    }
}
