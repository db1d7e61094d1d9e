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
    let full = match build(&changed) {
        Ok(made) => return Ok((changed, made)),
        Err(error) => error.to_string(),
    };
    let wrong = |count: usize| change(&settings[..count]).ok().and_then(|changed| build(&changed).err());
    // Without a change the fault is another flag's.
    match (0..=settings.len()).find_map(|count| Some((count, wrong(count)?))) {
        Some((count, error)) if count > 0 => {
            Err(Failure::new(USAGE, Fault::new(error.to_string(), Path::new("--set")).value(&settings[count - 1])))
        }
        _ => Err(Failure::new(USAGE, full)),
    }
}
