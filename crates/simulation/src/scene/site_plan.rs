//! Sites as data, read from their two files.

use std::path::{Path, PathBuf};

use seafix_component::{Fault, read_text};
use seafix_referencing::{Site, SiteObject};

use super::{check, plan::Geometry};

/// A site as data: its nominal description, and the bodies that carry its points.
#[derive(Debug, Clone, PartialEq)]
pub struct SitePlan {
    /// The site in the format `seafix-site/1`, without survey errors.
    pub site: Site,
    /// The bodies in the format `seafix-geometry/1`.
    pub geometry: Geometry,
    /// Models of objects that methods receive instead of surveyed ones, each with the ids of its object and of its points.
    /// A method receives the base of the model, and only its points.
    pub given: Vec<SiteObject>,
}

impl SitePlan {
    /// Parses the texts of both files.
    ///
    /// # Errors
    /// All faults of both.
    pub fn parse(site: (&str, &Path), geometry: (&str, &Path)) -> Result<Self, Vec<Fault>> {
        let described = Site::parse(site.0, site.1)?;
        let shape = Geometry::parse(geometry.0, geometry.1).map_err(|fault| vec![fault])?;
        let faults = check::faults(&shape, &described, geometry.0, geometry.1);
        if faults.is_empty() { Ok(Self { site: described, geometry: shape, given: Vec::new() }) } else { Err(faults) }
    }

    /// Reads `NAME.site.toml` and `NAME.geometry.toml`, given the path of the first.
    ///
    /// # Errors
    /// The files that cannot be read, or all faults in them.
    pub fn read(path: &Path) -> Result<Self, Vec<Fault>> {
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let Some(stem) = name.strip_suffix(".site.toml") else {
            let remedy = "give a file NAME.site.toml with NAME.geometry.toml beside it";
            return Err(vec![Fault::new("not the name of a site file", path).remedy(remedy)]);
        };
        let other: PathBuf = path.with_file_name(format!("{stem}.geometry.toml"));
        let read = |path: &Path| read_text(path).map_err(|fault| vec![fault]);
        Self::parse((&read(path)?, path), (&read(&other)?, &other))
    }

    /// The site with given models from these files.
    ///
    /// # Errors
    /// Files that are no sites, and objects or points that this site does not have.
    pub fn with_models(mut self, files: &[PathBuf]) -> Result<Self, Vec<Fault>> {
        for file in files {
            for given in Site::from_file(file)?.objects {
                let names = || self.site.objects.iter().map(|object| object.id.as_str());
                let Some(index) = names().position(|id| id == given.id) else {
                    let fault = Fault::new("a model of an object that the site does not have", file);
                    let remedy = format!("give one of {}", names().collect::<Vec<_>>().join(", "));
                    return Err(vec![fault.value(format!("`{}`", given.id)).remedy(remedy)]);
                };
                let object = &self.site.objects[index];
                if let Some(point) =
                    given.points.iter().find(|own| object.points.iter().all(|other| other.id != own.id))
                {
                    let fault =
                        Fault::new(format!("a model of `{}` with a point that the site does not have", given.id), file);
                    let names = object.points.iter().map(|point| point.id.as_str()).collect::<Vec<_>>().join(", ");
                    return Err(vec![fault.value(format!("`{}`", point.id)).remedy(format!("its points are {names}"))]);
                }
                self.given.push(given);
            }
        }
        Ok(self)
    }

    /// The given model of an object.
    pub(super) fn given(&self, object: &str) -> Option<&SiteObject> {
        self.given.iter().find(|given| given.id == object)
    }

    /// All faults of the geometry against the site; empty when a dive is possible.
    pub fn faults(&self) -> Vec<Fault> {
        check::faults(&self.geometry, &self.site, "", Path::new(&self.geometry.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        scene::{Changes, Scene, built_in},
        survey::SurveyErrors,
    };

    /// Fails if the model's own points, frame or uncertainty do not reach the method, or if the truth follows them.
    #[test]
    fn a_given_model_replaces_the_survey_and_not_the_truth() {
        let plain = built_in("drill-centre").expect("a built-in site");
        let mut given = plain.site.objects[1].clone();
        // One point is not in the model, another one is a millimetre off.
        let others: Vec<usize> = (0..given.points.len()).filter(|k| !given.base.contains(k)).collect();
        given.points[others[0]].at.coords.x += 1e-3;
        given.points.pop();
        assert!(others.len() >= 2 && others.contains(&given.points.len()), "the last point is none of the base");
        given.points.iter_mut().for_each(|point| point.sigma = 4e-4);
        (given.base_in_world, given.world_from_object, given.edges) = (None, None, Vec::new());
        let id = given.id.clone();
        let site = Site { name: id.clone(), frame: 0, objects: vec![given.clone()], warnings: Vec::new() };
        let folder = std::env::temp_dir().join(format!("seafix-given-model-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let file = folder.join("model.toml");
        std::fs::write(&file, site.to_toml()).unwrap();
        let plan = plain.clone().with_models(std::slice::from_ref(&file)).unwrap();

        let errors = SurveyErrors { model: 1e-3, survey: 0.0 };
        let scene = Scene::new(&plan, &Changes::default(), errors, 3);
        let (own, pose) = (&scene.nominal.objects[1], &scene.world_from_object[1]);
        assert_eq!(own.points.len(), given.points.len());
        for (k, (a, b)) in own.points.iter().zip(&given.points).enumerate() {
            assert!((a.sigma - 4e-4).abs() < 1e-12);
            let step = |points: &[seafix_referencing::ModelPoint]| points[k].at.distance(&points[0].at);
            assert!((step(&own.points) - step(&given.points)).abs() < 3e-6, "{}", a.id);
            let off = (*pose * a.at).coords - scene.objects[1].points[k].at;
            assert!(off.norm() < 1.1e-3, "{}: {off}", b.id);
            let normal = pose.rotation() * a.normal.expect("the true side");
            assert!(normal.angle(&scene.objects[1].points[k].normal.unwrap()) < 2e-3);
        }
        // Neither the bodies nor the centre that the route heads for depend on the model.
        let full = Scene::new(&plain, &Changes::default(), errors, 3);
        assert_eq!(scene.mesh.triangles.len(), full.mesh.triangles.len());
        assert_eq!(scene.objects[1].centroid(), full.objects[1].centroid());
        // The other objects have the survey that they had.
        assert_eq!(full.nominal.objects[0], scene.nominal.objects[0]);

        let message = |site: Site| {
            std::fs::write(&file, site.to_toml()).unwrap();
            plain.clone().with_models(std::slice::from_ref(&file)).unwrap_err()[0].to_string()
        };
        let mut strange = site.clone();
        strange.objects[0].id = "wreck".to_owned();
        assert!(message(strange).contains("a model of an object that the site does not have"));
        let mut strange = site;
        strange.objects[0].points[3].id = "Z9".to_owned();
        assert!(message(strange).contains("with a point that the site does not have"));
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
