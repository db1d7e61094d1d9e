//! Safety against hostile input and newer versions.
//!
//! Names are plain text in HTML, LaTeX, CSV, PDF and the terminal (B42). Logs of a newer version are rejected with both
//! versions (B57).

use std::{fs, process::Command};

use seafix_report::{Forms, report, summary};

use crate::made_up::write_run;

/// Seen to fail where control characters reach the terminal.
#[test]
fn names_command_nothing() {
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[5.0]);
    let out = folder.path().join("report");
    report(folder.path(), &out, Forms::ALL).unwrap();
    let read = |name: &str| fs::read_to_string(out.join(name)).unwrap();
    let page = read("report.html");
    assert!(!page.contains("<script") && page.contains("&lt;script&gt;"));
    let latex = read("report.tex");
    assert!(!latex.contains("\\input") && latex.contains("\\textbackslash{}input"));
    for file in fs::read_dir(out.join("tables")).unwrap().chain(fs::read_dir(out.join("figures")).unwrap()) {
        let path = file.unwrap().path();
        let bytes = fs::read(&path).unwrap();
        if path.extension().is_some_and(|e| e != "pdf") {
            assert!(!bytes.contains(&0x1b), "{}", path.display());
            assert!(
                path.extension().is_none_or(|e| e != "svg")
                    || !String::from_utf8(bytes.clone()).unwrap().contains("<script")
            );
        }
        if path.extension().is_some_and(|e| e == "csv") {
            for line in String::from_utf8(bytes).unwrap().lines() {
                assert!(!line.starts_with(['=', '+', '@']) && !line.contains(",="), "{line}");
            }
        }
    }
    for text in [page, latex, read("summary.txt"), read("run.bib"), summary(folder.path()).unwrap().to_string()] {
        assert!(!text.contains('\u{1b}'));
    }
}

/// The source compiles with `article`, `booktabs` and `graphicx` alone.
///
/// It gives no error and no box that is more than 2 pt too wide. Skipped without LaTeX.
#[test]
fn latex_compiles() {
    if Command::new("pdflatex").arg("--version").output().is_err() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[5.0]);
    let out = folder.path().join("report");
    report(folder.path(), &out, Forms::ALL).unwrap();
    let mut latex = Command::new("pdflatex");
    let ran = latex.args(["-interaction=nonstopmode", "report.tex"]).current_dir(&out).output().unwrap();
    let log = String::from_utf8_lossy(&fs::read(out.join("report.log")).unwrap()).into_owned();
    let errors: Vec<&str> = log.lines().filter(|line| line.starts_with('!')).collect();
    assert!(ran.status.success() && errors.is_empty(), "{errors:#?}");
    for line in log.lines().filter(|line| line.starts_with("Overfull \\hbox")) {
        let points = line.split(['(', 'p']).nth(2).and_then(|text| text.parse::<f64>().ok());
        assert!(points.is_some_and(|points| points <= 2.0), "{line}");
    }
    let packages: Vec<&str> = fs::read_to_string(out.join("report.tex"))
        .unwrap()
        .leak()
        .lines()
        .filter(|l| l.starts_with("\\usepackage"))
        .collect();
    assert_eq!(packages, ["\\usepackage{booktabs}", "\\usepackage{graphicx}"]);
}

#[test]
fn a_newer_log_is_rejected_with_both_versions() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("001.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    let schema = writer.add_schema("seafix.v3.TrialHeader", "protobuf", b"").unwrap();
    let channel = writer.add_channel(schema, "/run/header", "protobuf", &Default::default()).unwrap();
    let header = mcap::records::MessageHeader { channel_id: channel, sequence: 0, log_time: 1, publish_time: 1 };
    writer.write_to_known_channel(&header, b"").unwrap();
    writer.finish().unwrap();
    let rejected = report(folder.path(), &folder.path().join("report"), Forms::ALL).unwrap_err().to_string();
    assert!(rejected.contains("seafix.v3.TrialHeader") && rejected.contains("seafix.v2.TrialHeader"), "{rejected}");
    assert!(!folder.path().join("report").exists(), "no report is written");
}

/// Seen to fail where the manifest is not read.
#[test]
fn a_newer_manifest_is_rejected_with_both_versions() {
    let folder = tempfile::tempdir().unwrap();
    write_run(folder.path(), &[5.0]);
    let out = folder.path().join("report");
    for (format, known) in [("2", true), ("2.9", true), ("2.12", true), ("12", false), ("1.2", false), ("9.1", false)] {
        let manifest = format!("{{\"format\": \"seafix-manifest/{format}\"}}");
        fs::write(folder.path().join("manifest.json"), manifest).unwrap();
        let made = report(folder.path(), &out, Forms::ALL);
        assert_eq!(made.is_ok(), known, "{format}");
        let Err(rejected) = made else { continue };
        let rejected = rejected.to_string();
        assert!(rejected.contains(&format!("seafix-manifest/{format}")), "{rejected}");
        assert!(rejected.contains("reads seafix-manifest/2"), "{rejected}");
    }
}
