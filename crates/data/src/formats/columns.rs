//! The meaning of a pose table's columns by their names.
//!
//! Names may be spelt in any way: `qx`, `Q_X`, `q[x]`, `q_RS_x []`, `pose.orientation.x`, `p_RS_R_x [m]`, `pos_x`.

use std::path::Path;

use seafix_component::Fault;

/// The meaning of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Role {
    /// The time, in the unit that the name states.
    Stamp(Option<TimeUnit>),
    /// The nanoseconds that a column of whole seconds leaves.
    Nanoseconds,
    /// The position along the axis 0 to 2.
    Position(usize, LengthUnit),
    /// The quaternion's part w, x, y, z.
    Quaternion(usize),
    /// An angle or a rotation vector: an attitude in a form that is not read.
    OtherAttitude,
    /// Another quantity.
    Other,
}

/// The unit of a column of stamps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeUnit {
    Seconds,
    Milliseconds,
    Microseconds,
    Nanoseconds,
}

impl TimeUnit {
    /// The unit in nanoseconds.
    pub(crate) fn nanoseconds(self) -> u64 {
        match self {
            Self::Seconds => 1_000_000_000,
            Self::Milliseconds => 1_000_000,
            Self::Microseconds => 1_000,
            Self::Nanoseconds => 1,
        }
    }
}

/// The unit of a column of positions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum LengthUnit {
    Metres,
    Centimetres,
    Millimetres,
}

impl LengthUnit {
    /// The unit in metres.
    pub(crate) fn metres(self) -> f64 {
        match self {
            Self::Metres => 1.0,
            Self::Centimetres => 1e-2,
            Self::Millimetres => 1e-3,
        }
    }
}

/// The columns of the parts of a pose.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Columns {
    pub(crate) stamp: Option<(usize, Option<TimeUnit>)>,
    /// The column of nanoseconds beside whole seconds.
    pub(crate) nanoseconds: Option<usize>,
    pub(crate) position: [usize; 3],
    pub(crate) unit: LengthUnit,
    /// The columns of w, x, y, z.
    pub(crate) quaternion: Option<[usize; 4]>,
    /// Whether an attitude stands in columns that are not read.
    pub(crate) has_other_attitude: bool,
}

/// The names in a header, without the unit in brackets; the units by column.
fn split(header: &str) -> Vec<String> {
    let header = header.trim().trim_start_matches(['#', '%', '/']).trim();
    let separator = if header.contains([',', ';', '\t']) { [',', ';', '\t'].as_slice() } else { [' '].as_slice() };
    // Blanks inside brackets and before a unit do not separate names.
    let joined = header.replace(" [", "[").replace(" (", "(");
    joined
        .split(separator)
        .map(|name| name.trim().trim_matches('"').to_owned())
        .filter(|name| !name.is_empty())
        .collect()
}

/// The meaning of a column's name.
pub(crate) fn role(name: &str) -> Role {
    let lower = name.to_lowercase();
    let suffix = lower.rsplit_once('_').filter(|(_, unit)| ["m", "mm", "cm", "s", "ns"].contains(unit));
    let lower = suffix.map_or(lower.clone(), |(name, unit)| format!("{name}[{unit}]"));
    let bracketed = lower.split(['[', '(']).nth(1).map(|rest| rest.trim_end_matches([']', ')']).trim().to_owned());
    let unit = bracketed.as_deref().filter(|unit| !matches!(*unit, "w" | "x" | "y" | "z" | "qw" | "qx" | "qy" | "qz"));
    let named = if unit.is_some() { lower.split(['[', '(']).next().unwrap_or_default() } else { &lower };
    let joined: String = named.chars().filter(char::is_ascii_alphanumeric).collect();
    let is_any = |words: &[&str]| words.contains(&joined.as_str());
    let holds = |words: &[&str]| words.iter().any(|word| joined.contains(word));
    if holds(&["timestamp", "stamp", "time", "nanosec", "nsec"])
        || is_any(&["t", "sec", "secs", "seconds", "ns", "ms", "us"])
    {
        if joined.ends_with("nsec")
            || joined.ends_with("nsecs")
            || joined.ends_with("nanosec")
            || joined.ends_with("nanosecs")
        {
            return Role::Nanoseconds;
        }
        let spelt = unit.unwrap_or(&joined);
        return Role::Stamp(match spelt {
            "s" | "sec" | "secs" | "second" | "seconds" => Some(TimeUnit::Seconds),
            "ms" | "msec" => Some(TimeUnit::Milliseconds),
            "us" | "µs" | "usec" => Some(TimeUnit::Microseconds),
            "ns" | "nsec" | "nanoseconds" => Some(TimeUnit::Nanoseconds),
            _ if joined.ends_with("ns") || joined.ends_with("nanoseconds") => Some(TimeUnit::Nanoseconds),
            _ if joined.ends_with("sec") || joined.ends_with("secs") || joined.ends_with("seconds") => {
                Some(TimeUnit::Seconds)
            }
            _ => None,
        });
    }
    let length = match unit {
        Some("mm") => LengthUnit::Millimetres,
        Some("cm") => LengthUnit::Centimetres,
        _ => LengthUnit::Metres,
    };
    if let Some(axis) = ["easting", "northing", "up"].iter().position(|axis| *axis == joined) {
        return Role::Position(axis, length);
    }
    if holds(&["roll", "pitch", "yaw", "heading", "euler", "rotvec", "rvec"]) || is_any(&["rx", "ry", "rz"]) {
        return Role::OtherAttitude;
    }
    let Some(axis) = joined.chars().last().and_then(|last| "wxyz".find(last)) else { return Role::Other };
    let stem = &joined[..joined.len() - 1];
    let quaternion =
        stem.starts_with('q') || ["quat", "orient", "rotation", "attitude"].iter().any(|word| stem.contains(word));
    let velocity = ["vel", "twist", "linear", "angular", "acc", "gyr", "bias", "cov", "std", "sigma"];
    match (stem, axis) {
        _ if velocity.iter().any(|word| stem.contains(word)) => Role::Other,
        _ if quaternion => Role::Quaternion(axis),
        ("", 0) => Role::Quaternion(0),
        (_, 0) => Role::Other,
        ("" | "t" | "p", axis) => Role::Position(axis - 1, length),
        (stem, axis) if stem.starts_with('p') || ["trans", "pos", "loc"].iter().any(|word| stem.contains(word)) => {
            Role::Position(axis - 1, length)
        }
        _ => Role::Other,
    }
}

/// The columns that a header names; `None` if it is no header of poses.
///
/// # Errors
/// Names that leave the order open: a part that is named twice, a quaternion with a part missing, `q0` to `q3`.
pub(crate) fn columns(header: &str, line: usize, file: &Path) -> Result<Option<Columns>, Fault> {
    columns_of(&split(header), header, line, file)
}

/// The columns of a header's cells.
pub(crate) fn columns_of(names: &[String], header: &str, line: usize, file: &Path) -> Result<Option<Columns>, Fault> {
    let roles: Vec<Role> = names.iter().map(|name| role(name)).collect();
    let all = |wanted: &dyn Fn(Role) -> bool| -> Vec<usize> {
        (0..roles.len()).filter(|&column| wanted(roles[column])).collect()
    };
    let refuse =
        |what: &str, remedy: &str| Err(Fault::new(what, file).on_line(line).value(header.trim()).remedy(remedy));
    let positions: [Vec<usize>; 3] =
        [0, 1, 2].map(|axis| all(&|role| matches!(role, Role::Position(a, _) if a == axis)));
    let parts: [Vec<usize>; 4] = [0, 1, 2, 3].map(|part| all(&|role| role == Role::Quaternion(part)));
    let stamps = all(&|role| matches!(role, Role::Stamp(_)));
    let named = parts.iter().filter(|part| !part.is_empty()).count();
    let numbered =
        names.iter().filter(|name| matches!(name.to_lowercase().as_str(), "q0" | "q1" | "q2" | "q3")).count();
    if positions.iter().any(Vec::is_empty) {
        return Ok(None);
    }
    if numbered == 4 {
        return refuse("a quaternion q0 q1 q2 q3, whose w may be q0 or q3", "name its columns qw, qx, qy, qz");
    }
    if !(named == 0 || named == 4) {
        return refuse("a quaternion without all four parts", "name the columns of qw, qx, qy and qz");
    }
    if positions.iter().chain(&parts).any(|columns| columns.len() > 1) {
        return refuse("a column of the pose that is named twice", "give each of x y z and qx qy qz qw one column");
    }
    let Role::Position(_, unit) = roles[positions[0][0]] else { return Ok(None) };
    // Of several times that of the measurement counts, which messages call their stamp.
    let chosen = stamps.iter().find(|&&column| names[column].to_lowercase().contains("stamp")).or(stamps.first());
    let stamp = chosen.map(|&column| match roles[column] {
        Role::Stamp(unit) => (column, unit),
        _ => (column, None),
    });
    Ok(Some(Columns {
        stamp,
        nanoseconds: all(&|role| role == Role::Nanoseconds).first().copied(),
        position: positions.map(|columns| columns[0]),
        unit,
        quaternion: (named == 4).then(|| parts.map(|columns| columns[0])),
        has_other_attitude: roles.contains(&Role::OtherAttitude),
    }))
}

/// Whether a comment states that quaternions have w first; `None` if it states no order.
pub(crate) fn states_w_first(comment: &str) -> Option<bool> {
    let letters: String = comment.to_lowercase().chars().filter(char::is_ascii_alphanumeric).collect();
    let first = letters.contains("wxyz") || letters.contains("qwqxqyqz");
    let last = letters.contains("xyzw") || letters.contains("qxqyqzqw");
    (first != last).then_some(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(header: &str) -> [usize; 4] {
        let found = columns(header, 1, Path::new("a")).unwrap().unwrap();
        found.quaternion.unwrap()
    }

    #[test]
    fn names_are_obeyed_however_they_are_spelt() {
        for header in [
            "# t x y z q_w q_x q_y q_z",
            "Time,X,Y,Z,Qw,Qx,Qy,Qz",
            "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []",
            "stamp;pos_x;pos_y;pos_z;quat[w];quat[x];quat[y];quat[z]",
            "%time,position.x,position.y,position.z,orientation.w,orientation.x,orientation.y,orientation.z",
            "time_s,x_m,y_m,z_m,qw,qx,qy,qz",
            "# t (s) tx (m) ty (m) tz (m) q(w) q(x) q(y) q(z)",
        ] {
            assert_eq!(order(header), [4, 5, 6, 7], "{header}");
        }
        assert_eq!(order("t x y z qx qy qz qw"), [7, 4, 5, 6]);
        let found = columns("num,t,z [mm],y [mm],x [mm],v_x,v_y,v_z", 1, Path::new("a")).unwrap().unwrap();
        assert_eq!((found.position, found.unit, found.quaternion), ([4, 3, 2], LengthUnit::Millimetres, None));
        assert_eq!(found.stamp, Some((1, None)));
    }

    #[test]
    fn an_open_order_is_refused() {
        let refused = |header: &str| columns(header, 3, Path::new("a")).unwrap_err().to_string();
        assert!(refused("t x y z q0 q1 q2 q3").contains("may be q0 or q3"));
        assert!(refused("t x y z qx qy qz").contains("without all four parts"));
        assert!(refused("t x y z x y z qw qx qy qz").contains("named twice"));
        assert_eq!(columns("# ground truth of the walk", 1, Path::new("a")), Ok(None));
        assert_eq!((states_w_first("# quaternion order: w, x, y, z"), states_w_first("# poses")), (Some(true), None));
    }
}
