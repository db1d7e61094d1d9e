//! The files of a report.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{ReportError, Summary, content, document::Document, print, run::Run};

/// Which forms of the paper are written; figures and tables always are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Forms {
    /// `report.html`.
    pub html: bool,
    /// `report.tex`.
    pub latex: bool,
    /// `report.pdf`.
    pub pdf: bool,
}

impl Forms {
    /// All forms.
    pub const ALL: Self = Self { html: true, latex: true, pdf: true };
}

/// A report that was written.
#[derive(Debug)]
pub struct Report {
    /// The folder it is in.
    pub folder: PathBuf,
    /// Its page, or the first other form.
    pub page: PathBuf,
    /// The results in it, as a table for the terminal.
    pub summary: Summary,
}

/// One file: its name in the folder of the report, and its bytes.
pub(crate) type File = (String, Vec<u8>);

/// Reads the logs in `run_dir` and writes into `folder`: the paper in the wanted forms, `figures/` as SVG and PDF,
/// `tables/` as CSV and JSON with every plotted number, pictures as JPEG, `run.bib`, and the table for the terminal as
/// `summary.txt`. Files of an earlier report that this one has not are removed from `figures/` and `tables/`.
///
/// # Errors
/// [`ReportError`] when there is no log, one cannot be read, or the report cannot be written.
pub fn report(run_dir: &Path, folder: &Path, forms: Forms) -> Result<Report, ReportError> {
    let run = Run::read(run_dir)?;
    let summary = Summary::of(&run);
    let files = files(&run, &summary, forms)?;
    for part in ["figures", "tables"] {
        clear(&folder.join(part), part, &files)?;
    }
    for (name, bytes) in &files {
        write(folder, name, bytes)?;
    }
    let page = files.iter().map(|(name, _)| name).find(|name| name.starts_with("report."));
    let page = page.map_or_else(|| folder.to_owned(), |name| folder.join(name));
    Ok(Report { folder: folder.to_owned(), page, summary })
}

/// Everything that a report consists of.
pub(crate) fn files(run: &Run, summary: &Summary, forms: Forms) -> Result<Vec<File>, ReportError> {
    let document = content::document(run, summary)?;
    let mut files: Vec<File> = Vec::new();
    let mut add = |name: String, bytes: Vec<u8>| files.push((name, bytes));
    if forms.html {
        add("report.html".to_owned(), print::html(&document).into_bytes());
    }
    if forms.latex {
        add("report.tex".to_owned(), print::latex(&document).into_bytes());
    }
    if forms.pdf {
        add("report.pdf".to_owned(), print::pdf(&document));
    }
    figures(&document, &mut add);
    for picture in document.pictures() {
        // In the page they are already; LaTeX asks for files, and the first is the report's face.
        if forms.latex || picture.id == "fix" {
            add(format!("{}.jpg", picture.id), picture.jpeg.clone());
        }
    }
    add("run.bib".to_owned(), print::bibtex(run).into_bytes());
    add("summary.txt".to_owned(), summary.to_string().into_bytes());
    Ok(files)
}

fn figures(document: &Document, add: &mut impl FnMut(String, Vec<u8>)) {
    for figure in document.figures() {
        add(format!("figures/{}.svg", figure.id), print::standalone(&figure.drawing).into_bytes());
        add(format!("figures/{}.pdf", figure.id), print::figure_pdf(&figure.drawing));
    }
    for table in document.tables() {
        add(format!("tables/{}.csv", table.id), print::csv(table).into_bytes());
        add(format!("tables/{}.json", table.id), print::json(table).into_bytes());
    }
}

/// Writes `README.md` into `folder`: what the runs found, each with its question, its main figure and its numbers.
///
/// # Errors
/// [`ReportError`] when a log cannot be read, or the file cannot be written.
pub fn index(runs: &[PathBuf], folder: &Path) -> Result<PathBuf, ReportError> {
    let mut text = String::from(
        "# What we found\n\nEach sentence is made from logs by `seafix report`; the reports beside it say how each number came about, \
         and `seafix report --verify` computes them again. `reports/regenerate` runs the experiments and makes this folder.\n",
    );
    for path in runs {
        let run = Run::read(path)?;
        let summary = Summary::of(&run);
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        let escaped = print::escape_markdown(&name);
        text += &format!("\n## {escaped}\n\n*{}*\n\n", print::escape_markdown(&run.header().question));
        let main = [
            "fix.jpg",
            "figures/error-over-noise.svg",
            "figures/forest.svg",
            "figures/error-over-condition.svg",
            "figures/recall.svg",
        ];
        if let Some(figure) = main.iter().find(|figure| folder.join(&name).join(figure).exists()) {
            text += &format!("[![The main figure of {escaped}]({name}/{figure})]({name}/report.html)\n\n");
        }
        for finding in content::findings(&run, &summary) {
            text += &format!("- {}\n", print::markdown(&finding));
        }
        text += &format!("\n[Report]({name}/report.html), [PDF]({name}/report.pdf), [tables]({name}/tables)\n");
    }
    write(folder, "README.md", text.as_bytes())
}

/// Removes what an earlier report left in `folder` and this one does not write.
fn clear(folder: &Path, part: &str, files: &[File]) -> Result<(), ReportError> {
    let Ok(entries) = fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.flatten() {
        let name = format!("{part}/{}", entry.file_name().to_string_lossy());
        let ours = [".svg", ".pdf", ".csv", ".json", ".partial"].iter().any(|end| name.ends_with(end));
        if ours && !files.iter().any(|(known, _)| *known == name) {
            let path = entry.path();
            fs::remove_file(&path).map_err(|source| ReportError::Io { doing: "write", path, source })?;
        }
    }
    Ok(())
}

/// Writes a file whole or not at all.
pub(crate) fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<PathBuf, ReportError> {
    let (path, partial) = (folder.join(name), folder.join(format!("{name}.partial")));
    let io = |source| ReportError::Io { doing: "write", path: path.clone(), source };
    fs::create_dir_all(path.parent().unwrap_or(folder)).map_err(io)?;
    fs::write(&partial, bytes).map_err(io)?;
    fs::rename(&partial, &path).map_err(io)?;
    Ok(path)
}
