//! Trajectories as TUM lines: `seconds tx ty tz qx qy qz qw`.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use seafix_component::Fault;
use seafix_geometry::{Frame, Transform};

/// A stamp (ns) and the pose at it.
pub type Stamped<A, B> = (u64, Transform<A, B>);

/// Reads the poses of a TUM text; `file` is named in faults. Lines that begin with `#` are comments.
///
/// # Errors
/// The first line that is not eight numbers, has a quaternion off unit length by more than 1e-3, or has a stamp not
/// later than the previous one; a comment that names w first.
pub fn parse<A: Frame, B: Frame>(text: &str, file: &Path) -> Result<Vec<Stamped<A, B>>, Fault> {
    Ok(lines_of(text.lines().enumerate().map(|(index, line)| (index + 1, line)), file)?.0)
}

/// Reads numbered TUM lines of any origin. Quaternions that seem to have w first are rejected too; the format of a data
/// set excludes them, so that [`parse`] does not test it.
pub fn parse_lines<'a, A: Frame, B: Frame>(
    lines: impl Iterator<Item = (usize, &'a str)>,
    file: &Path,
) -> Result<Vec<Stamped<A, B>>, Fault> {
    let (poses, order) = lines_of(lines, file)?;
    match order.suspect() {
        None => Ok(poses),
        Some((number, line)) => {
            Err(Fault::new("quaternions that seem to have w first", file).on_line(number).value(line).remedy(
                "the order is qx qy qz qw: reorder the columns, or, if they have this order, name them in a comment above, \
                 `# seconds tx ty tz qx qy qz qw`",
            ))
        }
    }
}

/// The poses, and indications of the order of the quaternions.
fn lines_of<'a, A: Frame, B: Frame>(
    lines: impl Iterator<Item = (usize, &'a str)>,
    file: &Path,
) -> Result<(Vec<Stamped<A, B>>, Order<'a>), Fault> {
    let mut poses: Vec<Stamped<A, B>> = Vec::new();
    let mut order = Order::default();
    for (number, line) in lines {
        let line = line.trim();
        let fault =
            |what: &str, value: &str, remedy: &str| Fault::new(what, file).on_line(number).value(value).remedy(remedy);
        order.named |= line.starts_with('#') && line.contains("qx") && line.contains("qw");
        if line.starts_with('#') && matches!((line.find("qw"), line.find("qx")), (Some(w), Some(x)) if w < x) {
            return Err(fault("quaternions with w first", line, "TUM has qx qy qz qw: reorder the columns"));
        }
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.len() != 8 {
            let remedy = if line.contains(',') {
                "separate by blanks, not commas"
            } else {
                "a TUM line is `seconds tx ty tz qx qy qz qw`"
            };
            return Err(fault(&format!("{} columns", words.len()), line, remedy));
        }
        let stamp = nanoseconds(words[0])
            .ok_or_else(|| fault("an invalid stamp", words[0], "give seconds, not negative, as a decimal number"))?;
        let mut numbers = [0.0; 7];
        for (number, word) in numbers.iter_mut().zip(&words[1..]) {
            *number = word
                .parse()
                .ok()
                .filter(|x: &f64| x.is_finite())
                .ok_or_else(|| fault("not a finite number", word, "give a number"))?;
        }
        let [tx, ty, tz, qx, qy, qz, qw] = numbers;
        let quaternion = Quaternion::new(qw, qx, qy, qz);
        if (quaternion.norm() - 1.0).abs() > 1e-3 {
            return Err(fault(
                "a quaternion that is not of unit length",
                &format!("{:.6}", quaternion.norm()),
                "the order is qx qy qz qw",
            ));
        }
        if poses.last().is_some_and(|(last, _)| *last >= stamp) {
            return Err(fault("a stamp not later than the previous one", words[0], "sort the lines by time"));
        }
        order.see(number, line, [qx, qy, qz, qw]);
        poses.push((stamp, Transform::new(UnitQuaternion::new_normalize(quaternion), Vector3::new(tx, ty, tz))));
    }
    Ok((poses, order))
}

/// Indications that quaternions have w first: the first of the four numbers is close to one in every line, and no
/// comment names it x. A camera that looks down with a constant heading may have such numbers in the right order too;
/// the file then needs a comment.
#[derive(Default)]
struct Order<'a> {
    /// Whether a comment names the columns in the order of TUM.
    named: bool,
    /// The first line and its number.
    first: Option<(usize, &'a str)>,
    lines: usize,
    other: bool,
}

/// The minimum of |w| for a rotation of at most 50°.
const NEAR_ONE: f64 = 0.9;
/// The minimum number of lines for a decision.
const FEW: usize = 3;
/// The comment that names the columns.
pub const COLUMNS: &str = "# seconds tx ty tz qx qy qz qw\n";

impl<'a> Order<'a> {
    fn see(&mut self, number: usize, line: &'a str, quaternion: [f64; 4]) {
        self.first.get_or_insert((number, line));
        self.lines += 1;
        self.other |= quaternion[0].abs() < NEAR_ONE;
    }

    fn suspect(&self) -> Option<(usize, &'a str)> {
        self.first.filter(|_| self.lines >= FEW && !self.other && !self.named)
    }
}

/// The first line with a quaternion off unit length, and that length. Rounding to six decimals is tolerated. [`parse`]
/// normalises such a quaternion, and a warning states it.
pub(super) fn normalised(text: &str) -> Option<(usize, f64)> {
    const ROUNDING: f64 = 1e-5;
    text.lines().enumerate().find_map(|(index, line)| {
        let numbers: Vec<f64> = line.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        let length = numbers.get(4..8)?.iter().map(|q| q * q).sum::<f64>().sqrt();
        ((length - 1.0).abs() > ROUNDING).then_some((index + 1, length))
    })
}

/// The TUM text of these poses. Reading it returns the same poses except for rounding of the last bit. It names its
/// columns if their order could be doubted.
pub fn print<A: Frame, B: Frame>(poses: &[Stamped<A, B>]) -> String {
    let doubtful = poses.len() >= FEW && poses.iter().all(|(_, pose)| pose.rotation().i.abs() >= NEAR_ONE);
    let columns = if doubtful { COLUMNS } else { "" };
    let lines: String = poses
        .iter()
        .map(|(stamp, pose)| {
            let (t, q) = (pose.translation(), pose.rotation());
            format!(
                "{}.{:09} {} {} {} {} {} {} {}\n",
                stamp / 1_000_000_000,
                stamp % 1_000_000_000,
                t.x,
                t.y,
                t.z,
                q.i,
                q.j,
                q.k,
                q.w
            )
        })
        .collect();
    columns.to_owned() + &lines
}

/// The pose closest in time to `stamp`, within a millisecond.
pub fn at<A: Frame, B: Frame>(poses: &[Stamped<A, B>], stamp: u64) -> Option<Transform<A, B>> {
    const TOLERANCE_NS: u64 = 1_000_000;
    let after = poses.partition_point(|(time, _)| *time < stamp);
    poses[after.saturating_sub(1)..poses.len().min(after + 1)]
        .iter()
        .min_by_key(|(time, _)| time.abs_diff(stamp))
        .filter(|(time, _)| time.abs_diff(stamp) <= TOLERANCE_NS)
        .map(|(_, pose)| *pose)
}

/// The pose within a millisecond of `stamp`, otherwise one interpolated between neighbours at most `max_gap` (ns)
/// apart: linear in position, along the shortest rotation in attitude.
pub fn between<A: Frame, B: Frame>(poses: &[Stamped<A, B>], stamp: u64, max_gap: u64) -> Option<Transform<A, B>> {
    let after = poses.partition_point(|(time, _)| *time < stamp);
    at(poses, stamp).or_else(|| {
        let ((t0, before), (t1, after)) = (poses.get(after.checked_sub(1)?)?, poses.get(after)?);
        let fraction = (stamp - t0) as f64 / (t1 - t0) as f64;
        let turn = before.rotation().try_slerp(&after.rotation(), fraction, 1e-9)?;
        let place = before.translation().lerp(&after.translation(), fraction);
        (t1 - t0 <= max_gap).then(|| Transform::new(turn, place))
    })
}

/// Decimal seconds as nanoseconds, digit by digit: a double has a resolution of 238 ns for current times.
pub fn nanoseconds(word: &str) -> Option<u64> {
    if word.contains(['e', 'E']) {
        let seconds: f64 = word.parse().ok()?;
        return (seconds.is_finite() && (0.0..1.8e10).contains(&seconds)).then(|| (seconds * 1e9).round() as u64);
    }
    let (full, part) = word.split_once('.').unwrap_or((word, ""));
    if !part.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let nanos: u64 = format!("{:0<9.9}", part).parse().ok()?;
    full.parse::<u64>().ok()?.checked_mul(1_000_000_000)?.checked_add(nanos)
}

#[cfg(test)]
mod tests {
    use super::*;
    use seafix_geometry::{Camera, World};

    fn read(text: &str) -> Result<Vec<Stamped<World, Camera>>, Fault> {
        parse(text, Path::new("truth.tum"))
    }

    #[test]
    fn stamps_keep_their_nanoseconds() {
        let poses = read("# comment\n1700000000.123456789 1 2 3 0 0 0 1\n").unwrap();
        assert_eq!(poses[0].0, 1_700_000_000_123_456_789);
        assert_eq!(read(&print(&poses)).unwrap(), poses);
        assert_eq!(nanoseconds("1.5e0"), Some(1_500_000_000));
        assert_eq!(nanoseconds("-1"), None);
    }

    #[test]
    fn bad_lines_are_refused_by_number() {
        let message = |text: &str| read(text).unwrap_err().to_string();
        assert!(message("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0\n").starts_with("7 columns in truth.tum:2"));
        assert!(message("1,0,0,0,0,0,0,1\n").contains("not commas"));
        assert!(message("1 0 0 0 0 0 0 2\n").contains("unit length"));
        assert!(message("1 0 0 0 0 0 0 0\n").contains("unit length"));
        assert!(message("1 NaN 0 0 0 0 0 1\n").contains("not a finite number"));
        assert!(message("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n").contains("sort the lines"));
    }

    /// Seen to fail without the test of the order.
    #[test]
    fn w_first_is_suspected_where_no_one_states_otherwise() {
        let read = |text: &str| -> Result<Vec<Stamped<World, Camera>>, Fault> {
            parse_lines(text.lines().enumerate().map(|(index, line)| (index + 1, line)), Path::new("truth.tum"))
        };
        let walk = |q: &str| (1..5).map(|t| format!("{t} {t} 0 0 {q}\n")).collect::<String>();
        let said = read(&walk("0.99 0.1 0 0.0995")).unwrap_err().to_string();
        assert!(said.starts_with("quaternions that seem to have w first in truth.tum:1"), "{said}");
        assert!(read(&walk("1 0 0 0")).is_err());
        let of_a_data_set = parse::<World, Camera>(&walk("1 0 0 0"), Path::new("truth.tum"));
        assert_eq!(of_a_data_set.unwrap().len(), 4, "a data set is not tested");
        let down = read(&(COLUMNS.to_owned() + &walk("1 0 0 0"))).unwrap();
        assert_eq!(read(&print(&down)).unwrap(), down);
        assert!(read(&(walk("1 0 0 0") + "9 0 0 0 0.5 0.5 0.5 0.5\n")).is_ok());
        assert!(read(&walk("0 0 0 1")).is_ok() && read("1 0 0 0 1 0 0 0\n").is_ok());
    }

    #[test]
    fn a_quaternion_that_is_normalised_is_named_once() {
        let text = "# seconds\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1.0005\n3 0 0 0 0 0 0 0.9995\n";
        assert_eq!(read(text).unwrap()[1].1.rotation().w, 1.0);
        assert_eq!(normalised(text), Some((3, 1.0005)));
        assert_eq!(normalised("1 0 0 0 0.707107 0 0 0.707107\n"), None);
    }

    #[test]
    fn the_nearest_pose_in_time_is_found() {
        let poses = read("1 1 0 0 0 0 0 1\n2 2 0 0 0 0 0 1\n").unwrap();
        assert_eq!(at(&poses, 2_000_000_300).unwrap().translation().x, 2.0);
        assert_eq!(at(&poses, 1_500_000_000), None);
        assert_eq!(at::<World, Camera>(&[], 0), None);
    }
}
