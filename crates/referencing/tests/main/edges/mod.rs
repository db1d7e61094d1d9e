//! Laws of edges: the bound of the solvers, and the search with acceptance.

mod absent;
mod bound;
mod brute_force;
mod far;
mod laws;
mod near;
mod planted;
mod resembling;
mod scene;
mod search;
mod symmetric;
