//! Ports of a data set's cameras, in the model of the simulation.

use std::path::Path;

use seafix_component::Fault;
use seafix_io::dataset::{Description, PortKind, PortNumbers, rig_fault};
use seafix_simulation::optics::{self, Port};

/// A port and the distance of the camera's calibration in water.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibratedPort {
    /// The port.
    pub port: Port,
    /// The distance of the calibration (m); the camera parameters are exact there and approximate elsewhere.
    pub range: f64,
}

impl CalibratedPort {
    /// The parameters of the port in a description.
    pub(crate) fn numbers(&self) -> PortNumbers {
        let Port { kind, distance, thickness, radius, offset, glass, water } = self.port;
        let kind = match kind {
            optics::PortKind::None => PortKind::None,
            optics::PortKind::Flat => PortKind::Flat,
            optics::PortKind::Dome => PortKind::Dome,
        };
        PortNumbers { kind, calibrated_at: Some(self.range), distance, thickness, radius, offset, glass, water }
    }

    /// The port with these parameters.
    ///
    /// # Errors
    /// An invalid parameter, as `value; remedy`.
    fn of(numbers: &PortNumbers) -> Result<Self, String> {
        let PortNumbers { kind, distance, thickness, radius, offset, glass, water, .. } = *numbers;
        let kind = match kind {
            PortKind::None => optics::PortKind::None,
            PortKind::Flat => optics::PortKind::Flat,
            PortKind::Dome => optics::PortKind::Dome,
        };
        let port = Port { kind, distance, thickness, radius, offset, glass, water };
        // A flat port has no radius to check.
        let checked = if kind == optics::PortKind::Flat { Port { radius: 1.0, ..port.clone() } } else { port.clone() };
        checked.check()?;
        Ok(Self { port, range: numbers.calibrated_in_water()? })
    }
}

/// The ports of the left and the right camera.
///
/// # Errors
/// The first invalid parameter of a port.
pub(crate) fn ports(
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
