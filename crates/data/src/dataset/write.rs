//! Export of a sequence as a data set folder.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use seafix::FrameData;
use seafix_component::Fault;
use seafix_geometry::{Camera, Covariance6, Transform, World};

use seafix_io::dataset::{Description, FORMATS, PriorSigma, RigNumbers};

use super::{check::input_hashes, png::write_png, tum};
use crate::sequence::Sequence;

/// Writes every frame of `sequence` as a data set in `folder`, which must not exist.
///
/// The folder holds images and frames, site, truth, prior and visibility if known, the sensor readings, and the hash of
/// every file. It receives its name when it is complete. `done` is called after every frame.
///
/// # Errors
/// A sequence without images, an existing folder, or a file that cannot be written.
pub fn write(sequence: &dyn Sequence, folder: &Path, licence: &str, done: &dyn Fn()) -> Result<(), Fault> {
    if !sequence.images() {
        return Err(Fault::new("a source without images", folder).remedy("choose a source of stereo pairs"));
    }
    if folder.exists() {
        return Err(Fault::new("the folder exists", folder).remedy("choose a new one with --out"));
    }
    let mut partial = folder.as_os_str().to_owned();
    partial.push(".partial");
    let partial = PathBuf::from(partial);
    if partial.exists() {
        return Err(Fault::new("the remains of an interrupted export", &partial).remedy("delete it"));
    }
    let parent = partial.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.map_or(Ok(()), fs::create_dir_all).map_err(|error| failed(&partial, &error))?;
    fs::create_dir(&partial).map_err(|error| failed(&partial, &error))?;
    let name = folder.file_name().map_or_else(|| "dataset".to_owned(), |name| name.to_string_lossy().into_owned());
    let filled = fill(sequence, &partial, [&name, licence], done);
    let written = filled.and_then(|()| fs::rename(&partial, folder).map_err(|error| failed(folder, &error)));
    if written.is_err() {
        // This call has created the folder.
        let _ = fs::remove_dir_all(&partial);
    }
    written
}

fn fill(sequence: &dyn Sequence, folder: &Path, [name, licence]: [&str; 2], done: &dyn Fn()) -> Result<(), Fault> {
    let put =
        |name: &str, text: &str| fs::write(folder.join(name), text).map_err(|error| failed(&folder.join(name), &error));
    let mut frames = "stamp_ns,left,right\n".to_owned();
    let mut visibility: Option<String> = None;
    let mut objects = None;
    let mut truths: Vec<tum::Stamped<World, Camera>> = Vec::new();
    let mut priors: Vec<tum::Stamped<World, Camera>> = Vec::new();
    let mut covariances = Vec::new();
    for index in 0..sequence.frames() {
        let sensor_frame = sequence.sensor_frame(index)?;
        done();
        if let FrameData::Stereo(left, right) = &sensor_frame.frame_data {
            let (left_name, right_name) = (format!("left{index:03}.png"), format!("right{index:03}.png"));
            write_png(&folder.join(&left_name), left, sequence.bits())?;
            write_png(&folder.join(&right_name), right, sequence.bits())?;
            frames += &format!("{},{left_name},{right_name}\n", sensor_frame.stamp_ns);
        }
        priors.extend(sensor_frame.prior.map(|prior| (sensor_frame.stamp_ns, prior.world_from_camera)));
        covariances.extend(sensor_frame.prior.map(|prior| (sensor_frame.stamp_ns, prior.covariance)));
        let Some(truth) = sequence.truth(index) else { continue };
        truths.push((sensor_frame.stamp_ns, truth.world_from_camera));
        for (o, p) in truth.visible.iter().flatten() {
            let object = &sequence.site().objects[*o];
            let table = visibility.get_or_insert_with(|| "stamp_ns,object,point\n".to_owned());
            *table += &format!("{},{},{}\n", sensor_frame.stamp_ns, object.id, object.points[*p].id);
        }
        objects.get_or_insert(truth.world_from_object);
    }
    put("frames.csv", &frames)?;
    put("site.toml", &sequence.site().to_toml())?;
    if !truths.is_empty() {
        put("truth.tum", &tum::print(&truths))?;
    }
    if let Some(table) = &visibility {
        put("visibility.csv", table)?;
    }
    if !priors.is_empty() {
        put("prior.tum", &tum::print(&priors))?;
    }
    // A covariance common to all poses is written as its standard deviations.
    let varied = covariances.windows(2).any(|pair| pair[0].1 != pair[1].1);
    if varied {
        put("prior_covariance.csv", &table_of_covariances(&covariances))?;
    }
    let objects = objects.map(|objects| table_of_objects(sequence, &objects));
    if let Some(table) = &objects {
        put("objects.csv", table)?;
    }
    let sensors = sequence.sensors();
    for (name, table) in &sensors {
        put(name, table)?;
    }
    let has_readings = sequence.has_readings() && !sensors.is_empty();
    let known = |file: &str, is: bool| is.then(|| file.to_owned());
    let description = Description {
        format: FORMATS[if has_readings { 2 } else { 1 }].to_owned(),
        name: name.to_owned(),
        licence: licence.to_owned(),
        origin: Some(sequence.name().to_owned()),
        frames: "frames.csv".to_owned(),
        site: known("site.toml", true),
        truth: known("truth.tum", !truths.is_empty()),
        prior: known("prior.tum", !priors.is_empty()),
        prior_sigma: sequence
            .prior_sigma()
            .map(|(position, attitude)| PriorSigma { position, attitude_deg: attitude.to_degrees() }),
        prior_covariance: known("prior_covariance.csv", varied),
        visibility: known("visibility.csv", visibility.is_some()),
        objects: known("objects.csv", objects.is_some()),
        doppler: known("doppler.csv", has_readings),
        gyro: known("gyro.csv", has_readings),
        body_from_camera: Some(sequence.body_from_camera().rows()),
        bits: (sequence.bits() > 8).then(|| sequence.bits()),
        rig: RigNumbers::of(sequence.rig(), sequence.ports().map(|port| port.map(|port| port.numbers()))),
        hashes: input_hashes(folder)?.into_iter().collect::<BTreeMap<_, _>>(),
    };
    put("dataset.toml", &toml::to_string(&description).expect("a description has plain values"))
}

/// The table `stamp_ns,c00,…` of the prior's covariances.
fn table_of_covariances(all: &[(u64, Covariance6<World, Camera>)]) -> String {
    let columns: Vec<String> = (0..36).map(|i| format!("c{}{}", i / 6, i % 6)).collect();
    let mut text = format!("stamp_ns,{}\n", columns.join(","));
    for (stamp, covariance) in all {
        let numbers: Vec<String> = covariance.matrix.transpose().iter().map(f64::to_string).collect();
        text += &format!("{stamp},{}\n", numbers.join(","));
    }
    text
}

/// The table `object,m00,…` of the objects' true poses.
fn table_of_objects(sequence: &dyn Sequence, places: &[Option<Transform<World, seafix_geometry::Object>>]) -> String {
    let columns: Vec<String> = (0..16).map(|i| format!("m{}{}", i / 4, i % 4)).collect();
    let mut text = format!("object,{}\n", columns.join(","));
    for (object, place) in sequence.site().objects.iter().zip(places) {
        if let Some(place) = place {
            let numbers: Vec<String> = place.rows().iter().flatten().map(f64::to_string).collect();
            text += &format!("{},{}\n", object.id, numbers.join(","));
        }
    }
    text
}

fn failed(path: &Path, error: &std::io::Error) -> Fault {
    Fault::new(format!("cannot write ({error})"), path).remedy("check free space and permissions")
}
