//! EuRoC lines: `nanoseconds, px, py, pz, qw, qx, qy, qz`, further columns left unread.

use std::path::Path;

use seafix_component::Fault;

use super::{Pose, Trajectory, lines, number, pose, quaternion};

pub(super) fn parse(text: &str, file: &Path) -> Result<Trajectory, Fault> {
    let (mut stamps, mut poses) = (Vec::<u64>::new(), Vec::new());
    for (line, text) in lines(text) {
        let fault =
            |what: &str, value: &str, remedy: &str| Fault::new(what, file).on_line(line).value(value).remedy(remedy);
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        if words.len() < 8 {
            let remedy = "an EuRoC line begins `nanoseconds, px, py, pz, qw, qx, qy, qz`";
            return Err(fault(&format!("{} columns", words.len()), text, remedy));
        }
        let stamp: u64 =
            words[0].parse().map_err(|_| fault("a stamp that is no time", words[0], "give whole nanoseconds"))?;
        if stamps.last().is_some_and(|&last| last >= stamp) {
            return Err(fault("a stamp that is not after the one before", words[0], "sort the lines by time"));
        }
        let mut numbers = [0.0; 7];
        for (number_, word) in numbers.iter_mut().zip(&words[1..]) {
            *number_ = number(word, file, line)?;
        }
        let [x, y, z, q @ ..] = numbers;
        poses.push(pose([x, y, z], q).map_err(|norm| {
            let remedy = "the order is qw qx qy qz";
            fault("a quaternion that is not of unit length", &format!("{norm:.6}"), remedy)
        })?);
        stamps.push(stamp);
    }
    Ok(Trajectory { stamps: Some(stamps), poses })
}

pub(super) fn print(trajectory: &Trajectory) -> String {
    let line = |(i, pose): (usize, &Pose)| {
        let (stamp, p, [w, x, y, z]) = (trajectory.stamp(i), pose.position, quaternion(pose));
        format!("{stamp},{},{},{},{w},{x},{y},{z}\n", p.x, p.y, p.z)
    };
    let lines: String = trajectory.poses.iter().enumerate().map(line).collect();
    "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w, q_x, q_y, q_z\n".to_owned() + &lines
}
