//! Every parser reads or rejects some hundred mutated inputs. `cargo bolero` runs the same with engines for coverage.

#![allow(clippy::unwrap_used, reason = "a test may panic")]

use seafix_fuzz::{PARSERS, corpus, mutated};

/// The parsers of the shelf with this number modulo 4; four tests share the work.
fn parse(shelf: usize) {
    for parser in PARSERS.iter().skip(shelf).step_by(4) {
        let files = corpus(parser.name).unwrap();
        let folder = tempfile::tempdir().unwrap();
        parser.prepare(folder.path()).unwrap();
        for file in &files {
            parser.parse(folder.path(), file).unwrap();
        }
        bolero::check!()
            .with_iterations(100)
            .with_type::<u64>()
            .for_each(|seed| parser.parse(folder.path(), &mutated(&files, *seed)).unwrap());
    }
}

/// Fails where a decoder's panic leaves its parser.
#[test]
fn parsers_of_the_first_shelf() {
    parse(0);
}

#[test]
fn parsers_of_the_second_shelf() {
    parse(1);
}

#[test]
fn parsers_of_the_third_shelf() {
    parse(2);
}

#[test]
fn parsers_of_the_fourth_shelf() {
    parse(3);
}
