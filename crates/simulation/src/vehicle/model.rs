//! Vehicle dynamics in water.

use nalgebra::{DMatrix, DVector, Matrix6, Quaternion, UnitQuaternion, Vector3, Vector6};
use seafix_geometry::so3::skew;

/// Acceleration of gravity (m/s²).
const GRAVITY: f64 = 9.81;

/// A thruster: position, direction, maximum thrust (N).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Thruster {
    pub(crate) at: Vector3<f64>,
    pub(crate) along: Vector3<f64>,
    pub(crate) max: f64,
}

/// A rigid, neutrally buoyant vehicle in six degrees of freedom.
///
/// The centre of gravity is the origin of the body frame; the centre of buoyancy lies above it. The equation of motion
/// is Fossen's (*Handbook of Marine Craft Hydrodynamics and Motion Control*, 2021), M ν̇ + C(ν) ν + D(ν) ν + g(η) = τ,
/// with ν the velocity relative to the water, (v, ω) in Fossen's order.
#[derive(Debug, Clone)]
pub(crate) struct Model {
    /// Mass (kg).
    pub(crate) mass: f64,
    /// Principal moments of inertia (kg m²).
    pub(crate) inertia: Vector3<f64>,
    /// Added mass of surge, sway, heave (kg), roll, pitch, yaw (kg m²).
    pub(crate) added: Vector6<f64>,
    /// Linear damping of each degree of freedom.
    pub(crate) linear: Vector6<f64>,
    /// Quadratic damping of each degree of freedom.
    pub(crate) quadratic: Vector6<f64>,
    /// Height of the centre of buoyancy above the centre of gravity (m).
    pub(crate) righting: f64,
    pub(crate) thrusters: Vec<Thruster>,
    /// Time constant of the thrusters (s).
    pub(crate) lag: f64,
}

/// The vehicle's state: pose, velocity relative to the water and angular velocity in the body frame, thrusts (N).
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Motion {
    pub(crate) at: Vector3<f64>,
    pub(crate) turn: UnitQuaternion<f64>,
    /// (v, ω), relative to the water.
    pub(crate) nu: Vector6<f64>,
    pub(crate) thrusts: Vec<f64>,
}

fn vector(x: f64, y: f64, z: f64, k: f64, m: f64, n: f64) -> Vector6<f64> {
    Vector6::new(x, y, z, k, m, n)
}

impl Model {
    /// A hovering vehicle of 200 kg, scaled after Girona500.
    ///
    /// Two of its five thrusters act in surge, one in sway and two in heave; they also control yaw and pitch. Roll is
    /// passively stable.
    pub(crate) fn hover_200() -> Self {
        let thruster = |at: [f64; 3], along: [f64; 3], max| Thruster { at: at.into(), along: along.into(), max };
        Self {
            mass: 200.0,
            inertia: Vector3::new(20.0, 45.0, 50.0),
            added: vector(100.0, 180.0, 200.0, 10.0, 25.0, 25.0),
            linear: vector(30.0, 50.0, 60.0, 20.0, 30.0, 30.0),
            quadratic: vector(120.0, 350.0, 400.0, 40.0, 80.0, 80.0),
            righting: 0.04,
            thrusters: vec![
                thruster([-0.3, -0.4, 0.0], [1.0, 0.0, 0.0], 250.0),
                thruster([-0.3, 0.4, 0.0], [1.0, 0.0, 0.0], 250.0),
                thruster([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 200.0),
                thruster([0.45, 0.0, 0.0], [0.0, 0.0, 1.0], 150.0),
                thruster([-0.45, 0.0, 0.0], [0.0, 0.0, 1.0], 150.0),
            ],
            lag: 0.15,
        }
    }

    /// BlueROV2 Heavy after von Benzon et al., J. Mar. Sci. Eng. 10:1898, 2022, with corrected signs and a corrected
    /// angle of the third thruster. The thrust of a T200 is limited to 30 N.
    pub(crate) fn bluerov2_heavy() -> Self {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let flat = |x: f64, y: f64, dx: f64, dy: f64| Thruster {
            at: Vector3::new(x, y, 0.085),
            along: Vector3::new(dx * half, dy * half, 0.0),
            max: 30.0,
        };
        let upright = |x: f64, y: f64| Thruster { at: Vector3::new(x, y, 0.0), along: Vector3::z(), max: 30.0 };
        Self {
            mass: 13.5,
            inertia: Vector3::new(0.26, 0.23, 0.37),
            added: vector(6.36, 7.12, 18.68, 0.189, 0.135, 0.222),
            linear: vector(13.7, 0.0, 33.0, 0.0, 0.8, 0.0),
            quadratic: vector(141.0, 217.0, 190.0, 1.19, 0.47, 1.5),
            righting: 0.01,
            thrusters: vec![
                flat(0.156, 0.111, 1.0, -1.0),
                flat(0.156, -0.111, 1.0, 1.0),
                flat(-0.156, 0.111, -1.0, -1.0),
                flat(-0.156, -0.111, -1.0, 1.0),
                upright(0.12, 0.218),
                upright(0.12, -0.218),
                upright(-0.12, 0.218),
                upright(-0.12, -0.218),
            ],
            lag: 0.08,
        }
    }

    /// M, the inertia matrix of rigid body and added mass.
    pub(crate) fn inertia_matrix(&self) -> Matrix6<f64> {
        let i = self.inertia;
        let rigid = vector(self.mass, self.mass, self.mass, i.x, i.y, i.z);
        Matrix6::from_diagonal(&(rigid + self.added))
    }

    /// C(ν), the Coriolis and centripetal matrix; skew-symmetric, so that it does no work.
    pub(crate) fn coriolis(&self, nu: &Vector6<f64>) -> Matrix6<f64> {
        let p = self.inertia_matrix() * nu;
        let (linear, angular) = (skew(&p.fixed_rows::<3>(0).into_owned()), skew(&p.fixed_rows::<3>(3).into_owned()));
        let mut c = Matrix6::zeros();
        c.fixed_view_mut::<3, 3>(0, 3).copy_from(&-linear);
        c.fixed_view_mut::<3, 3>(3, 0).copy_from(&-linear);
        c.fixed_view_mut::<3, 3>(3, 3).copy_from(&-angular);
        c
    }

    /// −D(ν) ν, the damping force.
    fn drag(&self, nu: &Vector6<f64>) -> Vector6<f64> {
        Vector6::from_fn(|k, _| -(self.linear[k] + self.quadratic[k] * nu[k].abs()) * nu[k])
    }

    /// −g(η), the restoring moment; weight and buoyancy cancel.
    fn restoring(&self, turn: &UnitQuaternion<f64>) -> Vector6<f64> {
        // Buoyancy acts along −z of the world, at −righting on the body's z axis.
        let force = turn.inverse() * Vector3::new(0.0, 0.0, -self.mass * GRAVITY);
        let moment = Vector3::new(0.0, 0.0, -self.righting).cross(&force);
        vector(0.0, 0.0, 0.0, moment.x, moment.y, moment.z)
    }

    /// The thruster configuration matrix B from thrusts (N) to force and moment.
    pub(crate) fn thruster_matrix(&self) -> DMatrix<f64> {
        DMatrix::from_fn(6, self.thrusters.len(), |row, column| {
            let thruster = &self.thrusters[column];
            if row < 3 { thruster.along[row] } else { thruster.at.cross(&thruster.along)[row - 3] }
        })
    }

    /// B⁺, the allocation: minimum-norm thrusts for a desired force and moment.
    pub(crate) fn allocation(&self) -> DMatrix<f64> {
        self.thruster_matrix().pseudo_inverse(1e-6).unwrap_or_else(|_| DMatrix::zeros(self.thrusters.len(), 6))
    }

    /// Force and moment of the thrusts.
    fn push(&self, thrusts: &[f64]) -> Vector6<f64> {
        let mut sum = Vector6::zeros();
        for (thruster, thrust) in self.thrusters.iter().zip(thrusts) {
            let force = thruster.along * *thrust;
            let moment = thruster.at.cross(&force);
            sum += vector(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        }
        sum
    }

    /// Thrusts after saturation; all are scaled alike, so that the direction is kept.
    pub(crate) fn saturated(&self, wanted: &DVector<f64>) -> Vec<f64> {
        let worst = wanted.iter().zip(&self.thrusters).map(|(w, t)| w.abs() / t.max).fold(1.0, f64::max);
        wanted.iter().map(|w| w / worst).collect()
    }

    /// ν̇, the acceleration in a state.
    fn acceleration(&self, motion: &Motion) -> Vector6<f64> {
        let forces = self.push(&motion.thrusts) + self.drag(&motion.nu) + self.restoring(&motion.turn)
            - self.coriolis(&motion.nu) * motion.nu;
        let m = self.inertia_matrix().diagonal();
        forces.component_div(&m)
    }

    /// The state after `dt` in water that flows with `current`: fourth-order Runge–Kutta, with first-order thruster
    /// lag.
    pub(crate) fn step(&self, motion: &Motion, commands: &[f64], current: &Vector3<f64>, dt: f64) -> Motion {
        let keep = if self.lag > 0.0 { libm::exp(-dt / self.lag) } else { 0.0 };
        let thrusts: Vec<f64> = motion.thrusts.iter().zip(commands).map(|(t, c)| c + (t - c) * keep).collect();
        let from = Motion { thrusts, ..motion.clone() };
        // The attitude is integrated as a quaternion, q̇ = ½ q (0, ω); sums of rotation vectors would be of second
        // order.
        let slope = |m: &Motion| {
            let w = m.nu.fixed_rows::<3>(3).into_owned();
            let turning = m.turn.quaternion() * Quaternion::from_imag(w) * 0.5;
            (m.turn * m.nu.fixed_rows::<3>(0).into_owned() + current, turning, self.acceleration(m))
        };
        let moved = |(v, q, a): &(Vector3<f64>, Quaternion<f64>, Vector6<f64>), h: f64| Motion {
            at: from.at + v * h,
            turn: UnitQuaternion::new_normalize(from.turn.quaternion() + q * h),
            nu: from.nu + a * h,
            thrusts: from.thrusts.clone(),
        };
        let k1 = slope(&from);
        let k2 = slope(&moved(&k1, 0.5 * dt));
        let k3 = slope(&moved(&k2, 0.5 * dt));
        let k4 = slope(&moved(&k3, dt));
        let mean = (
            (k1.0 + 2.0 * (k2.0 + k3.0) + k4.0) / 6.0,
            (k1.1 + (k2.1 + k3.1) * 2.0 + k4.1) / 6.0,
            (k1.2 + 2.0 * (k2.2 + k3.2) + k4.2) / 6.0,
        );
        moved(&mean, dt)
    }

    /// Kinetic energy with that of the added mass, plus the potential energy of the righting lever (J).
    #[cfg(test)]
    pub(crate) fn energy(&self, motion: &Motion) -> f64 {
        let up = motion.turn * Vector3::z();
        0.5 * motion.nu.dot(&(self.inertia_matrix() * motion.nu)) - self.mass * GRAVITY * self.righting * up.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn still(model: &Model) -> Motion {
        Motion {
            at: Vector3::zeros(),
            turn: UnitQuaternion::identity(),
            nu: Vector6::zeros(),
            thrusts: vec![0.0; model.thrusters.len()],
        }
    }

    fn run(model: &Model, mut motion: Motion, commands: &[f64], current: Vector3<f64>, dt: f64, time: f64) -> Motion {
        for _ in 0..(time / dt).round() as usize {
            motion = model.step(&motion, commands, &current, dt);
        }
        motion
    }

    #[test]
    fn coriolis_does_no_work_and_allocation_inverts_the_thrusters() {
        // Regression: a wrong sign of one block of C(ν) fails this test.
        for model in [Model::hover_200(), Model::bluerov2_heavy()] {
            let nu = vector(0.4, -0.3, 0.2, 0.5, -0.1, 0.7);
            let c = model.coriolis(&nu);
            assert!((c + c.transpose()).amax() < 1e-12 && nu.dot(&(c * nu)).abs() < 1e-12);
            // B B⁺ is the identity on the controllable directions: all but roll of the larger vehicle.
            let both = model.thruster_matrix() * model.allocation();
            for k in [0, 1, 2, 4, 5] {
                for j in [0, 1, 2, 4, 5] {
                    assert!((both[(k, j)] - f64::from(u8::from(k == j))).abs() < 1e-9, "{both}");
                }
            }
        }
    }

    #[test]
    fn a_vehicle_left_alone_loses_energy_and_drifts_with_the_water() {
        let model = Model::hover_200();
        let begin = Motion { nu: vector(0.8, -0.5, 0.3, 0.4, 0.6, -0.5), ..still(&model) };
        let off = vec![0.0; 5];
        let (mut motion, mut energy) = (begin.clone(), model.energy(&begin));
        for _ in 0..2000 {
            motion = model.step(&motion, &off, &Vector3::zeros(), 0.01);
            let now = model.energy(&motion);
            assert!(now <= energy + 1e-9);
            energy = now;
        }
        let current = Vector3::new(0.2, 0.1, 0.0);
        // The vehicle first moves against the current relative to the water, and ends at rest in it.
        let anchored = Motion { nu: vector(-0.2, -0.1, 0.0, 0.0, 0.0, 0.0), ..still(&model) };
        let drifting = run(&model, anchored, &off, current, 0.05, 400.0);
        assert!(drifting.nu.norm() < 1e-6);
    }

    #[test]
    fn terminal_speed_balances_thrust_and_drag() {
        // Regression: a quadratic drag 5 % too high fails this test.
        let model = Model::bluerov2_heavy();
        let cosine = std::f64::consts::FRAC_1_SQRT_2;
        let forward = [30.0, 30.0, -30.0, -30.0, 0.0, 0.0, 0.0, 0.0];
        // The vehicle is held level as by its controller; only surge matters.
        let level = Model { righting: 5.0, ..model };
        let u = run(&level, still(&level), &forward, Vector3::zeros(), 0.01, 60.0).nu[0];
        let force = 4.0 * 30.0 * cosine;
        assert!((141.0 * u * u + 13.7 * u - force).abs() < 0.02 * force && (u - 0.73).abs() < 0.01, "{u}");
    }

    #[test]
    fn speed_and_energy_do_not_depend_on_the_step() {
        let model = Model::hover_200();
        let push = [60.0, 55.0, 10.0, -10.0, 5.0];
        // The thrusters already push; their lag is integrated to first order.
        let begin = Motion { nu: vector(0.8, -0.5, 0.3, 0.2, 0.3, -0.5), thrusts: push.to_vec(), ..still(&model) };
        let after = |dt, time| run(&model, begin.clone(), &push, Vector3::new(0.1, 0.0, 0.0), dt, time);
        let (fine, coarse) = (after(0.005, 8.0), after(0.04, 8.0));
        let energy = |motion: &Motion| model.energy(motion) - model.energy(&still(&model));
        assert!((energy(&coarse) / energy(&fine) - 1.0).abs() < 1e-5, "{} {}", energy(&coarse), energy(&fine));
        // Terminal speed under steady forward thrust.
        let ahead = |dt| run(&model, still(&model), &[60.0, 60.0, 0.0, 0.0, 0.0], Vector3::zeros(), dt, 120.0);
        let (slow, quick) = (ahead(0.01), ahead(0.08));
        assert!((slow.nu - quick.nu).norm() < 1e-9 * slow.nu.norm() && slow.nu[0] > 0.5, "{} {}", slow.nu, quick.nu);
        // The attitude remains a unit quaternion.
        assert!((coarse.turn.quaternion().norm() - 1.0).abs() < 1e-14);
    }

    #[test]
    fn it_rocks_with_the_period_of_its_righting_lever() {
        // Regression: a lever 5 % too long fails this test.
        let free = Model { linear: Vector6::zeros(), quadratic: Vector6::zeros(), ..Model::hover_200() };
        let tilted = Motion { turn: seafix_geometry::so3::exp(&(Vector3::x() * 0.01)), ..still(&free) };
        let period = std::f64::consts::TAU * ((20.0 + 10.0) / (200.0 * GRAVITY * 0.04)).sqrt();
        let after = run(&free, tilted.clone(), &[0.0; 5], Vector3::zeros(), period / 2000.0, period);
        assert!(seafix_geometry::so3::angle(&(after.turn.inverse() * tilted.turn)) < 1e-6);
    }

    #[test]
    fn the_integrator_is_of_fourth_order() {
        let model = Model { lag: 0.0, ..Model::hover_200() };
        let begin = Motion { nu: vector(0.8, -0.5, 0.3, 0.0, 0.3, -0.5), ..still(&model) };
        let end = |dt| run(&model, begin.clone(), &[40.0, 20.0, 10.0, -10.0, 5.0], Vector3::zeros(), dt, 1.6).nu;
        let exact = end(0.0025);
        let order = libm::log2((end(0.08) - exact).norm() / (end(0.04) - exact).norm());
        assert!((3.5..4.8).contains(&order), "{order}");
    }
}
