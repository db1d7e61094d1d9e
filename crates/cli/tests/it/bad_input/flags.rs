//! Settings of the command line.

use std::{fs, path::Path};

use tempfile::TempDir;

use super::rejected;

/// A setting that a component rejects is attributed to the change on the command line that made it so.
#[test]
fn a_rejected_change_is_attributed_to_the_flag() {
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample");
    let name = |file: &str| sample.join(file).to_str().unwrap().to_owned();
    let folder = TempDir::new().unwrap();
    let problem = folder.path().join("p.json");
    let points = "[[0,0,0],[1,0,0],[0,1,0]]";
    let text = format!(
        "{{\"format\":\"coherence-problem/1\",\"id\":\"p\",\"model\":{points},\"cloud\":{points},\"sigma\":0.01,\"delta\":0.05}}"
    );
    fs::write(&problem, text).unwrap();
    let cloud =
        ["cloud", &name("left000.png"), &name("right000.png"), "--rig", &name("dataset.toml")].map(str::to_owned);
    let odometry = ["odometry", &name("")].map(str::to_owned);
    let solve = ["solve", problem.to_str().unwrap()].map(str::to_owned);
    let cases: [(&[String], [&str; 2], &str); 6] = [
        (&cloud, ["detector.sigma=-1", "detector.k=0.05"], "give a number from 0.3 to 100"),
        (&cloud, ["detector.sigam=2", "detector.k=0.05"], "did you mean `sigma`?"),
        (&cloud, ["matcher=foo", "detector.k=0.05"], "no matcher is called `foo`"),
        (&odometry, ["detector.sigma=-1", "window=5"], "give a number from 0.3 to 100"),
        (&solve, ["search.budget=-1", "acceptance.min-points=4"], "not a whole number"),
        (&solve, ["acceptance.max-p-wrong=7", "search.budget=9"], "at most 1"),
    ];
    for (command, settings, reported) in cases {
        let mut arguments: Vec<&str> = command.iter().map(String::as_str).collect();
        settings.iter().for_each(|setting| arguments.extend(["--set", setting]));
        rejected(&arguments, 2, &[reported, &format!(" in --set: {}", settings[0])]);
    }
}
