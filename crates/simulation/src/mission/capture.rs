//! What the cameras show, working or not.

use super::Instant;
use crate::{
    sensors::{DeviceFault, FaultKind, FaultyDevice},
    stream::{Purpose, Stream},
};

/// Slow cameras show every so many-th frame until the next.
const SLOW: usize = 5;

/// What the cameras show at an instant, in images as in points.
pub(super) enum CaptureState<'a> {
    /// What is there.
    Current,
    /// What was there.
    Earlier(Instant<'a>),
    /// The right image as the left, and the left as the right.
    Swapped,
    /// Nothing.
    Dark,
    /// Anything, drawn from this.
    Garbage(Stream),
}

impl<'a> Instant<'a> {
    /// What the cameras show; of faults at once the last one counts.
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
