//! Marks of a simulated operator, from the truth of a dive.

use seafix_component::Fault;
use seafix_geometry::Pixel;
use seafix_simulation::{Purpose, Stream};

use crate::dataset::{Dataset, DatasetFrame};

/// An operator who marks each feature once, where it is well in view.
#[derive(Debug, Clone, Copy)]
pub struct SimulatedOperator {
    /// The standard deviation of a mark (px).
    pub error: f64,
    /// The seed of the marks.
    pub seed: u64,
}

/// The fraction of a feature's pairs, those nearest to the middle of the image, of which the operator takes one.
const CENTRAL: f64 = 1.0 / 3.0;

impl SimulatedOperator {
    /// The table of marks of an object: each point that a pair truly shows, in one pair.
    ///
    /// # Errors
    /// A data set without a site, a truth or a table of the visible points, or without this object.
    pub fn marks(&self, dataset: &Dataset, id: &str) -> Result<String, Fault> {
        let missing = |what: &str| {
            let fault = Fault::new(format!("no {what} for the marks of a simulated operator"), &dataset.folder);
            fault.remedy("give --marks, or the data set of a simulated dive")
        };
        let site = dataset.site.as_ref().ok_or_else(|| missing("site"))?;
        let object = site.object(id).ok_or_else(|| missing("object of this name").value(format!("`{id}`")))?;
        let displaced = dataset.objects.iter().find(|(name, _)| name == id).map(|(_, pose)| *pose);
        let world_from_object =
            displaced.or(object.world_from_object).ok_or_else(|| missing("place of the object in the world"))?;
        let mut text = "stamp_ns,id,left_u,left_v,right_u,right_v\n".to_owned();
        let mut count = 0;
        for (number, point) in object.points.iter().enumerate() {
            let mut stream = Stream::new(self.seed, 0, number as u64, Purpose::Marks);
            let seen = |frame: &DatasetFrame| {
                frame.visible.iter().find(|(object, name)| object == id && *name == point.id)?;
                let pixels = dataset.rig.project(&(frame.truth?.inverse() * (world_from_object * point.at)))?;
                Some((frame.stamp_ns, pixels.left))
            };
            let [u, v] = dataset.rig.left().principal();
            let mut pairs: Vec<(u64, Pixel)> = dataset.frames.iter().filter_map(seen).collect();
            pairs.sort_by(|a, b| a.1.distance(&Pixel { u, v }).total_cmp(&b.1.distance(&Pixel { u, v })));
            let central = (CENTRAL * pairs.len() as f64).ceil() as usize;
            if let Some((stamp, at)) = pairs.get(stream.below(central)) {
                let (u, v) = (at.u + self.error * stream.normal(), at.v + self.error * stream.normal());
                text += &format!("{stamp},{},{u:.2},{v:.2},,\n", point.id);
                count += 1;
            }
        }
        if count == 0 { Err(missing("visible points")) } else { Ok(text) }
    }
}
