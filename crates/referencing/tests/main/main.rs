//! Tests through the public interface, in one binary to save link time.

mod brute_force;
mod edges;
mod judgement;
