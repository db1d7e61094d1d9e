//! The pairs near a motion, by columns.

use super::{
    bits::ones,
    graph::ConsistencyGraph,
    likelihood::{PairTerms, Term},
    motion::Motion,
};
use crate::lanes::{LANES, packed};

/// Gate about a motion from a few noisy points (χ²₃).
pub(super) const LOOSE: f64 = 50.0;

/// The pairs' coordinates in model and cloud by axis, with their squared gates (m²) about a motion.
///
/// The columns are padded to complete words with entries that are within reach of nothing.
pub(super) struct Places {
    at: [Vec<f64>; 6],
    reach2: Vec<f64>,
}

impl Places {
    pub(super) fn of(terms: &PairTerms) -> Self {
        let full = terms.pairs.len().next_multiple_of(LANES);
        let filled = |value: &dyn Fn(&Term) -> f64| {
            let mut column: Vec<f64> = terms.pairs.iter().map(value).collect();
            column.resize(full, f64::NAN);
            column
        };
        // χ² is at least that of the greatest variance.
        Self {
            at: std::array::from_fn(|axis| {
                filled(&|pair| if axis < 3 { pair.model[axis] } else { pair.cloud[axis - 3] })
            }),
            reach2: filled(&|pair| LOOSE * pair.variance),
        }
    }

    /// The best pair within the gate of each model point; `None` if they are not more than `more_than`.
    pub(super) fn near(
        &self,
        terms: &PairTerms,
        graph: &ConsistencyGraph,
        motion: &Motion,
        more_than: usize,
    ) -> Option<Vec<usize>> {
        let mut within = Vec::new();
        within_reach(self, motion, &mut within);
        if within.iter().map(|word| word.count_ones() as usize).sum::<usize>() <= more_than {
            return None;
        }
        let mut best: Vec<(f64, usize)> = Vec::new();
        for v in ones(&within, 0) {
            let pair = &terms.pairs[v];
            let d2 = pair.distance(&(pair.cloud - motion.apply(&pair.model)));
            if !(d2 <= LOOSE) {
                continue;
            }
            match best.last_mut() {
                Some(last) if graph.rank[last.1] == graph.rank[v] => {
                    if d2 < last.0 {
                        *last = (d2, v);
                    }
                }
                _ => best.push((d2, v)),
            }
        }
        (best.len() > more_than).then(|| best.into_iter().map(|(_, v)| v).collect())
    }
}

/// The pairs within reach of a motion, one bit each.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn within_reach(places: &Places, motion: &Motion, within: &mut Vec<u64>) {
    let [mx, my, mz, cx, cy, cz] = places.at.each_ref().map(|column| column.as_chunks::<LANES>().0);
    let (r, t) = (&motion.rotation, &motion.translation);
    for (word, reach2) in places.reach2.as_chunks::<LANES>().0.iter().enumerate() {
        let (mx, my, mz, cx, cy, cz) = (&mx[word], &my[word], &mz[word], &cx[word], &cy[word], &cz[word]);
        let mut near = [0u8; LANES];
        for k in 0..LANES {
            let off = |row: usize, measured: f64| {
                measured - (r[(row, 0)] * mx[k] + r[(row, 1)] * my[k] + r[(row, 2)] * mz[k] + t[row])
            };
            let (x, y, z) = (off(0, cx[k]), off(1, cy[k]), off(2, cz[k]));
            near[k] = u8::from(x * x + y * y + z * z <= reach2[k]);
        }
        within.push(packed(&near));
    }
}
