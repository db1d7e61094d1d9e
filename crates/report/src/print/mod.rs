//! One paper, several printers. None of them knows what a report is about.

mod bibtex;
mod data;
mod fonts;
mod html;
mod latex;
mod markdown;
mod pdf;
mod svg;
mod unicode;

pub(crate) use bibtex::bibtex;
pub(crate) use data::{csv, json};
pub(crate) use fonts::width_of;
pub(crate) use html::{FORMS, html};
pub(crate) use latex::latex;
pub(crate) use markdown::{escape as escape_markdown, markdown};
pub(crate) use pdf::{figure_pdf, pdf};
pub(crate) use svg::standalone;
