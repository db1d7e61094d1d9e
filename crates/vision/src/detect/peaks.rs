//! Maxima of a response over an image: which, how many, and where to a fraction of a pixel.

use seafix_geometry::Pixel;

/// A pixel whose response is the greatest around.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Peak {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) response: f32,
}

/// The pixels with a positive response of at least `least` that none within `radius` px exceeds,
/// row by row; of equal ones within the radius the first counts. Never at the border of the image.
pub(super) fn maxima(response: &[f32], width: usize, least: f32, radius: usize) -> Vec<Peak> {
    let height = response.len() / width;
    let mut found = Vec::new();
    for y in 1..height.saturating_sub(1) {
        let row = |y: usize| &response[y * width..][..width];
        let (above, here, below) = (row(y - 1), row(y), row(y + 1));
        for x in 1..width.saturating_sub(1) {
            let r = here[x];
            if r >= least
                && r > 0.0
                && r > here[x - 1]
                && r >= here[x + 1]
                && r > above[x - 1].max(above[x]).max(above[x + 1])
                && r >= below[x - 1].max(below[x]).max(below[x + 1])
                && is_greatest(response, width, x, y, radius)
            {
                found.push(Peak { x, y, response: r });
            }
        }
    }
    found
}

/// Whether no pixel of the disc around (x, y) exceeds it, and no earlier one equals it.
fn is_greatest(response: &[f32], width: usize, x: usize, y: usize, radius: usize) -> bool {
    let height = response.len() / width;
    let r = response[y * width + x];
    let radius = radius.min(width.max(height));
    let squared = radius * radius;
    (y.saturating_sub(radius)..=(y + radius).min(height - 1)).all(|other_y| {
        let dy = other_y.abs_diff(y);
        (x.saturating_sub(radius)..=(x + radius).min(width - 1)).all(|other_x| {
            let dx = other_x.abs_diff(x);
            let other = response[other_y * width + other_x];
            let earlier = (other_y, other_x) < (y, x);
            dx * dx + dy * dy > squared || if earlier { other < r } else { other <= r }
        })
    })
}

/// Keeps at most `budget` peaks and puts the strongest first. With `balance` > 0 the image is cut into
/// square cells, `balance` along its longer side, and every cell gives its strongest before any gives
/// its second.
pub(super) fn strongest(peaks: &mut Vec<Peak>, [width, height]: [usize; 2], budget: usize, balance: usize) {
    let stronger = |a: &Peak, b: &Peak| b.response.total_cmp(&a.response).then((a.y, a.x).cmp(&(b.y, b.x)));
    peaks.sort_unstable_by(stronger);
    if peaks.len() <= budget {
        return;
    }
    if balance > 0 {
        let longer = width.max(height);
        let balance = balance.min(longer);
        let cell = |x: usize| x * balance / longer;
        let columns = cell(width - 1) + 1;
        let mut taken = vec![0_usize; columns * (cell(height - 1) + 1)];
        let mut ranked: Vec<(usize, Peak)> = peaks
            .iter()
            .map(|peak| {
                let rank = &mut taken[cell(peak.y) * columns + cell(peak.x)];
                *rank += 1;
                (*rank, *peak)
            })
            .collect();
        ranked.sort_by_key(|(rank, _)| *rank); // stable: within a rank the strongest stay first
        peaks.clear();
        peaks.extend(ranked.into_iter().take(budget).map(|(_, peak)| peak));
        peaks.sort_unstable_by(stronger);
    }
    peaks.truncate(budget);
}

/// The vertex of the quadratic through the peak and its eight neighbours (px), never more than a pixel
/// from the peak; the peak itself where the nine describe no maximum.
///
/// Newton's step −H⁻¹ g with the derivatives by central differences.
pub(super) fn vertex(response: &[f32], width: usize, peak: &Peak) -> Pixel {
    let at = |dx: isize, dy: isize| {
        let x = peak.x.wrapping_add_signed(dx);
        let y = peak.y.wrapping_add_signed(dy);
        f64::from(response[y * width + x])
    };
    let centre = at(0, 0);
    let gx = 0.5 * (at(1, 0) - at(-1, 0));
    let gy = 0.5 * (at(0, 1) - at(0, -1));
    let xx = at(1, 0) + at(-1, 0) - 2.0 * centre;
    let yy = at(0, 1) + at(0, -1) - 2.0 * centre;
    let xy = 0.25 * ((at(1, 1) + at(-1, -1)) - (at(1, -1) + at(-1, 1)));
    let determinant = xx * yy - xy * xy;
    let (mut dx, mut dy) = (0.0, 0.0);
    if determinant > 0.0 && xx < 0.0 {
        dx = (xy * gy - yy * gx) / determinant;
        dy = (xy * gx - xx * gy) / determinant;
        if !(dx.abs() <= 1.0 && dy.abs() <= 1.0) {
            (dx, dy) = (0.0, 0.0);
        }
    }
    Pixel { u: peak.x as f64 + dx, v: peak.y as f64 + dy }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadratic_has_its_vertex_where_it_is() {
        // 10 − 2 (x − 2.3)² − (y − 1.8)² − (x − 2.3)(y − 1.8) on 5×4 pixels.
        let value = |i: usize| {
            let (x, y) = ((i % 5) as f32 - 2.3, (i / 5) as f32 - 1.8);
            10.0 - 2.0 * x * x - y * y - x * y
        };
        let response: Vec<f32> = (0..20).map(value).collect();
        let found = maxima(&response, 5, 0.0, 2);
        assert_eq!(found.len(), 1);
        let vertex = vertex(&response, 5, &found[0]);
        assert!(vertex.distance(&Pixel { u: 2.3, v: 1.8 }) < 1e-5, "{vertex:?}");
    }

    #[test]
    fn of_equal_neighbours_the_first_counts_and_the_vertex_is_between() {
        let mut response = vec![0.0; 36];
        for i in [14, 15, 20, 21] {
            response[i] = 4.0;
        }
        let found = maxima(&response, 6, 0.0, 3);
        assert_eq!(found, [Peak { x: 2, y: 2, response: 4.0 }]);
    }

    #[test]
    fn balance_spreads_the_budget() {
        let peak = |x, response| Peak { x, y: 0, response };
        let all = vec![peak(1, 9.0), peak(3, 8.0), peak(5, 7.0), peak(60, 1.0)];
        let kept = |balance| {
            let mut peaks = all.clone();
            strongest(&mut peaks, [100, 10], 3, balance);
            peaks.iter().map(|peak| peak.x).collect::<Vec<_>>()
        };
        assert_eq!(kept(0), [1, 3, 5]);
        assert_eq!(kept(2), [1, 3, 60]);
    }
}
