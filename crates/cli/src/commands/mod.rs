//! The subcommands, one a file.

use std::path::PathBuf;

use clap::{CommandFactory, Subcommand};

use crate::{Arguments, exit::Ended};

mod check;
mod cloud;
mod compare;
mod completions;
mod diff;
mod dive;
mod eval;
mod export;
mod generate;
mod limits;
mod list;
mod merge;
mod model;
mod odometry;
mod pairs;
mod publish;
mod recover;
mod replay;
mod report;
mod run;
mod schema;
mod show;
mod solve;
mod sweep;

/// What `seafix` can do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run an experiment, or the default pipeline on a data set: logs, results and a report.
    Run(run::Run),
    /// Run an experiment in shards, here or on a cluster, and join them.
    Sweep(sweep::Sweep),
    /// Join the shards of a run into the run.
    Merge(merge::Merge),
    /// Solve coherence problems (coherence-problem/1), one result each.
    Solve(solve::Solve),
    /// Make the cloud of measured points of one stereo pair.
    Cloud(cloud::Cloud),
    /// Make a model of an object from points that were marked by hand in one stereo pair.
    Model(model::Model),
    /// Follow a stereo rig through a data set: poses relative to the first.
    Odometry(odometry::Odometer),
    /// Draw identification problems with truth (coherence-problem/1).
    Generate(generate::Generate),
    /// Compare runs of the same data: results side by side, and which differences are sure.
    Compare(compare::Compare),
    /// Say what differs between two runs: configuration, inputs, results.
    Diff(diff::Diff),
    /// Judge a trajectory against a reference: absolute and relative errors, drift (evo's definitions).
    Eval(eval::Eval),
    /// Say everything that is wrong with a data set, site, experiment, problem or log.
    Check {
        /// The files and folders.
        #[arg(required = true)]
        paths: Vec<PathBuf>,
        #[command(flatten)]
        limits: limits::Limits,
    },
    /// List the components that experiment files can name.
    List(list::List),
    /// Show a component: what it does, its source, its settings and their defaults.
    Show {
        /// The component's name.
        name: String,
    },
    /// Print the JSON schema of a file format, for editors that complete as one types.
    Schema {
        /// Which format.
        #[arg(value_enum)]
        of: schema::Format,
    },
    /// Save what is sound of a log that was cut off or damaged.
    Recover(recover::Recover),
    /// Run a search and a solver on the logged inputs of another run.
    Replay(replay::Replayed),
    /// Make the reports of runs again, from their logs alone, or verify them.
    Report(report::Report),
    /// Run the experiments of a list and keep their reports: what a repository says it found.
    Publish(publish::Publish),
    /// Make a dive: stereo pairs with truth, visibility and rough poses, as a data set.
    Dive(dive::Dive),
    /// Write the frames of an experiment's source as a data set.
    Export(export::Export),
    /// Print the completions of a shell, for its start-up file.
    Completions(completions::Completions),
    /// Write the manual pages of all commands.
    Man(completions::Man),
}

impl Command {
    pub(crate) fn execute(&self) -> Ended {
        match self {
            Self::Run(command) => command.execute(),
            Self::Sweep(command) => command.execute(),
            Self::Merge(command) => command.execute(),
            Self::Solve(command) => command.execute(),
            Self::Cloud(command) => command.execute(),
            Self::Model(command) => command.execute(),
            Self::Odometry(command) => command.execute(),
            Self::Generate(command) => command.execute(),
            Self::Compare(command) => command.execute(),
            Self::Diff(command) => command.execute(),
            Self::Eval(command) => command.execute(),
            Self::Check { paths, limits } => check::execute(paths, limits.of_images()),
            Self::List(command) => command.execute(),
            Self::Show { name } => show::execute(name),
            Self::Schema { of } => schema::execute(*of),
            Self::Recover(command) => command.execute(),
            Self::Replay(command) => command.execute(),
            Self::Report(command) => command.execute(),
            Self::Publish(command) => command.execute(),
            Self::Dive(command) => command.execute(),
            Self::Export(command) => command.execute(),
            Self::Completions(command) => command.execute(Arguments::command()),
            Self::Man(command) => command.execute(Arguments::command()),
        }
    }
}
