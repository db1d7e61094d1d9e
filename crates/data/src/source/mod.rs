//! Sources of stereo pairs and clouds.

use seafix_component::{Registry, entry};
use seafix_referencing::Site;

mod bag;
mod bag_messages;
mod dataset;
mod dive;
mod euroc;
mod generated_pairs;
mod generated_problems;
mod kitti;
mod logged;
mod mcap;
mod open_mcap;
mod problem_sequence;
mod problems;
mod readings;
mod recorded;
mod recordings;
mod topics;
mod virtual_dive;
mod virtual_images;
mod virtual_layouts;
mod virtual_points;

pub(crate) use bag::Bag;
pub use dataset::DatasetSource;
pub use dive::Dive;
pub use euroc::Euroc;
pub use generated_pairs::GeneratedPairs;
pub use generated_problems::GeneratedProblems;
pub use kitti::Kitti;
pub(crate) use logged::Logged;
pub use mcap::{LoggedInput, Mcap, Stamps};
pub use problems::Problems;
pub use recorded::check_recording;
pub use recordings::is_recording;
pub(crate) use recordings::{Recordings, is_log};
pub use virtual_images::VirtualImages;
pub use virtual_layouts::VirtualLayouts;
pub use virtual_points::VirtualPoints;

pub use crate::{
    dataset::Cameras,
    ports::CalibratedPort,
    ros::Views,
    sensor_buffer::SensorBuffer,
    sequence::{Sequence, Source, TrueAnswer, Truth},
};
pub use seafix::{FrameData, Hints, PosePrior, SensorFrame};

/// The registry of all sources.
pub static SOURCES: Registry<dyn Source> = Registry::new(
    "source",
    &[
        entry!(DatasetSource),
        entry!(Dive),
        entry!(GeneratedPairs),
        entry!(GeneratedProblems),
        entry!(Euroc),
        entry!(Kitti),
        entry!(Mcap),
        entry!(Problems),
        entry!(VirtualImages),
        entry!(VirtualLayouts),
        entry!(VirtualPoints),
    ],
);

/// The site of a coherence problem with an object of its own; `None` if the site of the sequence applies.
pub fn own_site(sensor_frame: &SensorFrame) -> Option<Site> {
    match &sensor_frame.hints {
        Hints::Problem(problem) => Some(problem_sequence::site_of(problem)),
        _ => None,
    }
}
