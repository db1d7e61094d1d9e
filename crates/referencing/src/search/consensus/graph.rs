//! The consistency graph: pairs whose distances agree and whose rotation the prior allows.

use nalgebra::Vector3;

use super::{super::association::reach, prior_terms::PriorTerms};
use crate::{
    lanes::{LANES, packed},
    problem::{Correspondence, Problem, Tolerance},
};

/// Maximum rotation between two pairs, in standard deviations of the prior.
const TURN_SIGMAS: f64 = 4.5;
/// Single-precision rounding error of a distance, half of it at either end (m per metre from the centre).
const ROUNDING: f32 = 4e-7;
/// Maximum distance from the centre (m) whose square is finite in single precision; a farther point is compatible with
/// nothing.
const FARTHEST: f64 = 1e15;

/// The candidate pairs with their compatibility.
///
/// The order depends on coordinates alone. Model points with few candidates come first, equals by descending distance
/// from the centroid: a search from the front meets each set at its least ambiguous points, far apart. Three points in
/// a row, as along an edge or a grid line, determine no pose.
pub(in crate::search) struct ConsistencyGraph {
    pub(in crate::search) vertices: Vec<Correspondence>,
    /// Index of the first pair of each model point, with one entry past the last.
    pub(in crate::search) starts: Vec<usize>,
    /// Mask of the last pair of each model point, and of the last bit of each word.
    pub(in crate::search) lasts: Vec<u64>,
    /// Upper limit of the cloud indices of the pairs.
    pub(in crate::search) clouds: usize,
    /// Rank of each vertex' model point in this order.
    pub(in crate::search) rank: Vec<u32>,
    /// Number of words of a row.
    words: usize,
    bits: Vec<u64>,
    /// Number of pair tests.
    pub(in crate::search) pair_tests: u64,
}

/// Coordinates by axis in single precision, about the cloud's centre.
#[derive(Default)]
struct Columns {
    /// Measured place, model place, and measured minus predicted place.
    at: [Vec<f32>; 9],
    /// Half the tolerance of a distance plus half its rounding error (m). The rounding error of a point far from the
    /// centre is larger, and the tolerance of the others is not affected.
    reach: Vec<f32>,
}

impl ConsistencyGraph {
    pub(in crate::search) fn of(problem: &Problem<'_>, prior_terms: &PriorTerms) -> Self {
        let (vertices, starts) = vertices(problem);
        let count = vertices.len();
        let rank = (0..starts.len() - 1).flat_map(|i| vec![i as u32; starts[i + 1] - starts[i]]).collect();
        let columns = Columns::of(problem, prior_terms, &vertices);
        let words = count.div_ceil(64);
        let clouds = vertices.iter().map(|pair| pair.cloud + 1).max().unwrap_or(0);
        let mut lasts = vec![1 << 63; words];
        starts[1..].iter().for_each(|end| lasts[(end - 1) / 64] |= 1 << ((end - 1) % 64));
        let mut graph =
            Self { vertices, starts, lasts, clouds, rank, words, bits: vec![0; words * count], pair_tests: 0 };
        let turn = prior_terms.known.as_ref().map(|known| {
            // Beyond first order, a rotation by ω moves a point by ω²/2 of its lever.
            let turn = TURN_SIGMAS * known.attitude;
            (turn + 0.5 * turn * turn) as f32
        });
        // A rotation moves nothing by more than twice its lever.
        let turn = turn.filter(|turn| *turn < 2.0);
        let mut row = vec![0; words];
        let by_cloud = VerticesByCloud::of(&graph.vertices, clouds);
        for a in 0..count {
            let from = graph.starts[graph.rank[a] as usize + 1];
            match turn {
                None => coherent(&columns, a, from / 64, &mut row),
                Some(turn) => compatible(&columns, a, from / 64, turn, &mut row),
            }
            graph.pair_tests += (count - from) as u64;
            graph.fill(problem, a, from, &row, &by_cloud);
        }
        graph
    }

    /// The later pairs that are compatible with a pair, one bit each.
    pub(in crate::search) fn row(&self, a: usize) -> &[u64] {
        &self.bits[a * self.words..(a + 1) * self.words]
    }

    /// Copies the pairs that passed the gate, without those that share a cloud point or fail the exact test.
    fn fill(&mut self, problem: &Problem<'_>, a: usize, from: usize, near: &[u64], by_cloud: &VerticesByCloud) {
        let (pair, words) = (self.vertices[a], self.words);
        let row = &mut self.bits[a * words..(a + 1) * words];
        let Some(first) = row.get_mut(from / 64..) else { return };
        first.copy_from_slice(&near[from / 64..]);
        if let Some(word) = first.first_mut() {
            *word &= !0 << (from % 64);
        }
        for &other in by_cloud.of_cloud(pair.cloud) {
            row[other as usize / 64] &= !(1 << (other % 64));
        }
        if matches!(problem.tolerance, Tolerance::Sigmas(_)) {
            for (word, bits) in row.iter_mut().enumerate().skip(from / 64) {
                let mut rest = *bits;
                while rest != 0 {
                    let bit = rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    if !problem.coherent(pair, self.vertices[word * 64 + bit]) {
                        *bits &= !(1 << bit);
                    }
                }
            }
        }
    }
}

/// The vertices of each cloud point.
struct VerticesByCloud {
    begins: Vec<u32>,
    vertices: Vec<u32>,
}

impl VerticesByCloud {
    fn of(vertices: &[Correspondence], clouds: usize) -> Self {
        let mut begins = vec![0; clouds + 1];
        vertices.iter().for_each(|pair| begins[pair.cloud] += 1);
        // From counts to ends, and from ends to begins as the lists are filled from behind.
        (1..=clouds).for_each(|cloud| begins[cloud] += begins[cloud - 1]);
        let mut sorted = vec![0; vertices.len()];
        for (v, pair) in vertices.iter().enumerate().rev() {
            begins[pair.cloud] -= 1;
            sorted[begins[pair.cloud] as usize] = v as u32;
        }
        Self { begins, vertices: sorted }
    }

    fn of_cloud(&self, cloud: usize) -> &[u32] {
        &self.vertices[self.begins[cloud] as usize..self.begins[cloud + 1] as usize]
    }
}

/// Marks the vertices whose distance to vertex `a` agrees, from word `from` on.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn coherent(columns: &Columns, a: usize, from: usize, row: &mut [u64]) {
    mark::<false>(columns, a, from, 0.0, row);
}

/// Marks the vertices that are coherent and whose offset from the prediction a rotation by `turn` (rad) allows.
#[multiversion::multiversion(targets("x86_64+avx512f+avx512vl+avx512bw+avx512dq", "x86_64+avx2+bmi1+bmi2"))]
fn compatible(columns: &Columns, a: usize, from: usize, turn: f32, row: &mut [u64]) {
    mark::<true>(columns, a, from, turn, row);
}

/// The body of both, compiled for the target of each caller.
#[inline(always)]
fn mark<const TURNED: bool>(columns: &Columns, a: usize, from: usize, turn: f32, row: &mut [u64]) {
    let chunks = columns.at.each_ref().map(|column| column[from * LANES..].as_chunks::<LANES>().0);
    let reaches = columns.reach[from * LANES..].as_chunks::<LANES>().0;
    let here: [f32; 9] = std::array::from_fn(|column| columns.at[column][a]);
    let reach = columns.reach[a];
    for (word, out) in row[from..].iter_mut().enumerate() {
        let mut near = [0u8; LANES];
        let [cx, cy, cz, mx, my, mz, ox, oy, oz] = chunks.map(|column| &column[word]);
        let reaches = &reaches[word];
        for k in 0..LANES {
            let measured = square([cx[k] - here[0], cy[k] - here[1], cz[k] - here[2]]);
            let known = square([mx[k] - here[3], my[k] - here[4], mz[k] - here[5]]);
            let tolerance = reach + reaches[k];
            let mut one = agree(known, measured, tolerance);
            if TURNED {
                let moved = square([ox[k] - here[6], oy[k] - here[7], oz[k] - here[8]]);
                let max = turn * known.sqrt() + 2.0 * tolerance;
                one &= moved <= max * max;
            }
            near[k] = u8::from(one);
        }
        *out = packed(&near);
    }
}

/// The square of a length.
#[inline(always)]
fn square([x, y, z]: [f32; 3]) -> f32 {
    x * x + y * y + z * z
}

/// Whether the roots of two squares A and B differ by at most r: A + B ≤ r² or (A − B)² ≤ r² (2 (A + B) − r²).
#[inline(always)]
fn agree(known: f32, measured: f32, tolerance: f32) -> bool {
    let (sum, difference, r2) = (known + measured, known - measured, tolerance * tolerance);
    (sum <= r2) | (difference * difference <= r2 * (2.0 * sum - r2))
}

impl Columns {
    fn of(problem: &Problem<'_>, prior_terms: &PriorTerms, vertices: &[Correspondence]) -> Self {
        let mut columns = Self::default();
        let cloud = |pair: &Correspondence| problem.cloud[pair.cloud].position.at.coords;
        // The centre of the largest part: outliers do not move it.
        let middle = prior_terms.parts.as_ref().and_then(|parts| Some((parts, parts.in_largest()?)));
        let inside = |pair: &&Correspondence| middle.is_none_or(|(parts, middle)| parts.together(pair.cloud, middle));
        let (mut sum, mut used) = (Vector3::zeros(), 0.0);
        for pair in vertices.iter().filter(inside) {
            (sum, used) = (sum + cloud(pair), used + 1.0);
        }
        let centre = sum / f64::max(used, 1.0);
        for pair in vertices {
            let (at, model) = (cloud(pair), problem.model[pair.model].at.coords);
            let offset = prior_terms.known.as_ref().map_or(Vector3::zeros(), |known| at - known.places[pair.model].0);
            for axis in 0..3 {
                columns.at[axis].push((at[axis] - centre[axis]) as f32);
                columns.at[3 + axis].push((model[axis] - prior_terms.centroid[axis]) as f32);
                columns.at[6 + axis].push(offset[axis] as f32);
            }
            let (seen, known) = ((at - centre).amax(), (model - prior_terms.centroid).amax());
            // NaN if the point is too far.
            let reach = if seen <= FARTHEST { reach(problem, *pair).0 as f32 } else { f32::NAN };
            columns.reach.push(reach + 0.5 * ROUNDING * seen.max(known) as f32);
        }
        // The padding of the last word is compatible with nothing.
        let full = vertices.len().next_multiple_of(LANES);
        columns.at.iter_mut().for_each(|column| column.resize(full, f32::NAN));
        columns.reach.resize(full, f32::NAN);
        columns
    }
}

/// The candidate pairs by model point, and the index of each model point's first pair.
fn vertices(problem: &Problem<'_>) -> (Vec<Correspondence>, Vec<usize>) {
    let by =
        |a: &Vector3<f64>, b: &Vector3<f64>| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z));
    let lists = &problem.candidates.lists;
    let at = |i: usize| &problem.model[i].at.coords;
    let listed: Vec<usize> = (0..lists.len()).filter(|&i| !lists[i].is_empty()).collect();
    let centroid = listed.iter().map(|&i| at(i)).sum::<Vector3<f64>>() / listed.len().max(1) as f64;
    // To seven digits: equal distances may differ in the last digit by the order of summation.
    let lever = |i: usize| (at(i) - centroid).norm_squared() as f32;
    let mut order: Vec<(usize, f32, usize)> = listed.into_iter().map(|i| (lists[i].len(), lever(i), i)).collect();
    order.sort_unstable_by(|(few, far, i), (many, near, k)| {
        few.cmp(many).then(near.total_cmp(far)).then_with(|| by(at(*i), at(*k))).then(i.cmp(k))
    });
    let (mut vertices, mut starts) = (Vec::with_capacity(problem.candidates.pairs()), vec![0]);
    for (_, _, model) in order {
        let begin = vertices.len();
        vertices.extend(lists[model].iter().map(|&cloud| Correspondence { model, cloud }));
        let at = |pair: &Correspondence| &problem.cloud[pair.cloud].position.at.coords;
        vertices[begin..].sort_unstable_by(|a, b| by(at(a), at(b)).then(a.cloud.cmp(&b.cloud)));
        starts.push(vertices.len());
    }
    (vertices, starts)
}
