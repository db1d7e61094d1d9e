//! Positions whose columns are named after the directions of the world.

/// A direction of the world.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compass {
    North,
    East,
    Down,
    Up,
}

impl Compass {
    /// The direction of a name in lower case. `height` and `altitude` are none: they may be above the seabed.
    pub(crate) fn of(name: &str) -> Option<Self> {
        match name {
            "north" | "northing" | "n" => Some(Self::North),
            "east" | "easting" | "e" => Some(Self::East),
            "down" | "depth" | "d" => Some(Self::Down),
            "up" | "u" => Some(Self::Up),
            _ => None,
        }
    }
}

/// The columns of x, y, z: (north, east, down) or (east, north, up), both right-handed, in whatever order they stand;
/// `None` where a direction is missing or stands twice, or down and up stand both.
pub(crate) fn axes(directions: &[Option<Compass>]) -> Option<[usize; 3]> {
    let only = |wanted: Compass| {
        let mut all = (0..directions.len()).filter(|&column| directions[column] == Some(wanted));
        all.next().filter(|_| all.next().is_none())
    };
    let (north, east) = (only(Compass::North)?, only(Compass::East)?);
    match (only(Compass::Down), only(Compass::Up)) {
        (Some(down), None) => Some([north, east, down]),
        (None, Some(up)) => Some([east, north, up]),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_are_right_handed_in_any_order() {
        let of = |names: &[&str]| axes(&names.iter().map(|name| Compass::of(name)).collect::<Vec<_>>());
        assert_eq!(of(&["t", "easting", "northing", "depth"]), Some([2, 1, 3]));
        assert_eq!(of(&["up", "north", "east"]), Some([2, 1, 0]));
        assert_eq!(of(&["east", "north", "height"]), None);
        assert_eq!(of(&["east", "north", "up", "down"]), None);
    }
}
