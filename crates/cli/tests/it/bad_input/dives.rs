//! Invalid settings of simulated dives.

use std::{fs, path::Path};

use super::{experiment, rejected};
use crate::program;

#[test]
fn dives_that_cannot_be() {
    // Line, place, value and remedy of each fault.
    let start = "question = 'why'\n[source]\nname = 'dive'\nframes = 2\nrate = 0.0\n";
    let waypoints = "[source.route]\nkind = 'waypoints'\n";
    for (text, parts) in [
        ("[source.water]\nattenuation = 1e9\n", ["e.toml:7", "water.attenuation = 1000000000", "from 0 to 20"]),
        ("route.speed = 0.0\n", ["e.toml:5", "rate = 0", "a route.speed above 0"]),
        ("rig.size = [0, 0]\n", ["e.toml:6", "rig.size = 0", "from 16 to 8192"]),
        ("[[source.lamps]]\n[[source.lamps]]\npower = -1.0\n", ["e.toml:8", "lamps[1].power = -1", "0 to 1000"]),
        (
            "[[source.lamps]]\nat = [0.0, 0.0, 3.2]\naim = [0.0, 0.0, 5.0]\n",
            ["lamp 0 comes within", "after 0.0 s", "north"],
        ),
        (
            "rig.focal = 300.0\nrig.focal-in = 'water'\nrig.port.kind = 'flat'\n",
            ["e.toml:6", "rig.focal = 300 (64.9 degrees)", "less than 48.3 degrees"],
        ),
        (
            "rig.distortion = [-5.0, 0.0, 0.0, 0.0]\n",
            ["e.toml:6", "no ray at pixel (0, 384)", "the middle of each side"],
        ),
        (
            &format!("clearance = 0.0\n{waypoints}waypoints = [[-23.1, -8.0, 0.7], [-23.1, -3.0, 0.7]]\n"),
            ["comes within 0 m of something near `tree-a`", "after 2.", "north -2"],
        ),
        (
            "[[source.faults]]\ndevice = 'images'\nkind = 'off'\nfrom = 3.0\nto = 1.0\n",
            ["e.toml:10:6", "faults[0].to = 1", "not before `from`"],
        ),
        ("current.speed = 3.0\n", ["off its route after 5.", "its thrusters do not hold it", "lower current.speed"]),
        (
            "rig.at = [0.0, 0.0, -10.0]\n",
            ["the vehicle comes within 0.3 m of something near `tree-a`", "after 0.0 s", "raise route.altitude"],
        ),
        (
            &format!("{waypoints}waypoints = [[0.0, 0.0, -4.0]]\n"),
            ["e.toml:8", "waypoints[0]", "height above the seabed"],
        ),
        ("site = 'm.site.toml'\n", ["m.geometry.toml:", "vertex 2 is [0.0, NaN, 0.0]", "give metres"]),
        ("site = 'z.site.toml'\n", ["z.geometry.toml:", "a triangle without area", "triangle 0 is [0, 1, 1]"]),
    ] {
        let (folder, file) = experiment(&format!("{start}{text}"));
        let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../simulation/data");
        let read = |name: &str| fs::read_to_string(data.join(name)).unwrap();
        for (name, third, last) in [("m", "nan", 2), ("z", "1.0", 1)] {
            let mesh = format!(
                "[[object.mesh]]\nvertices = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, {third}, 0.0]]\n\
                 triangles = [[0, 1, {last}]]\nmaterial = 'grey'\n"
            );
            fs::write(folder.path().join(format!("{name}.site.toml")), read("drill-centre.site.toml")).unwrap();
            let geometry = read("drill-centre.geometry.toml") + &mesh;
            fs::write(folder.path().join(format!("{name}.geometry.toml")), geometry).unwrap();
        }
        let out = folder.path().join("out");
        // The code is 2 for settings, 3 for a site or a route over it.
        let code = if parts[0].starts_with("e.toml") { 2 } else { 3 };
        rejected(&["dive", &file, "--out", out.to_str().unwrap()], code, &parts);
        assert!(!out.exists(), "{text}");
        if parts[0].contains("geometry") {
            let geometry = folder.path().join(parts[0].trim_end_matches(':'));
            let check = program().arg("check").arg(&geometry).output().unwrap();
            let said = String::from_utf8(check.stdout).unwrap();
            assert!(!check.status.success() && parts.iter().all(|part| said.contains(part)), "{said}");
        }
    }
}
