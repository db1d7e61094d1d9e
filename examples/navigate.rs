//! Navigation through a simulated dive, from fix to fix: `cargo run --release --example navigate`.

#![allow(clippy::print_stdout)]

use seafix::{Localizer, Navigation, Rig, component::Choice};
use seafix_data::source::SOURCES;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let choice = Choice::named("dive").with("frames", 4_i64);
    let source = SOURCES.build(&choice)?;
    let sequence = source.open(7, ".".as_ref()).map_err(seafix::Error::from)?;

    let rig = Rig { body_from_camera: sequence.body_from_camera(), ..Rig::from(*sequence.rig()) };
    let localizer = Localizer::new(sequence.site(), &rig)?;
    let navigation_stack = Navigation::default().build()?;
    let mut session = localizer.navigate(&navigation_stack, None)?;
    for index in 0..sequence.frames() {
        let state = session.push(&sequence.sensor_frame(index).map_err(seafix::Error::from)?)?;
        let sigma = state.pose.as_ref().map(|pose| 1e3 * pose.object_pose.covariance.position_sigma());
        println!("frame {index}: {}, position ± {sigma:.1?} mm", state.state);
        state.events.iter().for_each(|event| println!("    {event}"));
    }
    Ok(())
}
