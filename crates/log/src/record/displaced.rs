//! The logged event of a displaced object.

/// The words between the object's name and the distance.
const BEFORE: &str = " is ";
/// The words after the distance.
const AFTER: &str = " m from its place in the survey";

/// The event of an object that was moved since the survey, by a distance in metres.
///
/// ```
/// use seafix_log::{displaced_event, displaced_object};
/// let event = displaced_event("tree-b", 0.4996);
/// assert_eq!(event, "tree-b is 0.500 m from its place in the survey");
/// assert_eq!(displaced_object(&event), Some("tree-b"));
/// assert_eq!(displaced_object("fix at tree-b accepted"), None);
/// ```
pub fn displaced_event(object: &str, metres: f64) -> String {
    format!("{object}{BEFORE}{metres:.3}{AFTER}")
}

/// The object of an event that [`displaced_event`] made; `None` for any other event.
pub fn displaced_object(event: &str) -> Option<&str> {
    let (object, metres) = event.strip_suffix(AFTER)?.rsplit_once(BEFORE)?;
    metres.parse::<f64>().is_ok().then_some(object)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_may_have_the_words_of_the_event() {
        let name = "what is 1.000 m from its place in the survey is";
        assert_eq!(displaced_object(&displaced_event(name, 0.1)), Some(name));
        let disputed = "a or b is 0.100 m from its place in the survey, a third object decides which";
        assert_eq!(displaced_object(disputed), None);
    }
}
