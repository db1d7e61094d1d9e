//! A navigator with little to tell: a few events, and what each must do, in whole numbers.
//!
//! Fixes are exact or off by whole multiples of one shift of the world, so that two agree where their numbers are equal and
//! contradict each other by far where they are not. What the navigator must then know is a matter of whole numbers, written here anew.

use std::sync::Mutex;

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Covariance6, Object, Transform, World};
use seafix_navigation::{
    ConsiderStates, Event, Navigated, Navigator, ObjectPlacement, ObjectPose, Policy, RelativeMotion, Sensitivity,
    Situation, State,
};

/// What can happen to a navigator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Happening {
    /// A second passes, and odometry tells the motion.
    Step,
    /// A second passes, and odometry does not tell that the camera stood still.
    Lost,
    /// A fix of this kind comes.
    Fix(Kind),
    /// The navigator is asked whether a fix is due, an object being in view or not.
    Due(bool),
    /// Half a second passes at whose end images tell no motion.
    Blind(bool),
    /// A pose by a key frame that was found again; one that is well known, or not.
    Settle(bool),
}

/// Fixes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A right one of the first object.
    Right,
    /// A wrong one of it, always the same.
    Wrong,
    /// Another wrong one of it.
    Otherwise,
    /// A right one of the second object, which does not stand where the site says.
    Moved,
    /// A right one of the third object.
    Third,
    /// A right one of the third object, of which little is seen.
    Imprecise,
}

impl Kind {
    /// Its object, and how many shifts the camera is off that one has who believes the fix and the survey.
    fn states(self) -> (usize, i32) {
        match self {
            Self::Right => (0, 0),
            Self::Wrong => (0, 1),
            Self::Otherwise => (0, 3),
            Self::Moved => (1, -DISPLACED),
            Self::Third | Self::Imprecise => (2, 0),
        }
    }
}

/// How many objects there are.
pub const OBJECTS: usize = 3;
/// How many shifts the second object stands from where it was surveyed.
pub const DISPLACED: i32 = 2;
/// The age (s) at which a fix is due.
pub const INTERVAL: f64 = 1.75;
/// So many fixes in a row overrule what was known.
const VOTES: usize = 3;

/// A policy by age that remembers what it was told.
#[derive(Debug, Default)]
pub struct Listener(Mutex<Option<Situation>>);

impl Policy for Listener {
    fn due(&self, situation: &Situation) -> bool {
        *self.0.lock().expect("no thread died") = Some(*situation);
        situation.seconds >= INTERVAL
    }
}

impl Listener {
    /// What it was told since this was asked last.
    pub fn reported(&self) -> Option<Situation> {
        self.0.lock().expect("no thread died").take()
    }
}

/// Where objects and camera are.
#[derive(Debug)]
pub struct Site {
    /// Where the survey has the objects.
    pub surveyed: Vec<ObjectPlacement>,
    /// What odometry says of each second.
    pub step: RelativeMotion,
    /// Where the camera is after so many steps.
    cameras: Vec<Transform<World, Camera>>,
}

/// One shift of the world (m).
const SHIFT: [f64; 3] = [2.0, -1.0, 1.5];
/// Standard deviation of the position of a fix (m), that of a glimpse, and of a surveyed place.
const FIX: f64 = 0.005;
const IMPRECISE: f64 = 0.05;
const SURVEY: f64 = 0.02;
/// The part of a fix's that all of its object have in common.
const MODEL: f64 = 0.0045;
/// That of a settled pose that is well known, and of one that is not.
const SETTLED: f64 = 0.004;
const HARDLY: f64 = 1.0;

impl Site {
    /// A site, and a way of so many steps through it.
    pub fn new(steps: usize) -> Self {
        let place = |xi: [f64; 6]| ObjectPlacement {
            world_from_object: Transform::exp(&xi.into()),
            covariance: Covariance6::isotropic(1e-4, SURVEY),
        };
        let surveyed = vec![
            place([0.1, 0.2, -0.4, 3.0, 1.0, 5.0]),
            place([-0.3, 0.1, 0.9, -2.0, 3.0, 4.0]),
            place([0.5, -0.2, 2.0, 1.0, -4.0, 6.0]),
        ];
        let step = RelativeMotion::new(
            Transform::exp(&[0.02, -0.03, 0.05, 0.3, 0.1, -0.05].into()),
            Covariance6::isotropic(1e-4, 1e-3),
        );
        let first = Transform::<World, Camera>::exp(&[0.3, -0.1, 0.2, 0.5, -0.5, 1.0].into());
        let ahead = |at: &Transform<World, Camera>| Some((*at * step.motion).renormalized());
        let cameras = std::iter::successors(Some(first), ahead).take(steps + 1).collect();
        Self { surveyed, step, cameras }
    }

    /// The place of an object, so many shifts from where it was surveyed.
    pub fn place(&self, object: usize, shifts: i32) -> Transform<World, Object> {
        shifted(shifts) * self.surveyed[object].world_from_object
    }

    /// The camera after so many steps relative to an object, so many shifts off by the survey.
    pub fn camera(&self, object: usize, steps: usize, shifts: i32) -> Transform<Object, Camera> {
        self.surveyed[object].world_from_object.inverse() * shifted(shifts) * self.cameras[steps]
    }

    fn fix(&self, kind: Kind, steps: usize) -> Navigated {
        let (object, shifts) = kind.states();
        let sigma = if kind == Kind::Imprecise { IMPRECISE } else { FIX };
        let mut fraction = Sensitivity::zeros();
        fraction.fixed_view_mut::<3, 3>(3, 0).copy_from(&(Matrix3::identity() * MODEL));
        let object_pose = ObjectPose::new(self.camera(object, steps, shifts), Covariance6::isotropic(1e-3, sigma))
            .with_consider_states(ConsiderStates::of_model(object, [(0, fraction)]));
        Navigated { object, object_pose }
    }

    fn settled(&self, steps: usize, well: bool) -> Navigated {
        Navigated { object: 0, object_pose: ObjectPose::new(self.camera(0, steps, 0), settled(well)) }
    }
}

fn shifted(times: i32) -> Transform<World, World> {
    Transform::new(nalgebra::UnitQuaternion::identity(), Vector3::from(SHIFT) * f64::from(times))
}

/// What a navigator did.
#[derive(Debug, Clone, PartialEq)]
pub enum Did {
    /// What the fix did.
    Fix(Event),
    /// What it answered.
    Said(bool),
    /// It answers nothing.
    Went,
}

/// What an event of a fix must be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Must {
    /// [`Event::Taken`].
    Taken,
    /// [`Event::Left`].
    Left,
    /// [`Event::Doubted`].
    Doubted,
    /// [`Event::Relocated`].
    Relocated,
    /// [`Event::Disputed`] of these two, the second so many shifts from its place if the first stands right.
    Disputed([usize; 2], i32),
    /// [`Event::Displaced`] of this object by so many shifts.
    Displaced(usize, i32),
    /// The answer to a question.
    Said(bool),
    /// Nothing that is told.
    Went,
}

impl Must {
    /// Whether it is what was done.
    pub fn is(self, did: &Did, site: &Site) -> bool {
        let near = |x: f64, y: f64| (x - y).abs() < 1e-9;
        let shift = Vector3::from(SHIFT).norm();
        match (self, did) {
            (Self::Taken, Did::Fix(Event::Taken))
            | (Self::Left, Did::Fix(Event::Left))
            | (Self::Relocated, Did::Fix(Event::Relocated))
            | (Self::Went, Did::Went) => true,
            (Self::Doubted, Did::Fix(Event::Doubted(why))) => why.nis > why.limit,
            (Self::Disputed(two, shifts), Did::Fix(Event::Disputed { objects, metres })) => {
                *objects == two && near(*metres, f64::from(shifts.abs()) * shift)
            }
            (Self::Displaced(object, shifts), Did::Fix(Event::Displaced(found))) => {
                let far = found.old_from_new.translation().norm();
                let moved = site.surveyed[object].world_from_object.rotation() * found.old_from_new.translation();
                let along = Vector3::from(SHIFT) * f64::from(shifts);
                found.object == object && near(far, along.norm()) && (moved - along).norm() < 1e-9
            }
            (Self::Said(a), Did::Said(b)) => a == *b,
            _ => false,
        }
    }
}

/// Two objects of which one stands elsewhere, and where each stands if the other is right.
#[derive(Debug, Clone)]
struct Dispute {
    objects: [usize; 2],
    moved: [i32; 2],
}

/// What must be known, in whole numbers.
#[derive(Debug, Clone)]
pub struct Ledger {
    /// The object of the last fix taken, and how many shifts the camera is off by it and the survey.
    pub known: Option<(usize, i32)>,
    /// Where the objects stand.
    pub places: [i32; OBJECTS],
    /// Of each object the fixes that were doubted: what the last said, and how many in a row.
    doubts: [Option<(i32, usize)>; OBJECTS],
    agreed: Vec<[usize; 2]>,
    disputes: Vec<Dispute>,
    /// What the pose rests on.
    pub state: State,
    /// Seconds, and those with a motion, since a fix was taken; none before.
    pub since: Option<(f64, usize)>,
    /// Steps in all.
    pub steps: usize,
}

impl Default for Ledger {
    fn default() -> Self {
        Self {
            known: None,
            places: [0; OBJECTS],
            doubts: [None; OBJECTS],
            agreed: Vec::new(),
            disputes: Vec::new(),
            state: State::Prior,
            since: None,
            steps: 0,
        }
    }
}

impl Ledger {
    /// What this does to it, where `better` says whether a settled pose is better known than what there is; and what must be answered.
    pub fn enter(&mut self, happening: Happening, better: bool) -> Must {
        match happening {
            Happening::Step => {
                self.steps += 1;
                self.since = self.since.map(|(seconds, steps)| (seconds + 1.0, steps + 1));
                if self.known.is_some() && self.state != State::Searching {
                    self.state = State::DeadReckoning;
                }
                Must::Went
            }
            Happening::Lost => {
                (self.known, self.since, self.state) = (None, None, State::Prior);
                self.doubts = [None; OBJECTS];
                Must::Went
            }
            Happening::Fix(kind) => self.fix(kind),
            Happening::Due(in_view) => {
                let due = self.is_due(0.0);
                if due && in_view {
                    self.state = State::Searching;
                } else if self.state == State::Searching {
                    self.state = self.carried();
                }
                Must::Said(due)
            }
            Happening::Blind(in_view) => {
                let due = self.is_due(BLIND);
                let searches = self.state == State::Searching && due && in_view;
                if !searches && matches!(self.state, State::Searching | State::Fixed) {
                    self.state = self.carried();
                }
                Must::Said(due)
            }
            Happening::Settle(_) => {
                if better {
                    self.doubts = [None; OBJECTS];
                    self.take(0, 0);
                }
                Must::Said(better)
            }
        }
    }

    /// Whether an object is one of two of which one was moved.
    pub fn is_disputed(&self, object: usize) -> bool {
        self.disputes.iter().any(|dispute| dispute.objects.contains(&object))
    }

    /// How many shifts the camera is off by the survey of any object.
    pub fn known_at(&self, object: usize) -> Option<i32> {
        self.known.map(|(known, off)| self.places[known] + off - self.seen_from(known, object))
    }

    /// Where an object stands, seen from another that stands where it was surveyed or found.
    fn seen_from(&self, known: usize, object: usize) -> i32 {
        let between = self.disputes.iter().find(|one| one.objects.contains(&known) && one.objects.contains(&object));
        match between {
            Some(dispute) if known != object => dispute.moved[usize::from(dispute.objects[1] == object)],
            _ => self.places[object],
        }
    }

    fn is_due(&self, ahead: f64) -> bool {
        self.since.is_none_or(|(seconds, _)| seconds + ahead >= INTERVAL)
    }

    fn carried(&self) -> State {
        if self.known.is_some() { State::DeadReckoning } else { State::Prior }
    }

    fn take(&mut self, object: usize, off: i32) {
        (self.known, self.since, self.state) = (Some((object, off)), Some((0.0, 0)), State::Fixed);
    }

    fn fix(&mut self, kind: Kind) -> Must {
        let (object, off) = kind.states();
        let Some((known, _)) = self.known else {
            self.take(object, off);
            return Must::Taken;
        };
        let agrees = self.known_at(object) == Some(off);
        if self.disputes.iter().any(|one| one.objects == [known, object] || one.objects == [object, known]) {
            if !agrees {
                return self.doubt(object, off);
            }
        } else if let Some((moved, place)) = self.verdict(object, off) {
            self.doubts[object] = None;
            return self.displace(moved, place, object, off);
        } else if !agrees {
            return self.doubt(object, off);
        } else if object != known {
            self.agreed.push([known, object]);
            if kind == Kind::Imprecise {
                self.doubts[object] = None;
                return Must::Left;
            }
        }
        self.doubts[object] = None;
        self.take(object, off);
        Must::Taken
    }

    fn doubt(&mut self, object: usize, off: i32) -> Must {
        let Some((known, by)) = self.known else { return Must::Taken };
        let votes = match self.doubts[object] {
            Some((before, votes)) if before == off => votes + 1,
            _ => 1,
        };
        if votes < VOTES {
            self.doubts[object] = Some((off, votes));
            return Must::Doubted;
        }
        self.doubts[object] = None;
        if object == known {
            self.take(object, off);
            return Must::Relocated;
        }
        // World of the camera by either, the other object's place from it.
        let camera = [self.places[known] + by, self.places[object] + off];
        let moved = [camera[1] - by, camera[0] - off];
        let confirmed =
            |one: usize, but: usize| self.agreed.iter().any(|two| two.contains(&one) && !two.contains(&but));
        match (confirmed(known, object), confirmed(object, known)) {
            (false, true) => self.displace(known, moved[0], object, off),
            (true, false) => self.displace(object, moved[1], object, off),
            _ => {
                let two = [known, object];
                self.disputes.retain(|one| !(one.objects.contains(&known) && one.objects.contains(&object)));
                self.disputes.push(Dispute { objects: two, moved });
                self.agreed.retain(|one| !(one.contains(&known) && one.contains(&object)));
                self.take(object, off);
                Must::Disputed(two, moved[1] - self.places[object])
            }
        }
    }

    /// Which of two objects was moved: a third confirms the survey of one of them, or that it was moved, and not both.
    fn verdict(&self, object: usize, off: i32) -> Option<(usize, i32)> {
        let (known, by) = self.known.filter(|(known, _)| *known != object)?;
        self.disputes.iter().find_map(|dispute| {
            let [first, second] = dispute.objects;
            let side = match (known == first || object == first, known == second || object == second) {
                (true, false) => 0,
                (false, true) => 1,
                _ => return None,
            };
            // How far both are apart in what they say of the camera; the suspect's place belongs to one of them.
            let apart = self.places[known] + by - self.places[object] - off;
            let farther = dispute.moved[side] - self.places[dispute.objects[side]];
            let sign = if dispute.objects[side] == known { 1 } else { -1 };
            match (apart == 0, apart + sign * farther == 0) {
                (true, false) => Some((dispute.objects[1 - side], dispute.moved[1 - side])),
                (false, true) => Some((dispute.objects[side], dispute.moved[side])),
                _ => None,
            }
        })
    }

    fn displace(&mut self, moved: usize, place: i32, object: usize, off: i32) -> Must {
        let by = place - self.places[moved];
        self.places[moved] = place;
        self.agreed.retain(|two| !two.contains(&moved));
        self.disputes.retain(|dispute| !dispute.objects.contains(&moved));
        self.take(object, off);
        Must::Displaced(moved, by)
    }
}

/// How long it is blind (s).
pub const BLIND: f64 = 0.5;

/// Lets something happen to a navigator, after so many steps.
pub fn happens(navigator: &mut Navigator<'_>, site: &Site, steps: usize, happening: Happening) -> Did {
    match happening {
        Happening::Step => navigator.advance(1.0, Some(&site.step)),
        Happening::Lost => navigator.advance(1.0, None),
        Happening::Fix(kind) => return Did::Fix(navigator.fix(&site.fix(kind, steps))),
        Happening::Due(in_view) => return Did::Said(navigator.due(in_view)),
        Happening::Blind(in_view) => return Did::Said(navigator.blind(BLIND, in_view)),
        Happening::Settle(well) => {
            return Did::Said(navigator.settle(&site.settled(steps, well), "found again".to_owned()));
        }
    }
    Did::Went
}

/// Whether a settled pose is better known than this one of the same object.
pub fn is_better(well: bool, known: Option<&Navigated>) -> bool {
    let sigma = settled(well).position_sigma();
    known.is_none_or(|known| sigma < known.object_pose.covariance.position_sigma())
}

fn settled(well: bool) -> Covariance6<Object, Camera> {
    Covariance6::isotropic(1e-3, if well { SETTLED } else { HARDLY })
}
