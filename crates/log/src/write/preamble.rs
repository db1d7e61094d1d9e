//! The part of a log before its first frame.

use std::collections::BTreeMap;

use crate::{
    convert,
    record::TrialHeader,
    topic::{self, Logged, SchemaOf},
    view::{self, Places},
};

/// The records before the first frame. All of them follow from the header, so that a copy of the header restores them.
pub(crate) struct Preamble<'a> {
    /// The metadata record `run`.
    pub(crate) metadata: BTreeMap<String, String>,
    /// The names and texts of the attachments.
    pub(crate) attachments: [(&'static str, &'a str); 2],
    /// The messages: topic, schema and bytes. The first is the header.
    pub(crate) messages: Vec<(&'static str, SchemaOf, Vec<u8>)>,
}

impl<'a> Preamble<'a> {
    /// The name of the metadata record.
    pub(crate) const METADATA: &'static str = "run";

    /// The records of `header`, at the stamp of the first frame.
    pub(crate) fn of(header: &'a TrialHeader, places: &Places, stamp: u64) -> Self {
        let mut messages = Vec::new();
        add(&mut messages, topic::HEADER, &convert::header_message(header));
        for (topic, calibration) in topic::CALIBRATIONS.into_iter().zip(view::calibrations(&header.rig, stamp)) {
            add(&mut messages, topic, &calibration);
        }
        add(&mut messages, topic::TF, &view::fixed_transforms(places, stamp));
        add(&mut messages, topic::SCENE_MODEL, &view::model_scene(header, stamp));
        add(&mut messages, topic::MODEL, &view::model_cloud(header, places, stamp));
        add(&mut messages, topic::MODEL_EDGES, &view::model_edges(header, places, stamp));
        let attachments = [("configuration.toml", &header.configuration[..]), ("site.toml", &header.site[..])];
        Self { metadata: summary(header), attachments, messages }
    }
}

fn add<M: Logged>(messages: &mut Vec<(&'static str, SchemaOf, Vec<u8>)>, topic: &'static str, message: &M) {
    messages.push((topic, M::schema, message.encode_to_vec()));
}

/// The metadata record `run`: what a person wants to know without opening a message.
fn summary(header: &TrialHeader) -> BTreeMap<String, String> {
    let own = [
        ("run", &header.run),
        ("trial", &header.trial),
        ("title", &header.title),
        ("question", &header.question),
        ("command", &header.command),
        ("source", &header.source),
    ];
    let own = own.into_iter().map(|(key, value)| (key.to_owned(), value.clone()));
    let axes = header.axes.iter().map(|axis| (format!("axis.{}", axis.key), axis.value.clone()));
    let seeds = header.seeds.iter().map(|(name, value)| (format!("seed.{name}"), value.to_string()));
    let versions = header.versions.iter().map(|(name, value)| (format!("version.{name}"), value.clone()));
    own.chain(axes).chain(seeds).chain(versions).collect()
}
