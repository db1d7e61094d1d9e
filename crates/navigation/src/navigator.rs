//! From fix to fix: where the vehicle is, how well that is known, and why.

use std::fmt;

use seafix_geometry::{Covariance6, Object, Transform, so3};

use crate::{
    Local, Navigated, Place,
    fusion::{Contradiction, Fusion},
    policy::{Policy, Situation},
};

/// What the navigated pose rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum State {
    /// On acoustics alone: no fix yet, or none that could be carried here.
    Rough,
    /// A fix is due and an object should be in view, but none has been taken.
    Searching,
    /// On a fix of this instant.
    Referenced,
    /// On a fix carried along by odometry.
    DeadReckoning,
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Rough => "rough",
            Self::Searching => "searching",
            Self::Referenced => "referenced",
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
    /// An object does not stand where the site says; from now on it stands where it was found.
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
    pub place: Place,
}

/// A change of state, for the log.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
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

/// Carries the last fix along, asks for the next, and joins it with what is known.
#[derive(Debug)]
pub struct Navigator<'a> {
    policy: &'a dyn Policy,
    fusion: &'a dyn Fusion,
    places: Vec<Place>,
    names: Vec<String>,
    known: Option<Navigated>,
    doubts: Vec<Option<Doubt>>,
    /// With how many other objects each has agreed.
    agreed: Vec<Vec<usize>>,
    state: State,
    seconds: f64,
    fixed_at: f64,
    metres: f64,
    changes: Vec<Change>,
}

impl<'a> Navigator<'a> {
    /// Begins without a fix, at a site with these objects.
    pub fn new(places: Vec<Place>, policy: &'a dyn Policy, fusion: &'a dyn Fusion) -> Self {
        let n = places.len();
        Self {
            policy,
            fusion,
            places,
            names: (0..n).map(|index| format!("object {index}")).collect(),
            known: None,
            doubts: vec![None; n],
            agreed: vec![Vec::new(); n],
            state: State::Rough,
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
    pub fn changes(&self) -> &[Change] {
        &self.changes
    }

    /// The camera relative to the object it was last fixed at; `None` while there is no fix.
    pub fn pose(&self) -> Option<&Navigated> {
        self.known.as_ref()
    }

    /// The camera relative to any object of the site, by the site model.
    pub fn pose_at(&self, object: usize) -> Option<Navigated> {
        self.known.as_ref().map(|known| known.passed_to(object, &self.places))
    }

    /// Where the objects stand, as far as is known by now.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// Some time and the motion in it; without a motion the last fix is not carried across.
    pub fn advance(&mut self, seconds: f64, motion: Option<&Local>) {
        self.seconds += seconds;
        let Some(motion) = motion else {
            self.known = None;
            self.doubts.fill(None);
            (self.fixed_at, self.metres) = (f64::NEG_INFINITY, f64::INFINITY);
            self.turn(State::Rough, "the motion is unknown: the last fix is not carried across".to_owned());
            return;
        };
        self.metres += motion.motion.translation().norm();
        if let Some(known) = &mut self.known {
            *known = known.after(motion);
            self.turn(State::DeadReckoning, "carried along by odometry".to_owned());
        }
        for doubt in self.doubts.iter_mut().flatten() {
            doubt.latest = doubt.latest.after(motion);
        }
    }

    /// Whether a fix should be tried now; `in_view` says whether an object should be seen.
    pub fn due(&mut self, in_view: bool) -> bool {
        let sigma = self.known.as_ref().map_or(f64::INFINITY, |known| {
            let position = known.standing.covariance.matrix.fixed_view::<3, 3>(3, 3).into_owned();
            position.symmetric_eigenvalues().max().max(0.0).sqrt()
        });
        let due =
            self.policy.due(&Situation { seconds: self.seconds - self.fixed_at, metres: self.metres, sigma, in_view });
        if due && in_view && self.state == State::Rough {
            self.turn(State::Searching, "a fix is due and an object should be in view".to_owned());
        }
        due
    }

    /// A fix of one of the objects at this instant.
    pub fn fix(&mut self, fix: &Navigated) -> Event {
        let object = fix.object;
        let Some(known) = self.known.clone() else {
            self.take(fix.clone(), format!("first fix, at {}", self.names[object]));
            return Event::Taken;
        };
        match self.fusion.take(&known.passed_to(object, &self.places).standing, &fix.standing) {
            Ok(pose) => {
                if object != known.object {
                    self.agree(object, known.object);
                    if !self.fusion.passes(&known.standing, &pose) {
                        self.doubts[object] = None;
                        return Event::Left;
                    }
                }
                self.doubts[object] = None;
                self.take(Navigated { object, standing: pose }, format!("fix at {}", self.names[object]));
                Event::Taken
            }
            Err(contradiction) => self.doubt(&known, fix, contradiction),
        }
    }

    /// A pose at this instant that rests on more than the fixes in a row: a key frame was found again, and the way closed
    /// over the graph. It is taken where it is better known than what there was, and `why` said.
    pub fn settle(&mut self, pose: &Navigated, why: String) -> bool {
        let better = self.known.as_ref().is_none_or(|known| {
            let known = known.passed_to(pose.object, &self.places).standing;
            pose.standing.covariance.position_sigma() < known.covariance.position_sigma()
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
            Some(doubt) if self.fusion.take(&doubt.latest.standing, &fix.standing).is_ok() => doubt.votes + 1,
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
        // Which of the two stands elsewhere? The one that no other object confirms.
        let (moved, seen, still, by) = if self.agreed[known.object].is_empty() && !self.agreed[object].is_empty() {
            (known.object, known, object, fix)
        } else {
            (object, fix, known.object, known)
        };
        let place = found(&self.places[still], by, seen);
        let old_from_new = self.places[moved].world_from_object.inverse() * place.world_from_object;
        self.places[moved] = place;
        self.agreed[moved].clear();
        self.agreed.iter_mut().for_each(|others| others.retain(|&other| other != moved));
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
        self.turn(State::Referenced, why);
    }

    fn turn(&mut self, to: State, why: String) {
        if self.state != to {
            self.changes.push(Change { seconds: self.seconds, from: self.state, to, why });
            self.state = to;
        }
    }
}

/// Where an object stands that is seen from the same camera as one whose place is known:
/// W_m = W_r T_r T_m⁻¹, erring by Ad(T_m T_r⁻¹) ω_r + Ad(T_m)(ξ_r − ξ_m) in its own frame.
fn found(place: &Place, by: &Navigated, seen: &Navigated) -> Place {
    let (t_r, t_m) = (by.standing.object_from_camera, seen.standing.object_from_camera);
    let across = (t_m * t_r.inverse()).adjoint();
    let own = t_m.adjoint();
    let covariance = across * place.covariance.matrix * across.transpose()
        + own * (by.standing.covariance.matrix + seen.standing.covariance.matrix) * own.transpose();
    Place {
        world_from_object: (place.world_from_object * t_r * t_m.inverse()).renormalized(),
        covariance: Covariance6::new(covariance),
    }
}
