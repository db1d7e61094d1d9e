//! `seafix-network/1`: a network as a file.
//!
//! UTF-8 text, a JSON object a line. The first line names the format and how key frames were made of images; the last
//! says how many lines there are between, so that what is cut off shows. Between them stand `object`s, `station`s, `leg`s,
//! `fix`es, `rough`s and `loop`s, each kind in its order; what they refer to is a number from 0. Matrices are rows;
//! numbers of a key frame are base64 of little-endian values.

use std::path::Path;

use base64::{Engine, engine::general_purpose::STANDARD};
use nalgebra::{Matrix3, Matrix6, SVector, Vector4};
use seafix_component::Fault;
use seafix_geometry::{Camera, Covariance6, Frame, Object, Pixel, Point, Transform, UncertainPoint, World};
use seafix_vision::{Descriptors, Keypoint, Table};
use serde::{Deserialize, Serialize};

use super::{Fix, KeyFrame, Leg, Network, Recognition, Rough, Station, drift::Drift};
use crate::{
    Lasting, Local, Navigated, Place, Standing,
    lasting::{LASTING, Shares, Spread},
};

const FORMAT: &str = "seafix-network/1";

type Rows4 = [[f64; 4]; 4];
type Rows6 = [[f64; 6]; 6];

/// A line of the file.
#[derive(Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
enum Line {
    Network(Box<Head>),
    Object(RawObject),
    Station(RawStation),
    Leg(RawLeg),
    Fix(RawFix),
    Rough(RawRough),
    Loop(RawLeg),
    End(usize),
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    format: String,
    recognition: Recognition,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawObject {
    name: String,
    world_from_object: Rows4,
    covariance: Rows6,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStation {
    stamp_ns: u64,
    world_from_camera: Rows4,
    sigma: f64,
    keyframe: Option<RawKeyFrame>,
}

/// Of each point: x, y, z (m) and the six numbers xx, xy, xz, yy, yz, zz of its covariance (m²) as doubles; u and v as
/// doubles, response and scale as singles; its descriptor as singles or words of 64 bits.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawKeyFrame {
    count: usize,
    kind: Kind,
    points: String,
    keypoints: String,
    descriptors: String,
}

#[derive(Serialize, Deserialize, Clone, Copy, PartialEq)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Numbers,
    Bits,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLeg {
    from: usize,
    to: usize,
    motion: Rows4,
    covariance: Rows6,
    /// Absent where it errs independently of all others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    lasting: Option<RawLasting>,
}

/// Numbers of `Lasting`, under its names.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawLasting {
    by: [[f64; LASTING]; 6],
    keep: [f64; LASTING],
    with: [[f64; LASTING]; 6],
    before: RawSpread,
    after: RawSpread,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSpread {
    independent: [f64; 4],
    held: Rows6,
}

impl RawLasting {
    fn of(lasting: &Lasting) -> Self {
        let rows = |shares: &Shares| std::array::from_fn(|row| std::array::from_fn(|k| shares[(row, k)]));
        let spread = |spread: &Spread| RawSpread { independent: spread.independent.into(), held: rows6(&spread.held) };
        Self {
            by: rows(&lasting.by),
            keep: lasting.keep.into(),
            with: rows(&lasting.with),
            before: spread(&lasting.before),
            after: spread(&lasting.after),
        }
    }

    fn cooked(&self) -> Result<Lasting, Wrong> {
        let shares = |rows: &[[f64; LASTING]; 6]| Shares::from_fn(|row, k| rows[row][k]);
        let spread = |raw: &RawSpread| {
            let independent = Vector4::from(raw.independent);
            let wrong = || ("no variances", format!("{:?}", raw.independent), "give numbers of 0 or more");
            match independent.iter().all(|x| x.is_finite() && *x >= 0.0) {
                true => Ok(Spread { independent, held: finite(&raw.held)? }),
                false => Err(wrong()),
            }
        };
        let (by, keep, with) = (shares(&self.by), SVector::from(self.keep), shares(&self.with));
        Ok(Lasting { by, keep, with, before: spread(&self.before)?, after: spread(&self.after)? })
    }
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFix {
    station: usize,
    object: usize,
    object_from_camera: Rows4,
    covariance: Rows6,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawRough {
    station: usize,
    world_from_camera: Rows4,
    covariance: Rows6,
}

impl Network {
    /// The network as a file's text; `recognition` made its key frames.
    pub fn text(&self, recognition: &Recognition) -> String {
        let head = Head { format: FORMAT.to_owned(), recognition: recognition.clone() };
        let mut lines = vec![Line::Network(Box::new(head))];
        lines.extend(self.objects.iter().map(|(name, place)| {
            Line::Object(RawObject {
                name: name.clone(),
                world_from_object: place.world_from_object.rows(),
                covariance: rows6(&place.covariance.matrix),
            })
        }));
        lines.extend(self.stations.iter().map(|station| {
            Line::Station(RawStation {
                stamp_ns: station.stamp_ns,
                world_from_camera: station.world_from_camera.rows(),
                sigma: station.sigma,
                keyframe: station.keyframe.as_ref().map(raw),
            })
        }));
        let leg = |leg: &Leg| RawLeg {
            from: leg.from,
            to: leg.to,
            motion: leg.motion.motion.rows(),
            covariance: rows6(&leg.motion.covariance.matrix),
            lasting: leg.motion.lasting.as_ref().map(RawLasting::of),
        };
        lines.extend(self.legs.iter().map(|one| Line::Leg(leg(one))));
        lines.extend(self.fixes.iter().map(|fix| {
            Line::Fix(RawFix {
                station: fix.station,
                object: fix.navigated.object,
                object_from_camera: fix.navigated.standing.object_from_camera.rows(),
                covariance: rows6(&fix.navigated.standing.covariance.matrix),
            })
        }));
        lines.extend(self.roughs.iter().map(|rough| {
            Line::Rough(RawRough {
                station: rough.station,
                world_from_camera: rough.world_from_camera.rows(),
                covariance: rows6(&rough.covariance.matrix),
            })
        }));
        lines.extend(self.loops.iter().map(|one| Line::Loop(leg(one))));
        lines.push(Line::End(lines.len() - 1));
        let mut text = String::new();
        for line in &lines {
            text += &serde_json::to_string(line).expect("plain numbers and names");
            text.push('\n');
        }
        text
    }

    /// The network of a file's text.
    ///
    /// # Errors
    /// The first [`Fault`]: a line that is no record, a number out of place, another way of making key frames than
    /// `recognition` (what was described otherwise is not recognised), an end that is missing.
    pub fn read(file: &Path, text: &str, recognition: &Recognition) -> Result<Self, Fault> {
        let mut network = Self::default();
        let mut end = None;
        let count = text.lines().count();
        for (index, text) in text.lines().enumerate() {
            let at = |what: &str| Fault::new(what, file).on_line(index + 1);
            let line: Line = serde_json::from_str(text).map_err(|error| {
                let said = error.to_string();
                let said = said.split(" at line ").next().unwrap_or_default().to_owned();
                let cut = if index + 1 == count { "; is the file cut off?" } else { "" };
                at("no line of a network").value(said).remedy(format!("write it again by `lay = true`{cut}"))
            })?;
            if (index == 0) != matches!(line, Line::Network(_)) {
                return Err(at("the first line, and only the first, names the format")
                    .remedy(format!("give a file of format {FORMAT}")));
            }
            if end.is_some() {
                return Err(at("a line after the end").remedy("one network a file"));
            }
            if let Line::End(lines) = line {
                end = Some(lines);
                if lines + 2 != index + 1 {
                    return Err(at("lines are missing")
                        .value(format!("{} of {lines}", index - 1))
                        .remedy("take the whole file"));
                }
                continue;
            }
            network.take(line, recognition).map_err(|(what, value, remedy)| at(what).value(value).remedy(remedy))?;
        }
        match end {
            Some(_) => Ok(network),
            None => Err(Fault::new("the network has no end", file).on_line(count).remedy("take the whole file")),
        }
    }

    /// Takes in a line; what is wrong with it, the value, the remedy.
    fn take(&mut self, line: Line, recognition: &Recognition) -> Result<(), (&'static str, String, &'static str)> {
        match line {
            Line::Network(head) => {
                let Head { format, recognition: laid } = *head;
                if format != FORMAT {
                    return Err(("another format", format, "give a file of format seafix-network/1"));
                }
                if let Some(key) = laid.described_unlike(recognition) {
                    return Err((
                        "key frames were described otherwise than those they are to be compared with",
                        key.to_owned(),
                        "use the settings that the network was laid with, or lay it again",
                    ));
                }
            }
            Line::Object(object) => {
                if self.objects.iter().any(|(name, _)| *name == object.name) {
                    return Err(("two objects of one name", object.name, "give each its own"));
                }
                let place = Place {
                    world_from_object: pose::<World, Object>(&object.world_from_object)?,
                    covariance: Covariance6::new(finite(&object.covariance)?),
                };
                self.objects.push((object.name, place));
            }
            Line::Station(station) => {
                if !(station.sigma >= 0.0) {
                    return Err(("no standard deviation", station.sigma.to_string(), "give a length of 0 or more (m)"));
                }
                let keyframe = station.keyframe.as_ref().map(cooked).transpose()?;
                let world_from_camera = pose(&station.world_from_camera)?;
                self.lay(Station { stamp_ns: station.stamp_ns, world_from_camera, sigma: station.sigma, keyframe });
            }
            Line::Leg(leg) => {
                let leg = self.leg(&leg)?;
                self.legs.push(leg);
            }
            Line::Loop(leg) => {
                let leg = self.leg(&leg)?;
                self.loops.push(leg);
            }
            Line::Fix(fix) => {
                let station = among(fix.station, self.stations.len())?;
                let object = among(fix.object, self.objects.len())?;
                let covariance = Covariance6::new(covariance(&fix.covariance)?);
                let standing = Standing::new(pose(&fix.object_from_camera)?, covariance);
                self.fixes.push(Fix { station, navigated: Navigated { object, standing } });
            }
            Line::Rough(rough) => {
                let station = among(rough.station, self.stations.len())?;
                let covariance = Covariance6::new(covariance(&rough.covariance)?);
                self.roughs.push(Rough { station, world_from_camera: pose(&rough.world_from_camera)?, covariance });
            }
            Line::End(_) => unreachable!("the caller takes it"),
        }
        Ok(())
    }

    fn leg(&self, raw: &RawLeg) -> Result<Leg, (&'static str, String, &'static str)> {
        let (from, to) = (among(raw.from, self.stations.len())?, among(raw.to, self.stations.len())?);
        if from == to {
            return Err(("a motion from a station to itself", from.to_string(), "name two stations"));
        }
        let covariance = Covariance6::new(covariance(&raw.covariance)?);
        let lasting = raw.lasting.as_ref().map(RawLasting::cooked).transpose()?;
        let motion = Local { motion: pose(&raw.motion)?, covariance, lasting };
        if let Some(lasting) = &lasting
            && Drift::of(&motion, lasting).is_err()
        {
            let value = format!("from station {from} to {to}");
            return Err(("errors that last do not fit the covariance of their motion", value, "take the whole file"));
        }
        Ok(Leg { from, to, motion })
    }
}

impl Recognition {
    /// The setting in which key points and descriptors of two recognitions differ.
    fn described_unlike(&self, other: &Self) -> Option<&'static str> {
        if self.filters != other.filters {
            return Some("filters");
        }
        let parts = [
            ("detector", &self.detector, &other.detector),
            ("locator", &self.locator, &other.locator),
            ("descriptor", &self.descriptor, &other.descriptor),
        ];
        parts.iter().find(|(_, a, b)| a != b).map(|(name, ..)| *name)
    }
}

type Wrong = (&'static str, String, &'static str);

fn among(index: usize, count: usize) -> Result<usize, Wrong> {
    let wrong = || ("it refers to what does not stand before it", format!("{index} of {count}"), "take the whole file");
    if index < count { Ok(index) } else { Err(wrong()) }
}

fn pose<A: Frame, B: Frame>(rows: &Rows4) -> Result<Transform<A, B>, Wrong> {
    Transform::from_rows(rows).map_err(|error| ("no rigid motion", error.to_string(), "give a pose"))
}

fn finite(rows: &Rows6) -> Result<Matrix6<f64>, Wrong> {
    let matrix = Matrix6::from_fn(|row, column| rows[row][column]);
    let sound = matrix.iter().all(|x| x.is_finite()) && (0..6).all(|k| matrix[(k, k)] >= 0.0);
    let wrong = || ("no covariance", format!("diagonal {:?}", matrix.diagonal().as_slice()), "give variances");
    if sound { Ok(matrix) } else { Err(wrong()) }
}

fn covariance(rows: &Rows6) -> Result<Matrix6<f64>, Wrong> {
    let matrix = finite(rows)?;
    let wrong = || ("no covariance", "not positive definite".to_owned(), "give a covariance of full rank");
    if matrix.cholesky().is_some() { Ok(matrix) } else { Err(wrong()) }
}

fn rows6(matrix: &Matrix6<f64>) -> Rows6 {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(row, column)]))
}

/// Where the six numbers of a covariance stand.
const UPPER: [(usize, usize); 6] = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];

fn raw(keyframe: &KeyFrame) -> RawKeyFrame {
    let points = keyframe.points.iter().flat_map(|point| {
        let at = [point.at.coords.x, point.at.coords.y, point.at.coords.z];
        at.into_iter().chain(UPPER.map(|place| point.covariance[place]))
    });
    let points: Vec<u8> = points.flat_map(f64::to_le_bytes).collect();
    let mut keypoints = Vec::new();
    for keypoint in &keyframe.keypoints {
        keypoints.extend([keypoint.at.u, keypoint.at.v].iter().flat_map(|x| x.to_le_bytes()));
        keypoints.extend([keypoint.response, keypoint.scale].iter().flat_map(|x| x.to_le_bytes()));
    }
    let (kind, descriptors): (Kind, Vec<u8>) = match &keyframe.descriptors {
        Descriptors::Numbers(table) => (Kind::Numbers, table.values().iter().flat_map(|x| x.to_le_bytes()).collect()),
        Descriptors::Bits(table) => (Kind::Bits, table.values().iter().flat_map(|x| x.to_le_bytes()).collect()),
    };
    RawKeyFrame {
        count: keyframe.points.len(),
        kind,
        points: STANDARD.encode(points),
        keypoints: STANDARD.encode(keypoints),
        descriptors: STANDARD.encode(descriptors),
    }
}

/// What base64 holds, in pieces of `size` bytes, `count` of them where that is known.
fn pieces(text: &str, size: usize, count: usize) -> Result<Vec<u8>, Wrong> {
    let wrong = |value: String| ("a key frame that does not hold what it says", value, "take the whole file");
    let bytes = STANDARD.decode(text).map_err(|error| wrong(error.to_string()))?;
    if count.checked_mul(size) == Some(bytes.len()) {
        Ok(bytes)
    } else {
        Err(wrong(format!("{} bytes for {count} points of {size}", bytes.len())))
    }
}

fn cooked(raw: &RawKeyFrame) -> Result<KeyFrame, Wrong> {
    let doubles = |bytes: &[u8]| -> Vec<f64> {
        bytes.chunks_exact(8).map(|eight| f64::from_le_bytes(eight.try_into().expect("eight bytes"))).collect()
    };
    let wrong = |value: &str| ("a key frame that does not hold what it says", value.to_owned(), "take the whole file");
    let numbers = doubles(&pieces(&raw.points, 72, raw.count)?);
    let points: Vec<UncertainPoint<Camera>> = numbers
        .chunks_exact(9)
        .map(|nine| {
            let mut covariance = Matrix3::zeros();
            for ((row, column), value) in UPPER.into_iter().zip(&nine[3..]) {
                (covariance[(row, column)], covariance[(column, row)]) = (*value, *value);
            }
            UncertainPoint { at: Point::new(nine[0], nine[1], nine[2]), covariance }
        })
        .collect();
    if !numbers.iter().all(|x| x.is_finite()) {
        return Err(wrong("a coordinate is not finite"));
    }
    let bytes = pieces(&raw.keypoints, 24, raw.count)?;
    let single = |four: &[u8]| f32::from_le_bytes(four.try_into().expect("four bytes"));
    let keypoints: Vec<Keypoint> = bytes
        .chunks_exact(24)
        .map(|one| {
            let at = doubles(&one[..16]);
            Keypoint { at: Pixel { u: at[0], v: at[1] }, response: single(&one[16..20]), scale: single(&one[20..]) }
        })
        .collect();
    let bytes = STANDARD.decode(&raw.descriptors).map_err(|error| wrong(&error.to_string()))?;
    let width = match raw.kind {
        Kind::Numbers => 4,
        Kind::Bits => 8,
    };
    if raw.count == 0 || bytes.is_empty() || !bytes.len().is_multiple_of(raw.count * width) {
        return Err(wrong("descriptors that do not fill a row a point"));
    }
    let length = bytes.len() / (raw.count * width);
    let descriptors = match raw.kind {
        Kind::Numbers => {
            let values: Vec<f32> = bytes.chunks_exact(4).map(single).collect();
            if !values.iter().all(|x| x.is_finite()) {
                return Err(wrong("a descriptor is not finite"));
            }
            Descriptors::Numbers(Table::new(length, values))
        }
        Kind::Bits => {
            let word = |eight: &[u8]| u64::from_le_bytes(eight.try_into().expect("eight bytes"));
            Descriptors::Bits(Table::new(length, bytes.chunks_exact(8).map(word).collect()))
        }
    };
    Ok(KeyFrame { points, keypoints, descriptors })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn network() -> Network {
        let pose = |x: f64| Transform::exp(&[0.1, 0.2, 0.3, x, 2.0, 3.0].into());
        let place = Place { world_from_object: pose(1.0).relabel(), covariance: Covariance6::isotropic(0.01, 0.02) };
        let mut network = Network::new(vec![("box".to_owned(), place)]);
        let point = |x: f64| UncertainPoint::isotropic(Point::new(x, 0.1, 3.0), 0.01);
        let keypoint = |u: f64| Keypoint { at: Pixel { u, v: 7.5 }, response: 3.0, scale: 2.0 };
        let keyframe = KeyFrame {
            points: vec![point(0.1), point(1.0 / 3.0)],
            keypoints: vec![keypoint(10.1), keypoint(20.7)],
            descriptors: Descriptors::Numbers(Table::new(3, vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6])),
        };
        let station = |stamp_ns, keyframe| Station { stamp_ns, world_from_camera: pose(4.0), sigma: 0.1, keyframe };
        network.lay(station(5, Some(keyframe)));
        network.lay(station(9, None));
        let motion = Local::new(pose(0.1 + 0.2).relabel(), Covariance6::isotropic(0.01, 0.02));
        network.legs.push(Leg { from: 0, to: 1, motion: Local { lasting: Some(lasting()), ..motion } });
        network.loops.push(Leg { from: 0, to: 1, motion });
        let standing = Standing::new(pose(9.0).relabel(), Covariance6::isotropic(1e-3, 2e-3));
        network.fixes.push(Fix { station: 1, navigated: Navigated { object: 0, standing } });
        let covariance = Covariance6::isotropic(0.1, 0.5);
        network.roughs.push(Rough { station: 0, world_from_camera: pose(4.1), covariance });
        network
    }

    /// A scale that makes a tenth of the motion's variance, and the rest of the numbers as a reading that is held has them.
    fn lasting() -> Lasting {
        let (mut by, mut with) = (Shares::zeros(), Shares::zeros());
        (by[(3, 0)], with[(3, 0)]) = (0.1 + 0.2, (0.1 + 0.2) * 1e-6);
        let mut keep = SVector::zeros();
        keep[0] = 1.0;
        let spread = |held| Spread { independent: Vector4::new(1e-6, 0.0, 0.0, 0.0), held };
        let (before, after) = (spread(Matrix6::zeros()), spread(Matrix6::identity() * 1e-6));
        with.fixed_view_mut::<6, 6>(0, 4).copy_from(&after.held);
        Lasting { by, keep, with, before, after }
    }

    #[test]
    fn what_is_written_is_read() {
        let recognition = Recognition::default();
        let text = network().text(&recognition);
        let again = Network::read(Path::new("n.jsonl"), &text, &recognition).unwrap();
        assert_eq!(again.stations[0].keyframe, network().stations[0].keyframe, "to the last bit");
        assert_eq!((again.stations.len(), again.legs.len(), again.loops.len(), again.fixes.len()), (2, 1, 1, 1));
        assert_eq!(again.legs[0].motion.lasting, Some(lasting()), "to the last bit");
        let off = again.stations[0].world_from_camera.error_to(&network().stations[0].world_from_camera);
        assert!(off.norm() < 1e-12);
        assert_eq!(network().text(&recognition), text);
    }

    #[test]
    fn every_fault_is_one_line_with_its_place() {
        let recognition = Recognition::default();
        let text = network().text(&recognition);
        let lines: Vec<&str> = text.lines().collect();
        let said = |text: &str| Network::read(Path::new("n.jsonl"), text, &recognition).unwrap_err().to_string();
        assert!(said("").contains("no end in n.jsonl:0"), "{}", said(""));
        assert!(said(&lines[..4].join("\n")).contains("no end in n.jsonl:4"));
        assert!(said(&text[..text.len() / 2]).contains("cut off"), "{}", said(&text[..text.len() / 2]));
        let without = |line: usize| {
            let mut rest = lines.clone();
            rest.remove(line);
            said(&rest.join("\n"))
        };
        assert!(without(0).contains("first line"), "{}", without(0));
        assert!(without(5).contains("lines are missing in n.jsonl"), "{}", without(5));
        assert!(without(3).contains("does not stand before it in n.jsonl:4: 1 of 1"), "{}", without(3));
        let with = |from: &str, to: &str| said(&text.replacen(from, to, 1));
        assert!(with("network/1", "network/9").contains("another format in n.jsonl:1"));
        assert!(with("\"sigma\":0.1", "\"sigma\":-0.1").contains("no standard deviation in n.jsonl:3: -0.1"));
        assert!(with("\"count\":2", "\"count\":3").contains("does not hold what it says in n.jsonl:3"));
        assert!(with("\"stamp_ns\"", "\"stamp\"").contains("unknown field"));
        assert!(with("[1e-6,0.0", "[-1e-6,0.0").contains("no variances in n.jsonl:5: [-1e-6"));
        assert!(with("[1e-6,0.0", "[1.0,0.0").contains("do not fit the covariance of their motion in n.jsonl:5: from"));
        let other =
            Recognition { points: 100, descriptor: seafix_component::Choice::named("orb"), ..recognition.clone() };
        let unlike = Network::read(Path::new("n.jsonl"), &text, &other).unwrap_err().to_string();
        assert!(unlike.contains("described otherwise") && unlike.contains(": descriptor;"), "{unlike}");
        assert_eq!(with("box", "b\u{7}x").lines().count(), 1);
    }
}
