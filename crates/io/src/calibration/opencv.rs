//! OpenCV's FileStorage (yml, xml, json), and matrices as lists under the same names: camera matrices, coefficients, R and T of `stereoCalibrate`.
//!
//! Programs name the matrices in many ways; they are found by the part that says what it is and which camera it is of.

use std::{collections::BTreeMap, path::Path};

use nalgebra::Vector3;
use seafix_component::Fault;
use yaml_rust2::Yaml;

use super::{
    found::{Found, Given},
    opencv_xml,
    text::{Source, camera, matrix, rodrigues, rotation, rows, size},
};
use crate::{
    dataset::{CameraNumbers, Model, RigNumbers},
    yaml,
};

/// The numbers below each key, which may not be finite, and its words.
#[derive(Debug, Default)]
pub(super) struct Storage {
    pub(super) numbers: BTreeMap<String, Vec<f64>>,
    pub(super) words: BTreeMap<String, String>,
}

/// The names of the left and the right camera's matrix and coefficients, without signs and in lower case.
const MATRICES: [&str; 8] = ["k", "m", "cameramatrix", "intrinsicmatrix", "intrinsics", "cammatrix", "mtx", "cm"];
const COEFFICIENTS: [&str; 9] = [
    "d",
    "dist",
    "distcoeffs",
    "distcoefs",
    "distortioncoefficients",
    "distortioncoeffs",
    "distortion",
    "distcoeff",
    "coeffs",
];
const SIDES: [&[&str]; 2] = [&["1", "left", "l", "0"], &["2", "right", "r", "1"]];

pub(super) fn read(sources: &[Source], given: Given) -> Result<Option<Found>, Fault> {
    let mut storage = Storage::default();
    for source in sources {
        match source.yaml() {
            Some(content) => add(&mut storage, &content?),
            None if opencv_xml::is_one(&source.text) => opencv_xml::add(&mut storage, source)?,
            None => return Ok(None),
        }
    }
    let source = &sources[0];
    let keys: BTreeMap<String, &String> = storage.numbers.keys().map(|key| (plain(key), key)).collect();
    // Cameras are counted from one or from zero: `K0`, `K1` are left and right, `K1`, `K2` too.
    let from_zero = MATRICES.iter().any(|name| keys.contains_key(&format!("{name}0")));
    let find = |names: &[&str], side: usize| {
        let words = SIDES[side].iter().filter(|word| match **word {
            "0" | "2" => (**word == "0") == from_zero,
            "1" => (side == 1) == from_zero,
            _ => true,
        });
        let mut all = words
            .flat_map(|word| names.iter().flat_map(move |name| [format!("{name}{word}"), format!("{word}{name}")]));
        all.find_map(|name| keys.get(&name).map(|key| (*key).clone()))
    };
    let (Some(k_left), Some(k_right)) = (find(&MATRICES, 0), find(&MATRICES, 1)) else { return Ok(None) };
    let named = |names: &[&str]| names.iter().find_map(|name| keys.get(*name).map(|key| (*key).clone()));
    let missing = |what: &str| {
        let fault = source.fault("", format!("no {what} of the right camera"));
        fault.remedy("give R and T as `stereoCalibrate` returns them, in this file or in a second one (extrinsics.yml)")
    };
    let r = named(&["r", "rotation", "rotationmatrix", "rmat", "om", "rvec"]).ok_or_else(|| missing("rotation R"))?;
    let t =
        named(&["t", "translation", "translationvector", "tvec", "trans"]).ok_or_else(|| missing("translation T"))?;
    let finite = |key: &str| {
        let numbers = &storage.numbers[key];
        let all = numbers.iter().all(|number| number.is_finite());
        let file = || sources.iter().find(|source| source.text.contains(key)).unwrap_or(source);
        if all { Ok(numbers) } else { Err(file().not_finite(key)) }
    };
    let numbers = |key: &str, count: usize| {
        let numbers = finite(key)?;
        if numbers.len() == count {
            Ok(numbers)
        } else {
            Err(source.fault(key, format!("`{key}` has {} numbers", numbers.len())).remedy(format!("give {count}")))
        }
    };
    let turn = match finite(&r)?.as_slice() {
        &[x, y, z] => rodrigues([x, y, z]),
        _ => rotation(source, &r, &matrix(&numbers(&r, 9)?.as_slice().try_into().expect("nine")))?,
    };
    let step = Vector3::from_column_slice(numbers(&t, 3)?) * given.unit;
    let stated = stated_size(&storage, &keys);
    let side = |side: usize, key: &str| -> Result<CameraNumbers, Fault> {
        let k: [f64; 9] = numbers(key, 9)?.as_slice().try_into().expect("nine");
        let name = find(&COEFFICIENTS, side);
        let distortion = name.as_ref().map(|name| finite(name).cloned()).transpose()?.unwrap_or_default();
        let model = model(source, &storage, name.as_deref().unwrap_or_default(), &distortion)?;
        camera(source, size(source, stated, given)?, &k, model, distortion)
    };
    let numbers = RigNumbers {
        right_from_left: rows(&turn, &step),
        rectified: false,
        left: side(0, &k_left)?,
        right: side(1, &k_right)?,
    };
    Ok(Some(Found::new("OpenCV FileStorage", numbers)))
}

/// Whether a JSON file has the matrices of two cameras; other JSON files are problems.
pub(super) fn is_json(file: &Path, text: &str) -> bool {
    let source = Source { file: file.to_owned(), text: text.to_owned() };
    file.extension().is_some_and(|end| end == "json")
        && source.yaml().is_some_and(|content| {
            let mut storage = Storage::default();
            content.is_ok_and(|content| {
                add(&mut storage, &content);
                storage.numbers.keys().any(|key| {
                    let key = plain(key);
                    SIDES.iter().flat_map(|words| words.iter()).any(|side| {
                        MATRICES.iter().any(|name| key == format!("{name}{side}") || key == format!("{side}{name}"))
                    })
                })
            })
        })
}

/// A key without signs and in lower case.
fn plain(key: &str) -> String {
    key.chars().filter(char::is_ascii_alphanumeric).collect::<String>().to_lowercase()
}

/// Four coefficients without a named model are k1 k2 p1 p2 or those of `cv::fisheye`.
fn model(source: &Source, storage: &Storage, key: &str, distortion: &[f64]) -> Result<Model, Fault> {
    let named = storage.words.iter().find(|(key, _)| key.to_lowercase().contains("model"));
    let named = named.map(|(_, word)| word.to_lowercase());
    match named.as_deref() {
        Some(word) if word.contains("fish") || word.contains("equi") || word.contains("kannala") => {
            Ok(Model::Equidistant)
        }
        Some(_) => Ok(Model::Pinhole),
        None if distortion.len() == 4 && distortion.iter().any(|k| *k != 0.0) => {
            let fault = source.fault(key, "four coefficients that may be k1 k2 p1 p2 or those of a fisheye lens");
            Err(fault.remedy("add `distortion_model: plumb_bob` or `distortion_model: equidistant` to the file"))
        }
        None => Ok(Model::Pinhole),
    }
}

/// The size of the images, under one of its usual names.
fn stated_size(storage: &Storage, keys: &BTreeMap<String, &String>) -> Option<[f64; 2]> {
    let numbers = |name: &str| keys.get(name).map(|key| storage.numbers[*key].as_slice());
    let one = |name: &str| numbers(name).and_then(|numbers| numbers.first().copied());
    let pair = ["imagesize", "size", "imgsize", "resolution"].iter().find_map(|name| match numbers(name) {
        Some(&[width, height]) => Some([width, height]),
        _ => None,
    });
    let sides = || {
        ["image", "img", ""]
            .iter()
            .find_map(|name| Some([one(&format!("{name}width"))?, one(&format!("{name}height"))?]))
    };
    pair.or_else(sides)
}

/// Adds the matrices, lists and numbers of a YAML document.
fn add(storage: &mut Storage, content: &Yaml) {
    for (key, value) in content.as_hash().into_iter().flatten() {
        let Some(key) = key.as_str() else { continue };
        let data = if value["data"].is_badvalue() { value } else { &value["data"] };
        if let Some(numbers) = yaml::any_numbers(data).or_else(|| yaml::number(value).map(|number| vec![number])) {
            storage.numbers.insert(key.to_owned(), numbers);
        } else if let Some(word) = value.as_str() {
            storage.words.insert(key.to_owned(), word.to_owned());
        } else if value.as_hash().is_some() {
            add(storage, value);
        }
    }
}
