//! The two images of a pair show one world, and each pixel the body that its ray meets.

use super::*;

#[test]
fn depths_of_the_two_images_agree() {
    // Every place of the left image that the right one can see lies at the right one's depth there. A place that
    // something hides from the right camera is behind what it shows, never before.
    let field = field(&built_in("drill-centre").unwrap());
    let studio = studio(0.5, Water::default(), Imager::default(), Port::default(), &[]);
    for (object, tilt) in [(2, 0.3), (0, 0.0), (4, -0.2)] {
        let pose = above(field.objects[object].centroid(), 3.0, tilt);
        let left = shot(pose);
        let mut right = left.clone();
        right.world_from_left = (left.world_from_right).relabel();
        let depths = |shot: &Shot| {
            let mut work = Workspace::default();
            studio.left_radiance(&field, shot, &mut work);
            Studio::last_depths(&mut work)
        };
        let (ours, theirs) = (depths(&left), depths(&right));
        let (mut same, mut hidden, mut all) = (0, 0, 0);
        for v in 0..384_usize {
            for u in 0..512_usize {
                let z = f64::from(ours[v * 512 + u]);
                // f b / Z, in pixels of half the size.
                let there = u as f64 - 250.0 * 0.25 / z;
                if !z.is_finite() || !(1.0..=510.0).contains(&there) {
                    continue;
                }
                let (k, t) = (there as usize, there.fract());
                let (a, b) = (f64::from(theirs[v * 512 + k]), f64::from(theirs[v * 512 + k + 1]));
                if (a - b).abs() > 0.05 {
                    continue; // between two bodies
                }
                // Inverse depth is linear over a plane.
                let seen = 1.0 / ((1.0 - t) / a + t / b);
                all += 1;
                same += usize::from((seen / z - 1.0).abs() < 2e-3);
                hidden += usize::from(seen < z * (1.0 - 2e-3));
            }
        }
        assert!(all > 100_000 && same + hidden >= all - all / 1000, "{object}: {same} + {hidden} of {all}");
        assert!(same * 100 >= all * 95, "{object}: {same} of {all}");
    }
}
