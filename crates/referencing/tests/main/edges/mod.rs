//! Laws of edges: the bound of the solvers, and the search with acceptance.

mod bound;
mod near;
mod scene;
mod search;
