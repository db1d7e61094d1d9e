//! The report as one page of HTML: inline style, inline SVG, images as data, no scripts.

mod abstract_;
mod appendix;
mod data;
mod figures;
mod limits;
mod method;
mod results;
mod worst;

use maud::{DOCTYPE, Markup, PreEscaped, html};

use crate::{Summary, figure::Picture, run::Run};

/// The whole page. Every name out of the logs is escaped by the macro that writes it.
pub(crate) fn page(run: &Run, summary: &Summary, picture: Option<&Picture>) -> Markup {
    let header = run.header();
    let title = if header.title.is_empty() { &header.run } else { &header.title };
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content={ "seafix-report " (env!("CARGO_PKG_VERSION")) };
                title { (title) }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                header {
                    h1 { (sentence_case(title)) }
                    p.run { "Run " code { (header.run) } }
                }
                (abstract_::section(run, summary))
                main {
                    (figures::fix(run, picture))
                    (method::section(run))
                    (data::section(run, summary))
                    (results::section(run, summary))
                    (worst::section(run))
                    (appendix::section(run))
                }
            }
        }
    }
}

/// With a capital letter.
fn sentence_case(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// The distinct texts in the order of their first appearance.
fn distinct(texts: impl IntoIterator<Item = String>) -> Vec<String> {
    let mut seen = Vec::new();
    for text in texts {
        if !seen.contains(&text) {
            seen.push(text);
        }
    }
    seen
}
