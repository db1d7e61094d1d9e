//! The choice of the component for each stage of the front end.

use seafix_component::{BuildError, Choice, Registry};

use crate::{
    align::REFINEMENTS, describe::DESCRIPTORS, detect::DETECTORS, filter::FILTERS, front_end::FrontEnd,
    locate::LOCATORS, matching::MATCHERS, triangulate::TRIANGULATORS,
};

/// The chosen component of each stage; the fields have the names of the settings.
#[derive(Debug, Clone, Copy)]
pub struct StageChoices<'a> {
    /// The filters, applied to each image in order.
    pub filters: &'a [Choice],
    /// The detector.
    pub detector: &'a Choice,
    /// The locator.
    pub locator: &'a Choice,
    /// The descriptor.
    pub descriptor: &'a Choice,
    /// The matcher.
    pub matcher: &'a Choice,
    /// The refinement.
    pub refinement: &'a Choice,
    /// The triangulator.
    pub triangulator: &'a Choice,
}

/// A stage with an invalid choice.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{error}")]
pub struct InvalidStage {
    /// The stage's field of [`StageChoices`].
    pub stage: &'static str,
    /// The position of a filter in its list.
    pub place: Option<usize>,
    /// The cause.
    pub error: BuildError,
}

impl FrontEnd {
    /// The front end of these choices.
    ///
    /// # Errors
    /// [`InvalidStage`]: the first stage with an invalid choice.
    pub fn build(choices: &StageChoices<'_>) -> Result<Self, InvalidStage> {
        let filter = |(place, choice)| {
            FILTERS.build(choice).map_err(|error| InvalidStage { stage: "filters", place: Some(place), error })
        };
        Ok(Self {
            filters: choices.filters.iter().enumerate().map(filter).collect::<Result<_, _>>()?,
            detector: stage("detector", &DETECTORS, choices.detector)?,
            locator: stage("locator", &LOCATORS, choices.locator)?,
            descriptor: stage("descriptor", &DESCRIPTORS, choices.descriptor)?,
            matcher: stage("matcher", &MATCHERS, choices.matcher)?,
            refinement: stage("refinement", &REFINEMENTS, choices.refinement)?,
            triangulator: stage("triangulator", &TRIANGULATORS, choices.triangulator)?,
        })
    }
}

fn stage<T: ?Sized>(stage: &'static str, of: &Registry<T>, choice: &Choice) -> Result<Box<T>, InvalidStage> {
    of.build(choice).map_err(|error| InvalidStage { stage, place: None, error })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_invalid_stage_is_named_by_its_setting() {
        let filters = [Choice::named("clahe"), Choice::named("clahé")];
        let good = StageChoices {
            filters: &filters[..1],
            detector: &Choice::named("harris"),
            locator: &Choice::named("peak"),
            descriptor: &Choice::named("surf"),
            matcher: &Choice::named("epipolar-band"),
            refinement: &Choice::named("direct"),
            triangulator: &Choice::named("optimal"),
        };
        assert!(FrontEnd::build(&good).is_ok());
        let wrong = &Choice::named("nothing-of-this-name");
        let invalid = |choices| FrontEnd::build(&choices).map(|_| ()).unwrap_err();
        let reported = invalid(StageChoices { filters: &filters, ..good });
        assert_eq!((reported.stage, reported.place), ("filters", Some(1)));
        let each = [
            ("detector", StageChoices { detector: wrong, ..good }),
            ("locator", StageChoices { locator: wrong, ..good }),
            ("descriptor", StageChoices { descriptor: wrong, ..good }),
            ("matcher", StageChoices { matcher: wrong, ..good }),
            ("refinement", StageChoices { refinement: wrong, ..good }),
            ("triangulator", StageChoices { triangulator: wrong, ..good }),
        ];
        for (name, choices) in each {
            let reported = invalid(choices);
            assert_eq!((reported.stage, reported.place), (name, None));
            assert_eq!(reported.to_string(), reported.error.to_string());
        }
    }
}
