//! Signals: the first asks a run to end in good order, the second ends it at once.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use signal_hook::{
    consts::{SIGINT, SIGTERM},
    flag,
};

/// What was asked.
#[derive(Debug, Default)]
struct Asked {
    /// The signal that came; 0 before.
    signal: Arc<AtomicUsize>,
    /// Whether the next one ends the program at once.
    at_once: Arc<AtomicBool>,
}

static ASKED: OnceLock<Asked> = OnceLock::new();

/// From now on SIGINT and SIGTERM are noted, once each; the second of them ends the program.
pub(crate) fn listen() {
    ASKED.get_or_init(|| {
        let asked = Asked::default();
        for signal in [SIGINT, SIGTERM] {
            // What cannot be registered keeps the system's own manner: it ends the program.
            let _ = flag::register_conditional_shutdown(signal, code(signal as usize), Arc::clone(&asked.at_once));
            let _ = flag::register_usize(signal, Arc::clone(&asked.signal), signal as usize);
            let _ = flag::register(signal, Arc::clone(&asked.at_once));
        }
        asked
    });
}

/// From now on a file that may grow no further (`ulimit -f`) is an error of writing, not the end of the program.
pub(crate) fn outgrow_files() {
    #[cfg(unix)]
    {
        // A handler that does nothing: the system call then says EFBIG.
        let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
    }
}

/// From now on the next signal ends the program at once.
pub(crate) fn end_at_once() {
    if let Some(asked) = ASKED.get() {
        asked.at_once.store(true, Ordering::Relaxed);
    }
}

/// Whether a signal came.
pub(crate) fn turned_out() -> bool {
    ASKED.get().is_some_and(|asked| asked.signal.load(Ordering::Relaxed) != 0)
}

/// How a program ends that a signal ended: 130 after SIGINT, 143 after SIGTERM.
pub(crate) fn exit_code() -> u8 {
    code(ASKED.get().map_or(SIGINT as usize, |asked| asked.signal.load(Ordering::Relaxed))) as u8
}

fn code(signal: usize) -> i32 {
    128 + signal as i32
}
