//! The `seafix` command.
fn main() {}
