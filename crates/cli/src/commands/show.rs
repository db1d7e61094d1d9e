//! `seafix show`.

use seafix_component::{Listing, unknown};

use crate::{
    catalogue::kinds,
    exit::{DONE, Ended, Failure, USAGE},
    settings::{Section, names, section, text},
    terminal::print,
};

pub(crate) fn execute(name: &str) -> Ended {
    let kinds = kinds();
    // Several kinds may have one name: `surf` is a detector and a descriptor.
    let components = kinds.iter().flat_map(|kind| &kind.listings).filter(|listing| listing.name == name).map(component);
    let found: Vec<String> = components.chain(section(name).map(table)).collect();
    if found.is_empty() {
        let tables = names();
        let components = kinds.iter().flat_map(|kind| &kind.listings).map(|listing| listing.name);
        let all: Vec<&str> = tables.iter().map(String::as_str).chain(components).collect();
        return Err(Failure::new(USAGE, format!("no component or table is called `{name}`{}", unknown(name, &all))));
    }
    print(&found.join("\n"))?;
    Ok(DONE)
}

fn component(listing: &Listing) -> String {
    let settings = listing.table.settings();
    let settings = if settings.is_empty() { "\n# no settings\n".to_owned() } else { text(&settings) };
    let properties: String = listing.properties.iter().map(|(of, what)| format!("# {of}: {what}\n")).collect();
    format!(
        "# {} `{}`: {}\n# source: {}\n# version: {}\n{properties}name = \"{}\"\n{settings}",
        listing.kind, listing.name, listing.summary, listing.source, listing.version, listing.name
    )
}

fn table(Section { about, settings, .. }: Section) -> String {
    format!("# {about}\n{}", text(&settings))
}
