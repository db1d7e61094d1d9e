//! Tests through the public interface: one binary, so that a change of the crate links once.

mod brute_force;
mod judgement;
