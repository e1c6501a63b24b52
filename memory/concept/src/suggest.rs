//! Suggestions for misspelt field names.

/// Adds "did you mean" to a serde message about an unknown field whose name is near a known one.
///
/// ```
/// # use acm_concept::suggest::suggest;
/// let message = suggest("unknown field `colour`, expected one of `color`, `size`".into());
/// assert!(message.ends_with("did you mean `color`?"));
/// ```
pub fn suggest(message: String) -> String {
    let Some((_, rest)) = message.split_once("unknown field `") else { return message };
    let mut quoted = rest.split('`');
    let Some(unknown) = quoted.next() else { return message };
    // Between back ticks: the separators are at even places, the known names at odd ones.
    let known = rest.split('`').skip(2).step_by(2);
    let best = known.map(|name| (strsim::damerau_levenshtein(unknown, name), name)).min();
    match best {
        Some((distance, name)) if distance <= 1 + unknown.len() / 3 => {
            format!("{}; did you mean `{name}`?", message.trim_end())
        }
        _ => message,
    }
}
