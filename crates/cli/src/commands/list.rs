//! `seafix list`.

use clap::Args;
use seafix_component::unknown;

use crate::{
    catalogue::{kinds, markdown},
    exit::{DONE, Ended, Failure, USAGE},
    terminal::print,
};

#[derive(Debug, Args)]
pub(crate) struct List {
    /// List this kind only, as `solvers`; the complete list names all kinds.
    kind: Option<String>,
    /// Print the tables of docs/components.md.
    #[arg(long, conflicts_with = "kind")]
    markdown: bool,
}

impl List {
    pub(crate) fn execute(&self) -> Ended {
        if self.markdown {
            print(&markdown())?;
            return Ok(DONE);
        }
        let kinds = kinds();
        let wanted = |word: &str| kinds.iter().position(|kind| [kind.singular, &kind.plural].contains(&word));
        let chosen = match &self.kind {
            None => &kinds[..],
            Some(word) => match wanted(word) {
                Some(index) => &kinds[index..=index],
                None => {
                    let names: Vec<&str> = kinds.iter().map(|kind| &*kind.plural).collect();
                    return Err(Failure::new(USAGE, format!("there is no kind `{word}`{}", unknown(word, &names))));
                }
            },
        };
        let width = chosen.iter().flat_map(|kind| &kind.listings).map(|l| l.name.len()).max().unwrap_or(0);
        let mut text = String::new();
        for kind in chosen {
            text += &format!("{}\n", kind.plural);
            for listing in &kind.listings {
                text += &format!("  {:width$}  {}\n", listing.name, listing.summary);
            }
        }
        print(&text)?;
        Ok(DONE)
    }
}
