//! Output for people: standard output that may be closed, and the progress of a run.

use std::{
    io::{ErrorKind, IsTerminal, Write, stderr, stdout},
    path::Path,
};

use indicatif::{ProgressBar, ProgressStyle};
use seafix_component::Fault;
use seafix_experiment::Observer;

use crate::{
    exit::{Failure, OUTPUT},
    signals,
};

/// Prints `text` to standard output. A closed pipe (`| head`) ends the program quietly.
pub(crate) fn print(text: &str) -> Result<(), Failure> {
    let mut out = stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => std::process::exit(0),
        Err(error) => Err(Failure::new(OUTPUT, format!("cannot write to standard output: {error}"))),
        Ok(()) => Ok(()),
    }
}

/// The number of columns of standard output: that of the terminal, or 80.
pub(crate) fn width() -> usize {
    terminal_size::terminal_size_of(stdout()).map_or(80, |(width, _)| usize::from(width.0))
}

/// Prints a line to standard error; a failure of this is ignored, so that it stops no run.
pub(crate) fn notify(line: &str) {
    let _ = writeln!(stderr(), "{line}");
}

/// The progress of a run on standard error: a bar on a terminal, otherwise a line for every tenth of the frames.
pub(crate) struct Progress {
    bar: ProgressBar,
    watched: bool,
}

impl Progress {
    pub(crate) fn new() -> Self {
        let style = ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {eta} left  {msg}")
            .unwrap_or_else(|_| ProgressStyle::default_bar());
        Self { bar: ProgressBar::hidden().with_style(style), watched: stderr().is_terminal() }
    }

    /// Sets the number of steps.
    pub(crate) fn expect(&self, frames: usize) {
        self.bar.set_length(frames as u64);
        if self.watched {
            self.bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
        }
    }

    /// Counts a finished step.
    pub(crate) fn step(&self, message: &str) {
        self.bar.inc(1);
        if self.watched {
            self.bar.set_message(message.to_owned());
        } else {
            let (done, all) = (self.bar.position(), self.bar.length().unwrap_or(1).max(1));
            if done * 10 / all != done.saturating_sub(1) * 10 / all {
                notify(&format!("{done}/{all} frames"));
            }
        }
    }

    pub(crate) fn end(&self) {
        self.bar.finish_and_clear();
    }
}

impl Observer for Progress {
    fn begins(&self, frames: usize, bytes: u64, folder: &Path) {
        notify(&format!(
            "{frames} frames, at most about {} MB of logs, in {}",
            bytes.div_ceil(1_000_000),
            folder.display()
        ));
        self.expect(frames);
    }

    fn renews(&self, reason: &str) {
        notify(&format!("a kept run is repeated: {reason}"));
    }

    fn warns(&self, warning: &Fault) {
        notify(&format!("warning: {warning}"));
    }

    fn resumes(&self, frames: usize) {
        notify(&format!("{frames} of them are complete already"));
        self.bar.set_position(frames as u64);
    }

    fn frame(&self, trial: &str) {
        self.step(trial);
    }

    fn stops(&self) -> bool {
        signals::interrupted()
    }
}
