//! Ray casting through triangles by a bounding volume hierarchy.

use nalgebra::Vector3;

use super::mesh::Triangle;

/// Maximum number of triangles in a leaf.
const LEAF: usize = 4;

/// A node: its bounding box, and its children or triangles.
#[derive(Debug, Clone)]
struct Node {
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// Index of the first child (the second follows its subtree) or of the first triangle.
    first: u32,
    /// Number of triangles of a leaf; 0 for a branch.
    count: u32,
}

/// A bounding volume hierarchy (Rubin and Whitted, 1980), split at the median of the longest axis.
#[derive(Debug, Clone, Default)]
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    /// Triangle indices in the order of the leaves.
    order: Vec<u32>,
}

/// The intersection of a ray and a triangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Hit {
    /// Distance in units of the ray's direction.
    pub(crate) t: f64,
    /// Index of the triangle.
    pub(crate) triangle: usize,
}

impl Bvh {
    pub(crate) fn new(triangles: &[Triangle]) -> Self {
        let mut tree = Self { nodes: Vec::new(), order: (0..triangles.len() as u32).collect() };
        if !triangles.is_empty() {
            tree.split(triangles, 0, triangles.len());
        }
        tree
    }

    fn split(&mut self, triangles: &[Triangle], from: usize, to: usize) {
        let corners = || self.order[from..to].iter().flat_map(|&i| triangles[i as usize].at);
        let low = corners().fold(Vector3::repeat(f64::INFINITY), |a, b| a.inf(&b));
        let high = corners().fold(Vector3::repeat(f64::NEG_INFINITY), |a, b| a.sup(&b));
        let node = self.nodes.len();
        let leaf = to - from <= LEAF;
        let (first, count) = if leaf { (from, to - from) } else { (0, 0) };
        self.nodes.push(Node { low, high, first: first as u32, count: count as u32 });
        if leaf {
            return;
        }
        let axis = (high - low).imax();
        let middle = usize::midpoint(from, to);
        let key = |i: &u32| triangles[*i as usize].at.iter().map(|p| p[axis]).sum::<f64>();
        self.order[from..to].select_nth_unstable_by(middle - from, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
        self.split(triangles, from, middle);
        self.nodes[node].first = self.nodes.len() as u32;
        self.split(triangles, middle, to);
    }

    /// The first triangle that the ray `from + t·along` meets for 0 < t < `limit`.
    pub(crate) fn hit(
        &self,
        triangles: &[Triangle],
        from: &Vector3<f64>,
        along: &Vector3<f64>,
        limit: f64,
    ) -> Option<Hit> {
        let inverse = along.map(|x| 1.0 / x);
        let mut best = Hit { t: limit, triangle: usize::MAX };
        self.visit(
            |node, best: &Hit| {
                let (a, b) = ((node.low - from).component_mul(&inverse), (node.high - from).component_mul(&inverse));
                // A ray in the plane of a side gives 0·∞; min and max then take the other side.
                let (mut near, mut far) = (0.0, best.t);
                for k in 0..3 {
                    near = f64::max(near, a[k].min(b[k]));
                    far = f64::min(far, a[k].max(b[k]));
                }
                near <= far
            },
            |index, best| {
                if let Some(t) = meets(&triangles[index], from, along)
                    && (t < best.t || (t == best.t && index < best.triangle && best.triangle != usize::MAX))
                {
                    *best = Hit { t, triangle: index };
                }
            },
            &mut best,
        );
        (best.triangle != usize::MAX).then_some(best)
    }

    /// The distance from `place` to the nearest triangle, if it is below `limit`.
    pub(crate) fn distance(&self, triangles: &[Triangle], place: &Vector3<f64>, limit: f64) -> Option<f64> {
        let mut best = limit;
        self.visit(
            |node, best: &f64| {
                let outside = (node.low - place).sup(&(place - node.high)).sup(&Vector3::zeros());
                outside.norm() < *best
            },
            |index, best| *best = best.min((nearest(&triangles[index], place) - place).norm()),
            &mut best,
        );
        (best < limit).then_some(best)
    }

    /// Visits all nodes that `enter` accepts and passes their triangles to `leaf`.
    fn visit<S>(&self, enter: impl Fn(&Node, &S) -> bool, mut leaf: impl FnMut(usize, &mut S), state: &mut S) {
        let mut stack = [0_u32; 64];
        let mut depth = usize::from(!self.nodes.is_empty());
        while depth > 0 {
            depth -= 1;
            let index = stack[depth];
            let node = &self.nodes[index as usize];
            if !enter(node, state) {
                continue;
            }
            if node.count > 0 {
                for k in node.first..node.first + node.count {
                    leaf(self.order[k as usize] as usize, state);
                }
            } else {
                (stack[depth], stack[depth + 1]) = (node.first, index + 1);
                depth += 2;
            }
        }
    }
}

/// The t > 0 at which the ray meets the triangle (Möller and Trumbore, 1997).
fn meets(triangle: &Triangle, from: &Vector3<f64>, along: &Vector3<f64>) -> Option<f64> {
    let [a, b, c] = &triangle.at;
    let (e, f) = (b - a, c - a);
    let p = along.cross(&f);
    let determinant = e.dot(&p);
    if determinant.abs() < 1e-300 {
        return None;
    }
    let s = from - a;
    let u = s.dot(&p) / determinant;
    let q = s.cross(&e);
    let v = along.dot(&q) / determinant;
    // A margin beyond the sides, so that no ray slips between two triangles.
    const HAIR: f64 = 1e-12;
    let t = f.dot(&q) / determinant;
    (u >= -HAIR && v >= -HAIR && u + v <= 1.0 + HAIR && t > 0.0).then_some(t)
}

/// The point of the triangle nearest to `place` (Ericson, *Real-Time Collision Detection*, 2005, 5.1.5).
fn nearest(triangle: &Triangle, place: &Vector3<f64>) -> Vector3<f64> {
    let [a, b, c] = &triangle.at;
    let (ab, ac, ap) = (b - a, c - a, place - a);
    let (d1, d2) = (ab.dot(&ap), ac.dot(&ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return *a;
    }
    let bp = place - b;
    let (d3, d4) = (ab.dot(&bp), ac.dot(&bp));
    if d3 >= 0.0 && d4 <= d3 {
        return *b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let cp = place - c;
    let (d5, d6) = (ab.dot(&cp), ac.dot(&cp));
    if d6 >= 0.0 && d5 <= d6 {
        return *c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    let sum = va + vb + vc;
    a + ab * (vb / sum) + ac * (vc / sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stream::{Purpose, Stream};

    fn soup(n: usize) -> Vec<Triangle> {
        let mut stream = Stream::new(4, 0, 0, Purpose::Rocks);
        (0..n)
            .map(|_| {
                let centre = stream.normal3(2.0);
                let at = [(); 3].map(|()| centre + stream.normal3(0.5));
                Triangle { at, normals: at, uv: [[0.0; 2]; 3], skin: 0, edges: [true; 3], layer: 0 }
            })
            .collect()
    }

    #[test]
    fn the_tree_finds_what_trying_all_finds() {
        let triangles = soup(300);
        let tree = Bvh::new(&triangles);
        let mut stream = Stream::new(5, 0, 0, Purpose::Rocks);
        let mut hits = 0;
        for _ in 0..500 {
            let (from, along) = (stream.normal3(4.0), stream.normal3(1.0));
            let all = triangles.iter().enumerate().filter_map(|(i, t)| Some((meets(t, &from, &along)?, i)));
            let expected = all.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(t, triangle)| Hit { t, triangle });
            hits += usize::from(expected.is_some());
            assert_eq!(tree.hit(&triangles, &from, &along, f64::INFINITY), expected);
            let near = triangles.iter().map(|t| (nearest(t, &from) - from).norm()).fold(f64::INFINITY, f64::min);
            assert_eq!(tree.distance(&triangles, &from, 100.0), Some(near));
        }
        assert!(hits > 50, "{hits}");
    }

    #[test]
    fn no_place_of_a_triangle_is_nearer_than_the_nearest() {
        let triangles = soup(40);
        let mut stream = Stream::new(6, 0, 0, Purpose::Rocks);
        for t in &triangles {
            let place = stream.normal3(3.0);
            let found = (nearest(t, &place) - place).norm();
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (u, v) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let at = t.at[0] + (t.at[1] - t.at[0]) * u + (t.at[2] - t.at[0]) * v;
                    assert!((at - place).norm() >= found - 1e-12);
                }
            }
        }
    }

    #[test]
    fn an_empty_tree_is_met_by_nothing() {
        let tree = Bvh::new(&[]);
        assert_eq!(tree.hit(&[], &Vector3::zeros(), &Vector3::x(), 1.0), None);
        assert_eq!(tree.distance(&[], &Vector3::zeros(), 1.0), None);
    }
}
