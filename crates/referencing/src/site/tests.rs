//! Hand-worked sites.
