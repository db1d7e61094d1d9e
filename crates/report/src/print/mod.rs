//! Printers of a report: HTML, LaTeX, PDF, SVG, CSV, JSON, Markdown and BibTeX. They do not depend on its content.

mod bibtex;
mod data;
mod html;
mod latex;
mod markdown;
mod pdf;
mod svg;
mod unicode;

pub(crate) use bibtex::bibtex;
pub(crate) use data::{csv, json};
pub(crate) use html::{ANSWER, CLAIM, FORMS, html};
pub(crate) use latex::latex;
pub(crate) use markdown::{escape as escape_markdown, markdown};
pub(crate) use pdf::{figure_pdf, pdf};
pub(crate) use svg::standalone;
