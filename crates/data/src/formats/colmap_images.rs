//! COLMAP's `images.txt`: `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, camera_from_world, and a line of points.

use std::path::Path;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use seafix_component::Fault;

use super::stamp::nanoseconds;

/// The pose of an image: world_from_camera, and the stamp if its name is one.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct ImagePose {
    pub(crate) line: usize,
    pub(crate) name: String,
    pub(crate) stamp_ns: Option<u64>,
    pub(crate) rotation: UnitQuaternion<f64>,
    pub(crate) position: Vector3<f64>,
}

/// Whether the lines are those of an `images.txt`.
pub(crate) fn is_one(lines: &[(usize, &str)]) -> bool {
    let comments = lines.iter().map(|(_, line)| *line).take_while(|line| line.starts_with('#'));
    let named = comments.clone().any(|line| line.contains("IMAGE_ID") && line.contains("QW"));
    let image = |line: &str| {
        let words: Vec<&str> = line.split_whitespace().collect();
        words.len() == 10
            && words[..9].iter().all(|word| word.parse::<f64>().is_ok())
            && words[9].parse::<f64>().is_err()
    };
    named
        || lines
            .iter()
            .find(|(_, line)| !line.is_empty() && !line.starts_with('#'))
            .is_some_and(|(_, line)| image(line))
}

/// The poses of the images, in order of their stamps, or of their names.
///
/// # Errors
/// The first line that is no image.
pub(crate) fn parse(lines: &[(usize, &str)], file: &Path) -> Result<Vec<ImagePose>, Fault> {
    let data: Vec<&(usize, &str)> = lines.iter().filter(|(_, line)| !line.starts_with('#')).collect();
    let start = data.iter().position(|(_, line)| !line.is_empty()).unwrap_or(data.len());
    let mut poses = Vec::new();
    // Every image is followed by the line of its points, which may be empty.
    for &&(line, text) in data[start..].iter().step_by(2).filter(|(_, text)| !text.is_empty()) {
        let fault = |what: &str| {
            let remedy = "an image is `IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME`, then a line of points";
            Fault::new(what, file).on_line(line).value(text).remedy(remedy)
        };
        let words: Vec<&str> = text.splitn(10, ' ').collect();
        let numbers: Option<Vec<f64>> =
            words.iter().take(9).map(|word| word.parse().ok().filter(|number: &f64| number.is_finite())).collect();
        let (Some(numbers), Some(name)) = (numbers, words.get(9)) else {
            return Err(fault("not the line of an image"));
        };
        let quaternion = Quaternion::new(numbers[1], numbers[2], numbers[3], numbers[4]);
        if (quaternion.norm() - 1.0).abs() > 1e-3 {
            return Err(fault("a quaternion that is not of unit length"));
        }
        let world_from_camera = UnitQuaternion::new_normalize(quaternion).inverse();
        let position = -(world_from_camera * Vector3::new(numbers[5], numbers[6], numbers[7]));
        poses.push(ImagePose {
            line,
            name: name.trim().to_owned(),
            stamp_ns: stamp(name.trim()),
            rotation: world_from_camera,
            position,
        });
    }
    if poses.iter().all(|pose| pose.stamp_ns.is_some()) {
        poses.sort_by_key(|pose| pose.stamp_ns);
    } else {
        poses.sort_by(|a, b| a.name.cmp(&b.name));
    }
    Ok(poses)
}

/// The stamp (ns) that an image's name is: nanoseconds of 16 digits or more, or seconds with nine decimals.
fn stamp(name: &str) -> Option<u64> {
    let file = name.rsplit(['/', '\\']).next()?;
    let stem = file.rsplit_once('.')?.0;
    match stem.bytes().all(|byte| byte.is_ascii_digit()) && stem.len() >= 16 {
        true => stem.parse().ok(),
        false => nanoseconds(stem).filter(|_| stem.contains('.')),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera at (1, 2, 3), turned by 90° about z, by hand: t = −R c with R = camera_from_world.
    #[test]
    fn an_image_is_inverted() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let text = format!(
            "# Image list\n#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n\
             2 {half} 0 0 {half} 2 -1 -3 1 cam0/1403636579863555584.png\n\n\
             1 1 0 0 0 0 0 0 1 cam0/1403636579763555584.png\n1 2 3\n"
        );
        let lines: Vec<(usize, &str)> = text.lines().enumerate().map(|(index, line)| (index + 1, line)).collect();
        assert!(is_one(&lines) && is_one(&lines[2..]));
        let poses = parse(&lines, Path::new("images.txt")).unwrap();
        assert_eq!(poses[0].stamp_ns, Some(1_403_636_579_763_555_584));
        assert!((poses[1].position - Vector3::new(1.0, 2.0, 3.0)).amax() < 1e-15, "{}", poses[1].position);
        assert_eq!(stamp("left000.png"), None);
    }
}
