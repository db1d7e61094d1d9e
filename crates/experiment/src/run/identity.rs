//! The identity of a run: a hash of everything that determines its results.
//!
//! It covers the resolved configuration of every trial and the rest of its log header, the SHA-256 of every input file,
//! the versions of all components in use, and the versions of the shared code. It covers neither commit nor machine:
//! two runs with the same identity have the same results.

use std::collections::{BTreeMap, BTreeSet};

use hmac_sha256::Hash as Sha256;
use seafix::REGISTRIES;
use seafix_component::Listing;
use seafix_log::TrialHeader;
use serde::{Deserialize, Serialize};

use seafix_data::{dataset::hex, source::SOURCES};

use crate::{
    experiment::{Plan, Trial},
    run::group::Group,
};

/// The versions of the code outside of components. A change that alters a result for some input raises one;
/// `tests/versions.rs` fails if a result changed without a new version.
pub const SHARED: [SharedPart; 8] = [
    // Cameras, rigs, distortion, transforms and covariances.
    SharedPart { name: "geometry", version: 1, used: |_| true },
    // Points in view, candidates, gates, tolerance, acceptance tests, integrity and joint fixes.
    SharedPart { name: "acceptance", version: 6, used: |_| true },
    // Errors, rates and bounds; the comparison with truth.
    SharedPart { name: "evaluation", version: 1, used: |_| true },
    // The logged quantities and the choice of logged frames.
    SharedPart { name: "log", version: 3, used: |_| true },
    // The order of the stages on a stereo pair, and the trials that share them.
    SharedPart { name: "front-end", version: 4, used: |used| used.images },
    // The navigator, the pose graph and key frames.
    SharedPart { name: "navigation", version: 2, used: |used| used.navigates },
    // Sites, dives, sensors, noisy points, problems and random streams.
    SharedPart { name: "simulation", version: 1, used: |used| used.simulated },
    // Images of dives and of the virtual site.
    SharedPart { name: "renderer", version: 1, used: |used| used.simulated && used.images },
];

/// A part of the shared code with the version of its results.
#[derive(Debug, Clone, Copy)]
pub struct SharedPart {
    /// The name of the part.
    pub name: &'static str,
    /// The version of its results.
    pub version: u32,
    used: fn(&Used) -> bool,
}

/// The parts of the code that a trial uses.
struct Used {
    images: bool,
    labelled: bool,
    navigates: bool,
    simulated: bool,
}

/// All components, one list for each kind, in the order of the pipeline.
pub fn components() -> Vec<Vec<Listing>> {
    let others = REGISTRIES.iter().map(|registry| registry.listings());
    std::iter::once(SOURCES.listings()).chain(others).collect()
}

/// The inputs of one source.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Input {
    pub(crate) source: String,
    /// The warnings about them, including skipped pairs.
    #[serde(default)]
    pub(crate) warnings: Vec<String>,
    pub(crate) files: BTreeMap<String, String>,
}

/// The version of every component and shared part, by `solver kabsch` or `shared geometry`.
pub(crate) type Versions = BTreeMap<String, u32>;

/// The versions of everything that the trials of a plan use.
pub(crate) fn versions(groups: &[Group<'_>], inputs: &[Input]) -> Versions {
    // A program may have added components since the last run.
    let all = components().concat();
    let mut versions = Versions::new();
    for (group, input) in groups.iter().zip(inputs) {
        for trial in &group.trials {
            let used = Used {
                images: group.sequence.images(),
                labelled: group.sequence.labelled(),
                navigates: trial.navigation_stack.is_some(),
                // A recording has input files, a simulation has none.
                simulated: input.files.is_empty(),
            };
            versions.extend(of_trial(trial, &used, &all));
        }
    }
    versions
}

fn of_trial(trial: &Trial, used: &Used, all: &[Listing]) -> Versions {
    let mut settings =
        toml::Table::try_from(&trial.resolved).expect("a resolved experiment is a table of plain values");
    if let Some(pipeline) = settings.get_mut("pipeline").and_then(toml::Value::as_table_mut) {
        // All chosen stages before the search work on images.
        let front_end = |stage: &str| {
            let mut stages = REGISTRIES.iter().map(|registry| registry.kind()).take_while(|kind| *kind != "search");
            stage == "filters" || stages.any(|kind| kind == stage)
        };
        let idle = |stage: &str| !used.images && front_end(stage) || used.labelled && stage == "search";
        pipeline.retain(|stage, _| !idle(stage));
    }
    let mut found = Found { all, versions: Versions::new(), defaults: BTreeSet::new() };
    settings.iter().for_each(|(key, value)| found.visit(key, value));
    let shared = SHARED.iter().filter(|shared| (shared.used)(used));
    found.versions.extend(shared.map(|shared| (format!("shared {}", shared.name), shared.version)));
    found.versions
}

/// The components in a tree of settings.
///
/// A setting chooses a component by its bare name, or by `name` in a table. If the setting's key does not determine the
/// kind, a name that several kinds have counts for all of them: an unnecessary repetition of a run does less harm than
/// a stale result.
struct Found<'a> {
    all: &'a [Listing],
    versions: Versions,
    /// The components whose defaults have been searched.
    defaults: BTreeSet<(&'static str, &'static str)>,
}

impl Found<'_> {
    fn visit(&mut self, key: &str, value: &toml::Value) {
        match value {
            toml::Value::String(name) => self.component(key, name, &toml::Table::new()),
            toml::Value::Table(table) => {
                let name = table.get("name").and_then(toml::Value::as_str);
                name.into_iter().for_each(|name| self.component(key, name, table));
                table.iter().filter(|(key, _)| *key != "name").for_each(|(key, value)| self.visit(key, value));
            }
            toml::Value::Array(list) => list.iter().for_each(|value| self.visit(key, value)),
            _ => {}
        }
    }

    /// Adds the components of this name, and those among the defaults that `settings` do not override.
    fn component(&mut self, key: &str, name: &str, settings: &toml::Table) {
        let all = self.all;
        let reported = match key {
            "filters" => Some("filter"),
            key => all.iter().map(|listing| listing.kind).find(|kind| *kind == key),
        };
        for listing in
            all.iter().filter(|listing| listing.name == name && reported.is_none_or(|kind| kind == listing.kind))
        {
            self.versions.insert(format!("{} {name}", listing.kind), listing.version);
            let mut left = listing.table.defaults.iter().filter(|(key, _)| !settings.contains_key(*key)).peekable();
            if left.peek().is_some() && self.defaults.insert((listing.kind, listing.name)) {
                left.for_each(|(key, value)| self.visit(key, value));
            }
        }
    }
}

/// The identity of a run.
pub(crate) fn identity(plan: &Plan, groups: &[Group<'_>], inputs: &[Input], versions: &Versions) -> String {
    let mut hash = Sha256::new();
    // The length in front of every part prevents two lists of parts from giving the same text.
    let mut add = |text: &str| {
        hash.update((text.len() as u64).to_le_bytes());
        hash.update(text);
    };
    add("seafix-identity/1");
    add(&plan.experiment.to_toml());
    for (part, version) in versions {
        add(&format!("{part} {version}"));
    }
    for Input { source, files, .. } in inputs {
        add(source);
        files.iter().for_each(|(name, hash)| add(&format!("{hash} {name}")));
    }
    for group in groups {
        add(&group.sequence.frames().to_string());
        for header in &group.headers {
            // The commit and the package do not affect results.
            add(&format!("{:?}", TrialHeader { versions: Vec::new(), ..header.clone() }));
        }
    }
    hex(&hash.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::group::open;

    fn plan(text: &str) -> Plan {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("e.toml");
        std::fs::write(&file, text).unwrap();
        Plan::read(&file, &[]).unwrap_or_else(|faults| panic!("{faults:?}"))
    }

    fn used(text: &str) -> Versions {
        let plan = plan(text);
        let groups = open(&plan, false).unwrap();
        let input = || Input { source: String::new(), warnings: Vec::new(), files: BTreeMap::new() };
        versions(&groups, &groups.iter().map(|_| input()).collect::<Vec<_>>())
    }

    const POINTS: &str = "question = 'why'\nsource = 'virtual-points'\n";

    #[test]
    fn a_run_counts_the_components_it_uses_and_no_other() {
        let of_points = used(POINTS);
        let parts: Vec<&str> = of_points.keys().map(String::as_str).collect();
        let all = [
            "search rigid-consensus",
            "shared acceptance",
            "shared evaluation",
            "shared geometry",
            "shared log",
            "shared simulation",
            "solver stereo-reprojection",
            "source virtual-points",
        ];
        assert_eq!(parts, all);
        let labelled = used(
            "question = 'why'\n[source]\nname = 'virtual-layouts'\nlabelled = true\n[[vary]]\nkey = 'pipeline.solver'\n\
             values = ['kabsch', 'triad']\n",
        );
        assert!(labelled.contains_key("solver kabsch") && labelled.contains_key("solver triad"), "{labelled:?}");
        assert!(!labelled.keys().any(|part| part.starts_with("search ")), "{labelled:?}");
        let of_images = used("question = 'why'\nsource = 'virtual-images'\n[pipeline]\nfilters = ['median']\n");
        for part in ["filter median", "detector harris", "triangulator optimal", "shared front-end", "shared renderer"]
        {
            assert!(of_images.contains_key(part), "no {part} in {of_images:?}");
        }
        // The key determines the kind `descriptor`, although a detector has the same name.
        assert!(of_images.contains_key("descriptor surf") && !of_images.contains_key("detector surf"));
        assert!(!of_images.contains_key("shared navigation"));
    }

    #[test]
    fn a_component_that_another_owns_counts() {
        let text = "question = 'why'\nsource = 'virtual-images'\n[navigation]\nodometry = { name = 'stereo', \
                    between = 'lucas-kanade' }\n[navigation.pose-graph.settings.recognition]\nminimal = 'horn'\n";
        let owned = used(text);
        let parts =
            ["matcher lucas-kanade", "solver p3p-stereo", "solver horn", "descriptor sift", "shared navigation"];
        for part in parts {
            assert!(owned.contains_key(part), "no {part} in {owned:?}");
        }
        // A component chosen by its bare name includes the components of its defaults.
        let all = components().concat();
        let mut found = Found { all: &all, versions: Versions::new(), defaults: BTreeSet::new() };
        found.visit("odometry", &toml::Value::from("stereo"));
        assert!(found.versions.contains_key("solver p3p-stereo"), "{:?}", found.versions);
    }

    /// Seen to fail with an identity without versions.
    #[test]
    fn all_that_a_result_depends_on_is_in_the_identity() {
        let of = |text: &str, change: &dyn Fn(&mut Vec<Input>, &mut Versions)| {
            let mut plan = plan(text);
            // The command is part of the logs and contains a temporary folder.
            plan.command.clear();
            let groups = open(&plan, false).unwrap();
            let files = BTreeMap::from([("a.csv".to_owned(), "12".to_owned())]);
            let mut inputs = vec![Input { source: "s".to_owned(), warnings: Vec::new(), files }];
            let mut versions = versions(&groups, &inputs);
            change(&mut inputs, &mut versions);
            identity(&plan, &groups, &inputs, &versions)
        };
        let same = of(POINTS, &|_, _| {});
        assert_eq!(same, of(POINTS, &|_, _| {}), "identities of two plans of one text");
        let version = of(POINTS, &|_, versions| *versions.get_mut("solver stereo-reprojection").unwrap() += 1);
        let input = of(POINTS, &|inputs, _| drop(inputs[0].files.insert("a.csv".to_owned(), "13".to_owned())));
        let seed = of(&format!("seed = 1\n{POINTS}"), &|_, _| {});
        let setting = of(&format!("{POINTS}[pipeline]\nexpand-gates = true\n"), &|_, _| {});
        let question = of(&POINTS.replace("why", "how"), &|_, _| {});
        let all = BTreeSet::from([same, version, input, seed, setting, question]);
        assert_eq!(all.len(), 6);
    }

    #[test]
    fn every_part_has_one_name() {
        let names: BTreeSet<&str> = SHARED.iter().map(|shared| shared.name).collect();
        assert_eq!(names.len(), SHARED.len());
    }
}
