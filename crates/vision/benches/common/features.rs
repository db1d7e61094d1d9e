//! Features of Seafix or a peer, and the scores of two sets of them.

use std::cmp::Ordering;

use nalgebra::Matrix3;
use seafix_geometry::Pixel;
use seafix_vision::{Descriptors, Table};
use serde_json::Value;

use super::{
    peer::{bytes, is_bytes, numbers, shape},
    scene::map,
};

/// The features of one image by one method.
#[derive(Debug, Clone, Default)]
pub(crate) struct Features {
    /// The positions, strongest first.
    pub(crate) at: Vec<Pixel>,
    /// The descriptors, in the order of the positions.
    pub(crate) descriptors: Descriptors,
}

/// The scores of two images with a known homography.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Scores {
    pub(crate) repeatability: f64,
    pub(crate) matching: f64,
    pub(crate) accuracy: f64,
    /// The smaller number of points in the common part of both images.
    pub(crate) points: f64,
}

impl std::ops::AddAssign for Scores {
    fn add_assign(&mut self, other: Self) {
        self.repeatability += other.repeatability;
        self.matching += other.matching;
        self.accuracy += other.accuracy;
        self.points += other.points;
    }
}

/// The rows of x, y, size, angle, response in a peer's answer.
pub(crate) fn rows(answer: &Value) -> Vec<[f32; 5]> {
    let values = numbers(&answer["keypoints"]);
    values.chunks_exact(5).map(|row| std::array::from_fn(|i| row[i])).collect()
}

impl Features {
    /// The strongest `count` features of a peer's answer.
    pub(crate) fn of_peer(answer: &Value, count: usize) -> Self {
        let rows = rows(answer);
        let [n, length] = shape(&answer["descriptors"]);
        assert_eq!(n, rows.len(), "descriptors and key points differ in number");
        let mut order: Vec<usize> = (0..n).collect();
        order.sort_by(|&a, &b| rows[b][4].partial_cmp(&rows[a][4]).unwrap_or(Ordering::Equal));
        order.truncate(count);
        let at = order.iter().map(|&i| Pixel { u: f64::from(rows[i][0]), v: f64::from(rows[i][1]) }).collect();
        let descriptors = if is_bytes(&answer["descriptors"]) {
            let all = bytes(&answer["descriptors"]);
            let words = all.chunks_exact(8).map(|b| b.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte)));
            Descriptors::Bits(picked(&words.collect::<Vec<u64>>(), length / 8, &order))
        } else {
            Descriptors::Numbers(picked(&numbers(&answer["descriptors"]), length, &order))
        };
        Self { at, descriptors }
    }

    /// The features whose positions satisfy `keep`.
    fn only(&self, keep: impl Fn(Pixel) -> bool) -> Self {
        let order: Vec<usize> = (0..self.at.len()).filter(|&i| keep(self.at[i])).collect();
        let descriptors = match &self.descriptors {
            Descriptors::Numbers(table) => Descriptors::Numbers(picked(table.values(), table.length(), &order)),
            Descriptors::Bits(table) => Descriptors::Bits(picked(table.values(), table.length(), &order)),
        };
        Self { at: order.iter().map(|&i| self.at[i]).collect(), descriptors }
    }
}

fn picked<T: Copy + Default>(values: &[T], length: usize, order: &[usize]) -> Table<T> {
    let length = length.max(1);
    Table::new(length, order.iter().flat_map(|&i| values[i * length..][..length].iter().copied()).collect())
}

/// The scores of `a` and `b`, two images of `size` with the homography `b_from_a`.
pub(crate) fn scores(a: &Features, b: &Features, b_from_a: &Matrix3<f64>, size: [usize; 2]) -> Scores {
    let inside = |p: Pixel| {
        let [right, bottom] = size.map(|n| (n - 1) as f64);
        (0.0..=right).contains(&p.u) && (0.0..=bottom).contains(&p.v)
    };
    let a_from_b = b_from_a.try_inverse().expect("an invertible homography");
    // Only the common part of both images counts.
    let (a, b) = (a.only(|p| inside(map(b_from_a, p))), b.only(|p| inside(map(&a_from_b, p))));
    let fewer = a.at.len().min(b.at.len());
    if fewer == 0 {
        return Scores::default();
    }
    let there: Vec<Pixel> = a.at.iter().map(|&p| map(b_from_a, p)).collect();
    let matches = mutual(&a.descriptors, &b.descriptors);
    let right = matches.iter().filter(|&&(i, j)| there[i].distance(&b.at[j]) <= 3.0).count() as f64;
    Scores {
        repeatability: one_to_one(&there, &b.at, 1.5) as f64 / fewer as f64,
        matching: right / fewer as f64,
        accuracy: right / matches.len().max(1) as f64,
        points: fewer as f64,
    }
}

/// The number of pairs of points within `radius`, nearest pairs first and each point once.
fn one_to_one(a: &[Pixel], b: &[Pixel], radius: f64) -> usize {
    let mut pairs = Vec::new();
    for (i, p) in a.iter().enumerate() {
        let near = b.iter().enumerate().map(|(j, q)| (p.distance(q), i, j));
        pairs.extend(near.filter(|&(distance, ..)| distance <= radius));
    }
    pairs.sort_by(|x, y| x.0.total_cmp(&y.0));
    let (mut taken_a, mut taken_b) = (vec![false; a.len()], vec![false; b.len()]);
    let mut count = 0;
    for (_, i, j) in pairs {
        if !taken_a[i] && !taken_b[j] {
            (taken_a[i], taken_b[j]) = (true, true);
            count += 1;
        }
    }
    count
}

/// The mutual nearest neighbours.
fn mutual(a: &Descriptors, b: &Descriptors) -> Vec<(usize, usize)> {
    let (n, m) = (a.len(), b.len());
    let mut nearest_b = vec![(f32::INFINITY, usize::MAX); n];
    let mut nearest_a = vec![(f32::INFINITY, usize::MAX); m];
    for (i, row) in nearest_b.iter_mut().enumerate() {
        for (j, column) in nearest_a.iter_mut().enumerate() {
            let distance = distance(a, i, b, j);
            *row = if distance < row.0 { (distance, j) } else { *row };
            *column = if distance < column.0 { (distance, i) } else { *column };
        }
    }
    let pairs = nearest_b.iter().enumerate().map(|(i, &(_, j))| (i, j));
    pairs.filter(|&(i, j)| j != usize::MAX && nearest_a[j].1 == i).collect()
}

fn distance(a: &Descriptors, i: usize, b: &Descriptors, j: usize) -> f32 {
    match (a, b) {
        (Descriptors::Numbers(a), Descriptors::Numbers(b)) => {
            let mut lanes = [0.0_f32; 16];
            for (a, b) in a.row(i).chunks(16).zip(b.row(j).chunks(16)) {
                for ((lane, a), b) in lanes.iter_mut().zip(a).zip(b) {
                    *lane += (a - b) * (a - b);
                }
            }
            lanes.iter().sum()
        }
        (Descriptors::Bits(a), Descriptors::Bits(b)) => {
            a.row(i).iter().zip(b.row(j)).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>() as f32
        }
        _ => f32::INFINITY,
    }
}
