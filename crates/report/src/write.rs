//! The files of a report.

use std::{
    fmt, fs,
    path::{Path, PathBuf},
};

use rayon::prelude::*;
use seafix_component::{MARKER, Marker, Ownership, PartialFile, create_real_folder};

use crate::{
    answer::Answer,
    content::{self, Authored},
    document::{Block, Document, Figure, Table},
    error::ReportError,
    forms::Forms,
    index::Section,
    print,
    run::Run,
    summary::RunSummary,
};

/// A written report.
#[derive(Debug)]
pub struct Report {
    /// The folder of the report.
    pub folder: PathBuf,
    /// The page, or the first other form without a page.
    pub page: PathBuf,
    /// The results as a table for the terminal.
    pub summary: RunSummary,
    /// A scale or depth error that the fixes of a trial agree about, as a sentence.
    pub scale_warning: Option<String>,
    /// The report's section of the page that [`index`](crate::index) writes.
    pub findings: String,
}

/// The files of the forms, by order of [`Forms`].
const PAPERS: [&str; 3] = ["report.html", "report.tex", "report.pdf"];

/// A report in memory, before any of its files is written.
pub struct Prepared {
    /// One line for each claim of the written answer that does not hold in the logs.
    pub unmet: Vec<String>,
    files: Vec<File>,
    identity: String,
    summary: RunSummary,
    scale_warning: Option<String>,
    section: Section,
}

/// A file: its name in the folder of the report, and its bytes.
pub(crate) type File = (String, Vec<u8>);

/// Writes the report on the logs in `run_dir` to `folder`.
///
/// The files are the report in the selected forms, `figures/` as SVG and PDF, `tables/` as CSV and JSON with every
/// plotted number, pictures as JPEG, `run.bib`, and the table for the terminal as `summary.txt`. The marker
/// `.seafix-run` lists them; files that the marker of an earlier report lists are replaced or removed.
///
/// # Errors
/// [`ReportError`] when the run has no log, a log cannot be read, the folder is not empty and has no marker of a report,
/// or a file cannot be written.
pub fn report(run_dir: &Path, folder: &Path, forms: Forms) -> Result<Report, ReportError> {
    earlier(folder)?;
    prepare(run_dir, forms, None)?.write(folder)
}

/// Makes the report on the logs in `run_dir` with a written answer, or with a generated one, without writing it.
///
/// # Errors
/// [`ReportError`] when the run has no log, a log cannot be read, or the answer has no value in this run.
pub fn prepare(run_dir: &Path, forms: Forms, answer: Option<&Answer>) -> Result<Prepared, ReportError> {
    let run = Run::read(run_dir)?;
    let summary = RunSummary::of(&run);
    let authored = authored(&run, &summary, answer)?;
    let files = files(&run, &summary, forms, authored.as_ref())?;
    let section = Section::of(&run, &summary, authored.as_ref(), &files);
    let unmet = authored.map(|authored| authored.unmet()).unwrap_or_default();
    // Trials share frames: the fixes of several would not be independent.
    let scale_warning = run.trials.iter().find_map(|trial| trial.scale_errors.warning());
    Ok(Prepared { unmet, files, identity: run.header().run.clone(), summary, scale_warning, section })
}

/// The written answer with its values in a run.
pub(crate) fn authored(
    run: &Run,
    summary: &RunSummary,
    answer: Option<&Answer>,
) -> Result<Option<Authored>, ReportError> {
    let authored = answer.map(|answer| Authored::of(answer, run, summary)).transpose();
    authored.map_err(|error| ReportError::Answer { run: run.header().run.clone(), error })
}

impl fmt::Debug for Prepared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The files are megabytes.
        f.debug_struct("Prepared").field("unmet", &self.unmet).field("identity", &self.identity).finish_non_exhaustive()
    }
}

impl Prepared {
    /// Writes the report into `folder`, in place of an earlier one.
    ///
    /// # Errors
    /// [`ReportError`] when the folder is not empty and has no marker of a report, or a file cannot be written.
    pub fn write(self, folder: &Path) -> Result<Report, ReportError> {
        replace(folder, earlier(folder)?, &self.identity, &self.files)?;
        let page = self.files.iter().map(|(name, _)| name).find(|name| name.starts_with("report."));
        let page = page.map_or_else(|| folder.to_owned(), |name| folder.join(name));
        let findings = self.section.text(folder);
        let (summary, scale_warning) = (self.summary, self.scale_warning);
        Ok(Report { folder: folder.to_owned(), page, summary, scale_warning, findings })
    }
}

/// All files of a report.
pub(crate) fn files(
    run: &Run,
    summary: &RunSummary,
    forms: Forms,
    authored: Option<&Authored>,
) -> Result<Vec<File>, ReportError> {
    let document = content::document(run, summary, forms.small, authored)?;
    let html = || forms.html.then(|| print::html(&document, forms).into_bytes());
    let latex = || forms.latex.then(|| print::latex(&document).into_bytes());
    let pdf = || forms.pdf.then(|| print::pdf(&document));
    let plotted = || if forms.small { Vec::new() } else { figures(&document) };
    let ((html, latex), (pdf, plotted)) = rayon::join(|| rayon::join(html, latex), || rayon::join(pdf, plotted));
    let papers = PAPERS.into_iter().zip([html, latex, pdf]);
    let mut files: Vec<File> =
        papers.filter_map(|(name, bytes)| Some((name.to_owned(), bytes?))).chain(plotted).collect();
    let mut add = |name: String, bytes: Vec<u8>| files.push((name, bytes));
    if forms.small {
        kept(&document, &mut add);
        add("summary.txt".to_owned(), summary.to_string().into_bytes());
        return Ok(files);
    }
    for picture in document.pictures() {
        // The page embeds its pictures; LaTeX needs files, and the picture of a fix is always written.
        if forms.latex || picture.id == "fix" {
            add(format!("{}.jpg", picture.id), picture.jpeg.clone());
        }
    }
    add("run.bib".to_owned(), print::bibtex(run).into_bytes());
    add("summary.txt".to_owned(), summary.to_string().into_bytes());
    Ok(files)
}

/// Adds the files of a small report: main figure, picture of a fix, tables as CSV.
fn kept(document: &Document, add: &mut impl FnMut(String, Vec<u8>)) {
    if let Some(figure) = main_figure(document) {
        add("main.svg".to_owned(), print::standalone(&figure.drawing).into_bytes());
    }
    if let Some(fix) = document.pictures().find(|picture| picture.id == "fix") {
        add("fix.jpg".to_owned(), fix.jpeg.clone());
    }
    for table in document.tables() {
        add(format!("tables/{}.csv", table.id), print::csv(table).into_bytes());
    }
}

/// The main figure of a report, that of its first page.
fn main_figure(document: &Document) -> Option<&Figure> {
    document.front.iter().find_map(|block| match block {
        Block::Figure(figure) => Some(figure),
        _ => None,
    })
}

/// The files of all figures and tables, each in two formats.
fn figures(document: &Document) -> Vec<File> {
    let figures: Vec<&Figure> = document.figures().collect();
    let figure = |figure: &&Figure| {
        [
            (format!("figures/{}.svg", figure.id), print::standalone(&figure.drawing).into_bytes()),
            (format!("figures/{}.pdf", figure.id), print::figure_pdf(&figure.drawing)),
        ]
    };
    let tables: Vec<&Table> = document.tables().collect();
    let table = |table: &&Table| {
        [
            (format!("tables/{}.csv", table.id), print::csv(table).into_bytes()),
            (format!("tables/{}.json", table.id), print::json(table).into_bytes()),
        ]
    };
    figures.par_iter().flat_map_iter(figure).chain(tables.par_iter().flat_map_iter(table)).collect()
}

/// The kind of a report's folder.
const KIND: &str = "report";

/// The marker of the earlier report in `folder`, if there is one.
fn earlier(folder: &Path) -> Result<Option<Marker>, ReportError> {
    match Ownership::of(folder, KIND)? {
        Ownership::Free => Ok(None),
        Ownership::Ours(marker) => Ok(Some(marker)),
        Ownership::Foreign(other) => Err(ReportError::Foreign { folder: folder.to_owned(), other }),
    }
}

/// Claims `folder` for one file of our own, before anything is written into it.
pub(crate) fn claim(folder: &Path, kind: &str, name: &str) -> Result<(), ReportError> {
    let io = |source| ReportError::Io { doing: "write", path: folder.join(MARKER), source };
    match Ownership::of(folder, kind)? {
        Ownership::Ours(_) => Ok(()),
        Ownership::Free => {
            let marker = Marker::new(kind, "", [name.to_owned()]);
            fs::create_dir_all(folder).and_then(|()| marker.write(folder)).map_err(io)
        }
        Ownership::Foreign(other) => Err(ReportError::Foreign { folder: folder.to_owned(), other }),
    }
}

/// Writes the files of a report, and removes those of an earlier one.
fn replace(folder: &Path, earlier: Option<Marker>, identity: &str, files: &[File]) -> Result<(), ReportError> {
    let marker = Marker::new(KIND, identity, files.iter().map(|(name, _)| name.clone()));
    let earlier = earlier.unwrap_or_else(|| Marker::new(KIND, identity, []));
    if let Some((name, _)) = files.iter().find(|(name, _)| !earlier.owns(name) && folder.join(name).exists()) {
        return Err(ReportError::Foreign { folder: folder.to_owned(), other: name.clone() });
    }
    let mark = |marker: &Marker| {
        let io = |source| ReportError::Io { doing: "write", path: folder.join(MARKER), source };
        fs::create_dir_all(folder).and_then(|()| marker.write(folder)).map_err(io)
    };
    // An interrupted report owns the files of both.
    let both = marker.clone().and(&earlier);
    mark(&both)?;
    both.tidy(folder)?;
    for (name, bytes) in files {
        write(folder, name, bytes)?;
    }
    earlier.without(&marker).clear(folder, "")?;
    mark(&marker)
}

/// All files below `folder` that are not in the report's `files`.
pub(crate) fn strangers(folder: &Path, files: &[File]) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for path in fs::read_dir(&next).into_iter().flatten().flatten().map(|entry| entry.path()) {
            if path.is_dir() && !path.is_symlink() {
                folders.push(path);
            } else if path != folder.join(MARKER) && !files.iter().any(|(known, _)| folder.join(known) == path) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Writes a file atomically: a partial file is renamed once it is complete.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, ReportError> {
    let path = folder.join(name);
    let io = |source| ReportError::Io { doing: "write", path: path.clone(), source };
    create_real_folder(path.parent().unwrap_or(folder)).map_err(io)?;
    PartialFile::write(&path, bytes).map_err(io)?;
    Ok(path)
}
