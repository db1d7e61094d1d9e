//! Reports made from logs alone.
