//! Laws that every component of Seafix obeys.
