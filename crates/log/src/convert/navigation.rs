//! What a navigator knew.

use super::fields::{Malformed, flat, matrix, matrix_if_any};
use crate::{
    proto,
    record::{NavigatedRecord, NavigationErrors, NavigationRecord, OdometryStep},
};

/// The message that holds `navigation`.
pub(super) fn navigation_message(navigation: &NavigationRecord) -> proto::Navigation {
    let mut errors = proto::NavigationErrors::default();
    navigation.errors.write(&mut errors);
    let motion = navigation.odometry.motion.as_ref();
    proto::Navigation {
        state: navigation.state.clone(),
        due: navigation.due,
        pose: navigation.pose.as_ref().map(navigated_message),
        odometry_only: navigation.odometry_only.as_ref().map(navigated_message),
        odometry: Some(proto::OdometryStep {
            lost: navigation.odometry.lost.clone(),
            motion: motion.map_or_else(Vec::new, |(motion, _)| flat(motion)),
            covariance: motion.map_or_else(Vec::new, |(_, covariance)| flat(covariance)),
        }),
        events: navigation.events.clone(),
        errors: Some(errors),
    }
}

fn navigated_message(navigated: &NavigatedRecord) -> proto::Navigated {
    proto::Navigated {
        object: navigated.object.clone(),
        object_from_camera: flat(&navigated.object_from_camera),
        covariance: flat(&navigated.covariance),
    }
}

/// The record that `message` holds.
pub(super) fn navigation_record(message: proto::Navigation) -> Result<NavigationRecord, Malformed> {
    let odometry = message.odometry.unwrap_or_default();
    let errors = message.errors.unwrap_or_default();
    let motion = matrix_if_any("navigation.odometry.motion", &odometry.motion)?;
    let covariance = matrix_if_any("navigation.odometry.covariance", &odometry.covariance)?;
    Ok(NavigationRecord {
        state: message.state,
        due: message.due,
        pose: message.pose.map(navigated_record).transpose()?,
        odometry_only: message.odometry_only.map(navigated_record).transpose()?,
        odometry: OdometryStep { lost: odometry.lost, motion: motion.zip(covariance) },
        events: message.events,
        errors: NavigationErrors::of(&errors),
    })
}

fn navigated_record(message: proto::Navigated) -> Result<NavigatedRecord, Malformed> {
    Ok(NavigatedRecord {
        object: message.object,
        object_from_camera: matrix("navigation.object_from_camera", &message.object_from_camera)?,
        covariance: matrix("navigation.covariance", &message.covariance)?,
    })
}
