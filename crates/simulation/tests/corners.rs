//! An independent detector finds the corners of rendered images where the truth has them.

use std::{fmt::Write, fs, path::Path, process::Command};

use seafix_simulation::{Blueprint, Imager, Mission, ObjectPlan, optics::Water};
use seafix_vision::{Image, Threads};

/// OpenCV's corner refinement from starts on whole pixels: `image u v half-window` a line.
const REFINE: &str = r"
import sys, numpy, cv2
images = {}
for line in sys.stdin:
    path, u, v, half = line.split()
    image = images.setdefault(path, cv2.imread(path, cv2.IMREAD_GRAYSCALE))
    start = numpy.array([[[float(u), float(v)]]], dtype=numpy.float32)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
    found = cv2.cornerSubPix(image, start, (int(half), int(half)), (-1, -1), stop)
    print(*found.ravel())
";

/// Whether two panels touch at a feature point: an X. Otherwise, on one panel, it is an L.
fn is_x(plan: &ObjectPlan, panel: usize) -> bool {
    let here = &plan.panels[panel];
    plan.panels.iter().filter(|p| p.carrier == here.carrier && p.outline[0] == here.outline[0]).count() == 2
}

fn save(path: &Path, image: &Image) {
    let header = format!("P5\n{} {}\n255\n", image.width(), image.height());
    fs::write(path, [header.into_bytes(), image.to_u8()].concat()).expect("the temporary folder can be written");
}

#[test]
fn opencv_finds_corners_where_the_truth_has_them() {
    // crates/vision/benches/README.md says how the interpreter is made.
    let Ok(python) = std::env::var("SEAFIX_PEERS") else {
        println!("skipped: SEAFIX_PEERS names no Python with OpenCV");
        return;
    };
    let blueprint = Blueprint::drill_centre();
    let mut mission = Mission {
        frames: 30,
        rate: 0.0,
        // A particle before a corner is no corner.
        water: Water { attenuation: 0.1, snow: 0.0, ..Water::default() },
        imager: Imager::default(),
        ..Mission::default()
    };
    mission.route.altitude = 3.0;
    let plan = mission.plan(3, 0, Path::new("")).unwrap();
    let folder = std::env::temp_dir().join(format!("seafix-corners-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (mut asked, mut truth) = (String::new(), Vec::new());
    for index in 0..plan.len() {
        let instant = plan.instant(index);
        let names: Vec<_> = instant
            .truth()
            .visible
            .iter()
            .filter_map(|seen| {
                let object = &blueprint.objects[seen.object];
                Some((seen.pixels, is_x(object, object.points[seen.point].panel?)))
            })
            .collect();
        if names.is_empty() {
            continue;
        }
        let (left, right, _) = instant.render(Threads::Pool);
        for (side, image) in [("left", &left), ("right", &right)] {
            let path = folder.join(format!("{side}{index}.pgm"));
            save(&path, image);
            for (pixels, x) in &names {
                let at = if side == "left" { pixels.left } else { pixels.right };
                let inside = at.u > 12.0 && at.v > 12.0 && at.u < 1011.0 && at.v < 755.0;
                if inside {
                    let half = if *x { 4 } else { 5 };
                    writeln!(asked, "{} {} {} {half}", path.display(), at.u.round(), at.v.round()).unwrap();
                    truth.push((at, *x));
                }
            }
        }
    }
    fs::write(folder.join("asked"), &asked).unwrap();
    let answer = Command::new(python)
        .args(["-c", REFINE])
        .stdin(fs::File::open(folder.join("asked")).unwrap())
        .output()
        .unwrap();
    fs::remove_dir_all(&folder).unwrap();
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let lines = String::from_utf8(answer.stdout).unwrap();
    let mut squares = [Vec::new(), Vec::new()];
    for (line, (at, x)) in lines.lines().zip(&truth) {
        let [u, v]: [f64; 2] =
            line.split(' ').map(|word| word.parse().unwrap()).collect::<Vec<_>>().try_into().unwrap();
        squares[usize::from(!*x)].push(0.5 * ((u - at.u).powi(2) + (v - at.v).powi(2)));
    }
    for (errors, kind, most) in squares.iter().zip(["X", "L"]).zip([0.05, 0.2]).map(|((e, k), m)| (e, k, m)) {
        let n = errors.len();
        let rms = (errors.iter().sum::<f64>() / n as f64).sqrt();
        let mut sorted = errors.clone();
        sorted.sort_by(f64::total_cmp);
        let median = sorted.get(n / 2).copied().unwrap_or(f64::NAN).sqrt();
        let worst = sorted.last().copied().unwrap_or(f64::NAN).sqrt();
        println!("{kind}: {n} corners, RMS {rms:.4} px an axis, median {median:.4}, worst {worst:.3}");
        assert!(n > 30 && rms <= most, "{kind}: RMS {rms} px of {n}, {most} wanted");
    }
}
