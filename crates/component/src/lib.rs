//! Components with a name, settings and a source, built from TOML.
//!
//! Every method that a researcher compares (a detector, a search, a solver) is a *component*: a struct whose fields are
//! its settings, constants that describe it, and a small object-safe trait with its function. One line adds it to its
//! [`Registry`]: [`entry!`]`(Kabsch)` in the list of its module. The registry makes it available to experiment files,
//! command-line listings and property tests.
//!
//! ```
//! use seafix_component::{Choice, Component, Registry, Settings, entry};
//! use serde::{Deserialize, Serialize};
//!
//! trait Greeting: Send + Sync + std::fmt::Debug {
//!     fn greet(&self) -> String;
//! }
//!
//! #[derive(Debug, Default, Serialize, Deserialize, Settings)]
//! #[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
//! struct Hello {
//!     /// Number of greetings.
//!     times: usize,
//! }
//!
//! impl Component for Hello {
//!     const NAME: &'static str = "hello";
//!     const SUMMARY: &'static str = "says hello";
//!     const SOURCE: &'static str = "common usage";
//! }
//!
//! impl Greeting for Hello {
//!     fn greet(&self) -> String {
//!         "hello ".repeat(self.times)
//!     }
//! }
//!
//! static GREETINGS: Registry<dyn Greeting> = Registry::new("greeting", &[entry!(Hello)]);
//!
//! let choice: Choice = toml::from_str("name = 'hello'\ntimes = 2").unwrap();
//! assert_eq!(GREETINGS.build(&choice).unwrap().greet(), "hello hello ");
//! let unknown = GREETINGS.build(&Choice::named("helo")).unwrap_err();
//! assert_eq!(unknown.to_string(), "no greeting is called `helo`, did you mean `hello`? There are hello");
//! ```

extern crate self as seafix_component; // for the paths of `#[derive(Settings)]`

mod binary;
mod border;
mod choice;
mod fault;
mod owned;
mod places;
mod registry;
mod settings;
mod suggest;
mod text;
mod words;

pub use border::{decoded, decoded_file, undecodable};
pub use choice::Choice;
pub use fault::{Fault, line_at, place_at};
pub use owned::{LOCK, MARKER, Marker, Ownership, PartialFile, create_real_folder, is_plain_name};
pub use places::{Part, Places, line_of, place_of};
pub use registry::{
    BuildError, Component, Components, Entry, Listing, Properties, Registry,
    added::{Added, Construct, NotAdded},
    each_invalid, in_range, inside, out_of_range, settings, take_out,
};
pub use seafix_derive::Settings;
pub use settings::{Bound, Chosen, Field, Form, Range, Refusals, Setting, Settings, SettingsError, SettingsTable};
pub use suggest::{nearest, unknown};
pub use text::{read_long_text, read_text};
pub use words::{counted, number, plain};
