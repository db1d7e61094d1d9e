//! Navigation through a simulated dive, from fix to fix: `cargo run --release --example navigate`.

#![allow(clippy::print_stdout)]

use seafix::{Localizer, Navigation, Rig};
use seafix_component::Choice;
use seafix_data::source::SOURCES;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let choice = Choice::named("dive").with("frames", 4_i64);
    let source = SOURCES.build(&choice)?;
    let passage = source.open(7, ".".as_ref()).map_err(seafix::Error::from)?;

    let rig = Rig::from(*passage.rig());
    let localizer = Localizer::new(passage.site(), &rig)?;
    let helm = Navigation::default().build()?;
    let mut session = localizer.navigate(&helm, None)?;
    for index in 0..passage.frames() {
        let state = session.push(&passage.sight(index).map_err(seafix::Error::from)?)?;
        let sigma = state.pose.as_ref().map(|pose| 1e3 * pose.standing.covariance.position_sigma());
        println!("frame {index}: {}, position ± {sigma:.1?} mm", state.state);
        state.events.iter().for_each(|event| println!("    {event}"));
    }
    Ok(())
}
