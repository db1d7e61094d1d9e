//! The state of the cameras under faults.

use super::frame::Instant;
use crate::{
    sensors::{DeviceFault, FaultKind, FaultyDevice},
    stream::{Purpose, Stream},
};

/// Slow cameras capture every fifth frame and repeat it until the next.
const SLOW: usize = 5;

/// The content that the cameras deliver at an instant, for images and for points.
pub(super) enum CaptureState<'a> {
    /// The current view.
    Current,
    /// An earlier view.
    Earlier(Instant<'a>),
    /// Left and right images exchanged.
    Swapped,
    /// Black images.
    Dark,
    /// Random grey levels from this stream.
    Garbage(Stream),
}

impl<'a> Instant<'a> {
    /// The content under the active faults; the last active fault in the list decides.
    pub(super) fn capture(&self) -> CaptureState<'a> {
        let faults = self.mission.settings.faults.iter();
        let mut acting = faults.filter(|fault| fault.device == FaultyDevice::Images && fault.acts(self.time));
        acting.next_back().map_or(CaptureState::Current, |fault| self.failing(fault))
    }

    fn failing(&self, fault: &DeviceFault) -> CaptureState<'a> {
        let mission = self.mission;
        let earlier = |time: f64, index: usize| CaptureState::Earlier(Self::new(mission, index, time.max(0.0)));
        let mut stream = mission.stream(self.index, Purpose::Faults);
        match fault.kind {
            FaultKind::Off => CaptureState::Dark,
            FaultKind::Garbage => CaptureState::Garbage(stream),
            FaultKind::Intermittent if stream.unit() < fault.amount => CaptureState::Dark,
            FaultKind::Intermittent => CaptureState::Current,
            FaultKind::Wrong => CaptureState::Swapped,
            FaultKind::Stuck => {
                let first = mission.first_after(fault.from).min(self.index);
                earlier(mission.time(first), first)
            }
            FaultKind::Slow => {
                let kept = self.index - self.index % SLOW;
                earlier(mission.time(kept), kept)
            }
            FaultKind::Delayed => earlier(self.time - fault.amount, self.index),
        }
    }
}
