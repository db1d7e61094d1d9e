//! Whether records agree with themselves and with each other, before anything is written.

use std::collections::BTreeSet;

use crate::record::{CameraRecord, FrameRecord, TargetRecord, TrialHeader};

/// What is wrong with `header`.
pub(crate) fn header(header: &TrialHeader) -> Result<(), String> {
    for (name, camera) in [("left", &header.rig.left), ("right", &header.rig.right)] {
        let CameraRecord { size: [width, height], distortion, .. } = camera;
        if *width == 0 || *height == 0 {
            return Err(format!("the {name} camera has a size of {width} x {height} px"));
        }
        if distortion.len() > 12 {
            return Err(format!("the {name} camera has {} distortion coefficients; at most 12", distortion.len()));
        }
    }
    let mut ids = BTreeSet::new();
    for target in &header.targets {
        if target.id.is_empty() {
            return Err("a target has an empty id".to_owned());
        }
        if !ids.insert(&target.id) {
            return Err(format!("two targets are called `{}`", target.id));
        }
    }
    Ok(())
}

/// What is wrong with `frame` in the trial of `header`, after a frame at `last`.
pub(crate) fn frame(header: &TrialHeader, frame: &FrameRecord, last: Option<u64>) -> Result<(), String> {
    if let Some(last) = last.filter(|last| frame.stamp_ns < *last) {
        return Err(format!("stamp {} ns follows {last} ns; stamps must not decrease", frame.stamp_ns));
    }
    if frame.targets.is_empty() {
        return Err("no row; a frame that attempted no target has one with an empty object".to_owned());
    }
    if let Some(images) = &frame.images {
        for (image, camera) in images.iter().zip([&header.rig.left, &header.rig.right]) {
            let size = [image.width, image.height];
            // A thumbnail is smaller by one factor.
            let factor = camera.size[0] / image.width.max(1);
            let fits = factor > 0 && size == camera.size.map(|side| (side / factor).max(1));
            if !fits || image.pixels.len() as u64 != u64::from(image.width) * u64::from(image.height) {
                return Err(format!(
                    "an image of {} x {} px with {} bytes; the camera has {} x {} px",
                    size[0],
                    size[1],
                    image.pixels.len(),
                    camera.size[0],
                    camera.size[1]
                ));
            }
        }
    }
    frame.targets.iter().try_for_each(|target| {
        self::target(header, frame, target).map_err(|what| format!("target `{}`: {what}", target.object))
    })
}

/// What is wrong with the row of one target.
fn target(header: &TrialHeader, frame: &FrameRecord, target: &TargetRecord) -> Result<(), String> {
    let points = match frame.model(header, &target.object) {
        Some(model) => model.points.len(),
        None if target.object.is_empty() => 0,
        None => return Err("neither the header nor the frame knows such a target".to_owned()),
    };
    if target.candidates.len() > points {
        return Err(format!("{} lists of candidates for {points} points", target.candidates.len()));
    }
    let alternatives = target.alternatives.iter().flat_map(|other| &other.pairs);
    let models = target.pairs.iter().chain(alternatives.clone()).map(|pair| pair.model);
    let clouds = target.pairs.iter().chain(alternatives).map(|pair| pair.cloud);
    let clouds = clouds.chain(target.candidates.iter().flatten().copied());
    within("model point", models, points)?;
    within("cloud point", clouds, frame.cloud.len())?;
    within("pair", target.used.iter().copied(), target.pairs.len())
}

fn within(name: &str, mut indices: impl Iterator<Item = u32>, length: usize) -> Result<(), String> {
    match indices.find(|index| *index as usize >= length) {
        Some(index) => Err(format!("{name} {index} of {length}")),
        None => Ok(()),
    }
}
