//! `seafix report`.

use std::path::Path;

use crate::{
    exit::{DONE, Ended, Failure, INPUT},
    terminal::print,
};

pub(crate) fn execute(run: &Path) -> Ended {
    let path = seafix_report::report(run).map_err(|error| Failure::new(INPUT, error))?;
    let summary = seafix_report::summary(run).map_err(|error| Failure::new(INPUT, error))?;
    print(&format!("{summary}\nreport: {}\n", path.display()))?;
    Ok(DONE)
}
