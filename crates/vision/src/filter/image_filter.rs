//! Filters of images.

use crate::{image::Image, workspace::Workspace};

/// A filter: prepares an image, for example by shading correction or noise reduction.
///
/// An image within 0 to 255 stays within that range. A finite image gives a finite one.
///
/// ```
/// use seafix_vision::{Filter, Image, Workspace};
///
/// /// The negative of an image.
/// #[derive(Debug)]
/// struct Negative;
///
/// impl Filter for Negative {
///     fn apply(&self, image: &mut Image, _: &mut Workspace) {
///         image.pixels_mut().iter_mut().for_each(|pixel| *pixel = 255.0 - *pixel);
///     }
/// }
///
/// let image = Image::new(3, 1, vec![0.0, 55.0, 255.0]).unwrap();
/// assert_eq!(Negative.filtered(&image).pixels(), [255.0, 200.0, 0.0]);
/// ```
pub trait Filter: Send + Sync + std::fmt::Debug {
    /// Filters the image in place.
    fn apply(&self, image: &mut Image, work: &mut Workspace);

    /// A filtered copy of the image.
    fn filtered(&self, image: &Image) -> Image {
        let mut copy = image.clone();
        self.apply(&mut copy, &mut Workspace::default());
        copy
    }
}
