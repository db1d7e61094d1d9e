//! All odometries.

use seafix_component::{Registry, entry};

use crate::{dvl_gyro::DvlGyro, icp::Icp, odometry::Odometry, stereo::Stereo};

/// All odometries.
pub static ODOMETRIES: Registry<dyn Odometry> =
    Registry::new("odometry", &[entry!(DvlGyro), entry!(Icp), entry!(Stereo)]);
