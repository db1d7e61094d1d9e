//! Regions of aligned gradients, and their rectangles.

use super::{gradients::Gradients, straight::Straight};

/// One place of a region.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member {
    pub(super) place: u32,
    /// The undistorted pixel.
    at: [f32; 2],
    size: f32,
}

/// A rectangle around a region, in undistorted pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rectangle {
    pub(super) centre: [f64; 2],
    /// The unit direction of the longer side.
    pub(super) along: [f64; 2],
    /// The extent along and across, from the centre.
    pub(super) reach: [f64; 2],
    pub(super) half_width: f64,
    /// The members inside.
    pub(super) inside: usize,
}

/// The growth of one region at a time, and the places that regions have taken.
#[derive(Debug, Default)]
pub(super) struct Regions {
    taken: Vec<bool>,
    pub(super) members: Vec<Member>,
    /// The sum of the members' unit gradients, in undistorted pixels.
    sum: [f32; 2],
}

impl Regions {
    pub(super) fn reset(&mut self, places: usize) {
        self.taken.clear();
        self.taken.resize(places, false);
    }

    pub(super) fn is_free(&self, place: u32) -> bool {
        !self.taken[place as usize]
    }

    /// Replaces the region by that of `seed`: connected places whose gradients are within the angle of cosine `aligned`
    /// of the region's mean. Its places are taken.
    pub(super) fn grow(&mut self, field: &Gradients, straight: &Straight, seed: u32, aligned: f32) {
        self.members.clear();
        self.sum = [0.0; 2];
        self.add(field, straight, seed, None);
        let mut next = 0;
        while let Some(&Member { place, .. }) = self.members.get(next) {
            next += 1;
            let (x, y) = (place as usize % field.width, place as usize / field.width);
            for row in y.saturating_sub(1)..=(y + 1).min(field.height - 1) {
                for column in x.saturating_sub(1)..=(x + 1).min(field.width - 1) {
                    self.add(field, straight, (row * field.width + column) as u32, Some(aligned));
                }
            }
        }
    }

    fn add(&mut self, field: &Gradients, straight: &Straight, place: u32, aligned: Option<f32>) {
        let index = place as usize;
        let unit = field.unit[index];
        if self.taken[index] || unit == [0.0; 2] {
            return;
        }
        let (x, y) = ((index % field.width) as f32, (index / field.width) as f32);
        let Some(unit) = straight.turned(x, y, unit) else { return };
        if let Some(cosine) = aligned {
            let length = (self.sum[0] * self.sum[0] + self.sum[1] * self.sum[1]).sqrt();
            if self.sum[0] * unit[0] + self.sum[1] * unit[1] < cosine * length {
                return;
            }
        }
        let Some(at) = straight.at(x, y) else { return };
        self.taken[index] = true;
        self.sum = [self.sum[0] + unit[0], self.sum[1] + unit[1]];
        self.members.push(Member { place, at, size: field.size[index] });
    }

    /// Frees the members farther than `reach` (px) from the seed, the first member.
    pub(super) fn shrink(&mut self, reach: f32) {
        let Some(seed) = self.members.first().map(|member| member.at) else { return };
        let taken = &mut self.taken;
        self.members.retain(|member| {
            let near = (member.at[0] - seed[0]).powi(2) + (member.at[1] - seed[1]).powi(2) <= reach * reach;
            taken[member.place as usize] = near;
            near
        });
    }

    /// The largest distance of a member from the seed (px).
    pub(super) fn radius(&self) -> f32 {
        let seed = self.members[0].at;
        let squared = |member: &Member| (member.at[0] - seed[0]).powi(2) + (member.at[1] - seed[1]).powi(2);
        self.members.iter().map(squared).fold(0.0, f32::max).sqrt()
    }

    /// The rectangle along the main axis of the members, weighted by magnitude.
    ///
    /// The brighter side lies along (−d_y, d_x) of its direction d. `pixel` is the side of a place (px).
    pub(super) fn rectangle(&self, pixel: f64) -> Rectangle {
        let (mut weight, mut centre) = (0.0, [0.0; 2]);
        for member in &self.members {
            let w = f64::from(member.size);
            weight += w;
            centre = [centre[0] + w * f64::from(member.at[0]), centre[1] + w * f64::from(member.at[1])];
        }
        let centre = centre.map(|sum| sum / weight);
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for member in &self.members {
            let w = f64::from(member.size);
            let (x, y) = (f64::from(member.at[0]) - centre[0], f64::from(member.at[1]) - centre[1]);
            (xx, xy, yy) = (xx + w * x * x, xy + w * x * y, yy + w * y * y);
        }
        // The eigenvector of the larger eigenvalue.
        let root = (0.25 * (xx - yy) * (xx - yy) + xy * xy).sqrt();
        let half = 0.5 * (xx - yy);
        let mut along = if half >= 0.0 { [half + root, xy] } else { [xy, root - half] };
        let length = (along[0] * along[0] + along[1] * along[1]).sqrt();
        along = if length > 0.0 { along.map(|x| x / length) } else { [1.0, 0.0] };
        if f64::from(self.sum[1]) * along[0] - f64::from(self.sum[0]) * along[1] < 0.0 {
            along = along.map(|x| -x);
        }
        let (mut reach, mut half_width) = ([0.0_f64; 2], 0.0_f64);
        for member in &self.members {
            let [s, t] = coordinates(member, centre, along);
            reach = [reach[0].min(s), reach[1].max(s)];
            half_width = half_width.max(t.abs());
        }
        reach = [reach[0] - 0.5 * pixel, reach[1] + 0.5 * pixel];
        Rectangle { centre, along, reach, half_width: half_width + 0.5 * pixel, inside: self.members.len() }
    }

    /// The rectangle narrowed to `half_width` (px).
    pub(super) fn narrowed(&self, from: &Rectangle, half_width: f64) -> Rectangle {
        let mut reach = [f64::INFINITY, f64::NEG_INFINITY];
        let mut inside = 0;
        for member in &self.members {
            let [s, t] = coordinates(member, from.centre, from.along);
            if t.abs() <= half_width {
                inside += 1;
                reach = [reach[0].min(s), reach[1].max(s)];
            }
        }
        if inside == 0 {
            reach = [0.0; 2];
        }
        Rectangle { half_width, inside, reach, ..*from }
    }
}

/// The coordinates of a member along and across a rectangle.
fn coordinates(member: &Member, centre: [f64; 2], along: [f64; 2]) -> [f64; 2] {
    let (x, y) = (f64::from(member.at[0]) - centre[0], f64::from(member.at[1]) - centre[1]);
    [x * along[0] + y * along[1], y * along[0] - x * along[1]]
}

impl Rectangle {
    /// The number of places of side `pixel` (px) in the rectangle.
    pub(super) fn places(&self, pixel: f64) -> f64 {
        2.0 * self.half_width * self.length() / (pixel * pixel)
    }

    /// The length (px).
    pub(super) fn length(&self) -> f64 {
        self.reach[1] - self.reach[0]
    }

    /// The end at the start or the end of the rectangle's direction.
    pub(super) fn end(&self, which: usize) -> [f64; 2] {
        [0, 1].map(|axis| self.centre[axis] + self.reach[which] * self.along[axis])
    }
}
