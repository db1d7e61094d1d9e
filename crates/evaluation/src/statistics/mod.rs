//! Rates, quantiles, confidence intervals and significance tests.
//!
//! A failed trial has no error; in comparisons its error is infinite. All functions except means depend on ranks only,
//! so that no failure is averaged away.

mod block_length;
mod bootstrap;
mod clustered;
mod difference;
mod holm;
mod mcnemar;
pub(crate) mod quantile;
mod rate;
mod recall;
mod wilcoxon;

pub use block_length::block_length;
pub use bootstrap::Bootstrap;
pub use clustered::{clustered, of_blocks};
pub use difference::Difference;
pub use holm::holm;
pub use mcnemar::mcnemar;
pub use quantile::{median, quantile};
pub use rate::clopper_pearson;
pub use recall::recall_area;
pub use wilcoxon::{SignedRank, signed_rank};
