//! The documentation: links, the table of contents, and the blocks of code on its pages.
//!
//! A page's blocks run in order in a folder of their own, which has `datasets`, `experiments` and `examples` of the
//! repository. A block with a title is the file of that name; a `sh` block is run; a `text` block after it is its output,
//! with `…` for what is left out. Times and amounts of memory are not compared, and `SEAFIX_UPDATE=1` writes the other
//! numbers. A `rust` block is part of the example that its title names. The tests of the Python package run the `python`
//! blocks.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use tempfile::TempDir;

use crate::recordings::sample_recording;

/// A fenced block of a page: language, title, text, and the line on which it begins.
#[derive(Debug, Clone)]
struct Block {
    language: String,
    title: Option<String>,
    text: String,
    line: usize,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// The Markdown files below a folder, without those of builds.
fn markdown(folder: &Path, files: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() && !["target", ".git", ".venv", "node_modules"].contains(&name.as_str()) {
            markdown(&path, files);
        } else if name.ends_with(".md") {
            files.push(path);
        }
    }
}

fn pages(folder: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    markdown(&root().join(folder), &mut files);
    files.sort();
    files
}

/// The blocks of a page, and its text without them.
fn split(text: &str) -> (Vec<Block>, String) {
    let (mut blocks, mut prose, mut open) = (Vec::new(), String::new(), None::<Block>);
    for (number, line) in text.lines().enumerate() {
        match (&mut open, line.trim_start().strip_prefix("```")) {
            (None, Some(info)) => {
                let (language, rest) = info.split_once(' ').unwrap_or((info, ""));
                let title = rest.strip_prefix("title=\"").and_then(|rest| rest.strip_suffix('"'));
                let title = title.map(str::to_owned);
                open = Some(Block { language: language.to_owned(), title, text: String::new(), line: number + 1 });
            }
            (Some(_), Some("")) => blocks.extend(open.take()),
            (Some(block), _) => block.text += &format!("{line}\n"),
            (None, None) => prose += &format!("{line}\n"),
        }
    }
    assert!(open.is_none(), "an open block");
    (blocks, prose)
}

/// The targets of the links of a text; code between backticks has none.
fn links(prose: &str) -> Vec<String> {
    let plain: String = prose.split('`').step_by(2).collect::<Vec<_>>().join("code");
    let targets = plain.split("](").skip(1).filter_map(|rest| rest.split_once(')'));
    targets.map(|(target, _)| target.to_owned()).filter(|target| !target.contains("://")).collect()
}

/// The anchors of a page: its headings in lower case, with hyphens for blanks.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = text.lines().filter(|line| line.starts_with('#')).map(|line| line.trim_start_matches('#').trim());
    let kept = |c: char| (c.is_alphanumeric() || "-_ ".contains(c)).then_some(if c == ' ' { '-' } else { c });
    headings.map(|heading| heading.to_lowercase().chars().filter_map(kept).collect()).collect()
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let mut checked = 0;
    for page in pages("") {
        let text = fs::read_to_string(&page).unwrap();
        for link in links(&split(&text).1) {
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            assert!(target.exists(), "{}: {link} leads nowhere", page.display());
            if !anchor.is_empty() {
                let found = anchors(&fs::read_to_string(&target).unwrap()).contains(anchor);
                assert!(found, "{}: {link} leads to no heading", page.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 100, "{checked} links");
}

/// The site holds the files of `docs/` only.
#[test]
fn a_link_of_the_site_stays_in_the_site() {
    let docs = root().join("docs");
    for page in pages("docs") {
        for link in links(&split(&fs::read_to_string(&page).unwrap()).1) {
            let path = link.split('#').next().unwrap();
            let target = page.parent().unwrap().join(path).canonicalize().unwrap();
            assert!(
                target.starts_with(&docs),
                "{}: {link} is outside of docs/; name the file in backticks",
                page.display()
            );
        }
    }
}

#[test]
fn the_table_of_contents_has_every_page_once() {
    let contents = fs::read_to_string(root().join("mkdocs.yml")).unwrap();
    let (_, contents) = contents.split_once("\nnav:\n").unwrap();
    let mut listed: Vec<&str> = contents
        .lines()
        .filter_map(|line| line.rsplit([' ', ':']).next())
        .filter(|name| name.ends_with(".md"))
        .collect();
    listed.sort_unstable();
    let docs = root().join("docs");
    let mut present: Vec<String> =
        pages("docs").iter().map(|page| page.strip_prefix(&docs).unwrap().display().to_string()).collect();
    present.sort_unstable();
    assert_eq!(listed, present, "`nav` of mkdocs.yml against the files of docs/");
}

/// Every mean NEES of the page on integrity is that of its trial in the published report. Seen to fail with a digit of the page changed.
#[test]
fn the_published_consistency_is_repeated() {
    let page = fs::read_to_string(root().join("docs/integrity.md")).unwrap();
    let mean = |report: &str, quantity: &str, trial: &str| {
        let report = fs::read_to_string(root().join("reports").join(report).join("report.html")).unwrap();
        let title = format!("title=\"mean {quantity};");
        let ends = format!("{trial}.mcap\">");
        let mut values = report.split(&title).skip(1).filter_map(|rest| rest.split_once('<'));
        values.find_map(|(value, _)| Some(value.split_once(&ends)?.1.to_owned())).unwrap()
    };
    let dive =
        |trial| ["nees of found", "navigated_nees of navigated"].map(|name| mean("a2-virtual-200m", name, trial));
    for (label, trial) in [
        ("a fix in every frame", "001-navigation-a_fix_in_every_frame"),
        ("a fix due every 40 s", "002-navigation-a_fix_due_every_40_s"),
    ] {
        let [fixes, navigated] = dive(trial);
        let row = format!("| {label} | {fixes} | {navigated} |\n");
        assert!(page.contains(&row), "docs/integrity.md does not hold {row}");
    }
    let [five, ten] = ["001-seconds-5.0", "002-seconds-10.0"]
        .map(|trial| mean("re-referencing-interval", "navigated_nees of navigated", trial));
    let sentence = format!("the mean NEES is {five} with a fix due every 5 s and {ten} with one every 10 s");
    assert!(page.replace('\n', " ").contains(&sentence), "docs/integrity.md does not hold: {sentence}");
}

/// Lines without their margins, and without empty ones.
fn trimmed(text: &str) -> Vec<&str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect()
}

#[test]
fn a_block_of_rust_is_part_of_an_example() {
    let mut checked = 0;
    for page in pages("docs") {
        for block in split(&fs::read_to_string(&page).unwrap()).0 {
            let place = format!("{}:{}", page.display(), block.line);
            assert!(!block.language.is_empty(), "{place}: a block without a language");
            if block.language != "rust" {
                continue;
            }
            let title = block.title.unwrap_or_else(|| panic!("{place}: a block of Rust names its example as title"));
            let example = fs::read_to_string(root().join(&title)).unwrap();
            let example = trimmed(&example);
            for part in trimmed(&block.text).split(|line| *line == "// …") {
                let found = example.windows(part.len().max(1)).any(|lines| lines == part);
                assert!(found || part.is_empty(), "{place}: {title} does not hold\n{}", part.join("\n"));
            }
            checked += 1;
        }
    }
    assert!(checked >= 5, "{checked} blocks");
}

/// Blanks and rules are as long as the longest cell of a column, which may be a time.
fn narrow(line: &str) -> String {
    let mut narrow = String::new();
    for c in line.trim().chars() {
        if !(narrow.ends_with(c) && " ─".contains(c)) {
            narrow.push(c);
        }
    }
    narrow
}

/// Units of time and of memory.
const MACHINE: [&str; 7] = ["ns", "µs", "ms", "s", "kB", "MB", "GB"];

/// The lines that are not empty, with `#` for a number before a unit of time or of memory, and for a cell of a column with
/// such a unit.
fn numbers(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let is_machine = |unit: &str| MACHINE.contains(&unit.trim_end_matches([',', ';', '.']));
    let mut timed = Vec::new();
    let mut number = |(k, line): (usize, &&str)| {
        let cells: Vec<&str> = line.split("  ").map(str::trim).filter(|cell| !cell.is_empty()).collect();
        if lines.get(k + 1).is_some_and(|rule| rule.starts_with('─')) {
            timed = cells.iter().map(|title| title.rsplit(' ').next().is_some_and(is_machine)).collect();
        } else if cells.len() == timed.len() {
            let cells = cells.iter().zip(&timed).map(|(cell, timed)| if *timed { "#" } else { *cell });
            return cells.collect::<Vec<_>>().join(" ");
        } else if !line.starts_with('─') {
            timed.clear();
        }
        let line = narrow(line);
        let words: Vec<&str> = line.split(' ').collect();
        let is_time =
            |k: usize| words[k].parse::<f64>().is_ok() && words.get(k + 1).is_some_and(|unit| is_machine(unit));
        (0..words.len()).map(|k| if is_time(k) { "#" } else { words[k] }).collect::<Vec<_>>().join(" ")
    };
    lines.iter().enumerate().map(&mut number).collect()
}

/// The lines that are not empty, with 0 for every number and for the dash of an empty cell.
fn words(text: &str) -> Vec<String> {
    let form = |line: &str| {
        let mut words = String::new();
        for c in narrow(line).chars() {
            let dash = c == '–' && words.ends_with(' ');
            let c = if c.is_ascii_digit() || dash || (c == '.' && words.ends_with('0')) { '0' } else { c };
            if !(words.ends_with(c) && c == '0') {
                words.push(c);
            }
        }
        words
    };
    text.lines().filter(|line| !line.trim().is_empty()).map(form).collect()
}

/// For each line of `shown` that is not empty, the line of `output` that equals it in this form, or the first line without
/// one; `…` stands for any number of lines, or for a part of one.
fn aligned<'a>(shown: &'a str, output: &str, form: fn(&str) -> Vec<String>) -> Result<Vec<Option<usize>>, &'a str> {
    let output = form(output);
    let (mut at, mut free, mut places) = (0, false, Vec::new());
    for (line, sought) in shown.lines().filter(|line| !line.trim().is_empty()).zip(form(shown)) {
        if line.trim() == "…" {
            free = true;
            places.push(None);
            continue;
        }
        let same = |given: &String| match sought.split_once('…') {
            Some((begin, end)) => given.starts_with(begin) && given.ends_with(end),
            None => *given == sought,
        };
        let reach = if free { output.len() } else { output.len().min(at + 1) };
        let found = output.get(at..reach).into_iter().flatten().position(same).ok_or(line)?;
        places.push(Some(at + found));
        (at, free) = (at + found + 1, false);
    }
    Ok(places)
}

/// The first line of `shown` that `output` does not have.
fn difference<'a>(shown: &'a str, output: &str) -> Option<&'a str> {
    aligned(shown, output, numbers).err()
}

/// The lines of `shown` with the numbers of `output`; an error is the first line whose words differ.
fn renewed(shown: &str, output: &str) -> Result<Vec<String>, String> {
    let mut places = aligned(shown, output, words)?.into_iter();
    let output: Vec<&str> = output.lines().filter(|line| !line.trim().is_empty()).collect();
    let renew = |line: &str| {
        let place = if line.trim().is_empty() { None } else { places.next().flatten() };
        place.filter(|_| !line.contains('…')).map_or(line, |place| output[place].trim_end()).to_owned()
    };
    Ok(shown.lines().map(renew).collect())
}

#[cfg(target_os = "linux")]
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    for name in ["datasets", "experiments", "examples"] {
        std::os::unix::fs::symlink(root().join(name), folder.path().join(name)).unwrap();
    }
    folder
}

/// Runs the blocks of a page in `folder` and compares their output, or writes it to the page.
#[cfg(target_os = "linux")]
fn run(page: &str, folder: &Path) {
    let file = root().join("docs").join(page);
    let text = fs::read_to_string(&file).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_seafix")).parent().unwrap();
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap());
    let mut fresh: Vec<String> = text.lines().map(str::to_owned).collect();
    let (mut output, mut ran) = (None, 0);
    for block in split(&text).0 {
        let place = format!("docs/{page}:{}", block.line);
        match (block.language.as_str(), block.title) {
            ("rust", _) | ("python", None) => output = None,
            ("sh", None) => {
                let script = format!("exec 2>&1\n{}", block.text);
                let ended = Command::new("sh").args(["-ec", &script]).current_dir(folder).env("PATH", &path).output();
                let ended = ended.unwrap();
                let printed = String::from_utf8(ended.stdout).unwrap();
                assert!(ended.status.success(), "{place}: {}\n{printed}", ended.status);
                (output, ran) = (Some(printed), ran + 1);
            }
            ("text", None) => {
                let Some(printed) = output.take() else { continue };
                let Some(different) = difference(&block.text, &printed) else { continue };
                let update = std::env::var_os("SEAFIX_UPDATE").is_some();
                assert!(update, "{place}: not printed: {different}\n{printed}run the tests once with SEAFIX_UPDATE=1");
                let lines = renewed(&block.text, &printed).unwrap_or_else(|line| panic!("{place}: {line}\n{printed}"));
                let left = difference(&lines.join("\n"), &printed).map(str::to_owned);
                assert!(left.is_none(), "{place}: to be written by hand: {}\n{printed}", left.unwrap());
                fresh.splice(block.line..block.line + lines.len(), lines);
            }
            (_, Some(title)) => {
                let file = folder.join(title);
                fs::create_dir_all(file.parent().unwrap()).unwrap();
                fs::write(file, block.text).unwrap();
            }
            _ => {}
        }
    }
    assert!(ran > 0, "{page}: no block is run");
    let fresh = fresh.join("\n") + "\n";
    if fresh != text {
        fs::write(file, fresh).unwrap();
    }
}

#[cfg(target_os = "linux")]
macro_rules! page {
    ($($name:ident: $file:literal),* $(,)?) => {
        $(
            #[test]
            fn $name() {
                let folder = folder();
                if $file.contains("ros2") {
                    sample_recording(&folder.path().join("dive.mcap"));
                }
                run($file, folder.path());
            }
        )*

        #[test]
        fn every_tutorial_is_run() {
            let tested = [$($file),*];
            for page in pages("docs/tutorials") {
                let file = format!("tutorials/{}", page.file_name().unwrap().display());
                let commands = fs::read_to_string(&page).unwrap().contains("\n```sh\n");
                assert!(!commands || tested.contains(&file.as_str()), "{file} has no test here");
            }
        }
    };
}

#[cfg(target_os = "linux")]
page! {
    the_first_fix_is_as_written: "tutorials/first-fix.md",
    own_data_is_as_written: "tutorials/own-data.md",
    a_recording_is_as_written: "tutorials/ros2.md",
    a_chessboard_is_as_written: "tutorials/chessboard.md",
    a_comparison_is_as_written: "tutorials/compare.md",
    a_report_is_as_written: "tutorials/report.md",
    a_sweep_is_as_written: "tutorials/cluster.md",
    generated_problems_are_as_written: "tutorials/property-test.md",
}

#[test]
fn output_is_compared_by_its_words_and_numbers() {
    let output = "1/2 frames\n2/2 frames\nfix of A: 4.71 mm\n";
    assert_eq!(difference("…\nfix of A: 4.71 mm\n", output), None);
    assert_eq!(difference("1/2 frames\n2/2 frames\nfix … mm\n", output), None);
    assert_eq!(difference("…\nfix of A: 4.72 mm\n", output), Some("fix of A: 4.72 mm"));
    assert_eq!(difference("fix of A: 4.71 mm\n", output), Some("fix of A: 4.71 mm"));
    assert_eq!(difference("…\nfix of B: 4.71 mm\n", output), Some("fix of B: 4.71 mm"));
    assert_eq!(links("[a](b.md#c) `[x](y)` ![i](p.png) [w](https://w)"), ["b.md#c", "p.png"]);
}

/// Fails if a column of times is compared, if the column before it is not, or if a time is compared in a sentence.
#[test]
fn times_are_not_compared() {
    let table =
        |tre: &str, ms: &str| format!("method  TRE mm  ms\n──────────\na + b  {tre}  {ms}\n\nframes: in 7 MB, 3 m\n");
    assert_eq!(difference(&table("1.5", "2.0"), &table("1.5", "  13.0")), None);
    assert_eq!(difference(&table("1.5", "2.0"), &table("1.6", "2.0")), Some("a + b  1.5  2.0"));
    assert_eq!(difference("2 frames in 3.1 s, 20 MB", "2 frames in 4 s, 31 MB"), None);
    assert_eq!(difference("3 frames in 3.1 s, 20 MB", "2 frames in 3.1 s, 20 MB"), Some("3 frames in 3.1 s, 20 MB"));
}

/// Fails if a line is renewed from the line before or after it, or if `…` is.
#[test]
fn blocks_are_renewed_from_the_output() {
    let output = "1/2 frames\n2/2 frames\n\nA  4.7  –\nA  12.0  3\nend\n";
    assert_eq!(renewed("…\nA  1.0  2\nA  –  –\n\n…\n", output).unwrap(), ["…", "A  4.7  –", "A  12.0  3", "", "…"]);
    assert_eq!(renewed("…\nB  1.0  2\n", output).unwrap_err(), "B  1.0  2");
}
