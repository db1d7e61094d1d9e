//! What the stages keep from frame to frame.

use std::any::Any;

use rayon::prelude::*;

/// The memory that components keep between frames, so that a warm front end allocates nothing, and
/// whether they may share their work among threads.
///
/// Each component keeps what it likes under a type of its own; what is in it never changes a result.
#[derive(Debug, Default)]
pub struct Workspace {
    threads: Threads,
    kept: Vec<Box<dyn Any + Send>>,
}

/// Who works.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Threads {
    /// The calling thread alone.
    #[default]
    One,
    /// All threads of the rayon pool that the call is made in; the results are the same.
    Pool,
}

impl Workspace {
    /// An empty one.
    pub fn new(threads: Threads) -> Self {
        Self { threads, kept: Vec::new() }
    }

    /// Who works.
    pub fn threads(&self) -> Threads {
        self.threads
    }

    /// What was kept under this type; its default the first time.
    pub fn get<T: Any + Send + Default>(&mut self) -> &mut T {
        let index = self.kept.iter().position(|kept| kept.is::<T>()).unwrap_or_else(|| {
            self.kept.push(Box::new(T::default()));
            self.kept.len() - 1
        });
        self.kept[index].downcast_mut().expect("its type was just compared")
    }
}

impl Threads {
    /// `work(index, piece)` for every piece of `size` of `items`, with one scratch for each piece.
    ///
    /// What a piece holds does not depend on the threads, so neither does the result.
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

    /// How many of `rows` rows make a band, where each row's result depends on its surroundings alone:
    /// few bands, for every band repeats work at its edges, yet enough to keep all threads busy.
    pub(crate) fn rows_a_band(self, rows: usize) -> usize {
        match self {
            Self::One => rows.max(1),
            Self::Pool => rows.div_ceil(4 * rayon::current_num_threads()).max(16),
        }
    }

    /// Both, one after the other or side by side.
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
