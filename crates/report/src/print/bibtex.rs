//! A run as a BibTeX entry.

use crate::{print::latex::escape, run::Run};

/// The `@misc` entry of a run.
pub(crate) fn bibtex(run: &Run) -> String {
    let header = run.header();
    let key: String = header.run.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let versions: Vec<String> = header.versions.iter().map(|(name, version)| format!("{name} {version}")).collect();
    let seeds: Vec<String> = header.seeds.iter().map(|(name, seed)| format!("{name} {seed}")).collect();
    // Braces keep BibTeX from changing capitals.
    format!(
        "@misc{{seafix-{key},\n  title = {{{{{}}}}},\n  howpublished = {{Experiment run with Seafix, logs in MCAP}},\n  \
         note = {{Question: {} Versions: {}. Seeds: {}.}},\n}}\n",
        escape(&header.run),
        escape(&header.question),
        escape(&versions.join(", ")),
        escape(&seeds.join(", ")),
    )
}
