//! How to get the same again.

use maud::{Markup, html};

use crate::run::Run;

pub(super) fn section(run: &Run) -> Markup {
    let header = run.header();
    html! {
        h2 { "How to reproduce" }
        @if header.command.is_empty() {
            p { "Run the configuration below." }
        } @else {
            pre { (header.command) }
        }
        p {
            "Every number of this page is computed from the logs beside it alone; with the same version and seeds "
            "everything but the times comes out the same."
        }
        h2 { "Configuration" }
        p { "Each trial with every default written out." }
        @for trial in &run.trials {
            details {
                summary { code { (trial.file()) } }
                pre { (trial.header.configuration.trim_end()) }
            }
        }
        @if !header.site.is_empty() {
            details { summary { "The site" } pre { (header.site.trim_end()) } }
        }
    }
}
