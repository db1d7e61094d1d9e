//! From fix to fix: where the vehicle is, how well that is known, and why.

use std::fmt;

use seafix_geometry::{Covariance6, Object, Transform, so3};

use crate::{
    Navigated, ObjectPlacement, RelativeMotion,
    fusion::{Contradiction, Fusion},
    policy::{Policy, Situation},
};

/// What the navigated pose rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// On acoustics alone: no fix yet, or none that could be carried here.
    Prior,
    /// A fix is due and an object should be in view, but none has been taken.
    Searching,
    /// On a fix of this instant.
    Fixed,
    /// On a fix carried along by odometry.
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

/// What a fix did.
#[derive(Debug, Clone, PartialEq)]
pub enum Event {
    /// It was taken.
    Taken,
    /// It is of another object, and so poor that the pose stays relative to the one before.
    Left,
    /// It contradicts what is known and waits for others that say the same.
    Doubted(Contradiction),
    /// It and those before it agree with each other and not with what was known of the same object.
    Relocated,
    /// It and those before it agree with each other, and not with another object: one of the two does not stand where the site
    /// says, and no third has told yet which. Neither is moved.
    Disputed {
        /// The two.
        objects: [usize; 2],
        /// How far the second stands from its place if the first stands right (m).
        metres: f64,
    },
    /// An object does not stand where the site says; from now on it stands where it was found. The fix is taken.
    Displaced(Box<Displacement>),
}

/// An object that stands elsewhere than was believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Displacement {
    /// Which, as its place in the site.
    pub object: usize,
    /// From where it was believed to stand to where it stands, in its own frame.
    pub old_from_new: Transform<Object, Object>,
    /// Where it stands.
    pub place: ObjectPlacement,
}

/// A change of state, for the log.
#[derive(Debug, Clone, PartialEq)]
pub struct StateChange {
    /// When (s since the navigator began).
    pub seconds: f64,
    /// The state before.
    pub from: State,
    /// The state after.
    pub to: State,
    /// Why.
    pub why: String,
}

/// So many fixes in a row must say the same before they overrule what was known.
const VOTES: usize = 3;

/// Fixes of one object that were doubted, the latest carried along by odometry.
#[derive(Debug, Clone)]
struct Doubt {
    latest: Navigated,
    votes: usize,
}

/// Two objects of which one stands elsewhere than was believed.
#[derive(Debug, Clone)]
struct Dispute {
    objects: [usize; 2],
    /// Where each stands if it is the one that was moved.
    moved: [ObjectPlacement; 2],
}

impl Dispute {
    fn is_of(&self, a: usize, b: usize) -> bool {
        self.objects == [a, b] || self.objects == [b, a]
    }

    /// Which of its two `object` is.
    fn side(&self, object: usize) -> Option<usize> {
        self.objects.iter().position(|&one| one == object)
    }
}

/// Carries the last fix along, asks for the next, and joins it with what is known.
#[derive(Debug, Clone)]
pub struct Navigator<'a> {
    policy: &'a dyn Policy,
    fusion: &'a dyn Fusion,
    places: Vec<ObjectPlacement>,
    names: Vec<String>,
    known: Option<Navigated>,
    doubts: Vec<Option<Doubt>>,
    /// With which other objects each has agreed.
    agreed: Vec<Vec<usize>>,
    disputes: Vec<Dispute>,
    state: State,
    seconds: f64,
    fixed_at: f64,
    metres: f64,
    changes: Vec<StateChange>,
}

impl<'a> Navigator<'a> {
    /// Begins without a fix, at a site with these objects.
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

    /// The same, its objects called by these names in what it says.
    #[must_use]
    pub fn with_names(mut self, names: Vec<String>) -> Self {
        self.names = names;
        self
    }

    /// What the pose rests on.
    pub fn state(&self) -> State {
        self.state
    }

    /// Every change of state so far, with its reason.
    pub fn changes(&self) -> &[StateChange] {
        &self.changes
    }

    /// The camera relative to the object it was last fixed at; `None` while there is no fix.
    pub fn pose(&self) -> Option<&Navigated> {
        self.known.as_ref()
    }

    /// The camera relative to any object of the site, by the site model; between two objects of which one was moved, by what
    /// was found of them.
    pub fn pose_at(&self, object: usize) -> Option<Navigated> {
        self.known.as_ref().map(|known| self.passed(known, object))
    }

    /// Whether it is open whether an object stands where the site says.
    pub fn is_disputed(&self, object: usize) -> bool {
        self.disputes.iter().any(|dispute| dispute.side(object).is_some())
    }

    /// Where the objects stand, as far as is known by now.
    pub fn places(&self) -> &[ObjectPlacement] {
        &self.places
    }

    /// Some time and the motion in it; without a motion the last fix is not carried across.
    pub fn advance(&mut self, seconds: f64, motion: Option<&RelativeMotion>) {
        self.seconds += seconds;
        let Some(motion) = motion else {
            self.known = None;
            self.doubts.fill(None);
            (self.fixed_at, self.metres) = (f64::NEG_INFINITY, f64::INFINITY);
            self.turn(State::Prior, "the motion is unknown: the last fix is not carried across".to_owned());
            return;
        };
        self.metres += motion.motion.translation().norm();
        if let Some(known) = &mut self.known {
            *known = known.after(motion);
            // Whether it still searches is told when the next fix is asked for.
            if self.state != State::Searching {
                self.turn(State::DeadReckoning, "carried along by odometry".to_owned());
            }
        }
        for doubt in self.doubts.iter_mut().flatten() {
            doubt.latest = doubt.latest.after(motion);
        }
    }

    /// Whether a fix should be tried now; `in_view` says whether an object should be seen. It searches from then on, until a
    /// fix is taken, none is due any more, or no object should be in view.
    pub fn due(&mut self, in_view: bool) -> bool {
        let due = self.is_due(0.0, in_view);
        if due && in_view {
            self.turn(State::Searching, "a fix is due and an object should be in view".to_owned());
        } else if self.state == State::Searching {
            let why = if due { "no object should be in view any more" } else { "no fix is due any more" };
            self.turn(self.carried(), why.to_owned());
        }
        due
    }

    /// An instant `seconds` after the last one whose images tell no motion: nothing is carried there, and nothing forgotten.
    /// Whether a fix would have been due.
    pub fn blind(&mut self, seconds: f64, in_view: bool) -> bool {
        let due = self.is_due(seconds, in_view);
        if self.state == State::Fixed || self.state == State::Searching && !(due && in_view) {
            self.turn(self.carried(), "no motion to this instant: the last pose waits for one".to_owned());
        }
        due
    }

    /// Without a fix of this instant, and without looking for one.
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

    /// A fix of one of the objects at this instant.
    pub fn fix(&mut self, fix: &Navigated) -> Event {
        let object = fix.object;
        let Some(known) = self.known.clone() else {
            self.take(fix.clone(), format!("first fix, at {}", self.names[object]));
            return Event::Taken;
        };
        if self.disputes.iter().any(|dispute| dispute.is_of(object, known.object)) {
            // Where each stands seen from the other is known, whichever was moved.
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
                        return Event::Left;
                    }
                }
                self.doubts[object] = None;
                self.take(Navigated { object, object_pose: pose }, format!("fix at {}", self.names[object]));
                Event::Taken
            }
            Err(contradiction) => self.doubt(&known, fix, contradiction),
        }
    }

    /// A pose at this instant that rests on more than the fixes in a row: a key frame was found again, and the way closed
    /// over the graph. It is taken where it is better known than what there was, and `why` said.
    pub fn settle(&mut self, pose: &Navigated, why: String) -> bool {
        let better = self.known.as_ref().is_none_or(|known| {
            let known = known.passed_to(pose.object, &self.places).object_pose;
            pose.object_pose.covariance.position_sigma() < known.covariance.position_sigma()
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
            let why = format!("{VOTES} fixes at {} agree with each other, not with what was known", self.names[object]);
            self.take(fix.clone(), why);
            return Event::Relocated;
        }
        // Where each stands if the other stands right.
        let moved = [found(&self.places[object], fix, known), found(&self.places[known.object], known, fix)];
        let others = |one: usize, other: usize| self.agreed[one].iter().any(|&third| third != other);
        match (others(known.object, object), others(object, known.object)) {
            (false, true) => self.displace(known.object, moved[0], fix),
            (true, false) => self.displace(object, moved[1], fix),
            // None other confirms just one of them: that the later was seen later says nothing.
            _ => {
                let metres = self.shift(object, &moved[1]).translation().norm();
                let objects = [known.object, object];
                self.disputes.retain(|dispute| !dispute.is_of(object, known.object));
                self.disputes.push(Dispute { objects, moved });
                for [one, other] in [objects, [objects[1], objects[0]]] {
                    self.agreed[one].retain(|&third| third != other);
                }
                let names = objects.map(|one| self.names[one].as_str());
                let why = format!("{} or {} stands {metres:.3} m from where it was surveyed", names[0], names[1]);
                self.take(fix.clone(), why);
                Event::Disputed { objects, metres }
            }
        }
    }

    /// Which object of an open dispute was moved, and where it stands: a fix passes between one of the two and a third, and it
    /// agrees with the survey of that one or with its having been moved, not with both.
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

    /// Whether a fix agrees with what is known, where an object stands elsewhere than was believed.
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

    /// What is known, relative to another object.
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

    /// From where an object was believed to stand to `place`, in its own frame.
    fn shift(&self, object: usize, place: &ObjectPlacement) -> Transform<Object, Object> {
        self.places[object].world_from_object.inverse() * place.world_from_object
    }

    /// An object stands elsewhere; the fix that told is taken.
    fn displace(&mut self, moved: usize, place: ObjectPlacement, fix: &Navigated) -> Event {
        let old_from_new = self.shift(moved, &place);
        self.places[moved] = place;
        self.agreed[moved].clear();
        self.agreed.iter_mut().for_each(|others| others.retain(|&other| other != moved));
        self.disputes.retain(|dispute| dispute.side(moved).is_none());
        let (shift, turn) = (old_from_new.translation().norm(), so3::angle(&old_from_new.rotation()).to_degrees());
        let name = &self.names[moved];
        self.take(fix.clone(), format!("{name} stands {shift:.3} m and {turn:.2}° from where it was surveyed"));
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

/// Where an object stands that is seen from the same camera as one whose place is known:
/// W_m = W_r T_r T_m⁻¹, erring by Ad(T_m T_r⁻¹) ω_r + Ad(T_m)(ξ_r − ξ_m) in its own frame.
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
