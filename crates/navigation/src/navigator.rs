//! Navigation from fix to fix: pose, covariance, and the reason of every change.

use std::fmt;

use seafix_geometry::{Covariance6, Object, Transform, so3};

use crate::{
    fusion::{Contradiction, Fusion},
    navigated::{Navigated, ObjectPlacement},
    odometry_trajectory::RelativeMotion,
    policy::{Policy, Situation},
};

/// The basis of the navigated pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// The prior pose alone: there is no fix yet, or the odometry has had a break since.
    Prior,
    /// A search: a fix is due and an object should be in view, but no fix has been accepted.
    Searching,
    /// A fix, or a recognised key frame, of this instant.
    Fixed,
    /// A fix propagated by odometry; at a skipped frame, to the last frame before it.
    DeadReckoning,
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Prior => "prior",
            Self::Searching => "searching",
            Self::Fixed => "fix",
            Self::DeadReckoning => "dead reckoning",
        })
    }
}

/// The effect of a fix.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// The fix was accepted.
    Taken,
    /// The fix is of another object and too inaccurate; the pose stays relative to the previous object.
    LessAccurate,
    /// The fix contradicts the navigated pose; it waits for further fixes that agree with it.
    Doubted(Contradiction),
    /// Several fixes agree with each other, but not with the known pose relative to their object; they replace it.
    Relocated,
    /// The fix and those before it agree with each other, but not with another object. One of the two objects is
    /// displaced, and no third object has shown which. Neither placement is changed.
    Disputed {
        /// The two objects.
        objects: [usize; 2],
        /// The displacement (m) of the second object if the first one is where it was surveyed.
        metres: f64,
    },
    /// An object is displaced: its placement in the site is replaced, and the fix is accepted.
    Displaced(Box<Displacement>),
}

/// A displaced object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Displacement {
    /// The object, as its index in the site.
    pub object: usize,
    /// The transform from the new to the old pose, in the object's own frame.
    pub old_from_new: Transform<Object, Object>,
    /// The new placement.
    pub place: ObjectPlacement,
}

/// A change of the navigation state, for the log.
#[derive(Debug, Clone, PartialEq)]
pub struct StateChange {
    /// Time of the change (s since the navigator began).
    pub seconds: f64,
    /// The previous state.
    pub from: State,
    /// The new state.
    pub to: State,
    /// The reason.
    pub why: String,
}

/// The number of consecutive fixes that must agree before they overrule the known pose.
const VOTES: usize = 3;

/// The fixes of one object that contradicted the known pose; the latest is propagated by odometry.
#[derive(Debug, Clone)]
struct Doubt {
    latest: Navigated,
    votes: usize,
}

/// Two objects of which one is displaced.
#[derive(Debug, Clone)]
struct Dispute {
    objects: [usize; 2],
    /// The placement of each object if that object is the displaced one.
    moved: [ObjectPlacement; 2],
}

impl Dispute {
    fn is_of(&self, a: usize, b: usize) -> bool {
        self.objects == [a, b] || self.objects == [b, a]
    }

    /// The position of `object` in the pair, 0 or 1.
    fn side(&self, object: usize) -> Option<usize> {
        self.objects.iter().position(|&one| one == object)
    }
}

/// A navigator: it propagates the last fix, requests the next one, and fuses it with the propagated pose.
#[derive(Debug, Clone)]
pub struct Navigator<'a> {
    policy: &'a dyn Policy,
    fusion: &'a dyn Fusion,
    places: Vec<ObjectPlacement>,
    names: Vec<String>,
    known: Option<Navigated>,
    doubts: Vec<Option<Doubt>>,
    /// For each object, the other objects that its fixes have agreed with.
    agreed: Vec<Vec<usize>>,
    disputes: Vec<Dispute>,
    state: State,
    seconds: f64,
    fixed_at: f64,
    metres: f64,
    changes: Vec<StateChange>,
}

impl<'a> Navigator<'a> {
    /// A navigator without a fix, at a site with objects at `places`.
    pub fn new(places: Vec<ObjectPlacement>, policy: &'a dyn Policy, fusion: &'a dyn Fusion) -> Self {
        let n = places.len();
        Self {
            policy,
            fusion,
            places,
            names: (0..n).map(|index| format!("object {index}")).collect(),
            known: None,
            doubts: vec![None; n],
            agreed: vec![Vec::new(); n],
            disputes: Vec::new(),
            state: State::Prior,
            seconds: 0.0,
            fixed_at: f64::NEG_INFINITY,
            metres: f64::INFINITY,
            changes: Vec::new(),
        }
    }

    /// The same navigator, with names of the objects for its messages.
    #[must_use]
    pub fn with_names(mut self, names: Vec<String>) -> Self {
        self.names = names;
        self
    }

    /// The basis of the current pose.
    pub fn state(&self) -> State {
        self.state
    }

    /// All changes of state since the start, with their reasons.
    pub fn changes(&self) -> &[StateChange] {
        &self.changes
    }

    /// The camera's pose relative to the object of the last fix; `None` without a fix.
    pub fn pose(&self) -> Option<&Navigated> {
        self.known.as_ref()
    }

    /// The camera's pose relative to any object of the site, by the site model.
    ///
    /// Between two disputed objects the estimated placement is used instead.
    pub fn pose_at(&self, object: usize) -> Option<Navigated> {
        self.known.as_ref().map(|known| self.passed(known, object))
    }

    /// Whether the placement of an object is disputed.
    pub fn is_disputed(&self, object: usize) -> bool {
        self.disputes.iter().any(|dispute| dispute.side(object).is_some())
    }

    /// The current placements of the objects.
    pub fn places(&self) -> &[ObjectPlacement] {
        &self.places
    }

    /// Propagates the pose by a motion over `seconds`; without a motion the last fix is dropped.
    pub fn advance(&mut self, seconds: f64, motion: Option<&RelativeMotion>) {
        self.seconds += seconds;
        let Some(motion) = motion else {
            self.known = None;
            self.doubts.fill(None);
            (self.fixed_at, self.metres) = (f64::NEG_INFINITY, f64::INFINITY);
            self.turn(State::Prior, "the motion is unknown: the last fix is dropped".to_owned());
            return;
        };
        self.metres += motion.motion.translation().norm();
        if let Some(known) = &mut self.known {
            *known = known.after(motion);
            // The next call of `due` decides whether the search continues.
            if self.state != State::Searching {
                self.turn(State::DeadReckoning, "propagated by odometry".to_owned());
            }
        }
        for doubt in self.doubts.iter_mut().flatten() {
            doubt.latest = doubt.latest.after(motion);
        }
    }

    /// Whether a fix should be tried now; `in_view`: an object should be visible.
    ///
    /// The state is `Searching` from then on, until a fix is accepted, none is due, or no object should be in view.
    pub fn due(&mut self, in_view: bool) -> bool {
        let due = self.is_due(0.0, in_view);
        if due && in_view {
            self.turn(State::Searching, "a fix is due and an object should be in view".to_owned());
        } else if self.state == State::Searching {
            let why = if due { "no object should be in view" } else { "no fix is due" };
            self.turn(self.carried(), why.to_owned());
        }
        due
    }

    /// Whether a fix would be due at a frame that the odometry skipped, `seconds` after its last motion.
    ///
    /// The pose is neither propagated nor dropped.
    pub fn due_without_motion(&mut self, seconds: f64, in_view: bool) -> bool {
        let due = self.is_due(seconds, in_view);
        if self.state == State::Fixed || self.state == State::Searching && !(due && in_view) {
            self.turn(self.carried(), "no motion to this instant: the last pose is kept".to_owned());
        }
        due
    }

    /// The state without a fix of this instant and without a search.
    fn carried(&self) -> State {
        if self.known.is_some() { State::DeadReckoning } else { State::Prior }
    }

    /// Whether a fix is due `ahead` seconds from now.
    fn is_due(&self, ahead: f64, in_view: bool) -> bool {
        let sigma = self.known.as_ref().map_or(f64::INFINITY, |known| {
            let position = known.object_pose.covariance.matrix.fixed_view::<3, 3>(3, 3).into_owned();
            position.symmetric_eigenvalues().max().max(0.0).sqrt()
        });
        let seconds = self.seconds - self.fixed_at + ahead;
        self.policy.due(&Situation { seconds, metres: self.metres, sigma, in_view })
    }

    /// Takes a fix of one of the objects at this instant.
    pub fn fix(&mut self, fix: &Navigated) -> Event {
        let object = fix.object;
        let Some(known) = self.known.clone() else {
            self.take(fix.clone(), format!("first fix at {}", self.names[object]));
            return Event::Taken;
        };
        if self.disputes.iter().any(|dispute| dispute.is_of(object, known.object)) {
            // The relative placement of a disputed pair is known, whichever of the two is displaced.
            return match self.agrees(&known, fix, None) {
                Ok(()) => {
                    self.doubts[object] = None;
                    self.take(fix.clone(), format!("fix at {}", self.names[object]));
                    Event::Taken
                }
                Err(contradiction) => self.doubt(&known, fix, contradiction),
            };
        }
        if let Some((moved, place)) = self.verdict(&known, fix) {
            self.doubts[object] = None;
            return self.displace(moved, place, fix);
        }
        match self.fusion.take(&known.passed_to(object, &self.places).object_pose, &fix.object_pose) {
            Ok(pose) => {
                if object != known.object {
                    self.agree(object, known.object);
                    if !self.fusion.passes(&known.object_pose, &pose) {
                        self.doubts[object] = None;
                        return Event::LessAccurate;
                    }
                }
                self.doubts[object] = None;
                self.take(Navigated { object, object_pose: pose }, format!("fix at {}", self.names[object]));
                Event::Taken
            }
            Err(contradiction) => self.doubt(&known, fix, contradiction),
        }
    }

    /// Takes a pose at this instant that results from a closed loop of the pose graph.
    ///
    /// It is accepted if its covariance is smaller than that of the known pose; `why` is the logged reason.
    pub fn settle(&mut self, pose: &Navigated, why: String) -> bool {
        let better = self.known.as_ref().is_none_or(|known| {
            let known = known.passed_to(pose.object, &self.places).object_pose;
            pose.object_pose.covariance.position_rms() < known.covariance.position_rms()
        });
        if better {
            self.doubts.fill(None);
            self.take(pose.clone(), why);
        }
        better
    }

    fn doubt(&mut self, known: &Navigated, fix: &Navigated, contradiction: Contradiction) -> Event {
        let object = fix.object;
        let votes = match self.doubts[object].take() {
            Some(doubt) if self.fusion.take(&doubt.latest.object_pose, &fix.object_pose).is_ok() => doubt.votes + 1,
            _ => 1,
        };
        if votes < VOTES {
            self.doubts[object] = Some(Doubt { latest: fix.clone(), votes });
            return Event::Doubted(contradiction);
        }
        if object == known.object {
            let why =
                format!("{VOTES} fixes at {} agree with each other and contradict the known pose", self.names[object]);
            self.take(fix.clone(), why);
            return Event::Relocated;
        }
        // The placement of each object if the other one is where it was surveyed.
        let moved = [found(&self.places[object], fix, known), found(&self.places[known.object], known, fix)];
        let others = |one: usize, other: usize| self.agreed[one].iter().any(|&third| third != other);
        match (others(known.object, object), others(object, known.object)) {
            (false, true) => self.displace(known.object, moved[0], fix),
            (true, false) => self.displace(object, moved[1], fix),
            // No other object confirms exactly one of them; the order of the fixes is no evidence.
            _ => {
                let metres = self.shift(object, &moved[1]).translation().norm();
                let objects = [known.object, object];
                self.disputes.retain(|dispute| !dispute.is_of(object, known.object));
                self.disputes.push(Dispute { objects, moved });
                for [one, other] in [objects, [objects[1], objects[0]]] {
                    self.agreed[one].retain(|&third| third != other);
                }
                let names = objects.map(|one| self.names[one].as_str());
                let why = format!("{} or {} stands {metres:.3} m from its surveyed position", names[0], names[1]);
                self.take(fix.clone(), why);
                Event::Disputed { objects, metres }
            }
        }
    }

    /// The displaced object of an open dispute, and its placement.
    ///
    /// The dispute is decided by a fix between one of the two objects and a third. It must agree with exactly one of
    /// two hypotheses: the object is where it was surveyed, or it is displaced.
    fn verdict(&self, known: &Navigated, fix: &Navigated) -> Option<(usize, ObjectPlacement)> {
        self.disputes.iter().find_map(|dispute| {
            let side = match (dispute.side(known.object), dispute.side(fix.object)) {
                (Some(side), None) | (None, Some(side)) => side,
                _ => return None,
            };
            let suspect = dispute.objects[side];
            let as_surveyed = self.agrees(known, fix, None).is_ok();
            let as_moved = self.agrees(known, fix, Some((suspect, dispute.moved[side]))).is_ok();
            match (as_surveyed, as_moved) {
                (true, false) => Some((dispute.objects[1 - side], dispute.moved[1 - side])),
                (false, true) => Some((suspect, dispute.moved[side])),
                _ => None,
            }
        })
    }

    /// Whether a fix agrees with the known pose, optionally with one object displaced.
    fn agrees(
        &self,
        known: &Navigated,
        fix: &Navigated,
        moved: Option<(usize, ObjectPlacement)>,
    ) -> Result<(), Contradiction> {
        let passed = match moved {
            None => self.passed(known, fix.object),
            Some((object, place)) => {
                let mut places = self.places.clone();
                places[object] = place;
                known.passed_to(fix.object, &places)
            }
        };
        self.fusion.take(&passed.object_pose, &fix.object_pose).map(drop)
    }

    /// The known pose relative to another object.
    fn passed(&self, known: &Navigated, object: usize) -> Navigated {
        let Some(dispute) = self.disputes.iter().find(|dispute| dispute.is_of(object, known.object)) else {
            return known.passed_to(object, &self.places);
        };
        let mut places = self.places.clone();
        if let Some(side) = dispute.side(object) {
            places[object] = dispute.moved[side];
        }
        known.passed_to(object, &places)
    }

    /// The transform from the new placement of an object to the known one, in its own frame.
    fn shift(&self, object: usize, place: &ObjectPlacement) -> Transform<Object, Object> {
        self.places[object].world_from_object.inverse() * place.world_from_object
    }

    /// Replaces the placement of a displaced object and accepts the fix.
    fn displace(&mut self, moved: usize, place: ObjectPlacement, fix: &Navigated) -> Event {
        let old_from_new = self.shift(moved, &place);
        self.places[moved] = place;
        self.agreed[moved].clear();
        self.agreed.iter_mut().for_each(|others| others.retain(|&other| other != moved));
        self.disputes.retain(|dispute| dispute.side(moved).is_none());
        let (shift, turn) = (old_from_new.translation().norm(), so3::angle(&old_from_new.rotation()).to_degrees());
        let name = &self.names[moved];
        self.take(fix.clone(), format!("{name} stands {shift:.3} m and {turn:.2}° from its surveyed pose"));
        Event::Displaced(Box::new(Displacement { object: moved, old_from_new, place }))
    }

    fn agree(&mut self, a: usize, b: usize) {
        for (one, other) in [(a, b), (b, a)] {
            if !self.agreed[one].contains(&other) {
                self.agreed[one].push(other);
            }
        }
    }

    fn take(&mut self, pose: Navigated, why: String) {
        self.known = Some(pose);
        (self.fixed_at, self.metres) = (self.seconds, 0.0);
        self.turn(State::Fixed, why);
    }

    fn turn(&mut self, to: State, why: String) {
        if self.state != to {
            self.changes.push(StateChange { seconds: self.seconds, from: self.state, to, why });
            self.state = to;
        }
    }
}

/// The placement of an object seen by the same camera as an object with a known placement.
///
/// W_m = W_r T_r T_m⁻¹; its error in its own frame is Ad(T_m T_r⁻¹) ω_r + Ad(T_m)(ξ_r − ξ_m).
fn found(place: &ObjectPlacement, by: &Navigated, seen: &Navigated) -> ObjectPlacement {
    let (t_r, t_m) = (by.object_pose.object_from_camera, seen.object_pose.object_from_camera);
    let across = (t_m * t_r.inverse()).adjoint();
    let own = t_m.adjoint();
    let covariance = across * place.covariance.matrix * across.transpose()
        + own * (by.object_pose.covariance.matrix + seen.object_pose.covariance.matrix) * own.transpose();
    ObjectPlacement {
        world_from_object: (place.world_from_object * t_r * t_m.inverse()).renormalized(),
        covariance: Covariance6::new(covariance),
    }
}
