//! The built-in sites.

use std::path::Path;

use super::site_plan::SitePlan;

/// Names and descriptions of the built-in sites.
pub const BUILT_IN: [(&str, &str); 2] = [
    ("drill-centre", "a virtual production system: seven objects, fifty feature points, 50 m across"),
    ("karmin2", "a laboratory: six boxes, forty-eight corners, one object"),
];

/// The built-in site of this name.
pub fn built_in(name: &str) -> Option<SitePlan> {
    let (site, geometry) = match name {
        "drill-centre" => {
            (include_str!("../../data/drill-centre.site.toml"), include_str!("../../data/drill-centre.geometry.toml"))
        }
        "karmin2" => (include_str!("../../data/karmin2.site.toml"), include_str!("../../data/karmin2.geometry.toml")),
        _ => return None,
    };
    let (site_file, geometry_file) = (Path::new("site.toml"), Path::new("geometry.toml"));
    Some(SitePlan::parse((site, site_file), (geometry, geometry_file)).expect("built-in sites are read by a test"))
}
