//! `seafix-geometry/1`: what truly stands on the bed, as data.

use std::path::Path;

use seafix_component::{Fault, line_at};
use serde::{Deserialize, Serialize};

/// The format that is read and written.
pub const GEOMETRY_FORMAT: &str = "seafix-geometry/1";

/// Solid bodies, paint and materials of a site; each object's in the frame that its site file gives it.
///
/// Lengths are metres, angles degrees.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Geometry {
    /// `seafix-geometry/1`.
    pub format: String,
    /// Its name.
    pub name: String,
    /// The sea bed.
    #[serde(rename = "bed")]
    pub seabed: SeabedPlan,
    /// What surfaces are made of.
    #[serde(default, rename = "material")]
    pub materials: Vec<MaterialPlan>,
    /// The objects, by the ids of the site.
    #[serde(default, rename = "object")]
    pub objects: Vec<ObjectGeometry>,
}

/// The sea bed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct SeabedPlan {
    /// Depth of the mean bed below the world's origin.
    pub depth: f64,
    /// Scale of the relief: 0 is flat, 1 has waves of a few centimetres.
    pub relief: f64,
    /// Share of the light that it returns.
    pub albedo: f64,
    /// How it looks.
    pub texture: Texture,
    /// Rocks around each object.
    pub rocks: usize,
}

impl Default for SeabedPlan {
    fn default() -> Self {
        Self { depth: 40.0, relief: 1.0, albedo: 0.33, texture: Texture::Sand, rocks: 7 }
    }
}

/// How a surface looks up close.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Texture {
    /// One albedo.
    Plain,
    /// Sand with pebbles and shells.
    Sand,
    /// Coated steel with stains.
    Steel,
    /// Paint, worn.
    Paint,
    /// Rock.
    Rock,
    /// Soft growth.
    Growth,
    /// A rough floor: grain down to some millimetres, cracks of shade over metres.
    Concrete,
}

/// What a surface is made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MaterialPlan {
    /// Its name.
    pub name: String,
    /// Share of the light that it returns, 0 to 1. (Lambert.)
    pub albedo: f64,
    /// How it looks.
    pub texture: Texture,
}

/// The bodies of one object.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ObjectGeometry {
    /// Its id in the site.
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
    /// Chequered markings: corners that are no feature points.
    #[serde(default, rename = "chequer", skip_serializing_if = "Vec::is_empty")]
    pub chequers: Vec<ChequerBody>,
    /// Triangle meshes.
    #[serde(default, rename = "mesh", skip_serializing_if = "Vec::is_empty")]
    pub meshes: Vec<MeshBody>,
}

/// A box.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct BoxBody {
    /// Its centre.
    pub centre: [f64; 3],
    /// Its extents along its own axes.
    pub size: [f64; 3],
    /// Roll, pitch, yaw: R = Rz(yaw) Ry(pitch) Rx(roll), degrees.
    #[serde(default)]
    pub turn_deg: [f64; 3],
    /// Name of its material.
    pub material: String,
}

/// A cylinder with its two caps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct CylinderBody {
    /// One end of its axis.
    pub from: [f64; 3],
    /// The other end.
    pub to: [f64; 3],
    /// Its radius.
    pub radius: f64,
    /// Name of its material.
    pub material: String,
}

/// A flat, convex painted area; it is drawn upon the face in whose plane it lies.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct PanelBody {
    /// Its corners in order, anticlockwise seen from outside.
    pub outline: Vec<[f64; 3]>,
    /// Name of its material.
    pub material: String,
}

/// A chequered marking.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ChequerBody {
    /// Its first corner.
    pub corner: [f64; 3],
    /// From the first corner to the end of its first row of squares; `along` × `across` points outside.
    pub along: [f64; 3],
    /// From the first corner to the end of its first column of squares.
    pub across: [f64; 3],
    /// Squares along and across; those of an even sum are painted.
    pub cells: [u32; 2],
    /// Name of the painted squares' material.
    pub material: String,
}

/// A mesh of triangles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct MeshBody {
    /// Its vertices.
    pub vertices: Vec<[f64; 3]>,
    /// Triples of places in `vertices`, from 0, anticlockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
    /// Name of its material.
    pub material: String,
}

impl Geometry {
    /// Reads the file's text.
    ///
    /// # Errors
    /// What the TOML reader finds, or another format. What the numbers say is
    /// checked against a site.
    pub fn parse(text: &str, file: &Path) -> Result<Self, Fault> {
        let read: Self = toml::from_str(text).map_err(|error| Fault::in_toml(file, text, &error))?;
        if read.format != GEOMETRY_FORMAT {
            let line = text.find("format").map(|place| line_at(text, place));
            return Err(Fault::new("unknown format", file)
                .on_line(line)
                .value(format!("`{}`", read.format))
                .remedy(format!("this reader knows `{GEOMETRY_FORMAT}`")));
        }
        Ok(read)
    }

    /// The file's text.
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
