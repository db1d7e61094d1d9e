//! The MCAP files of a recording: one, or those in a folder of rosbag2.

use std::path::{Component, Path, PathBuf};

use seafix_component::Fault;
use seafix_io::yaml;
use seafix_log::{Entry, Recording, Topic};

use super::logged::fault;

/// The name of the file that describes a folder of rosbag2.
const DESCRIPTION: &str = "metadata.yaml";

/// A recording in one or several files, in order.
#[derive(Debug)]
pub(crate) struct Recordings {
    files: Vec<Recording>,
    /// The topics of all files, one a name.
    topics: Vec<Topic>,
    messages: Vec<Message>,
}

/// The place of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Message {
    file: usize,
    entry: Entry,
    /// The index of its topic.
    pub(super) topic: usize,
    /// The time at which it was recorded (ns).
    pub(super) log_time: u64,
    /// Its number on its channel.
    pub(super) sequence: u32,
}

/// Whether `path` is a folder of rosbag2 or its description.
pub fn is_recording(path: &Path) -> bool {
    described(path).is_some()
}

/// Whether a recording is the log of a trial.
pub(crate) fn is_log(recording: &Recordings) -> bool {
    recording.topics().iter().any(|topic| topic.schema == "seafix.v2.TrialHeader")
}

/// The description of a folder of rosbag2: `path` itself or the file in the folder `path`.
fn described(path: &Path) -> Option<PathBuf> {
    let file = if path.is_dir() { path.join(DESCRIPTION) } else { path.to_owned() };
    let named = file.file_name().is_some_and(|name| name == DESCRIPTION) && file.is_file();
    (named && seafix_component::read_text(&file).is_ok_and(|text| text.contains("rosbag2_bagfile_information")))
        .then_some(file)
}

/// The files of the recording at `path`: an MCAP file, a folder of rosbag2 or its `metadata.yaml`, or a folder with one
/// MCAP file.
///
/// # Errors
/// A description without files, files of another storage, a folder with several files and no description.
pub(super) fn files(path: &Path) -> Result<Vec<PathBuf>, Fault> {
    if let Some(file) = described(path) {
        return listed(&file);
    }
    if !path.is_dir() {
        return Ok(vec![path.to_owned()]);
    }
    let unreadable = |error: std::io::Error| Fault::new(format!("cannot read ({error})"), path);
    let entries = std::fs::read_dir(path).map_err(unreadable)?.filter_map(Result::ok).map(|entry| entry.path());
    let mut found: Vec<PathBuf> = entries.filter(|file| is_named_mcap(file) && file.is_file()).collect();
    found.sort();
    match found.len() {
        1 => Ok(found),
        0 => Err(Fault::new("a folder without a recording", path).remedy("name an .mcap file or a folder of rosbag2")),
        _ => {
            let names: Vec<_> = found.iter().filter_map(|file| file.file_name()?.to_str()).collect();
            let fault = Fault::new("several recordings in a folder without metadata.yaml", path);
            Err(fault.value(names.join(", ")).remedy("name one of them, or `ros2 bag reindex` the folder"))
        }
    }
}

/// The files that a `metadata.yaml` lists, in order.
fn listed(file: &Path) -> Result<Vec<PathBuf>, Fault> {
    let content = yaml::read(file)?;
    let information = &content["rosbag2_bagfile_information"];
    let bad = |what: &str, remedy: &str| Fault::new(what, file).remedy(remedy);
    if let Some(storage) = information["storage_identifier"].as_str().filter(|storage| *storage != "mcap") {
        let remedy =
            "convert it: `pip install rosbags`, then `rosbags-convert --src FOLDER --dst OUT --dst-storage mcap`";
        return Err(bad("a recording that is not stored as MCAP", remedy).value(storage));
    }
    let names = information["relative_file_paths"].as_vec().map(Vec::as_slice).unwrap_or_default();
    let names: Vec<&str> = names.iter().filter_map(|name| name.as_str()).collect();
    if names.is_empty() {
        return Err(bad("no `relative_file_paths`", "run `ros2 bag reindex` on the folder"));
    }
    let folder = file.parent().unwrap_or(Path::new(""));
    let inside = |name: &&str| Path::new(name).components().all(|part| matches!(part, Component::Normal(_)));
    if let Some(outside) = names.iter().find(|name| !inside(name)) {
        return Err(bad("a file outside the recording's folder", "give paths below the folder").value(outside));
    }
    // Older versions of rosbag2 wrote the folder's own name before that of the file.
    // A file that was compressed afterwards has a longer name than the listed one.
    let place = |name: &&str| {
        let full = folder.join(name);
        let short = Path::new(name).file_name().map(|name| folder.join(name));
        let candidates = || std::iter::once(&full).chain(&short);
        let named = |file: &Path, end: &str| {
            let mut name = file.as_os_str().to_owned();
            name.push(end);
            PathBuf::from(name)
        };
        let packed = |end: &str| candidates().map(|file| named(file, end)).find(|file| file.exists());
        let found = candidates().find(|file| file.exists()).cloned();
        found.or_else(|| packed(".zstd")).or_else(|| packed(".zst")).unwrap_or(full)
    };
    Ok(names.iter().map(place).collect())
}

/// Whether a file's name is that of an MCAP file, compressed or not.
fn is_named_mcap(file: &Path) -> bool {
    file.file_name()
        .and_then(|name| name.to_str())
        .is_some_and(|name| [".mcap", ".mcap.zstd", ".mcap.zst"].iter().any(|end| name.ends_with(end)))
}

impl Recordings {
    /// Reads through the recording at `path` and notes the messages of the topics that are `wanted`.
    ///
    /// # Errors
    /// Those of [`files`], and a file that is damaged.
    pub(crate) fn open(path: &Path, wanted: impl Fn(&Topic) -> bool) -> Result<Self, Fault> {
        let paths = files(path)?;
        let open = |path: &PathBuf| Recording::open(path, &wanted).map_err(|error| fault(path, &error));
        let files = paths.iter().map(open).collect::<Result<Vec<_>, Fault>>()?;
        let (mut topics, mut messages) = (Vec::<Topic>::new(), Vec::new());
        for (file, recording) in files.iter().enumerate() {
            let own: Vec<usize> = recording
                .topics()
                .iter()
                .map(|topic| {
                    let known = topics.iter().position(|known| known.name == topic.name);
                    known.unwrap_or_else(|| {
                        topics.push(topic.clone());
                        topics.len() - 1
                    })
                })
                .collect();
            messages.extend(recording.entries().iter().map(|&entry| Message {
                file,
                entry,
                topic: own[entry.topic],
                log_time: entry.log_time,
                sequence: entry.sequence,
            }));
        }
        Ok(Self { files, topics, messages })
    }

    /// The topics.
    pub(super) fn topics(&self) -> &[Topic] {
        &self.topics
    }

    /// The messages of the wanted topics, in the order of the files.
    pub(super) fn messages(&self) -> &[Message] {
        &self.messages
    }

    /// Whether check sums covered all that was read.
    pub(super) fn is_protected(&self) -> bool {
        self.files.iter().all(Recording::is_protected)
    }

    /// The bytes of a message.
    ///
    /// # Errors
    /// A file that has changed since it was opened.
    pub(super) fn bytes(&self, message: &Message) -> Result<Vec<u8>, Fault> {
        let recording = &self.files[message.file];
        recording.message(&message.entry).map_err(|error| fault(recording.path(), &error))
    }

    /// The files.
    pub(super) fn paths(&self) -> impl Iterator<Item = &Path> {
        self.files.iter().map(Recording::path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_means_its_files_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        for name in ["dive_0.mcap", "dive_1.mcap"] {
            write(name, "");
        }
        let said = files(folder.path()).unwrap_err().to_string();
        assert!(said.contains("several recordings") && said.contains("dive_0.mcap, dive_1.mcap"), "{said}");
        let listing = |storage: &str, first: &str| {
            write(
                DESCRIPTION,
                &format!(
                    "rosbag2_bagfile_information:\n  storage_identifier: {storage}\n  relative_file_paths:\n    - {first}\n    - dive_0.mcap\n"
                ),
            );
        };
        listing("mcap", "dive/dive_1.mcap");
        let expected = ["dive_1.mcap", "dive_0.mcap"].map(|name| folder.path().join(name));
        assert_eq!(files(folder.path()).unwrap(), expected);
        assert_eq!(files(&folder.path().join(DESCRIPTION)).unwrap(), expected);
        assert!(is_recording(folder.path()));
        listing("mcap", "../dive_1.mcap");
        assert!(files(folder.path()).unwrap_err().to_string().starts_with("a file outside the recording's folder"));
        listing("sqlite3", "dive.db3");
        assert!(files(folder.path()).unwrap_err().to_string().contains("--dst-storage mcap"));
    }
}
