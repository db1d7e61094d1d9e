//! A data set, read and checked.

use std::{
    collections::HashSet,
    path::{Path, PathBuf},
};

use seafix_component::{Fault, decoded, line_of, nearest, read_text, undecodable};
use seafix_geometry::{Camera, Covariance6, Object, Transform, World};
use seafix_io::{
    ImageLimits,
    dataset::{Description, FORMATS},
};
use seafix_navigation::Device;
use seafix_referencing::Site;

use super::{
    contents::{Dataset, DatasetFrame},
    euroc,
    folder::{inside, is_absent},
    kitti::{self, Cameras},
    pairing::clock_offset,
    tables, tum,
};
use crate::{ports, sensor_buffer::SensorBuffer};

impl Dataset {
    /// Reads the data set in `folder`: `seafix-dataset/1`, EuRoC or KITTI.
    ///
    /// # Errors
    /// All faults of the data set.
    pub fn open(folder: &Path) -> Result<Self, Vec<Fault>> {
        Self::read(folder, false, false)
    }

    /// Reads a data set and sorts its pairs by time. The first pair of each stamp is kept (`seafix-dataset/1` only).
    ///
    /// # Errors
    /// All other faults of the data set.
    pub fn open_repaired(folder: &Path) -> Result<Self, Vec<Fault>> {
        Self::read(folder, false, true)
    }

    /// Reads the KITTI sequence in `folder` with two of its cameras.
    ///
    /// # Errors
    /// All faults of the sequence.
    pub fn open_kitti(folder: &Path, cameras: Cameras) -> Result<Self, Vec<Fault>> {
        at_the_border(folder, || kitti::read(folder, cameras, false))
    }

    /// Reads the EuRoC data set in `folder`.
    ///
    /// # Errors
    /// All faults of the data set.
    pub fn open_euroc(folder: &Path) -> Result<Self, Vec<Fault>> {
        let Some(home) = euroc::home(folder) else {
            let fault = Fault::new("a folder without an EuRoC data set", folder);
            return Err(vec![fault.remedy("name the folder that has mav0/cam0")]);
        };
        at_the_border(folder, || euroc::read(folder, &home, false))
    }

    /// Reads the part of a data set that odometry may use: rig, stereo pairs and readings.
    ///
    /// Site, truth and prior are ignored. A missing image file is a fault of its [`pair`](Self::pair) only.
    /// `sort_stamps` is explained at [`open_repaired`](Self::open_repaired).
    ///
    /// # Errors
    /// All other faults of the data set.
    pub fn open_pairs(folder: &Path, sort_stamps: bool) -> Result<Self, Vec<Fault>> {
        Self::read(folder, true, sort_stamps)
    }

    fn read(folder: &Path, pairs_only: bool, sort_stamps: bool) -> Result<Self, Vec<Fault>> {
        at_the_border(folder, || Self::read_any(folder, pairs_only, sort_stamps))
    }

    fn read_any(folder: &Path, pairs_only: bool, sort_stamps: bool) -> Result<Self, Vec<Fault>> {
        let file = folder.join("dataset.toml");
        if !folder.is_dir() {
            return Err(vec![Fault::new("no such folder", folder).remedy("give a folder with a dataset.toml")]);
        }
        if !file.exists() {
            if let Some(home) = euroc::home(folder) {
                return euroc::read(folder, &home, pairs_only);
            }
            if kitti::is_one(folder) {
                return kitti::read(folder, Cameras::Any, pairs_only);
            }
            let fault = Fault::new("a folder without a data set", folder);
            let remedy =
                "give a folder with dataset.toml, with EuRoC's mav0/cam0, or with KITTI's calib.txt and image_0";
            return Err(vec![fault.remedy(remedy)]);
        }
        let source = read_text(&file).map_err(|fault| vec![fault])?;
        let mut described: Description =
            toml::from_str(&source).map_err(|error| vec![Fault::in_toml(&file, &source, &error)])?;
        if pairs_only {
            described.keep_pairs_only();
        }
        let (faults, warnings) = (Vec::new(), Vec::new());
        Reader {
            folder,
            file: &file,
            source: &source,
            described: &described,
            pairs_only,
            sort_stamps,
            faults,
            warnings,
        }
        .read()
    }
}

/// Reads a data set; a panic becomes a fault of it.
fn at_the_border<T>(folder: &Path, read: impl FnOnce() -> Result<T, Vec<Fault>>) -> Result<T, Vec<Fault>> {
    decoded(read, |message| vec![undecodable(folder, message)])
}

/// Whether `folder` holds a data set in a supported format.
pub fn is_one(folder: &Path) -> bool {
    folder.join("dataset.toml").exists() || euroc::home(folder).is_some() || kitti::is_one(folder)
}

/// A reader of one description that collects its faults.
struct Reader<'a> {
    folder: &'a Path,
    file: &'a Path,
    source: &'a str,
    described: &'a Description,
    pairs_only: bool,
    sort_stamps: bool,
    faults: Vec<Fault>,
    warnings: Vec<Fault>,
}

/// The contents of the files that a description names.
struct Tables {
    lines: Vec<tables::FrameLine>,
    site: Option<Site>,
    truth: Vec<tum::Stamped<World, Camera>>,
    prior: Vec<tum::Stamped<World, Camera>>,
    covariances: Option<Vec<(u64, Covariance6<World, Camera>)>>,
    visibility: Option<Vec<tables::VisibleLine>>,
    objects: Vec<(String, Transform<World, Object>)>,
    sensor_buffer: SensorBuffer,
}

impl Reader<'_> {
    fn read(mut self) -> Result<Dataset, Vec<Fault>> {
        let d = self.described;
        if !FORMATS.contains(&d.format.as_str()) {
            let remedy = format!("supported are {}", FORMATS.join(" and "));
            self.fault(&["format"], "an unknown format", &d.format, &remedy);
        }
        let bits = d.depth(self.file, self.source).map_err(|fault| self.faults.push(fault));
        let rig = d.build_rig(self.file, self.source).and_then(|rig| {
            let ports = ports::ports(d, self.file, self.source)?;
            Ok((rig, ports))
        });
        let rig = rig.map_err(|fault| self.faults.push(fault));
        let body_from_camera = d.mounting(self.file, self.source).unwrap_or_else(|fault| {
            self.faults.push(fault);
            Transform::identity()
        });
        let tables = self.tables();
        let sigma = self.prior_sigma();
        if d.prior.is_some() && sigma.is_none() && tables.covariances.is_none() {
            self.fault(&["prior"], "a prior without its uncertainty", "", "add prior_sigma or prior_covariance");
        }
        self.names(tables.site.as_ref(), tables.visibility.as_deref().unwrap_or_default(), &tables.objects);
        let frames = self.frames(&tables, sigma);
        self.warnings.extend(tables.site.iter().flat_map(|site| site.warnings.clone()));
        self.warnings.extend(rig.as_ref().ok().and_then(|(rig, _)| d.not_rectified(rig, self.file, self.source)));
        self.missing_poses(&tables, &frames);
        match (rig, bits) {
            (Ok((rig, ports)), Ok(bits)) if self.faults.is_empty() => Ok(Dataset {
                name: d.name.clone(),
                folder: self.folder.to_owned(),
                rig,
                ports,
                site: tables.site,
                body_from_camera,
                table: d.frames.clone(),
                frames,
                objects: tables.objects,
                has_visibility: tables.visibility.is_some(),
                sensor_buffer: tables.sensor_buffer,
                bits,
                limits: ImageLimits::default(),
                hashes: d.hashes.clone().into_iter().collect(),
                warnings: self.warnings,
            }),
            _ => Err(self.faults),
        }
    }

    fn tables(&mut self) -> Tables {
        let (d, sort_stamps) = (self.described, self.sort_stamps);
        Tables {
            lines: self.table(&d.frames, |text, file| tables::frames(text, file, sort_stamps)).unwrap_or_default(),
            site: d.site.as_deref().and_then(|name| self.site(name)),
            truth: d.truth.as_deref().and_then(|name| self.poses(name)).unwrap_or_default(),
            prior: d.prior.as_deref().and_then(|name| self.poses(name)).unwrap_or_default(),
            covariances: d.prior_covariance.as_deref().and_then(|name| self.table(name, tables::covariances)),
            visibility: d.visibility.as_deref().and_then(|name| self.table(name, tables::visibility)),
            objects: d.objects.as_deref().and_then(|name| self.table(name, tables::objects)).unwrap_or_default(),
            sensor_buffer: self.sensor_buffer(),
        }
    }

    /// The readings of both devices of dead reckoning.
    fn sensor_buffer(&mut self) -> SensorBuffer {
        let d = self.described;
        let mut readings = |name: &Option<String>, device| {
            let table = |name: &str| self.table(name, |text, file| tables::readings(text, file, device));
            name.as_deref().and_then(table).unwrap_or_default()
        };
        let (doppler, gyro) = (readings(&d.doppler, Device::Doppler), readings(&d.gyro, Device::Gyro));
        for (key, given, other) in [("doppler", &d.doppler, &d.gyro), ("gyro", &d.gyro, &d.doppler)] {
            if given.is_some() && other.is_none() {
                self.fault(&[key], "one device without the other", key, "dead reckoning needs `doppler` and `gyro`");
            }
        }
        SensorBuffer::new(doppler.into_iter().chain(gyro).collect())
    }

    /// The stereo pairs with their poses and visible points.
    fn frames(&mut self, tables: &Tables, sigma: Option<Covariance6<World, Camera>>) -> Vec<DatasetFrame> {
        let mut frames = Vec::with_capacity(tables.lines.len());
        for line in &tables.lines {
            let (Some(left), Some(right)) = (self.image(line, &line.left), self.image(line, &line.right)) else {
                continue;
            };
            let own = tables.covariances.iter().flatten().find(|(stamp, _)| *stamp == line.stamp_ns);
            let visible = tables.visibility.iter().flatten().filter(|v| v.stamp_ns == line.stamp_ns);
            frames.push(DatasetFrame {
                stamp_ns: line.stamp_ns,
                left,
                right,
                truth: tum::at(&tables.truth, line.stamp_ns),
                prior: tum::at(&tables.prior, line.stamp_ns).zip(own.map(|(_, covariance)| *covariance).or(sigma)),
                visible: visible.map(|v| (v.object.clone(), v.point.clone())).collect(),
            });
        }
        frames
    }

    /// Warns of pairs without a pose; of different clocks if no pair has one.
    fn missing_poses(&mut self, tables: &Tables, frames: &[DatasetFrame]) {
        let d = self.described;
        for (name, given, found, poses) in [
            ("truth", d.truth.is_some(), frames.iter().filter(|f| f.truth.is_some()).count(), &tables.truth),
            ("prior", d.prior.is_some(), frames.iter().filter(|f| f.prior.is_some()).count(), &tables.prior),
        ] {
            let warning = |what: String| Fault::new(what, self.file).on_line(line_of(self.source, &[name]));
            if given
                && found == 0
                && let Some(offset) =
                    clock_offset(frames.iter().map(|frame| frame.stamp_ns), poses.iter().map(|pose| pose.0))
            {
                let fault = warning(format!("clocks of pairs and {name} that differ")).value(offset);
                self.warnings.push(fault.remedy("no pair has a pose: give both in one clock, UTC or GPS time"));
            } else if given && found < frames.len() {
                let fault = warning(format!("stereo pairs without a {name}"));
                let fault = fault.value(format!("{} of {}", frames.len() - found, frames.len()));
                self.warnings.push(fault.remedy("a pose belongs to a pair when its stamp is within 1 ms"));
            }
        }
    }

    fn fault(&mut self, key: &[&str], what: &str, value: &str, remedy: &str) {
        self.faults.push(Fault::new(what, self.file).on_line(line_of(self.source, key)).value(value).remedy(remedy));
    }

    /// The content of a file in the description, or a fault.
    fn content(&mut self, name: &str) -> Option<(PathBuf, String)> {
        let read =
            inside(self.folder, name, self.file).and_then(|path| read_text(&path).map(|content| (path, content)));
        read.map_err(|fault| {
            let line = self.source.lines().position(|line| line.contains(name)).map(|index| index + 1);
            self.faults.push(if fault.file == self.file { fault.on_line(line) } else { fault });
        })
        .ok()
    }

    fn table<T>(&mut self, name: &str, parse: impl FnOnce(&str, &Path) -> Result<T, Fault>) -> Option<T> {
        let (path, content) = self.content(name)?;
        parse(&content, &path).map_err(|fault| self.faults.push(fault)).ok()
    }

    /// A trajectory. Each table with a quaternion that needed normalisation has one warning.
    fn poses(&mut self, name: &str) -> Option<Vec<tum::Stamped<World, Camera>>> {
        let (path, content) = self.content(name)?;
        let (poses, normalised) = tum::parse(&content, &path).map_err(|fault| self.faults.push(fault)).ok()?;
        if let Some((line, length)) = normalised {
            let what = Fault::new("a quaternion that is not of unit length", &path).on_line(line);
            self.warnings.push(what.value(format!("{length:.6}")).remedy("it was normalised; give more decimals"));
        }
        Some(poses)
    }

    fn site(&mut self, name: &str) -> Option<Site> {
        let (path, content) = self.content(name)?;
        Site::parse(&content, &path).map_err(|faults| self.faults.extend(faults)).ok()
    }

    fn image(&mut self, line: &tables::FrameLine, name: &str) -> Option<PathBuf> {
        let table = self.folder.join(&self.described.frames);
        if self.pairs_only && is_absent(self.folder, name) {
            return Some(self.folder.join(name));
        }
        inside(self.folder, name, &table).map_err(|fault| self.faults.push(fault.on_line(line.line))).ok()
    }

    fn prior_sigma(&mut self) -> Option<Covariance6<World, Camera>> {
        let sigma = self.described.prior_sigma?;
        for (name, value) in [("position", sigma.position), ("attitude_deg", sigma.attitude_deg)] {
            if !(value.is_finite() && value > 0.0) {
                self.fault(
                    &["prior_sigma", name],
                    "a standard deviation that is not positive",
                    &format!("{name} = {value}"),
                    "give metres and degrees above zero",
                );
                return None;
            }
        }
        Some(Covariance6::isotropic(sigma.attitude_deg.to_radians(), sigma.position))
    }

    /// Checks that the site has the objects and points in the tables.
    fn names(
        &mut self,
        site: Option<&Site>,
        visibility: &[tables::VisibleLine],
        objects: &[(String, Transform<World, Object>)],
    ) {
        let Some(site) = site else { return };
        let points = |id: &str| site.objects.iter().find(|object| object.id == id).map(|object| &object.points);
        for line in visibility {
            if points(&line.object).is_some_and(|points| points.iter().all(|point| point.id != line.point)) {
                let table = self.folder.join(self.described.visibility.as_deref().unwrap_or_default());
                let fault = Fault::new("an unknown point of an object", &table).on_line(line.line);
                self.faults
                    .push(fault.value(format!("{}/{}", line.object, line.point)).remedy("name a point of the site"));
            }
        }
        let ids: Vec<&str> = site.objects.iter().map(|object| object.id.as_str()).collect();
        let named: HashSet<&str> =
            visibility.iter().map(|v| v.object.as_str()).chain(objects.iter().map(|(id, _)| id.as_str())).collect();
        let mut unknown: Vec<&str> = named.into_iter().filter(|id| !ids.contains(id)).collect();
        unknown.sort_unstable();
        for id in unknown {
            let remedy = nearest(id, ids.iter().copied())
                .map_or_else(|| format!("there are {}", ids.join(", ")), |near| format!("did you mean `{near}`?"));
            self.fault(&["site"], "an object that is not in the site", id, &remedy);
        }
    }
}
