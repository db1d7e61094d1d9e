//! Conversion of navigation events to logged sentences.

use seafix::NavigationEvent;
use seafix_log::displaced_event;

/// The logged sentence of an event; readers of logs find displaced objects by [`seafix_log::displaced_object`].
pub(crate) fn logged(event: &NavigationEvent) -> String {
    match event {
        NavigationEvent::Displaced { object, metres } => displaced_event(object, *metres),
        event => event.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use seafix_log::displaced_object;

    use super::*;

    /// The logged sentence is the printed one, and a log is searched for this event alone.
    #[test]
    fn a_displaced_object_is_found_in_the_log() {
        let object = || "tree-b".to_owned();
        let displaced = NavigationEvent::Displaced { object: object(), metres: 0.4996 };
        assert_eq!(logged(&displaced), displaced.to_string());
        assert_eq!(displaced_object(&logged(&displaced)), Some("tree-b"));
        let others = [
            NavigationEvent::Disputed { objects: [object(), "pump".to_owned()], metres: 0.5 },
            NavigationEvent::FixTaken { object: object() },
            NavigationEvent::FixDoubted { object: object(), why: "0.5 m apart".to_owned() },
        ];
        for event in others {
            assert_eq!(displaced_object(&logged(&event)), None, "{event}");
        }
    }
}
