//! What the navigation sensors of a vehicle say.

use std::fmt;

use nalgebra::{Matrix3, Vector3};

/// A navigation sensor whose readings an odometry may go by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Device {
    /// A Doppler velocity log: velocity over ground of its place in the vehicle (m/s, body frame).
    Doppler,
    /// A gyro: rate of turn of the vehicle against the world (rad/s, body frame).
    Gyro,
}

impl Device {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Doppler, Self::Gyro];

    /// Its name in logs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Doppler => "doppler",
            Self::Gyro => "gyro",
        }
    }

    /// The device of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|device| device.name() == name)
    }
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Doppler => "Doppler log",
            Self::Gyro => "gyro",
        })
    }
}

/// A reading: three numbers of the body frame, and how far each may be off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Who says it.
    pub device: Device,
    /// When it was so (ns); it may be told later.
    pub stamp_ns: u64,
    /// What it says.
    pub value: Vector3<f64>,
    /// The covariance of its noise; what the device has wrong all the time is not in it.
    pub covariance: Matrix3<f64>,
}
