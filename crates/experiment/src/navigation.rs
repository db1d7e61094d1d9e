//! The `[navigation]` table of an experiment: the navigation of the library, and how its odometry fails.

use seafix::{Keyframes, NavigationStack, PipelineError, invalid_setting};
use seafix_component::Choice;
use serde::{Deserialize, Serialize};

use crate::odometry_fault::OdometryFault;

/// The settings of the navigation between fixes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Navigation {
    /// Moves the last fix along.
    pub odometry: Choice,
    /// Decides when a fix is attempted.
    pub policy: Choice,
    /// Joins a fix to the navigated pose.
    pub fusion: Choice,
    /// Failures of the odometry, with their times.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<OdometryFault>,
    /// Key frames where no object is in view; none without it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pose_graph: Option<Keyframes>,
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

    /// The same with every setting of its components written out.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn resolved(&self) -> Result<Self, PipelineError> {
        Ok(Self::with_faults(self.without_faults().resolved()?, self.faults.clone()))
    }

    /// Every setting that it cannot be built with.
    pub(crate) fn invalid(&self) -> Vec<PipelineError> {
        let mut all = self.without_faults().invalid();
        all.extend(self.unsound());
        all
    }

    /// The faults that are none.
    fn unsound(&self) -> impl Iterator<Item = PipelineError> {
        let all = self.faults.iter().enumerate().filter_map(|(k, fault)| fault.check(k).err());
        all.map(|message| invalid_setting("faults", message))
    }

    /// Ready to work.
    ///
    /// # Errors
    /// [`PipelineError`] names the setting.
    pub fn build(&self) -> Result<NavigationStack, PipelineError> {
        self.unsound().next().map_or(Ok(()), Err)?;
        self.without_faults().build()
    }
}
