//! Units that the names of columns state.

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
    Decimetres,
    Centimetres,
    Millimetres,
    Kilometres,
    /// The international foot.
    Feet,
}

impl LengthUnit {
    /// The unit in metres.
    pub(crate) fn metres(self) -> f64 {
        match self {
            Self::Metres => 1.0,
            Self::Decimetres => 1e-1,
            Self::Centimetres => 1e-2,
            Self::Millimetres => 1e-3,
            Self::Kilometres => 1e3,
            Self::Feet => 0.3048,
        }
    }

    /// The unit of a sign; a column without a sign, or with that of a number, is in metres.
    ///
    /// # Errors
    /// A sign of no length.
    pub(crate) fn of(sign: Option<&str>) -> Result<Self, String> {
        match sign.unwrap_or_default() {
            "" | "-" | "m" | "meter" | "metre" | "meters" | "metres" => Ok(Self::Metres),
            "dm" => Ok(Self::Decimetres),
            "cm" => Ok(Self::Centimetres),
            "mm" => Ok(Self::Millimetres),
            "km" => Ok(Self::Kilometres),
            "ft" | "feet" | "foot" => Ok(Self::Feet),
            other => Err(other.to_owned()),
        }
    }
}
