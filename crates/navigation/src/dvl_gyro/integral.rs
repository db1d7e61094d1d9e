//! Integration of velocity and angular rate to a pose.

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use seafix_geometry::{Body, Transform, so3};

use super::{
    settings::DvlGyro,
    signal::{Signal, Value, seconds},
};

/// The derivative of a pose error by the log's scale error and the gyro's bias.
pub(super) type Biased = SMatrix<f64, 6, 4>;

/// The readings of both devices, in order of time.
#[derive(Debug, Clone, Default)]
pub(super) struct DeviceSignals {
    pub(super) doppler: Signal,
    pub(super) gyro: Signal,
}

/// The integrated pose of the body, with its error ξ = by · (scale, bias) + noise.
#[derive(Debug, Clone, Copy)]
pub(super) struct IntegratedPose {
    pub(super) stamp_ns: u64,
    /// The body's pose in its initial frame.
    pub(super) start_from_body: Transform<Body, Body>,
    pub(super) by: Biased,
    /// The covariance due to readings that were unknown at the last reported pose.
    pub(super) settled: Matrix6<f64>,
    /// The covariance due to extrapolation of the last readings.
    pub(super) held: Matrix6<f64>,
}

impl IntegratedPose {
    pub(super) fn new(stamp_ns: u64, start_from_body: Transform<Body, Body>) -> Self {
        let (settled, held) = (Matrix6::zeros(), Matrix6::zeros());
        Self { stamp_ns, start_from_body, by: Biased::zeros(), settled, held }
    }
}

impl DeviceSignals {
    /// The pose integrated to a later time.
    ///
    /// Noise counts from the times `new` (Doppler log, gyro), up to which each device was known before.
    pub(super) fn carry(
        &self,
        from: &IntegratedPose,
        to: u64,
        new: [u64; 2],
        settings: &DvlGyro,
    ) -> Option<IntegratedPose> {
        let mut stamps: Vec<u64> = self.doppler.within(from.stamp_ns, to).collect();
        stamps.extend(self.gyro.within(from.stamp_ns, to));
        stamps.push(to);
        stamps.sort_unstable();
        stamps.dedup();
        stamps.into_iter().try_fold(*from, |here, stamp| self.step(&here, stamp, new, settings))
    }

    /// One integration step, without a reading between its ends.
    fn step(&self, from: &IntegratedPose, to: u64, new: [u64; 2], settings: &DvlGyro) -> Option<IntegratedPose> {
        let h = seconds(from.stamp_ns, to);
        let (velocity, rate) = (self.doppler.midway(from.stamp_ns, to)?, self.gyro.midway(from.stamp_ns, to)?);
        let lever = so3::skew(&Vector3::from(settings.at));
        // Velocity of the body origin: v − ω × l.
        let ahead = velocity.at + lever * rate.at;
        let mut xi = Vector6::zeros();
        xi.fixed_rows_mut::<3>(0).copy_from(&(rate.at * h));
        xi.fixed_rows_mut::<3>(3).copy_from(&(ahead * h));
        let motion = Transform::<Body, Body>::exp(&xi);

        // The true rate is the measured one minus the bias; the true velocity is the measured one minus its scale
        // error.
        let mut by_rate = SMatrix::<f64, 6, 3>::zeros();
        by_rate.fixed_view_mut::<3, 3>(0, 0).copy_from(&-Matrix3::identity());
        by_rate.fixed_view_mut::<3, 3>(3, 0).copy_from(&-lever);
        let mut by = Biased::zeros();
        by.fixed_view_mut::<3, 1>(3, 0).copy_from(&-velocity.at);
        by.fixed_view_mut::<6, 3>(0, 1).copy_from(&by_rate);

        let unsteady = [settings.unsteady, settings.unsteady_turn_deg.to_radians()];
        let noise = |value: &Value, unsteady: f64| {
            (value.noise + Matrix3::identity() * (value.wander * unsteady * unsteady)) * h
        };
        let mut of_velocity = Matrix6::zeros();
        of_velocity.fixed_view_mut::<3, 3>(3, 3).copy_from(&noise(&velocity, unsteady[0]));
        let of_rate = by_rate * noise(&rate, unsteady[1]) * by_rate.transpose();
        let (mut settled, mut held) = (Matrix6::zeros(), Matrix6::zeros());
        for (value, noise, new) in [(&velocity, of_velocity, new[0]), (&rate, of_rate, new[1])] {
            match value.held {
                true => held += noise,
                false if from.stamp_ns >= new => settled += noise,
                false => {}
            }
        }
        let across = motion.inverse().adjoint();
        let carried = |m: &Matrix6<f64>| across * m * across.transpose();
        Some(IntegratedPose {
            stamp_ns: to,
            start_from_body: (from.start_from_body * motion).renormalized(),
            by: across * from.by + by * h,
            settled: carried(&from.settled) + settled,
            held: carried(&from.held) + held,
        })
    }
}
