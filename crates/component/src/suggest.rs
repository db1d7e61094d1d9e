//! Suggestions for misspelt words.

/// The settings of earlier versions, with the settings that replaced them.
const REPLACED: [(&str, &str); 5] = [
    ("absence", "max-p-wrong"),
    ("chance-budget", "max-p-wrong"),
    ("doubt", "max-p-wrong"),
    ("max-nfa", "max-p-wrong"),
    ("rare", "max-p-wrong"),
];

/// The option nearest to `word` by edit distance, if it is close enough to be meant; or the one that replaced it.
///
/// ```
/// assert_eq!(seafix_component::nearest("umeyma", ["horn", "umeyama"]), Some("umeyama"));
/// assert_eq!(seafix_component::nearest("banana", ["horn", "umeyama"]), None);
/// assert_eq!(seafix_component::nearest("a", ["id"]), None, "no common letter");
/// assert_eq!(seafix_component::nearest("max-nfa", ["risk", "max-p-wrong"]), Some("max-p-wrong"));
/// ```
pub fn nearest<'a>(word: &str, options: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let mut options = options.into_iter().collect::<Vec<_>>();
    if let Some((_, new)) = REPLACED.into_iter().find(|(old, new)| *old == word && options.contains(new)) {
        return Some(new);
    }
    let length = word.chars().count();
    let limit = (length / 3).max(2).min(length.saturating_sub(1));
    options
        .drain(..)
        .map(|option| (strsim::damerau_levenshtein(&word.to_lowercase(), &option.to_lowercase()), option))
        .filter(|(distance, _)| *distance <= limit)
        .min()
        .map(|(_, option)| option)
}

/// The second half of a message about an unknown word: the nearest option, then all options.
///
/// ```
/// assert_eq!(seafix_component::unknown("trad", &["kabsch", "triad"]), ", did you mean `triad`? There are kabsch, triad");
/// assert_eq!(seafix_component::unknown("x", &["kabsch", "triad"]), "; there are kabsch, triad");
/// assert_eq!(seafix_component::unknown("x", &[]), "; there are none");
/// ```
pub fn unknown(word: &str, options: &[&str]) -> String {
    let all = if options.is_empty() { "none".to_owned() } else { options.join(", ") };
    match nearest(word, options.iter().copied()) {
        Some(near) => format!(", did you mean `{near}`? There are {all}"),
        None => format!("; there are {all}"),
    }
}
