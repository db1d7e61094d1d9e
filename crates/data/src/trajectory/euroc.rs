//! EuRoC lines: `nanoseconds, px, py, pz, qw, qx, qy, qz`; further columns are ignored. A header that names the columns
//! of the quaternion decides their order.

use std::path::Path;

use seafix_component::Fault;

use super::{BROKEN, Pose, Trajectory, holds_numbers, number, pose, quaternion};

/// The columns of qw, qx, qy, qz.
fn order(header: &str) -> Option<[usize; 4]> {
    let names = header.trim_start_matches('#').split(',').map(|name| name.split('[').next().unwrap_or_default().trim());
    let names: Vec<String> = names.map(str::to_ascii_lowercase).collect();
    let column = |axis: char| names.iter().position(|name| name.starts_with('q') && name.ends_with(axis));
    let found = [column('w')?, column('x')?, column('y')?, column('z')?];
    // The header may name the columns in any order.
    found.iter().all(|column| (4..8).contains(column)).then_some(found)
}

pub(super) fn parse(lines: &[(usize, &str)], file: &Path) -> Result<Trajectory, Fault> {
    let header = lines.iter().filter(|(_, line)| line.starts_with('#')).find_map(|(_, line)| order(line));
    let [w, x, y, z] = header.unwrap_or([4, 5, 6, 7]).map(|column| column - 4);
    let (mut stamps, mut poses) = (Vec::<u64>::new(), Vec::new());
    for &(line, text) in lines.iter().filter(|(_, line)| holds_numbers(line)) {
        let fault =
            |what: &str, value: &str, remedy: &str| Fault::new(what, file).on_line(line).value(value).remedy(remedy);
        let words: Vec<&str> = text.split(',').map(str::trim).collect();
        if words.len() < 8 {
            let remedy = "an EuRoC line begins `nanoseconds, px, py, pz, qw, qx, qy, qz`";
            return Err(fault(&format!("{} columns", words.len()), text, remedy));
        }
        let stamp: u64 = words[0].parse().map_err(|_| fault("an invalid stamp", words[0], "give whole nanoseconds"))?;
        if stamps.last().is_some_and(|&last| last >= stamp) {
            return Err(fault("a stamp not later than the previous one", words[0], "sort the lines by time"));
        }
        let mut numbers = [0.0; 7];
        for (number_, word) in numbers.iter_mut().zip(&words[1..]) {
            *number_ = number(word, file, line)?;
        }
        let [px, py, pz, q @ ..] = numbers;
        poses.push(pose([px, py, pz], [q[w], q[x], q[y], q[z]]).map_err(|norm| {
            let remedy = "the order is qw qx qy qz";
            fault("a quaternion that is not of unit length", &format!("{norm:.6}"), remedy)
        })?);
        stamps.push(stamp);
    }
    Ok(Trajectory { stamps: Some(stamps), poses, breaks: Vec::new() })
}

pub(super) fn print(trajectory: &Trajectory) -> String {
    let line = |(i, pose): (usize, &Pose)| {
        let (stamp, p, [w, x, y, z]) = (trajectory.stamp(i), pose.position, quaternion(pose));
        let broken = if trajectory.breaks.contains(&i) { format!("{BROKEN}\n") } else { String::new() };
        format!("{broken}{stamp},{},{},{},{w},{x},{y},{z}\n", p.x, p.y, p.z)
    };
    let lines: String = trajectory.poses.iter().enumerate().map(line).collect();
    "#timestamp [ns], p_x [m], p_y [m], p_z [m], q_w, q_x, q_y, q_z\n".to_owned() + &lines
}
