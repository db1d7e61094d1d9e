//! Settings of the navigation between fixes: odometry, policy and fusion.

use seafix_component::Choice;
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_navigation::{FUSIONS, Fusion, ODOMETRIES, Odometry, POLICIES, Policy};
use serde::{Deserialize, Serialize};

use crate::{
    Keyframes, PipelineError,
    odometry_session::TrialOdometry,
    pipeline::{build, faults, resolve},
};

/// The settings of the way from fix to fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Navigation {
    /// Carries the last fix along.
    pub odometry: Choice,
    /// When a fix is tried.
    pub policy: Choice,
    /// What becomes of the navigated pose when a fix comes.
    pub fusion: Choice,
    /// Key frames where no object is in view; without it none are laid.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_graph: Option<Keyframes>,
}

impl Default for Navigation {
    fn default() -> Self {
        Self {
            odometry: Choice::named("stereo"),
            policy: Choice::named("every-frame"),
            fusion: Choice::named("fuse"),
            pose_graph: None,
        }
    }
}

impl Navigation {
    /// The same with every setting of its components written out.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        Ok(Self {
            odometry: resolve(&ODOMETRIES, &self.odometry)?,
            policy: resolve(&POLICIES, &self.policy)?,
            fusion: resolve(&FUSIONS, &self.fusion)?,
            pose_graph: self.pose_graph.as_ref().map(Keyframes::resolved).transpose()?,
        })
    }

    /// Every setting that it cannot be built with.
    pub fn invalid(&self) -> Vec<PipelineError> {
        let mut all = faults(&ODOMETRIES, &self.odometry);
        all.extend(faults(&POLICIES, &self.policy));
        all.extend(faults(&FUSIONS, &self.fusion));
        all.extend(self.pose_graph.iter().flat_map(Keyframes::invalid));
        all
    }

    /// Ready to work.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn build(&self) -> Result<NavigationStack, PipelineError> {
        let invalid = self.pose_graph.iter().flat_map(Keyframes::invalid).next();
        invalid.map_or(Ok(()), Err)?;
        Ok(NavigationStack {
            odometry: build(&ODOMETRIES, &self.odometry)?,
            policy: build(&POLICIES, &self.policy)?,
            fusion: build(&FUSIONS, &self.fusion)?,
            pose_graph: self.pose_graph.clone(),
        })
    }
}

/// The components between fixes, built.
#[derive(Debug)]
pub struct NavigationStack {
    pub(crate) odometry: Box<dyn Odometry>,
    pub(crate) policy: Box<dyn Policy>,
    pub(crate) fusion: Box<dyn Fusion>,
    /// The settings of the key frames, where any are kept.
    pub pose_graph: Option<Keyframes>,
}

impl NavigationStack {
    /// Whether it cannot do without what the vehicle's Doppler log and gyro say.
    pub fn listens(&self) -> bool {
        self.odometry.listens()
    }

    /// Its odometry, with nothing seen yet.
    pub fn begin_odometry<'a>(
        &'a self,
        rig: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
    ) -> TrialOdometry<'a> {
        TrialOdometry::begin(&*self.odometry, rig, body_from_camera)
    }
}
