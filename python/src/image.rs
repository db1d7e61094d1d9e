//! Images from arrays and files.

use std::path::PathBuf;

use numpy::{PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray};
use pyo3::prelude::*;
use seafix::vision::Image;
use seafix_io::{ImageLimits, image::image_of_samples, read_image};

use crate::{
    interpreter::detached,
    invalid::{in_file, invalid},
};

/// The two images of a pair, each of the size for which its camera is calibrated.
pub(crate) fn pair(left: &Bound<'_, PyAny>, right: &Bound<'_, PyAny>, rig: &seafix::Rig) -> PyResult<(Image, Image)> {
    let sizes = [rig.stereo.left().size(), rig.stereo.right().size()];
    Ok((image(left, "left", sizes[0], rig.bits)?, image(right, "right", sizes[1], rig.bits)?))
}

/// An image of any size from an array, with 16-bit levels from 0 to 65535.
pub(crate) fn single(given: &Bound<'_, PyAny>) -> PyResult<Image> {
    let shape: Option<Vec<u32>> = given.getattr_opt("shape")?.and_then(|shape| shape.extract().ok());
    match shape.as_deref() {
        Some(&[height, width] | &[height, width, 3]) => image(given, "image", [width, height], 16),
        _ => {
            let what = format!("the image is a {}", given.get_type().name()?);
            Err(invalid(given.py(), "image", what, "give an array (h, w), or (h, w, 3) of uint8"))
        }
    }
}

/// An image: the path of a file, a grey array (h, w) of uint8, uint16 or float32, or an array (h, w, 3) of uint8 in
/// OpenCV's order blue, green, red.
fn image(given: &Bound<'_, PyAny>, name: &str, size: [u32; 2], bits: u8) -> PyResult<Image> {
    let py = given.py();
    if let Ok(array) = given.cast::<PyArray2<u8>>() {
        // Levels of 8 bits are those of an image already.
        return levels(py, &array.readonly(), name, size, f32::from);
    }
    if let Ok(array) = given.cast::<PyArray2<f32>>() {
        let image = levels(py, &array.readonly(), name, size, |level| level)?;
        if image.pixels().iter().any(|level| !level.is_finite()) {
            let what = format!("the {name} image has a level that is not finite");
            return Err(invalid(py, name, what, "give grey levels, 0 black and 255 white"));
        }
        return Ok(image);
    }
    if let Ok(array) = given.cast::<PyArray2<u16>>() {
        let array = array.readonly();
        let view = array.as_array();
        check_size(py, name, [view.shape()[1], view.shape()[0]], size)?;
        let samples: Vec<u16> = view.iter().copied().collect();
        return sampled(py, &samples, name, size, ((1_u32 << bits) - 1) as u16);
    }
    if let Ok(array) = given.cast::<PyArray3<u8>>() {
        let array = array.readonly();
        let view = array.as_array();
        if view.shape()[2] == 3 {
            check_size(py, name, [view.shape()[1], view.shape()[0]], size)?;
            let pixels = view.rows().into_iter();
            let samples: Vec<u16> = pixels.flat_map(|bgr| [bgr[2], bgr[1], bgr[0]].map(u16::from)).collect();
            return sampled(py, &samples, name, size, 255);
        }
    }
    if let Ok(path) = given.extract::<PathBuf>() {
        let read = detached(py, || read_image(&path, size, bits, ImageLimits::default()))?;
        return read.map_err(|fault| in_file(py, &fault));
    }
    let what = format!("the {name} image is a {}", given.get_type().name()?);
    let remedy =
        "give a path, an array (h, w) of uint8, uint16 or float32, or (h, w, 3) of uint8 in the order of OpenCV";
    Err(invalid(py, name, what, remedy))
}

fn levels<T: numpy::Element + Copy>(
    py: Python<'_>,
    array: &PyReadonlyArray<'_, T, numpy::Ix2>,
    name: &str,
    size: [u32; 2],
    level: fn(T) -> f32,
) -> PyResult<Image> {
    let view = array.as_array();
    let found = [view.shape()[1], view.shape()[0]];
    check_size(py, name, found, size)?;
    let pixels = match view.to_slice() {
        Some(flat) => flat.iter().map(|&value| level(value)).collect(),
        None => view.iter().map(|&value| level(value)).collect(),
    };
    Image::new(found[0], found[1], pixels).map_err(|error| invalid(py, name, error, "give an image with pixels"))
}

fn sampled(py: Python<'_>, samples: &[u16], name: &str, size: [u32; 2], white: u16) -> PyResult<Image> {
    let image = image_of_samples(samples, size, white);
    image.map_err(|fault| {
        invalid(py, name, format!("the {name} image has {}: {}", fault.what, fault.value), fault.remedy)
    })
}

fn check_size(py: Python<'_>, name: &str, [width, height]: [usize; 2], expected: [u32; 2]) -> PyResult<()> {
    if [width, height] == expected.map(|size| size as usize) {
        return Ok(());
    }
    let [w, h] = expected;
    let what = format!("the {name} image has {width}×{height} px, and its camera is calibrated for {w}×{h}");
    Err(invalid(py, name, what, "scale the calibration or give the original image"))
}
