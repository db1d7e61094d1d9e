//! Rates, quantiles, intervals and tests: what says how sure a number is, and whether two differ.
//!
//! A failure has no error; where one is compared, it stands as infinity. Everything here but a mean is a function of
//! ranks and keeps it so: no failure is averaged away.

mod bootstrap;
mod clustered;
mod holm;
mod mcnemar;
mod quantile;
mod rate;
mod recall;
mod wilcoxon;

pub use bootstrap::Bootstrap;
pub use clustered::{clustered, of_blocks};
pub use holm::holm;
pub use mcnemar::mcnemar;
pub use quantile::{median, quantile};
pub use rate::clopper_pearson;
pub use recall::recall_area;
pub use wilcoxon::{SignedRank, signed_rank};
