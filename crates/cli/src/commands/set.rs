//! Settings that the command line changes, and which of them a component rejects.

use std::path::Path;

use seafix_component::Fault;

use crate::exit::{Failure, USAGE};

/// What `build` makes of the settings after the changes of `--set`, with the settings. A rejection names the first change
/// that causes one.
pub(crate) fn built<S, T, E: ToString>(
    settings: &[String],
    change: impl Fn(&[String]) -> Result<S, Vec<Fault>>,
    build: impl Fn(&S) -> Result<T, E>,
) -> Result<(S, T), Failure> {
    let changed = change(settings).map_err(|faults| Failure::faults(USAGE, &faults))?;
    let what = match build(&changed) {
        Ok(made) => return Ok((changed, made)),
        Err(error) => error.to_string(),
    };
    let is_wrong = |count: usize| change(&settings[..count]).is_ok_and(|changed| build(&changed).is_err());
    // Without a change the fault is another flag's.
    match (0..=settings.len()).find(|&count| is_wrong(count)) {
        Some(count) if count > 0 => {
            Err(Failure::new(USAGE, Fault::new(what, Path::new("--set")).value(&settings[count - 1])))
        }
        _ => Err(Failure::new(USAGE, what)),
    }
}
