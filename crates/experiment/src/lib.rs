//! Experiment files, trials, the runner and its results.
