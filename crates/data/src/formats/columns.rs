//! The meaning of a pose table's columns by their names.
//!
//! Names may be spelt in any way: `qx`, `Q_X`, `q[x]`, `q_RS_x []`, `pose.orientation.x`, `p_RS_R_x [m]`, `pos_x`.

use std::path::Path;

use seafix_component::Fault;

use super::{
    compass::{self, Compass},
    units::{LengthUnit, TimeUnit},
};

/// The meaning of a column.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Role {
    /// The time, in the unit that the name states.
    Stamp(Option<TimeUnit>),
    /// The nanoseconds that a column of whole seconds leaves.
    Nanoseconds,
    /// The position along the axis 0 to 2.
    Position(usize, LengthUnit),
    /// The position along a direction of the world.
    Direction(Compass, LengthUnit),
    /// A position or a stamp in a unit that is not read.
    UnknownUnit(String),
    /// Latitude or longitude.
    Geographic,
    /// The quaternion's part w, x, y, z.
    Quaternion(usize),
    /// An angle or a rotation vector: an attitude in a form that is not read.
    OtherAttitude,
    /// Another quantity.
    Other,
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
    let suffix =
        lower.rsplit_once('_').filter(|(_, unit)| ["m", "mm", "cm", "km", "ft", "s", "ms", "us", "ns"].contains(unit));
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
        if let Some("min" | "minutes" | "h" | "hours" | "d" | "days") = unit {
            return Role::UnknownUnit(unit.unwrap_or_default().to_owned());
        }
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
    let length = LengthUnit::of(unit);
    if let Some(direction) = Compass::of(&joined) {
        return length.map_or_else(Role::UnknownUnit, |length| Role::Direction(direction, length));
    }
    if is_any(&["lat", "latitude", "lon", "long", "lng", "longitude"]) {
        return Role::Geographic;
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
        (stem, axis)
            if matches!(stem, "" | "t")
                || stem.starts_with('p')
                || ["trans", "pos", "loc"].iter().any(|word| stem.contains(word)) =>
        {
            length.map_or_else(Role::UnknownUnit, |length| Role::Position(axis - 1, length))
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
    let all = |wanted: &dyn Fn(&Role) -> bool| -> Vec<usize> {
        (0..roles.len()).filter(|&column| wanted(&roles[column])).collect()
    };
    let refuse =
        |what: &str, remedy: &str| Err(Fault::new(what, file).on_line(line).value(header.trim()).remedy(remedy));
    let mut positions: [Vec<usize>; 3] =
        [0, 1, 2].map(|axis| all(&|role| matches!(role, Role::Position(a, _) if *a == axis)));
    let parts: [Vec<usize>; 4] = [0, 1, 2, 3].map(|part| all(&|role| *role == Role::Quaternion(part)));
    let stamps = all(&|role| matches!(role, Role::Stamp(_)));
    let named = parts.iter().filter(|part| !part.is_empty()).count();
    let numbered =
        names.iter().filter(|name| matches!(name.to_lowercase().as_str(), "q0" | "q1" | "q2" | "q3")).count();
    if let Some(sign) = roles.iter().find_map(|role| if let Role::UnknownUnit(sign) = role { Some(sign) } else { None })
    {
        return refuse(&format!("a column in the unit `{sign}`, which is not read"), "give metres and seconds");
    }
    if positions.iter().all(Vec::is_empty) {
        let direction = |role: &Role| if let Role::Direction(direction, _) = role { Some(*direction) } else { None };
        if let Some(axes) = compass::axes(&roles.iter().map(direction).collect::<Vec<_>>()) {
            positions = axes.map(|column| vec![column]);
        } else if roles.contains(&Role::Geographic) {
            return refuse(
                "geographic coordinates, which are no lengths",
                "project them to metres (UTM, or north, east and down of a place near by), and name the columns so",
            );
        }
    }
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
    let units = positions.each_ref().map(|columns| match &roles[columns[0]] {
        Role::Position(_, unit) | Role::Direction(_, unit) => *unit,
        _ => LengthUnit::Metres,
    });
    if units.iter().any(|unit| *unit != units[0]) {
        return refuse("positions whose axes have different units", "give all three in metres");
    }
    // Of several times that of the measurement counts, which messages call their stamp.
    let chosen = stamps.iter().find(|&&column| names[column].to_lowercase().contains("stamp")).or(stamps.first());
    let stamp = chosen.map(|&column| match roles[column] {
        Role::Stamp(unit) => (column, unit),
        _ => (column, None),
    });
    Ok(Some(Columns {
        stamp,
        nanoseconds: all(&|role| *role == Role::Nanoseconds).first().copied(),
        position: positions.map(|columns| columns[0]),
        unit: units[0],
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

    /// Fails if an unknown unit counts as metres, or if the first of three units is that of all.
    #[test]
    fn units_and_directions_are_obeyed_or_rejected() {
        let found = |header: &str| columns(header, 1, Path::new("a")).unwrap().unwrap();
        for (header, metres) in [
            ("t,x [ft],y [ft],z [ft]", 0.3048),
            ("t,x_km,y_km,z_km", 1000.0),
            ("t,x (dm),y (dm),z (dm)", 0.1),
            ("t,x [m],y [m],z [m]", 1.0),
        ] {
            assert_eq!(found(header).unit.metres(), metres, "{header}");
        }
        assert_eq!(found("time,easting [m],northing [m],depth [m]").position, [2, 1, 3]);
        assert_eq!(found("time;up;north;east").position, [3, 2, 1]);
        assert_eq!(found("time,x,y,z,depth").position, [1, 2, 3], "the depth is another quantity");
        let rejected = |header: &str| columns(header, 3, Path::new("a")).unwrap_err().to_string();
        assert!(rejected("t,x [in],y [in],z [in]").starts_with("a column in the unit `in`, which is not read in a:3"));
        assert!(rejected("time [h],x,y,z").contains("the unit `h`"));
        assert!(rejected("t,x [m],y [m],z [mm]").contains("different units"));
        assert!(
            rejected("time,lat,lon,depth").contains("geographic coordinates")
                && rejected("t,longitude,latitude").contains("UTM")
        );
    }

    #[test]
    fn an_open_order_is_rejected() {
        let rejected = |header: &str| columns(header, 3, Path::new("a")).unwrap_err().to_string();
        assert!(rejected("t x y z q0 q1 q2 q3").contains("may be q0 or q3"));
        assert!(rejected("t x y z qx qy qz").contains("without all four parts"));
        assert!(rejected("t x y z x y z qw qx qy qz").contains("named twice"));
        assert_eq!(columns("# ground truth of the walk", 1, Path::new("a")), Ok(None));
        assert_eq!((states_w_first("# quaternion order: w, x, y, z"), states_w_first("# poses")), (Some(true), None));
    }
}
