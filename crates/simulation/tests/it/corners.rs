//! An independent detector finds the corners of rendered images at their true positions.

use std::{fmt::Write, fs, path::Path, process::Command};

use seafix_simulation::{
    Blueprint, Imager, Mission, ObjectPlan,
    optics::Water,
    scene::{Texture, built_in},
};
use seafix_vision::{Image, Threads};

/// OpenCV's corner refinement from whole-pixel starts; each input line is `image u v half-window`.
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

/// Whether two panels touch at a feature point (an X corner); a corner of one panel is an L.
fn is_x(plan: &ObjectPlan, panel: usize) -> bool {
    let here = &plan.panels[panel];
    plan.panels.iter().filter(|p| p.carrier == here.carrier && p.outline[0] == here.outline[0]).count() == 2
}

fn save(path: &Path, image: &Image) {
    let header = format!("P5\n{} {}\n255\n", image.width(), image.height());
    fs::write(path, [header.into_bytes(), image.to_u8()].concat()).expect("the temporary folder can be written");
}

/// The corners that OpenCV finds in the images of a dive: errors in pixels, and whether each is an X.
fn errors(python: &str, folder: &Path, mission: &Mission) -> Vec<([f64; 2], bool)> {
    let blueprint = Blueprint::drill_centre();
    let plan = mission.plan(3, 0, folder).unwrap();
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
    assert!(answer.status.success(), "{}", String::from_utf8_lossy(&answer.stderr));
    let lines = String::from_utf8(answer.stdout).unwrap();
    let found = lines.lines().map(|line| {
        let uv: Vec<f64> = line.split(' ').map(|word| word.parse().unwrap()).collect();
        [uv[0], uv[1]]
    });
    found.zip(&truth).map(|([u, v], (at, x))| ([u - at.u, v - at.v], *x)).collect()
}

/// RMS error on each axis of the X or L corners; prints it with median and maximum.
fn rms(errors: &[([f64; 2], bool)], x: bool, name: &str) -> f64 {
    let mut squares: Vec<f64> = errors.iter().filter(|e| e.1 == x).map(|([u, v], _)| 0.5 * (u * u + v * v)).collect();
    squares.sort_by(f64::total_cmp);
    let n = squares.len();
    assert!(n > 30, "{name}: {n} corners");
    let rms = (squares.iter().sum::<f64>() / n as f64).sqrt();
    let kind = if x { "X" } else { "L" };
    let (median, worst) = (squares[n / 2].sqrt(), squares[n - 1].sqrt());
    println!("{name}, {kind}: {n} corners, RMS {rms:.4} px an axis, median {median:.4}, worst {worst:.3}");
    rms
}

#[test]
fn opencv_finds_corners_where_the_truth_has_them() {
    // crates/vision/benches/README.md describes the interpreter.
    let Ok(python) = std::env::var("SEAFIX_PEERS") else {
        println!("skipped: SEAFIX_PEERS names no Python with OpenCV");
        return;
    };
    let folder = std::env::temp_dir().join(format!("seafix-corners-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    // The same site with smooth paint and plates.
    let mut smooth = built_in("drill-centre").unwrap();
    smooth.geometry.seabed.texture = Texture::Plain;
    smooth.geometry.materials.iter_mut().for_each(|material| material.texture = Texture::Plain);
    fs::write(folder.join("smooth.site.toml"), smooth.site.to_toml()).unwrap();
    fs::write(folder.join("smooth.geometry.toml"), smooth.geometry.to_toml()).unwrap();
    let dive = |site: &str| {
        let mut mission = Mission {
            site: site.to_owned(),
            frames: 30,
            rate: 0.0,
            // Particles before corners would disturb the detector.
            water: Water { attenuation: 0.1, snow: 0.0, ..Water::default() },
            imager: Imager::default(),
            ..Mission::default()
        };
        mission.route.altitude = 3.0;
        errors(&python, &folder, &mission)
    };
    let (worn, plain) = (dive("drill-centre"), dive("smooth.site.toml"));
    fs::remove_dir_all(&folder).unwrap();
    // An X on smooth surfaces is the intersection of its edges; stains and grain of worn plates move OpenCV's corner.
    // Regression: equal grain at a centimetre and at a decimetre, which no coat has, gave 0.054 for X. Shadows in steps
    // of a map pixel displaced a smooth L by 0.95 px, which raised the RMS to 0.202.
    for (name, found) in [("worn", &worn), ("smooth", &plain)] {
        let (x, l) = (rms(found, true, name), rms(found, false, name));
        assert!(x <= 0.05 && l <= 0.2, "{name}: X {x}, L {l}");
    }
}
