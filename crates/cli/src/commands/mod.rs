//! The subcommands, one a file.

use std::path::PathBuf;

use clap::{CommandFactory, Parser, Subcommand};

use crate::exit::Ended;

mod check;
mod cloud;
mod cloud_input;
mod compare;
mod completions;
mod convert;
mod diff;
mod dive;
mod eval;
mod export;
mod export_pairs;
mod fixes;
mod generate;
mod limits;
mod list;
mod merge;
mod model;
mod odometry;
mod pair_source;
mod publish;
mod recover;
mod replay;
mod report;
mod run;
mod schema;
mod set;
mod show;
mod solve;
mod sweep;
mod view;

/// Position and attitude of an underwater vehicle relative to a known structure, from stereo images.
#[derive(Debug, Parser)]
#[command(name = "seafix", version, propagate_version = true)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The subcommands of `seafix`.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run an experiment, or the default pipeline on a data set: logs, results and a report.
    Run(run::Run),
    /// Run an experiment in shards, on this machine or on a cluster, and merge them.
    Sweep(sweep::Sweep),
    /// Merge the shards of a run.
    Merge(merge::Merge),
    /// Solve coherence problems (coherence-problem/1 and 1.1), one answer each.
    Solve(solve::Solve),
    /// Triangulate the cloud of one stereo pair.
    Cloud(cloud::Cloud),
    /// Convert files of other programs.
    Convert(convert::Convert),
    /// Build the model of an object from points marked by hand in one stereo pair, or in pairs of a dive.
    Model(model::Model),
    /// Estimate the trajectory of a stereo rig through a data set, a recording or a log, relative to the first pose.
    Odometry(odometry::OdometryCommand),
    /// Generate coherence problems with truth (coherence-problem/1).
    Generate(generate::Generate),
    /// Compare runs of the same data: results side by side, significance of the differences.
    Compare(compare::Compare),
    /// List the differences of two runs: configuration, inputs, results.
    Diff(diff::Diff),
    /// Compute the errors of a trajectory: absolute and relative pose errors, drift (evo's definitions); or of a site.
    Eval(eval::Eval),
    /// List all faults of a data set, site, experiment, problem or log.
    Check {
        /// The files and folders.
        #[arg(required = true)]
        paths: Vec<PathBuf>,
        #[command(flatten)]
        limits: limits::Limits,
    },
    /// List the components for experiment files.
    List(list::List),
    /// Show the settings of a component, or of a table of a file: meaning, unit, range and default.
    Show {
        /// The component's name, or `experiment`, `pipeline`, `acceptance`, `navigation`, `sites` or a table below them.
        name: String,
    },
    /// Print the JSON schema of a file format, for completion in editors.
    Schema {
        /// The format.
        #[arg(value_enum)]
        of: schema::Format,
    },
    /// Save the intact part of a damaged or truncated log, or of an unfinished run.
    Recover(recover::Recover),
    /// Write the fixes of a run or a log as a table or as a trajectory.
    Fixes(fixes::Fixes),
    /// Run a search and a solver on the logged inputs of another run.
    Replay(replay::Replayed),
    /// Make the reports of runs from their logs only, or verify them.
    Report(report::Report),
    /// Run the experiments of a list and write their reports into a folder of the repository.
    Publish(publish::Publish),
    /// Open a log in Rerun, with images, clouds and the site side by side.
    View(view::View),
    /// Simulate a dive: stereo pairs with truth, visibility and prior poses, as a data set.
    Dive(dive::Dive),
    /// Write the frames of an experiment's source as a data set.
    Export(export::Export),
    /// Print a completion script for a shell.
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
            Self::Convert(command) => command.execute(),
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
            Self::Fixes(command) => command.execute(),
            Self::Replay(command) => command.execute(),
            Self::Report(command) => command.execute(),
            Self::Publish(command) => command.execute(),
            Self::View(command) => command.execute(),
            Self::Dive(command) => command.execute(),
            Self::Export(command) => command.execute(),
            Self::Completions(command) => command.execute(Arguments::command()),
            Self::Man(command) => command.execute(Arguments::command()),
        }
    }
}
