//! The working memory that the stages keep between frames.

use std::any::Any;

use rayon::prelude::*;

/// The working memory of components and their use of threads.
///
/// Components keep buffers between frames, so that a warm front end allocates nothing. Each component keeps its own
/// type here; the contents never change a result.
#[derive(Debug, Default)]
pub struct Workspace {
    threads: Threads,
    kept: Vec<Box<dyn Any + Send>>,
}

/// The threads that execute the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Threads {
    /// The calling thread alone.
    #[default]
    One,
    /// All threads of the current rayon pool; the results are the same as on one thread.
    Pool,
}

impl Workspace {
    /// An empty workspace.
    pub fn new(threads: Threads) -> Self {
        Self { threads, kept: Vec::new() }
    }

    /// The threads that execute the work.
    pub fn threads(&self) -> Threads {
        self.threads
    }

    /// The value kept under type `T`, or its default on first use.
    pub fn get<T: Any + Send + Default>(&mut self) -> &mut T {
        let index = self.kept.iter().position(|kept| kept.is::<T>()).unwrap_or_else(|| {
            self.kept.push(Box::new(T::default()));
            self.kept.len() - 1
        });
        self.kept[index].downcast_mut().expect("its type was just compared")
    }
}

impl Threads {
    /// Calls `work(index, piece, scratch)` for each piece of `size` items, with one scratch per piece.
    ///
    /// The pieces do not depend on the number of threads, so neither does the result.
    pub fn pieces<T: Send, S: Send + Default>(
        self,
        items: &mut [T],
        size: usize,
        scratch: &mut Vec<S>,
        work: impl Fn(usize, &mut [T], &mut S) + Send + Sync,
    ) {
        let size = size.max(1);
        scratch.resize_with(items.len().div_ceil(size).max(scratch.len()), S::default);
        match self {
            Self::One => {
                let pieces = items.chunks_mut(size).zip(scratch).enumerate();
                pieces.for_each(|(index, (piece, scratch))| work(index, piece, scratch));
            }
            Self::Pool => {
                let pieces = items.par_chunks_mut(size).zip(scratch).enumerate();
                pieces.for_each(|(index, (piece, scratch))| work(index, piece, scratch));
            }
        }
    }

    /// The number of `rows` per band, for results that depend on a row's surroundings alone.
    ///
    /// Each band repeats work at its edges, so bands are few, yet enough to keep all threads busy.
    pub(crate) fn rows_a_band(self, rows: usize) -> usize {
        match self {
            Self::One => rows.max(1),
            Self::Pool => rows.div_ceil(4 * rayon::current_num_threads()).max(16),
        }
    }

    /// Both results, computed in sequence or in parallel.
    pub fn join<A: Send, B: Send>(self, a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
        match self {
            Self::One => (a(), b()),
            Self::Pool => rayon::join(a, b),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_type_has_its_own_place() {
        let mut work = Workspace::default();
        work.get::<Vec<f32>>().push(1.5);
        work.get::<Vec<u8>>().push(7);
        assert_eq!(*work.get::<Vec<f32>>(), [1.5]);
    }

    #[test]
    fn pieces_are_the_same_for_any_threads() {
        let run = |threads: Threads| {
            let mut items = vec![0_usize; 103];
            threads.pieces(&mut items, 10, &mut Vec::new(), |index, piece, seen: &mut usize| {
                for item in piece {
                    *seen += 1;
                    *item = 100 * index + *seen;
                }
            });
            items
        };
        let alone = run(Threads::One);
        assert_eq!((alone[0], alone[9], alone[10], alone[102]), (1, 10, 101, 1003));
        assert_eq!(run(Threads::Pool), alone);
        assert_eq!(Threads::Pool.join(|| 1, || 2), (1, 2));
    }
}
