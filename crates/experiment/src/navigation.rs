//! The `[navigation]` table of an experiment: the library's settings, and faults of the odometry.

use seafix::{KeyframeSettings, NavigationStack, PipelineError, invalid_setting};
use seafix_component::{Choice, Settings};
use serde::{Deserialize, Serialize};

use crate::odometry_fault::OdometryFault;

/// The settings of navigation between fixes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Navigation {
    /// The odometry that moves the last fix from frame to frame.
    pub odometry: Choice,
    /// The policy that decides when a fix is due.
    pub policy: Choice,
    /// The fusion of a fix with the navigated pose.
    pub fusion: Choice,
    /// The failures of the odometry, with their times.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<OdometryFault>,
    /// The key frames that support navigation where no object is in view; none if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_graph: Option<KeyframeSettings>,
}

impl Default for Navigation {
    fn default() -> Self {
        Self::with_faults(seafix::Navigation::default(), Vec::new())
    }
}

impl Navigation {
    fn with_faults(navigation: seafix::Navigation, faults: Vec<OdometryFault>) -> Self {
        let seafix::Navigation { odometry, policy, fusion, pose_graph } = navigation;
        Self { odometry, policy, fusion, faults, pose_graph }
    }

    fn without_faults(&self) -> seafix::Navigation {
        let Self { odometry, policy, fusion, pose_graph, .. } = self.clone();
        seafix::Navigation { odometry, policy, fusion, pose_graph }
    }

    /// The same settings with the defaults of all components written out.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        Ok(Self::with_faults(self.without_faults().resolved()?, self.faults.clone()))
    }

    /// All faults that keep the navigation stack from being built.
    pub(crate) fn invalid(&self) -> Vec<PipelineError> {
        let mut all = self.without_faults().invalid();
        all.extend(self.unsound());
        all
    }

    /// The faults of the odometry faults' settings.
    fn unsound(&self) -> impl Iterator<Item = PipelineError> {
        let all = self.faults.iter().enumerate().filter_map(|(k, fault)| fault.check(k).err());
        all.map(|message| invalid_setting("faults", message))
    }

    /// Builds all components.
    ///
    /// # Errors
    /// The first invalid setting.
    pub fn build(&self) -> Result<NavigationStack, PipelineError> {
        self.unsound().next().map_or(Ok(()), Err)?;
        self.without_faults().build()
    }
}
