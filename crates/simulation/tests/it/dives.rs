//! Common parts of the tests of complete dives.

use std::{path::Path, sync::LazyLock};

use seafix_geometry::MeasuredPoint;
use seafix_simulation::{
    Instant, Mission, PlannedMission, PriorKind, RigPlan,
    optics::{Lamp, Water},
    sensors::Readings,
};
use seafix_vision::{Image, Threads};

/// A short, small dive in clear water over the first object, with prior poses from the sensors.
pub(crate) fn base() -> Mission {
    Mission {
        frames: 2,
        rate: 0.5,
        start: 3.0,
        prior: PriorKind::Sensors,
        rig: RigPlan { size: [128, 96], focal: 62.5, ..RigPlan::default() },
        water: Water { attenuation: 0.0, snow: 0.0, ..Water::default() },
        lamps: Lamp::pair(0.25),
        ..Mission::default()
    }
}

/// All outputs of a dive, for a method and for the evaluation.
#[derive(Debug, PartialEq)]
pub(crate) struct Seen {
    pub(crate) images: Vec<(Image, Image)>,
    pub(crate) points: Vec<Vec<MeasuredPoint>>,
    pub(crate) poses: Vec<String>,
    pub(crate) readings: Readings,
    pub(crate) nominal: String,
}

fn plan(mission: &Mission) -> PlannedMission {
    mission.plan(5, 0, Path::new("")).expect("the mission can be planned")
}

/// Keeps the surface textures, which dives of one seed share; computing them anew takes longer than all the rest.
static KEPT: LazyLock<PlannedMission> = LazyLock::new(|| plan(&base()));

/// The outputs of a dive; `images` includes the images, which take most of the time.
pub(crate) fn seen(mission: &Mission, images: bool) -> Seen {
    LazyLock::force(&KEPT);
    let plan = plan(mission);
    let instants: Vec<_> = (0..plan.len()).map(|k| plan.instant(k)).collect();
    let pair = |instant: &Instant<'_>| {
        let (left, right, _) = instant.render(Threads::One);
        (left, right)
    };
    Seen {
        images: instants.iter().filter(|_| images).map(pair).collect(),
        points: instants.iter().map(|i| i.points()).collect(),
        poses: instants.iter().map(|i| format!("{:?} {:?}", i.prior, i.truth())).collect(),
        readings: plan.readings(),
        nominal: format!("{} {:?} {:?}", plan.site().to_toml(), plan.rig(), plan.world_from_object()),
    }
}
