//! The format `seafix-geometry/1`: true bodies on the seabed, as data.

use std::path::Path;

use seafix_component::{Fault, Settings, line_at};
use serde::{Deserialize, Serialize};

/// Name of the format.
pub const GEOMETRY_FORMAT: &str = "seafix-geometry/1";

/// Solid bodies, paint and materials of a site, each object's in the frame of its site file.
///
/// Lengths are in metres, angles in degrees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Geometry {
    /// Name of the format, `seafix-geometry/1`.
    pub format: String,
    /// Name of the site.
    pub name: String,
    /// The seabed.
    #[serde(rename = "bed")]
    pub seabed: SeabedPlan,
    /// Materials of the surfaces.
    #[serde(default, rename = "material")]
    pub materials: Vec<MaterialPlan>,
    /// The objects, identified by the ids of the site.
    #[serde(default, rename = "object")]
    pub objects: Vec<ObjectGeometry>,
}

/// The seabed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SeabedPlan {
    /// Depth of the mean seabed below the world's origin (m), from −100 000 to 100 000.
    pub depth: f64,
    /// Factor of the relief, from 0 to 3: 0 is flat, 1 has waves of a few centimetres.
    pub relief: f64,
    /// Albedo, from 0 to 1.
    pub albedo: f64,
    /// Texture.
    pub texture: Texture,
    /// Number of rocks around each object, at most 1000.
    pub rocks: usize,
}

impl Default for SeabedPlan {
    fn default() -> Self {
        Self { depth: 40.0, relief: 1.0, albedo: 0.33, texture: Texture::Sand, rocks: 7 }
    }
}

/// The texture of a surface.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, Settings)]
#[serde(rename_all = "kebab-case")]
pub enum Texture {
    /// Uniform albedo.
    Plain,
    /// Sand with pebbles and shells.
    Sand,
    /// Coated steel with stains.
    Steel,
    /// Worn paint.
    Paint,
    /// Rock.
    Rock,
    /// Soft marine growth.
    Growth,
    /// A rough floor: grain down to some millimetres, variations of shade over metres.
    Concrete,
}

/// A material, with Lambertian reflection.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MaterialPlan {
    /// Name, to which bodies refer.
    pub name: String,
    /// Albedo, from 0 to 1.
    pub albedo: f64,
    /// Texture.
    pub texture: Texture,
}

/// The bodies of one object.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ObjectGeometry {
    /// Id of the object in the site.
    pub id: String,
    /// Boxes.
    #[serde(default, rename = "box", skip_serializing_if = "Vec::is_empty")]
    pub boxes: Vec<BoxBody>,
    /// Cylinders: pipes, bars, valve heads.
    #[serde(default, rename = "cylinder", skip_serializing_if = "Vec::is_empty")]
    pub cylinders: Vec<CylinderBody>,
    /// Convex painted areas in the plane of a face.
    #[serde(default, rename = "panel", skip_serializing_if = "Vec::is_empty")]
    pub panels: Vec<PanelBody>,
    /// Chequered markings, whose corners are no feature points.
    #[serde(default, rename = "chequer", skip_serializing_if = "Vec::is_empty")]
    pub chequers: Vec<ChequerBody>,
    /// Triangle meshes.
    #[serde(default, rename = "mesh", skip_serializing_if = "Vec::is_empty")]
    pub meshes: Vec<MeshBody>,
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct BoxBody {
    /// Centre (m).
    pub centre: [f64; 3],
    /// Extents along the box's axes (m).
    pub size: [f64; 3],
    /// Roll, pitch, yaw (degrees): R = Rz(yaw) Ry(pitch) Rx(roll).
    #[serde(default)]
    pub turn_deg: [f64; 3],
    /// Name of the material.
    pub material: String,
}

/// A cylinder with its two caps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct CylinderBody {
    /// Start of the axis (m).
    pub from: [f64; 3],
    /// End of the axis (m).
    pub to: [f64; 3],
    /// Radius (m).
    pub radius: f64,
    /// Name of the material.
    pub material: String,
}

/// A flat, convex painted area, rendered upon the face in whose plane it lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PanelBody {
    /// Corners in order, anticlockwise seen from outside (m).
    pub outline: Vec<[f64; 3]>,
    /// Name of the material.
    pub material: String,
}

/// A chequered marking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ChequerBody {
    /// First corner (m).
    pub corner: [f64; 3],
    /// Vector from the first corner to the end of the first row of squares (m); `along` × `across` points outside.
    pub along: [f64; 3],
    /// Vector from the first corner to the end of the first column of squares (m).
    pub across: [f64; 3],
    /// Number of squares along and across; squares with an even sum of indices are painted.
    pub cells: [u32; 2],
    /// Name of the painted squares' material.
    pub material: String,
}

/// A mesh of triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, Settings)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MeshBody {
    /// Vertices (m).
    pub vertices: Vec<[f64; 3]>,
    /// Triples of vertex indices from 0, anticlockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
    /// Name of the material.
    pub material: String,
}

impl Geometry {
    /// Parses the text of the file.
    ///
    /// # Errors
    /// A TOML error or another format. Values are checked against a site later.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Fault> {
        let read: Self = toml::from_str(text).map_err(|error| Fault::in_toml(file, text, &error))?;
        if read.format != GEOMETRY_FORMAT {
            let line = text.find("format").map(|place| line_at(text, place));
            return Err(Fault::new("unknown format", file)
                .on_line(line)
                .value(format!("`{}`", read.format))
                .remedy(format!("give `{GEOMETRY_FORMAT}`")));
        }
        Ok(read)
    }

    /// The text of the file.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a geometry is made of tables, strings and numbers")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let geometry = Geometry {
            format: GEOMETRY_FORMAT.to_owned(),
            name: "one box".to_owned(),
            seabed: SeabedPlan::default(),
            materials: vec![MaterialPlan { name: "steel".to_owned(), albedo: 0.5, texture: Texture::Steel }],
            objects: vec![ObjectGeometry {
                id: "a".to_owned(),
                boxes: vec![BoxBody {
                    centre: [0.0; 3],
                    size: [1.0; 3],
                    turn_deg: [0.0, 0.0, 30.0],
                    material: "steel".to_owned(),
                }],
                ..ObjectGeometry::default()
            }],
        };
        let text = geometry.to_toml();
        assert_eq!(Geometry::parse(&text, Path::new("g.toml")).unwrap(), geometry);
        let other = text.replace("geometry/1", "geometry/9");
        assert!(Geometry::parse(&other, Path::new("g.toml")).unwrap_err().to_string().contains("g.toml:1"));
    }
}
