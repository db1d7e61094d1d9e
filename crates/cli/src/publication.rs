//! Lists of published experiments: the format `seafix-reports/1`.

use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

use seafix_component::{Fault, place_at, read_text};
use seafix_experiment::Plan;
use seafix_report::{Answer, AnswerError};
use serde::Deserialize;
use toml::Spanned;

const FORMAT: &str = "seafix-reports/1";

/// The file: its reports in the order of the page of all findings.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    #[serde(default)]
    report: Vec<Entry>,
}

/// One report.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// The experiment file, relative to the folder of the list.
    experiment: String,
    /// Changed settings, `source.frames=60`; the page states them.
    #[serde(default)]
    set: Vec<String>,
    /// The answer to the question, words and queries in braces; without it the answer is generated.
    answer: Option<Spanned<String>>,
    /// The relations that the words of the answer assert.
    #[serde(default)]
    claims: Vec<Spanned<String>>,
}

impl Entry {
    /// The written answer, if there is one; the fault has the place of the answer or of the claim in `text`.
    fn answer(&self, path: &Path, text: &str) -> Result<Option<Answer>, Fault> {
        let fault = |error: AnswerError, start: usize| {
            Fault::new(error.what, path)
                .at(Some(place_at(text, start)))
                .value(format!("`{}`", error.place))
                .remedy(error.remedy)
        };
        let Some(answer) = &self.answer else {
            let Some(claim) = self.claims.first() else { return Ok(None) };
            let error = AnswerError {
                place: claim.get_ref().clone(),
                what: "a claim without an answer".to_owned(),
                remedy: "add `answer`, or remove the claim".to_owned(),
            };
            return Err(fault(error, claim.span().start));
        };
        let none: [&str; 0] = [];
        Answer::parse(answer.get_ref(), &none).map_err(|error| fault(error, answer.span().start))?;
        for claim in &self.claims {
            Answer::parse(answer.get_ref(), &[claim.get_ref()]).map_err(|error| fault(error, claim.span().start))?;
        }
        let claims: Vec<&String> = self.claims.iter().map(Spanned::get_ref).collect();
        Answer::parse(answer.get_ref(), &claims).map(Some).map_err(|error| fault(error, answer.span().start))
    }
}

/// A published experiment.
#[derive(Debug)]
pub(crate) struct Published {
    /// The experiment's name, and that of its folders.
    pub(crate) name: String,
    pub(crate) plan: Plan,
    /// The written answer; `None` for a generated one.
    pub(crate) answer: Option<Answer>,
}

/// Reads the list and every experiment in it.
///
/// # Errors
/// All faults of the list and its experiments.
pub(crate) fn read(path: &Path) -> Result<Vec<Published>, Vec<Fault>> {
    let text = read_text(path).map_err(|fault| vec![fault])?;
    let file: File = toml::from_str(&text).map_err(|error| vec![Fault::in_toml(path, &text, &error)])?;
    let mut faults = Vec::new();
    if file.format != FORMAT {
        let fault = Fault::new("unsupported format", path).value(format!("`{}`", file.format));
        faults.push(fault.remedy(format!("use {FORMAT}")));
    }
    if file.report.is_empty() {
        faults.push(Fault::new("no report", path).remedy("add [[report]] with `experiment = \"FILE.toml\"`"));
    }
    let (mut published, mut names) = (Vec::new(), BTreeSet::new());
    for entry in file.report {
        let experiment: PathBuf = path.parent().unwrap_or(Path::new("")).join(&entry.experiment);
        let answer = entry.answer(path, &text).unwrap_or_else(|fault| {
            faults.push(fault);
            None
        });
        match Plan::read(&experiment, &entry.set) {
            Ok(plan) if names.insert(plan.name.clone()) => {
                published.push(Published { name: plan.name.clone(), plan, answer });
            }
            Ok(plan) => {
                let fault = Fault::new("two reports with one name", path).value(format!("`{}`", plan.name));
                faults.push(fault.remedy("rename one of the experiment files"));
            }
            Err(more) => faults.extend(more),
        }
    }
    if faults.is_empty() { Ok(published) } else { Err(faults) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_faults_of_a_list_are_reported_at_once() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("a.toml", "question = 'Why?'\nsource = 'virtual-points'\n");
        let reported = |text: &str| {
            write("list.toml", text);
            let faults = read(&folder.path().join("list.toml")).map(|all| all.len());
            faults.map_err(|faults| faults.iter().map(|fault| fault.to_string() + "\n").collect::<String>())
        };
        let one = "[[report]]\nexperiment = 'a.toml'\n";
        assert_eq!(reported(&format!("format = 'seafix-reports/1'\n{one}")), Ok(1));
        let reported_of = |text: &str| reported(text).unwrap_err();
        assert!(reported_of(&format!("format = 'seafix-reports/1'\n{one}{one}")).contains("two reports with one name"));
        assert!(reported_of(&format!("format = 'seafix-reports/2'\n{one}")).contains("unsupported format"));
        assert!(reported_of("format = 'seafix-reports/1'\n").contains("no report"));
        assert!(reported_of("format = 'seafix-reports/1'\n[[report]]\nexperimnt = 'a.toml'\n").contains("list.toml:3"));
        let answered = |more: &str| format!("format = 'seafix-reports/1'\n{one}{more}\n");
        assert_eq!(reported(&answered("answer = 'Yes, in {fix-rate: all}.'\nclaims = ['wrong: all = 0']")), Ok(1));
        let misspelt = reported_of(&answered("answer = 'Yes, in {fixrate: all}.'"));
        assert!(misspelt.contains("list.toml:4:10: `fixrate: all`; did you mean `fix-rate`?"), "{misspelt}");
        let unrelated = reported_of(&answered("answer = 'Yes.'\nclaims = ['wrong: all = 0', 'wrong: all']"));
        assert!(unrelated.contains("no relation in ") && unrelated.contains("list.toml:5:29"), "{unrelated}");
        assert!(reported_of(&answered("claims = ['wrong: all = 0']")).contains("a claim without an answer"));
        let both = reported_of("format = 'seafix-reports/0'\n[[report]]\nexperiment = 'b.toml'\n");
        assert!(both.contains("unsupported format") && both.contains("b.toml"), "{both}");
    }

    /// The text of a page: tags removed, white space joined, entities decoded.
    fn plain(page: &str) -> String {
        let text: String = page.split('<').map(|part| part.split_once('>').map_or(part, |(_, text)| text)).collect();
        let signs = [("&lt;", "<"), ("&gt;", ">"), ("&quot;", "\""), ("&#39;", "'"), ("&nbsp;", " "), ("&amp;", "&")];
        let text = signs.iter().fold(text, |text, (written, sign)| text.replace(written, sign));
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// The committed reports agree with each other and with the list. No experiment runs: a release's reports need not
    /// equal the results of the current program.
    ///
    /// Seen to fail with a digit of README.md changed, and with two reports exchanged in it.
    #[test]
    fn the_reports_of_a_release_agree_with_each_other() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let reports = root.join("reports");
        let text = std::fs::read_to_string(reports.join("README.md")).unwrap();
        let (head, sections) = text.split_once("\n## ").unwrap();
        let version = head.split_once("Made by seafix ").unwrap().1.split(' ').next().unwrap();
        assert_eq!(version.trim_end_matches('.').split('.').filter(|part| part.parse::<u32>().is_ok()).count(), 3);
        let sections: Vec<(&str, &str)> = sections.split("\n## ").map(|one| one.split_once('\n').unwrap()).collect();
        let listed = read(&root.join("experiments/reports.toml")).unwrap();
        let listed: Vec<&str> = listed.iter().map(|one| one.name.as_str()).collect();
        assert_eq!(sections.iter().map(|(name, _)| *name).collect::<Vec<_>>(), listed);
        for (name, section) in sections {
            let page = plain(&std::fs::read_to_string(reports.join(name).join("report.html")).unwrap());
            let message = section
                .lines()
                .filter_map(|line| line.strip_prefix("- "))
                .map(|message| message.replace(['\\', '`'], "").replace("**", ""));
            let message: Vec<String> =
                message.map(|message| message.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
            assert!(!message.is_empty(), "{name}");
            for sentence in message {
                assert!(page.contains(&sentence), "reports/{name}/report.html lacks: {sentence}");
            }
            for link in section.split("](").skip(1).map(|rest| rest.split_once(')').unwrap().0) {
                assert!(link.starts_with(&format!("{name}/")) && reports.join(link).exists(), "reports/{link}");
            }
        }
    }
}
