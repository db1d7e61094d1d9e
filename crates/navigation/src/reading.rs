//! Readings of a vehicle's navigation sensors.

use std::fmt;

use nalgebra::{Matrix3, Vector3};

/// A navigation sensor whose readings an odometry may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Device {
    /// A Doppler velocity log: velocity over ground at its mounting point (m/s, body frame).
    Doppler,
    /// A gyro: angular rate of the vehicle relative to the world (rad/s, body frame).
    Gyro,
}

impl Device {
    /// All devices.
    pub const ALL: [Self; 2] = [Self::Doppler, Self::Gyro];

    /// The device's name in logs.
    pub fn name(self) -> &'static str {
        match self {
            Self::Doppler => "doppler",
            Self::Gyro => "gyro",
        }
    }

    /// The device with a given name.
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

/// A sensor reading: three components in the body frame, with their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// The sensor.
    pub device: Device,
    /// Time of the measurement (ns); the reading may arrive later.
    pub stamp_ns: u64,
    /// The measured value.
    pub value: Vector3<f64>,
    /// The covariance of its noise; constant errors of the sensor are not included.
    pub covariance: Matrix3<f64>,
}
