//! Settings of the navigation between fixes: odometry, policy and fusion.

use seafix_component::{Choice, Settings};
use seafix_geometry::{Body, Camera, StereoRig, Transform};
use seafix_navigation::{FUSIONS, Fusion, ODOMETRIES, Odometry, POLICIES, Policy};
use serde::{Deserialize, Serialize};

use crate::{
    choices,
    keyframe_mapper::KeyframeSettings,
    odometry_session::FrameOdometry,
    pipeline_error::{PipelineError, build},
};

/// The settings of navigation from fix to fix.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Navigation {
    /// The odometry that moves the last fix from frame to frame.
    pub odometry: Choice,
    /// The policy that decides when a fix is due.
    pub policy: Choice,
    /// The fusion of a fix with the navigated pose.
    pub fusion: Choice,
    /// The key frames that support navigation where no object is in view; none if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_graph: Option<KeyframeSettings>,
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
    /// The same settings with the defaults of all components written out.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        Ok(Self {
            pose_graph: self.pose_graph.as_ref().map(KeyframeSettings::resolved).transpose()?,
            ..choices::resolved(self)?
        })
    }

    /// All faults that keep the navigation stack from being built.
    pub fn invalid(&self) -> Vec<PipelineError> {
        let mut all = choices::faults(self);
        all.extend(self.pose_graph.iter().flat_map(KeyframeSettings::invalid));
        all
    }

    /// Builds all components.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn build(&self) -> Result<NavigationStack, PipelineError> {
        let invalid = self.pose_graph.iter().flat_map(KeyframeSettings::invalid).next();
        invalid.map_or(Ok(()), Err)?;
        Ok(NavigationStack {
            odometry: build(&ODOMETRIES, &self.odometry)?,
            policy: build(&POLICIES, &self.policy)?,
            fusion: build(&FUSIONS, &self.fusion)?,
            pose_graph: self.pose_graph.clone(),
        })
    }
}

/// The built components of navigation: odometry, policy, fusion and key frames.
#[derive(Debug)]
pub struct NavigationStack {
    pub(crate) odometry: Box<dyn Odometry>,
    pub(crate) policy: Box<dyn Policy>,
    pub(crate) fusion: Box<dyn Fusion>,
    /// The settings of the key frames, if there are any.
    pub pose_graph: Option<KeyframeSettings>,
}

impl NavigationStack {
    /// Whether the odometry requires readings of the vehicle's Doppler log and gyro.
    pub fn needs_readings(&self) -> bool {
        self.odometry.needs_readings()
    }

    /// The odometry at its start.
    pub fn begin_odometry<'a>(
        &'a self,
        rig: &'a StereoRig,
        body_from_camera: Transform<Body, Camera>,
    ) -> FrameOdometry<'a> {
        FrameOdometry::begin(&*self.odometry, rig, body_from_camera)
    }
}
