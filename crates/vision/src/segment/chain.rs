//! Chains of places along an edge, and the straight parts of a chain.

use super::{gradients::Gradients, straight::Straight};

/// A place of a chain, in undistorted pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Link {
    pub(super) at: [f64; 2],
    /// The unit gradient.
    pub(super) unit: [f64; 2],
}

/// Whether the magnitude of a place is the largest across its edge.
pub(super) fn is_ridge(field: &Gradients, place: usize) -> bool {
    let (x, y) = (place % field.width, place / field.width);
    if x == 0 || y == 0 || x + 1 == field.width || y + 1 == field.height {
        return false;
    }
    let [gx, gy] = field.unit[place];
    let step = if gx.abs() >= gy.abs() { 1 } else { field.width };
    field.size[place] >= field.size[place - step] && field.size[place] > field.size[place + step]
}

/// Appends the places from `from` on along the edge in the direction `heading`, and takes them.
///
/// The next place is the steepest of the three ahead whose gradient is within the angle of cosine `aligned`.
pub(super) fn walk(
    field: &Gradients,
    taken: &mut [bool],
    from: usize,
    mut heading: [f32; 2],
    aligned: f32,
    places: &mut Vec<usize>,
) {
    let mut place = from;
    loop {
        let (x, y) = (place % field.width, place / field.width);
        if x == 0 || y == 0 || x + 1 == field.width || y + 1 == field.height {
            return;
        }
        let [gx, gy] = field.unit[place];
        let along = if -gy * heading[0] + gx * heading[1] < 0.0 { [gy, -gx] } else { [-gy, gx] };
        let (ahead, beside) = match along[0].abs() >= along[1].abs() {
            true => (if along[0] > 0.0 { place + 1 } else { place - 1 }, field.width),
            false => (if along[1] > 0.0 { place + field.width } else { place - field.width }, 1),
        };
        let good = |&next: &usize| {
            let [ux, uy] = field.unit[next];
            !taken[next] && ux * gx + uy * gy >= aligned
        };
        let steepest = [ahead, ahead - beside, ahead + beside].into_iter().filter(good);
        let Some(next) = steepest.max_by(|&a, &b| field.size[a].total_cmp(&field.size[b]).then(b.cmp(&a))) else {
            return;
        };
        taken[next] = true;
        places.push(next);
        (place, heading) = (next, along);
    }
}

/// Replaces `links` by the places in undistorted pixels, without those outside the lens model.
pub(super) fn links(field: &Gradients, straight: &Straight, places: &[usize], links: &mut Vec<Link>) {
    links.clear();
    links.extend(places.iter().filter_map(|&place| {
        let (x, y) = ((place % field.width) as f32, (place / field.width) as f32);
        let (at, unit) = (straight.at(x, y)?, straight.turned(x, y, field.unit[place])?);
        Some(Link { at: at.map(f64::from), unit: unit.map(f64::from) })
    }));
}

/// A straight line through links.
#[derive(Debug, Clone, Copy)]
pub(super) struct Chord {
    centre: [f64; 2],
    /// The unit direction; the brighter side lies along (−d_y, d_x).
    along: [f64; 2],
}

impl Chord {
    /// The line of least squared distances, directed by the gradients.
    pub(super) fn of(links: &[Link]) -> Self {
        let n = links.len() as f64;
        let centre = [0, 1].map(|axis| links.iter().map(|link| link.at[axis]).sum::<f64>() / n);
        let (mut xx, mut xy, mut yy, mut sum) = (0.0, 0.0, 0.0, [0.0; 2]);
        for link in links {
            let (x, y) = (link.at[0] - centre[0], link.at[1] - centre[1]);
            (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
            sum = [sum[0] + link.unit[0], sum[1] + link.unit[1]];
        }
        let half = 0.5 * (xx - yy);
        let root = (half * half + xy * xy).sqrt();
        let along = if half >= 0.0 { [half + root, xy] } else { [xy, root - half] };
        let length = along[0].hypot(along[1]);
        let mut along = if length > 0.0 { along.map(|x| x / length) } else { [1.0, 0.0] };
        if sum[1] * along[0] - sum[0] * along[1] < 0.0 {
            along = along.map(|x| -x);
        }
        Self { centre, along }
    }

    /// The distance of a link from the line (px).
    pub(super) fn distance(&self, link: &Link) -> f64 {
        let (x, y) = (link.at[0] - self.centre[0], link.at[1] - self.centre[1]);
        (y * self.along[0] - x * self.along[1]).abs()
    }

    /// Whether the gradient of a link is across the line, within the angle of cosine `aligned`.
    pub(super) fn is_aligned(&self, link: &Link, aligned: f64) -> bool {
        link.unit[1] * self.along[0] - link.unit[0] * self.along[1] >= aligned
    }

    /// The ends of the links on the line, in its direction.
    pub(super) fn ends(&self, links: &[Link]) -> [[f64; 2]; 2] {
        let position =
            |link: &Link| (link.at[0] - self.centre[0]) * self.along[0] + (link.at[1] - self.centre[1]) * self.along[1];
        let minimum = links.iter().map(position).fold(f64::INFINITY, f64::min);
        let maximum = links.iter().map(position).fold(f64::NEG_INFINITY, f64::max);
        [minimum, maximum].map(|s| [0, 1].map(|axis| self.centre[axis] + s * self.along[axis]))
    }
}
