//! Comparison of a recording's schema with the supported definition.

use super::idl;

/// The supported types and their parts: name, then type and name of each field.
const KNOWN: [(&str, &[(&str, &str)]); 19] = [
    (
        "sensor_msgs/Image",
        &[
            ("Header", "header"),
            ("uint32", "height"),
            ("uint32", "width"),
            ("string", "encoding"),
            ("uint8", "is_bigendian"),
            ("uint32", "step"),
            ("uint8[]", "data"),
        ],
    ),
    ("sensor_msgs/CompressedImage", &[("Header", "header"), ("string", "format"), ("uint8[]", "data")]),
    (
        "sensor_msgs/CameraInfo",
        &[
            ("Header", "header"),
            ("uint32", "height"),
            ("uint32", "width"),
            ("string", "distortion_model"),
            ("float64[]", "d"),
            ("float64[9]", "k"),
            ("float64[9]", "r"),
            ("float64[12]", "p"),
            ("uint32", "binning_x"),
            ("uint32", "binning_y"),
            ("RegionOfInterest", "roi"),
        ],
    ),
    (
        "nav_msgs/Odometry",
        &[
            ("Header", "header"),
            ("string", "child_frame_id"),
            ("PoseWithCovariance", "pose"),
            ("TwistWithCovariance", "twist"),
        ],
    ),
    ("geometry_msgs/PoseStamped", &[("Header", "header"), ("Pose", "pose")]),
    ("geometry_msgs/PoseWithCovarianceStamped", &[("Header", "header"), ("PoseWithCovariance", "pose")]),
    ("tf2_msgs/TFMessage", &[("TransformStamped[]", "transforms")]),
    (
        "sensor_msgs/RegionOfInterest",
        &[
            ("uint32", "x_offset"),
            ("uint32", "y_offset"),
            ("uint32", "height"),
            ("uint32", "width"),
            ("bool", "do_rectify"),
        ],
    ),
    ("std_msgs/Header", &[("Time", "stamp"), ("string", "frame_id")]),
    ("builtin_interfaces/Time", &[("int32", "sec"), ("uint32", "nanosec")]),
    ("geometry_msgs/PoseWithCovariance", &[("Pose", "pose"), ("float64[36]", "covariance")]),
    ("geometry_msgs/TwistWithCovariance", &[("Twist", "twist"), ("float64[36]", "covariance")]),
    ("geometry_msgs/Pose", &[("Point", "position"), ("Quaternion", "orientation")]),
    ("geometry_msgs/Twist", &[("Vector3", "linear"), ("Vector3", "angular")]),
    ("geometry_msgs/Point", &[("float64", "x"), ("float64", "y"), ("float64", "z")]),
    ("geometry_msgs/Vector3", &[("float64", "x"), ("float64", "y"), ("float64", "z")]),
    ("geometry_msgs/Quaternion", &[("float64", "x"), ("float64", "y"), ("float64", "z"), ("float64", "w")]),
    (
        "geometry_msgs/TransformStamped",
        &[("Header", "header"), ("string", "child_frame_id"), ("Transform", "transform")],
    ),
    ("geometry_msgs/Transform", &[("Vector3", "translation"), ("Quaternion", "rotation")]),
];

/// The name of a type without the `msg` part: `sensor_msgs/msg/Image` is `sensor_msgs/Image`.
pub(crate) fn plain(name: &str) -> String {
    name.replace("::", "/").replace("/msg/", "/")
}

/// A type with its fields: type without package, and name.
pub(super) type Definition = (String, Vec<(String, String)>);

/// The first difference of a schema from the supported definition of type `name`; `None` if they agree or the schema is
/// empty. `encoding` is the language of the schema `definition`.
pub(crate) fn differs(name: &str, encoding: &str, definition: &str) -> Option<String> {
    let found = if encoding == "ros2idl" { idl::definitions(definition) } else { messages(name, definition) };
    found.iter().find_map(|(name, fields)| {
        let (_, known) = KNOWN.iter().find(|(known, _)| known == name)?;
        let count = fields.len().max(known.len());
        (0..count).find_map(|index| {
            let found = fields.get(index).map(|(kind, field)| format!("{kind} {field}"));
            let known = known.get(index).map(|(kind, field)| format!("{kind} {field}"));
            let message =
                |field: &Option<String>| field.as_deref().map_or("nothing".to_owned(), |field| format!("`{field}`"));
            // ROS 1 writes D, K, R and P, which the layout does not depend on.
            let same = |a: &String, b: &String| a.eq_ignore_ascii_case(b);
            let agree = match (&found, &known) {
                (Some(found), Some(known)) => same(found, known),
                (found, known) => found == known,
            };
            (!agree)
                .then(|| format!("field {} of {name} is {}, expected {}", index + 1, message(&found), message(&known)))
        })
    })
}

/// The types of a `ros2msg` schema: the first has its name, each other follows a line `MSG: package/Type`.
fn messages(name: &str, text: &str) -> Vec<Definition> {
    let mut all: Vec<Definition> = vec![(plain(name), Vec::new())];
    for line in text.lines() {
        let line = line.split('#').next().unwrap_or_default().trim();
        if let Some(name) = line.strip_prefix("MSG:") {
            all.push((plain(name.trim()), Vec::new()));
            continue;
        }
        let mut words = line.split_whitespace();
        let (Some(kind), Some(field)) = (words.next(), words.next()) else { continue };
        // A constant is not a field.
        if field.contains('=') || words.next().is_some_and(|word| word.starts_with('=')) || kind.starts_with("===") {
            continue;
        }
        let kind = plain(kind);
        let kind = kind.rsplit('/').next().unwrap_or(&kind).to_owned();
        let (_, fields) = all.last_mut().expect("the first is always there");
        fields.push((if kind == "byte" { "uint8".to_owned() } else { kind }, field.to_owned()));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    const IMAGE: &str = "# an image\nstd_msgs/Header header # Header timestamp\nuint32 height\nuint32 width\nstring encoding\n\
                         uint8 is_bigendian\nuint32 step\nuint8[] data\n\
                         ================================================================================\n\
                         MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n\
                         ================================================================================\n\
                         MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

    #[test]
    fn the_first_difference_is_named() {
        let of = |text: &str| differs("sensor_msgs/msg/Image", "ros2msg", text);
        assert_eq!(of(IMAGE), None);
        assert_eq!(
            of(&IMAGE.replace("uint32 width", "uint64 width")).unwrap(),
            "field 3 of sensor_msgs/Image is `uint64 width`, expected `uint32 width`"
        );
        assert_eq!(
            of(&IMAGE.replace("uint8[] data\n", "")).unwrap(),
            "field 7 of sensor_msgs/Image is nothing, expected `uint8[] data`"
        );
        assert!(of(&IMAGE.replace("uint32 nanosec", "uint32 nsec")).unwrap().contains("builtin_interfaces/Time"));
        assert_eq!(of(&IMAGE.replace("uint32 height", "uint32 Height")), None);
        assert_eq!(of(&IMAGE.replace("uint32 height", "uint8 MONO=1\nuint8 RGB = 2\nuint32 height")), None);
    }
}
