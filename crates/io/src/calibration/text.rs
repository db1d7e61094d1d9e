//! A calibration file as text, and what its formats share.

use std::path::{Path, PathBuf};

use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, UnitQuaternion, Vector3};
use seafix_component::{Fault, read_text};
use yaml_rust2::Yaml;

use super::found::Given;
use crate::{
    dataset::{CameraNumbers, Model},
    yaml,
};

/// A file and its content.
#[derive(Debug)]
pub(super) struct Source {
    pub(super) file: PathBuf,
    pub(super) text: String,
}

impl Source {
    pub(super) fn read(file: &Path) -> Result<Self, Fault> {
        Ok(Self { file: file.to_owned(), text: read_text(file)? })
    }

    /// The fault of a key, on its line.
    pub(super) fn fault(&self, key: &str, what: impl Into<String>) -> Fault {
        let line = self.text.lines().position(|line| !key.is_empty() && line.contains(key)).map(|index| index + 1);
        Fault::new(what, &self.file).on_line(line)
    }

    /// The fault of a number below a key that is not finite, on its line.
    pub(super) fn not_finite(&self, key: &str) -> Fault {
        let is_one = |word: &&str| {
            let plain = word.trim_matches(|sign: char| !sign.is_ascii_alphabetic()).to_lowercase();
            ["nan", "inf", "infinity"].contains(&plain.as_str())
        };
        let words = |line: &'_ str| -> Option<String> {
            let apart = |sign: char| sign.is_whitespace() || ",[]<>:".contains(sign);
            line.split(apart).find(is_one).map(str::to_owned)
        };
        let below = self.text.lines().enumerate().skip_while(|(_, line)| !line.contains(key));
        let (line, word) = below.filter_map(|(index, line)| Some((index + 1, words(line)?))).next().unzip();
        let fault = Fault::new(format!("`{key}` has a number that is not finite"), &self.file).on_line(line);
        fault.value(word.unwrap_or_default()).remedy("calibrate again: the calibration that wrote the file has failed")
    }

    /// The content as YAML, of which JSON is a part; `None` if it is not meant to be.
    pub(super) fn yaml(&self) -> Option<Result<Yaml, Fault>> {
        let is_one = self.file.extension().is_some_and(|end| ["yaml", "yml", "json"].iter().any(|known| end == *known));
        (is_one || self.text.starts_with("%YAML")).then(|| yaml::parse(&self.text, &self.file))
    }

    /// The numbers of a list below `key`.
    pub(super) fn numbers<const N: usize>(&self, key: &str, value: &Yaml) -> Result<[f64; N], Fault> {
        let numbers = self.list(key, value)?;
        let count = numbers.len();
        numbers
            .try_into()
            .map_err(|_| self.fault(key, format!("`{key}` has {count} numbers")).remedy(format!("give {N}")))
    }

    /// The numbers of a list of any length, or of the `data` of a matrix.
    pub(super) fn list(&self, key: &str, value: &Yaml) -> Result<Vec<f64>, Fault> {
        let list = if value["data"].is_badvalue() { value } else { &value["data"] };
        yaml::numbers(list)
            .ok_or_else(|| self.fault(key, format!("`{key}` is not a list of numbers")).remedy("give its numbers"))
    }
}

/// A camera from its matrix K (row by row).
///
/// A K of zeros is what drivers publish for a camera that nobody calibrated.
pub(super) fn camera(
    source: &Source,
    size: [u32; 2],
    k: &[f64; 9],
    model: Model,
    distortion: Vec<f64>,
) -> Result<CameraNumbers, Fault> {
    if k[0] == 0.0 && k[4] == 0.0 {
        let fault = source.fault("camera_matrix", "a camera that is not calibrated: K is zero");
        return Err(fault.remedy("calibrate it, and give the file that the calibration wrote"));
    }
    let [fx, skew, cx, zero, fy, cy, a, b, c] = *k;
    if [zero, a, b] != [0.0; 3] || c != 1.0 || skew.abs() > 1e-6 * fx.abs() {
        let fault = source.fault("", "a camera matrix that is not fx 0 cx, 0 fy cy, 0 0 1").value(format!("{k:?}"));
        return Err(fault.remedy("give it row by row, without skew"));
    }
    Ok(CameraNumbers { size, fx, fy, cx, cy, model, distortion, port: None })
}

/// The size of the images, from the file or as given.
pub(super) fn size(source: &Source, stated: Option<[f64; 2]>, given: Given) -> Result<[u32; 2], Fault> {
    let stated = stated.map(|[width, height]| [width as u32, height as u32]);
    stated.or(given.size).ok_or_else(|| {
        let fault = Fault::new("no size of the images", &source.file);
        fault.remedy("`seafix convert calibration FILE… --size WIDTHxHEIGHT --out dataset.toml` states it")
    })
}

/// The rows of a rigid motion of this rotation and translation.
pub(super) fn rows(rotation: &Matrix3<f64>, translation: &Vector3<f64>) -> [[f64; 4]; 4] {
    let mut matrix: Matrix4<f64> = rotation.to_homogeneous();
    matrix.fixed_view_mut::<3, 1>(0, 3).copy_from(translation);
    matrix.transpose().into()
}

/// The rotation nearest to a matrix whose digits were rounded; `None` if it is none.
pub(super) fn rotation(source: &Source, key: &str, m: &Matrix3<f64>) -> Result<Matrix3<f64>, Fault> {
    /// Six decimals in a calibration file.
    const ROUNDED: f64 = 1e-4;
    let off = (m.transpose() * m - Matrix3::identity()).amax();
    if off <= ROUNDED && m.determinant() < 0.0 {
        let fault = source.fault(key, format!("`{key}` is a reflection")).value("its determinant is -1");
        return Err(fault.remedy("give a rotation, of determinant 1: one axis, a row or a column, has the wrong sign"));
    }
    if !(off <= ROUNDED) {
        let fault = source.fault(key, format!("`{key}` is not a rotation")).value(format!("off by {off:.1e}"));
        return Err(fault.remedy("give the rotation of the right camera, 3×3"));
    }
    let mut turn = Rotation3::from_matrix_unchecked(*m);
    turn.renormalize();
    Ok(*turn.matrix())
}

/// The rotation of a quaternion w, x, y, z.
pub(super) fn turn([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)).to_rotation_matrix().into_inner()
}

/// The motion of 12 or 16 numbers, row by row; the other direction is its inverse.
pub(super) fn motion(source: &Source, key: &str, numbers: &[f64]) -> Result<(Matrix3<f64>, Vector3<f64>), Fault> {
    let &[a, b, c, x, d, e, f, y, g, h, i, z, ..] = numbers else {
        let fault = source.fault(key, format!("`{key}` has {} numbers", numbers.len()));
        return Err(fault.remedy("give a motion of 4×4 numbers, row by row"));
    };
    if numbers.len() != 12 && (numbers.len() != 16 || numbers[12..] != [0.0, 0.0, 0.0, 1.0]) {
        let fault = source.fault(key, format!("`{key}` is not a motion")).value(format!("{:?}", &numbers[12..]));
        return Err(fault.remedy("give 4×4 numbers row by row, the last row 0 0 0 1"));
    }
    Ok((rotation(source, key, &Matrix3::new(a, b, c, d, e, f, g, h, i))?, Vector3::new(x, y, z)))
}

/// The motion in the other direction.
pub(super) fn inverse((turn, step): (Matrix3<f64>, Vector3<f64>)) -> (Matrix3<f64>, Vector3<f64>) {
    (turn.transpose(), -(turn.transpose() * step))
}

/// The rotation of a rotation vector (rad).
pub(super) fn rodrigues(vector: [f64; 3]) -> Matrix3<f64> {
    Rotation3::from_scaled_axis(Vector3::from(vector)).into_inner()
}

/// The matrix of nine numbers, row by row.
pub(super) fn matrix(numbers: &[f64; 9]) -> Matrix3<f64> {
    Matrix3::from_row_slice(numbers)
}
