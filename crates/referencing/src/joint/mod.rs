//! Joint fix: one estimate of camera and object poses from all visible objects over several instants.
//!
//! Each object of a site is modelled by itself, and a survey relates the objects. The survey's error is equal for all
//! points of an object and for all instants: six shared numbers per object, not independent noise of each point. Camera
//! poses and these six numbers are therefore estimated together, with the survey as an observation beside the pixels.
//! An object with one or two visible points has no fix of its own, but its survey makes its points usable: they are
//! searched at their positions predicted from the other objects.

mod displaced;
mod fix;
mod gather;
pub(crate) mod member;
mod relative_pose;
mod system;
#[cfg(test)]
mod tests;

pub use displaced::{JointFixes, Unjoined, joint_fixes};
pub use fix::{JointFix, joint_fix};
pub use gather::{Gathered, Unadded, gather};
pub use member::{Member, ObjectObservations, Placement};
pub use relative_pose::RelativePose;
