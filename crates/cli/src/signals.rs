//! Signals: the first ends a run in good order, the second at once.

use std::sync::{
    Arc, OnceLock,
    atomic::{AtomicBool, AtomicUsize, Ordering},
};

use signal_hook::{
    consts::{SIGINT, SIGTERM},
    flag,
};

/// The received signals.
#[derive(Debug, Default)]
struct Asked {
    /// The number of the received signal, or 0.
    signal: Arc<AtomicUsize>,
    /// Whether the next signal ends the program at once.
    at_once: Arc<AtomicBool>,
}

static ASKED: OnceLock<Asked> = OnceLock::new();

/// Starts recording SIGINT and SIGTERM; the second of them ends the program.
pub(crate) fn listen() {
    ASKED.get_or_init(|| {
        let asked = Asked::default();
        for signal in [SIGINT, SIGTERM] {
            // A signal that cannot be registered keeps the default action: it ends the program.
            let _ = flag::register_conditional_shutdown(signal, code(signal as usize), Arc::clone(&asked.at_once));
            let _ = flag::register_usize(signal, Arc::clone(&asked.signal), signal as usize);
            let _ = flag::register(signal, Arc::clone(&asked.at_once));
        }
        asked
    });
}

/// Turns the limit of a file's size (`ulimit -f`) into a write error instead of the end of the program.
pub(crate) fn ignore_size_limit_signal() {
    #[cfg(unix)]
    {
        // With an empty handler the system call returns EFBIG.
        let _ = flag::register(signal_hook::consts::SIGXFSZ, Arc::new(AtomicBool::new(false)));
    }
}

/// Makes the next signal end the program at once.
pub(crate) fn end_at_once() {
    if let Some(asked) = ASKED.get() {
        asked.at_once.store(true, Ordering::Relaxed);
    }
}

/// Whether a signal was received.
pub(crate) fn interrupted() -> bool {
    ASKED.get().is_some_and(|asked| asked.signal.load(Ordering::Relaxed) != 0)
}

/// The exit code after a signal: 130 after SIGINT, 143 after SIGTERM.
pub(crate) fn exit_code() -> u8 {
    code(ASKED.get().map_or(SIGINT as usize, |asked| asked.signal.load(Ordering::Relaxed))) as u8
}

fn code(signal: usize) -> i32 {
    128 + signal as i32
}
