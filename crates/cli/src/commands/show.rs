//! `seafix show`.

use seafix_component::unknown;

use crate::{
    catalogue::kinds,
    exit::{DONE, Ended, Failure, USAGE},
    terminal::print,
};

pub(crate) fn execute(name: &str) -> Ended {
    let kinds = kinds();
    // Several kinds may have one name: `surf` is a detector and a descriptor.
    let found: Vec<String> = kinds
        .iter()
        .flat_map(|kind| &kind.listings)
        .filter(|listing| listing.name == name)
        .map(|listing| {
            let settings = if listing.defaults.is_empty() {
                "# no settings\n".to_owned()
            } else {
                toml::to_string(&listing.defaults).expect("defaults are plain values")
            };
            let properties: String = listing.properties.iter().map(|(of, what)| format!("# {of}: {what}\n")).collect();
            format!(
                "# {} `{}`: {}\n# source: {}\n# version: {}\n{properties}name = \"{}\"\n{settings}",
                listing.kind, listing.name, listing.summary, listing.source, listing.version, listing.name
            )
        })
        .collect();
    if found.is_empty() {
        let names: Vec<&str> = kinds.iter().flat_map(|kind| &kind.listings).map(|listing| listing.name).collect();
        return Err(Failure::new(USAGE, format!("no component is called `{name}`{}", unknown(name, &names))));
    }
    print(&found.join("\n"))?;
    Ok(DONE)
}
