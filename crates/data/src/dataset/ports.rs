//! The ports of a data set's cameras, as the simulation models them.

use std::path::Path;

use seafix_component::Fault;
use seafix_io::dataset::{Description, PortKind, PortNumbers, rig_fault};
use seafix_simulation::optics::{self, Port};

/// A port, and the distance at which the camera behind it was calibrated in the water.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedPort {
    /// The port.
    pub port: Port,
    /// Distance of the calibration (m): the camera's numbers hold there, and only nearly elsewhere.
    pub range: f64,
}

impl CalibratedPort {
    /// Its numbers in a description.
    pub(super) fn numbers(&self) -> PortNumbers {
        let Port { kind, distance, thickness, radius, offset, glass, water } = self.port;
        let kind = match kind {
            optics::PortKind::None => PortKind::None,
            optics::PortKind::Flat => PortKind::Flat,
            optics::PortKind::Dome => PortKind::Dome,
        };
        PortNumbers { kind, calibrated_at: Some(self.range), distance, thickness, radius, offset, glass, water }
    }

    /// The port that the numbers describe.
    ///
    /// # Errors
    /// A number outside its range: `value; remedy`.
    fn of(numbers: &PortNumbers) -> Result<Self, String> {
        let PortNumbers { kind, distance, thickness, radius, offset, glass, water, .. } = *numbers;
        let kind = match kind {
            PortKind::None => optics::PortKind::None,
            PortKind::Flat => optics::PortKind::Flat,
            PortKind::Dome => optics::PortKind::Dome,
        };
        let port = Port { kind, distance, thickness, radius, offset, glass, water };
        // A flat port has no radius to be wrong.
        let checked = if kind == optics::PortKind::Flat { Port { radius: 1.0, ..port.clone() } } else { port.clone() };
        checked.check()?;
        Ok(Self { port, range: numbers.calibrated_in_water()? })
    }
}

/// The ports of the left and the right camera.
///
/// # Errors
/// The first number of a port that is outside its range.
pub(super) fn ports(
    description: &Description,
    file: &Path,
    source: &str,
) -> Result<[Option<CalibratedPort>; 2], Fault> {
    let port = |side, numbers: Option<&PortNumbers>| {
        let port = numbers.map(CalibratedPort::of).transpose();
        port.map_err(|message| rig_fault(file, source, &[side, "port"], &message))
    };
    let rig = &description.rig;
    Ok([port("left", rig.left.port.as_ref())?, port("right", rig.right.port.as_ref())?])
}
