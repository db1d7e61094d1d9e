//! The CSV tables of a data set: a header line, then values.

use std::path::Path;

use nalgebra::{Matrix3, Matrix4, Matrix6, Vector3};
use seafix_component::Fault;
use seafix_geometry::{Camera, Covariance6, Object, Transform, World};
use seafix_navigation::{Device, Reading};

use crate::formats::named::{number, rows};

/// The content of a table, or its first fault.
type Table<T> = Result<Vec<T>, Fault>;

/// A line of `frames.csv`: the stamp and the two image files of a stereo pair.
pub(super) struct FrameLine {
    pub(super) line: usize,
    pub(super) stamp_ns: u64,
    pub(super) left: String,
    pub(super) right: String,
}

/// A line of the visibility table: a feature point in view of both cameras.
pub(super) struct VisibleLine {
    pub(super) line: usize,
    pub(super) stamp_ns: u64,
    pub(super) object: String,
    pub(super) point: String,
}

/// Reads `stamp_ns,left,right` in order of time. Lines out of order are rejected, or with `sort_stamps` sorted, keeping
/// the first of each stamp.
pub(super) fn frames(text: &str, file: &Path, sort_stamps: bool) -> Table<FrameLine> {
    let mut frames: Vec<FrameLine> = Vec::new();
    for (line, [stamp, left, right]) in rows(text, file, ["stamp_ns", "left", "right"])? {
        let stamp_ns = number(&stamp, line, file)?;
        if !sort_stamps && frames.last().is_some_and(|last| last.stamp_ns >= stamp_ns) {
            return Err(Fault::new("a stamp not later than the previous one", file).on_line(line).value(stamp).remedy(
                "sort the lines by time, one a stereo pair; `sort-stamps` does it and keeps the first of each stamp",
            ));
        }
        frames.push(FrameLine { line, stamp_ns, left, right });
    }
    if sort_stamps {
        frames.sort_by_key(|frame| frame.stamp_ns);
        frames.dedup_by_key(|frame| frame.stamp_ns);
    }
    if frames.is_empty() {
        return Err(Fault::new("no stereo pair", file).remedy("give one line a pair: stamp_ns,left,right"));
    }
    Ok(frames)
}

/// Reads `stamp_ns,object,point`.
pub(super) fn visibility(text: &str, file: &Path) -> Table<VisibleLine> {
    rows(text, file, ["stamp_ns", "object", "point"])?
        .into_iter()
        .map(|(line, [stamp, object, point])| {
            let stamp_ns = number(&stamp, line, file)?;
            Ok(VisibleLine { line, stamp_ns, object, point })
        })
        .collect()
}

/// Reads `object,m00,…,m33`: the true `world_from_object`, row by row.
pub(super) fn objects(text: &str, file: &Path) -> Table<(String, Transform<World, Object>)> {
    wide_rows(text, file, "object", 16)?
        .into_iter()
        .map(|(line, id, numbers)| {
            Transform::from_matrix(&Matrix4::from_row_slice(&numbers))
                .map(|pose| (id.to_owned(), pose))
                .map_err(|error| Fault::new(error.to_string(), file).on_line(line).value(id))
        })
        .collect()
}

/// Reads `stamp_ns,c00,…,c55`: the covariance of the prior (rotation first, camera frame), row by row.
pub(super) fn covariances(text: &str, file: &Path) -> Table<(u64, Covariance6<World, Camera>)> {
    wide_rows(text, file, "stamp_ns", 36)?
        .into_iter()
        .map(|(line, stamp, numbers)| {
            let matrix = Matrix6::from_row_slice(&numbers);
            let symmetric = (matrix - matrix.transpose()).amax() <= 1e-9 * matrix.amax();
            if !symmetric || matrix.cholesky().is_none() {
                return Err(Fault::new("a covariance that is not symmetric and positive definite", file)
                    .on_line(line)
                    .value(stamp)
                    .remedy("give the full symmetric 6×6 matrix, rotation first"));
            }
            Ok((number(stamp, line, file)?, Covariance6::new(matrix)))
        })
        .collect()
}

/// Reads `stamp_ns,arrival_ns,vx,vy,vz,sigma` of a Doppler log, or `wx,wy,wz` of a gyro: readings with their times of
/// arrival.
pub(super) fn readings(text: &str, file: &Path, device: Device) -> Table<(u64, Reading)> {
    let axes = match device {
        Device::Doppler => ["vx", "vy", "vz"],
        Device::Gyro => ["wx", "wy", "wz"],
    };
    rows(text, file, ["stamp_ns", "arrival_ns", axes[0], axes[1], axes[2], "sigma"])?
        .into_iter()
        .map(|(line, [stamp, arrival, x, y, z, sigma])| {
            let real = |word: &str| number::<f64>(word, line, file);
            let value = Vector3::new(real(&x)?, real(&y)?, real(&z)?);
            let fault = |what: &str, value: &str, remedy: &str| {
                Err(Fault::new(what, file).on_line(line).value(value).remedy(remedy))
            };
            let spread = real(&sigma)?;
            if !(spread >= 0.0 && spread.is_finite()) {
                return fault("an invalid standard deviation", &sigma, "give one number for each axis, zero or more");
            }
            if !value.iter().all(|x| x.is_finite()) {
                return fault(
                    "a reading that is not finite",
                    &value.map(|x| x.to_string()).as_slice().join(","),
                    "remove the line",
                );
            }
            let (stamp_ns, arrival_ns) = (number(&stamp, line, file)?, number(&arrival, line, file)?);
            if arrival_ns < stamp_ns {
                return fault(
                    "a reading that arrives before its measurement",
                    &arrival,
                    "arrival_ns must be the later time",
                );
            }
            let covariance = Matrix3::identity() * (spread * spread);
            Ok((arrival_ns, Reading { device, stamp_ns, value, covariance }))
        })
        .collect()
}

/// The data lines of a key and `count` numbers, below a header that begins with `head`.
fn wide_rows<'a>(text: &'a str, file: &Path, head: &str, count: usize) -> Table<(usize, &'a str, Vec<f64>)> {
    let first = text.lines().next().unwrap_or_default();
    if first.split(',').map(str::trim).next() != Some(head) || first.split(',').count() != count + 1 {
        return Err(Fault::new("a wrong header", file)
            .on_line(1)
            .value(first)
            .remedy(format!("the first line names `{head}` and {count} columns of numbers")));
    }
    text.lines()
        .enumerate()
        .skip(1)
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty())
        .map(|(line, content)| {
            let mut words = content.split(',').map(str::trim);
            let key = words.next().unwrap_or_default();
            let numbers: Vec<f64> = words.map(|word| number(word, line, file)).collect::<Result<_, _>>()?;
            if numbers.len() != count || numbers.iter().any(|x| !x.is_finite()) {
                return Err(Fault::new(format!("{} finite numbers after the key", numbers.len()), file)
                    .on_line(line)
                    .remedy(format!("{count} are needed")));
            }
            Ok((line, key, numbers))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_places_needs_its_header() {
        let file = Path::new("objects.csv");
        assert!(objects("x\n", file).unwrap_err().to_string().contains("names `object` and 16 columns"));
        let columns: String = (0..16).map(|i| format!(",m{i}")).collect();
        let identity = "box,1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1";
        assert_eq!(objects(&format!("object{columns}\n{identity}\n"), file).unwrap()[0].0, "box");
    }

    #[test]
    fn readings_are_finite_and_come_after_they_are_made() {
        let file = Path::new("doppler.csv");
        let table =
            |line: &str| readings(&format!("stamp_ns,arrival_ns,vx,vy,vz,sigma\n{line}\n"), file, Device::Doppler);
        let (arrival, reading) = table("5,7,0.4,0,-0.1,0.004").unwrap()[0];
        assert_eq!((arrival, reading.stamp_ns, reading.value.x, reading.covariance[(2, 2)]), (7, 5, 0.4, 1.6e-5));
        let said = |line: &str| table(line).unwrap_err().to_string();
        assert!(
            said("5,4,0.4,0,0,0.004").contains("doppler.csv:2")
                && said("5,4,0,0,0,0").contains("before its measurement")
        );
        assert!(said("5,7,nan,0,0,0.004").contains("not finite") && said("5,7,0,0,0,-1").contains("invalid standard"));
        assert!(readings("stamp_ns,arrival_ns,wx,wy,wz,sigma\n", file, Device::Gyro).unwrap().is_empty());
    }

    #[test]
    fn tables_name_the_line_at_fault() {
        let file = Path::new("frames.csv");
        let message = |text: &str| frames(text, file, false).map(|_| ()).unwrap_err().to_string();
        assert!(message("time,left,right\n").contains("the first line is `stamp_ns,left,right`"));
        assert!(message("stamp_ns,left,right\n1,a.png\n").starts_with("2 columns in frames.csv:2"));
        assert!(message("stamp_ns,left,right\nx,a.png,b.png\n").starts_with("not a number in frames.csv:2: x"));
        assert!(message("stamp_ns,left,right\n2,a,b\n1,c,d\n").contains("frames.csv:3"));
        assert!(message("stamp_ns,left,right\n").starts_with("no stereo pair"));
        assert_eq!(frames("stamp_ns,left,right\n1,a.png,b.png\n\n", file, false).unwrap()[0].left, "a.png");
        let mixed = "stamp_ns,left,right\n2,b,b\n1,a,a\n2,c,c\n";
        assert!(message(mixed).contains("`sort-stamps` does it"));
        let lefts: Vec<String> = frames(mixed, file, true).unwrap().into_iter().map(|frame| frame.left).collect();
        assert_eq!(lefts, ["a", "b"]);
    }
}
