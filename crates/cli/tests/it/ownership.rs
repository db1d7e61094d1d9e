//! No command loses a file that it has not written.

use std::{
    collections::BTreeMap,
    fs,
    os::unix::fs::symlink,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

use crate::{Ended, ended, program};

const EXPERIMENT: &str = "question = 'Is anything lost?'\n[source]\nname = 'virtual-points'\nframes = 20\n\
    [pipeline]\nsolver = 'kabsch'\n";

/// A folder with an experiment, and with files of a user.
struct Place {
    folder: TempDir,
    user: BTreeMap<PathBuf, String>,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("e.toml"), EXPERIMENT).unwrap();
        Self { folder, user: BTreeMap::new() }
    }

    fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// A file of the user, which must stay.
    fn user(&mut self, name: &str) -> &mut Self {
        let (path, text) = (self.at(name), format!("{name}: a year of work"));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(&path, &text).unwrap();
        self.user.insert(path, text);
        self
    }

    fn seafix(&self, arguments: &[&str]) -> Ended {
        ended(program().current_dir(self.folder.path()).args(arguments))
    }

    fn run(&self, out: &str, more: &[&str]) -> Ended {
        self.seafix(&[&["run", "e.toml", "--untimed", "--out", out], more].concat())
    }

    fn made(&self, out: &str, more: &[&str]) {
        let ended = self.run(out, more);
        assert_eq!(ended.code, Some(0), "{}", ended.error);
    }

    /// The command must be rejected in one line with this code, and all files of the user stay.
    fn rejected(&self, code: i32, part: &str, arguments: &[&str]) {
        let Ended { code: found, error, .. } = self.seafix(arguments);
        assert_eq!(found, Some(code), "{arguments:?}: {error}");
        assert!(error.contains(part) && error.lines().count() == 1, "{arguments:?}: {error}");
        self.unharmed();
    }

    fn unharmed(&self) {
        for (path, text) in &self.user {
            assert_eq!(fs::read_to_string(path).ok().as_ref(), Some(text), "{}", path.display());
        }
        assert!(remains(self.folder.path()).is_empty(), "{:?}", remains(self.folder.path()));
    }
}

/// The unfinished files below a folder.
fn remains(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir() && !path.is_symlink());
    let files = files.into_iter().filter(|path| path.to_string_lossy().contains(".partial"));
    files.chain(folders.iter().flat_map(|folder| remains(folder))).collect()
}

/// Fails where a manifest or the names of files count as a proof.
#[test]
fn a_folder_without_a_marker_is_not_ours() {
    let mut place = Place::new();
    place.made("real", &[]);
    place.made("other", &[]);
    place.user("mine/manifest.json").user("mine/thesis.mcap").user("mine/results.csv").user("mine/report/report.html");
    // Even a copied manifest proves nothing.
    fs::create_dir(place.at("copy")).unwrap();
    fs::copy(place.at("real/manifest.json"), place.at("copy/manifest.json")).unwrap();
    place.user("copy/dive.mcap");
    for out in ["mine", "copy"] {
        for more in [&[][..], &["--overwrite"], &["--resume"]] {
            place.rejected(4, "the output folder is not empty", &[&["run", "e.toml", "--out", out], more].concat());
        }
        place.rejected(4, "which no report here has written", &["report", "real", "--out", out]);
    }
    place.rejected(4, "which no report here has written", &["report", "real", "--out", "mine/report"]);
    place.user("notes/README.md");
    place.rejected(4, "README.md", &["report", "real", "--out", "notes", "--index"]);
    place.rejected(4, "which no report here has written", &["compare", "real", "other", "--out", "notes"]);
    place.rejected(4, "it is not empty", &["man", "notes"]);
    place.user("swept-shards/logs/1.log");
    let sweep = ["sweep", "e.toml", "--shards", "2", "--out", "swept"];
    place.rejected(4, "folder of the shards is not empty", &sweep);
    // A lock is not ours by its name.
    place.user("locked/.lock");
    place.rejected(4, "the output folder is not empty", &["run", "e.toml", "--out", "locked"]);
    // A run is neither a report nor the folder of one.
    place.rejected(4, "which no report here has written", &["report", "real", "--out", "real"]);
    assert!(place.at("real/results.csv").exists());
}

/// Fails where a folder of the run is removed with its content.
#[test]
fn a_file_of_the_user_in_a_run_stays() {
    for name in ["notes.txt", "pieces/000000/notes.txt", "report/notes.txt", "report/figures/mine.svg"] {
        let mut place = Place::new();
        place.made("out", &[]);
        place.user(&format!("out/{name}"));
        place.rejected(4, "not part of a run", &["run", "e.toml", "--out", "out", "--overwrite"]);
        assert!(place.at("out/results.csv").exists());
        // A resumed run and a new report leave it, too.
        for command in [&["run", "e.toml", "--untimed", "--out", "out", "--resume"][..], &["report", "out", "--html"]] {
            let ended = place.seafix(command);
            assert_eq!(ended.code, Some(0), "{name}: {}", ended.error);
            place.unharmed();
        }
    }
    // The next report would have this file.
    let mut place = Place::new();
    place.made("out", &[]);
    assert_eq!(place.seafix(&["report", "out", "--out", "page", "--html"]).code, Some(0));
    place.user("page/report.pdf");
    place.rejected(4, "report.pdf", &["report", "out", "--out", "page"]);
}

/// Fails where files are opened by names that may be links.
#[test]
fn nothing_is_written_through_a_link() {
    let mut place = Place::new();
    place.user("mine/thesis.txt").user("mine/seal.json").user("mine/1/rows.csv").user("mine/report.html");
    place.made("out", &[]);
    let link = |to: &str, name: &str| {
        let _ = fs::remove_file(place.at(name)).or_else(|_| fs::remove_dir_all(place.at(name)));
        symlink(place.at(to), place.at(name)).unwrap();
    };
    link("mine", "linked");
    place.rejected(4, "a symbolic link", &["run", "e.toml", "--out", "linked", "--overwrite"]);
    place.rejected(4, "a symbolic link", &["report", "out", "--out", "linked"]);
    link("mine/thesis.txt", "out/.lock");
    place.rejected(4, "not a regular file", &["run", "e.toml", "--out", "out", "--overwrite"]);
    fs::remove_file(place.at("out/.lock")).unwrap();
    link("mine", "out/report/figures");
    place.rejected(4, "a file or symbolic link has this name", &["report", "out"]);
    place.rejected(4, "not part of a run", &["run", "e.toml", "--out", "out", "--overwrite"]);
    fs::remove_file(place.at("out/report/figures")).unwrap();
    link("mine", "out/pieces");
    place.rejected(4, "not part of a run", &["run", "e.toml", "--out", "out", "--overwrite"]);
    fs::remove_file(place.at("out/pieces")).unwrap();
    for name in ["out/results.csv", "out/manifest.json.partial", "out/results.csv.partial", "out/report/report.html"] {
        link("mine/thesis.txt", name);
    }
    place.made("out", &["--overwrite"]);
    place.unharmed();
    link("mine/thesis.txt", "out/.seafix-run");
    place.rejected(4, "an invalid marker", &["run", "e.toml", "--out", "out", "--overwrite"]);
    // Single files.
    for name in ["saved.mcap.partial", "saved.mcap.partial-1"] {
        link("mine/thesis.txt", name);
    }
    let recovered = place.seafix(&["recover", "out/001.mcap", "--out", "saved.mcap"]);
    assert_eq!(recovered.code, Some(0), "{}", recovered.error);
    ["saved.mcap.partial", "saved.mcap.partial-1"].iter().for_each(|name| fs::remove_file(place.at(name)).unwrap());
    place.unharmed();
}

/// Fails where the marker is believed.
#[test]
fn a_marker_names_no_file_elsewhere() {
    let mut place = Place::new();
    place.user("mine/thesis.txt").user("thesis.txt");
    place.made("out", &[]);
    let marker = fs::read_to_string(place.at("out/.seafix-run")).unwrap();
    for name in ["../thesis.txt", "../mine/*/thesis.txt", "/etc/hostname"] {
        fs::write(place.at("out/.seafix-run"), marker.replace("manifest.json", name)).unwrap();
        place.rejected(4, "an invalid marker", &["run", "e.toml", "--out", "out", "--overwrite"]);
    }
}

/// Fails where names of trials become paths unchecked.
#[test]
fn the_name_of_a_trial_does_not_leave_the_folder() {
    let mut place = Place::new();
    for k in ["1", "2"] {
        place.made(k, &["--shard", &format!("{k}/2")]);
    }
    place.user("escaped.mcap");
    let manifest = fs::read_to_string(place.at("1/manifest.json")).unwrap();
    for (from, to) in [("\"001.mcap\"", "\"../escaped.mcap\""), ("\"name\": \"001\"", "\"name\": \"../escaped\"")] {
        for k in ["1", "2"] {
            fs::write(place.at(k).join("manifest.json"), manifest.replace(from, to)).unwrap();
        }
        place.rejected(3, "no file name in its folder", &["merge", "1", "2", "--out", "all"]);
        assert!(!place.at("all").exists());
    }
    place.made("run", &[]);
    let log = seafix_log::read(&place.at("run/001.mcap")).unwrap();
    let header = seafix_log::TrialHeader { trial: "../escaped".to_owned(), ..log.header };
    let mut writer = seafix_log::Writer::create(&place.at("foreign.mcap"), &header).unwrap();
    log.frames.iter().for_each(|frame| writer.frame(frame).unwrap());
    writer.finish().unwrap();
    place.rejected(3, "no valid file name", &["replay", "foreign.mcap", "--out", "again"]);
}

/// Fails where `--overwrite` removes a run before it is read.
#[test]
fn an_input_is_never_an_output() {
    let place = Place::new();
    place.made("run", &[]);
    for k in ["1", "2"] {
        place.made(k, &["--shard", &format!("{k}/2")]);
    }
    place.rejected(4, "an input in the output folder", &["replay", "run/001.mcap", "--out", "run", "--overwrite"]);
    place.rejected(4, "an input in the output folder", &["merge", "1", "2", "--out", "1", "--overwrite"]);
    assert!(place.at("run/001.mcap").exists() && place.at("1/pieces").exists());
    place.rejected(4, "exists", &["recover", "run/001.mcap", "--out", "run/001.mcap"]);
    let set = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets/virtual-sample");
    fs::create_dir(place.at("set")).unwrap();
    for entry in fs::read_dir(set).unwrap().flatten() {
        fs::copy(entry.path(), place.at("set").join(entry.file_name())).unwrap();
    }
    let before = fs::read(place.at("set/truth.tum")).unwrap();
    fs::hard_link(place.at("set/left000.png"), place.at("hard.ply")).unwrap();
    let pair = ["set/left000.png", "set/right000.png", "--rig", "set/dataset.toml"];
    for (command, out) in [
        ([&["cloud"], &pair[..]].concat(), "set/dataset.toml"),
        ([&["cloud"], &pair[..]].concat(), "hard.ply"),
        (vec!["odometry", "set"], "set/truth.tum"),
        (vec!["eval", "set/truth.tum", "set/prior.tum"], "set/prior.tum"),
    ] {
        let out = ["--out", out];
        place.rejected(4, "an input as output", &[&command[..], &out].concat());
        place.rejected(4, "an input as output", &[&command[..], &out, &["--overwrite"]].concat());
    }
    assert_eq!(fs::read(place.at("set/truth.tum")).unwrap(), before);
    place.rejected(4, "not empty", &["run", "set", "--out", "set", "--overwrite"]);
    // Another file is replaced on request only.
    let eval = ["eval", "set/truth.tum", "set/prior.tum", "--out", "matched.tum"];
    assert_eq!(place.seafix(&eval).code, Some(0));
    place.rejected(4, "exists", &eval);
    assert_eq!(place.seafix(&[&eval[..], &["--overwrite"]].concat()).code, Some(0));
}
