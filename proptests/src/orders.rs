//! A discrete model of the navigator: few events, and their results in integers.
//!
//! Fixes are exact, or off by multiples of one shift of the world, so that two agree if their integers are equal and
//! contradict each other by far otherwise. The state that the navigator must have is then a matter of integers, and is
//! implemented independently here.

use std::sync::Mutex;

use nalgebra::{Matrix3, Vector3};
use seafix_geometry::{Camera, Covariance6, Object, Transform, World};
use seafix_navigation::{
    ConsiderStates, Event, Navigated, Navigator, ObjectPlacement, ObjectPose, Policy, RelativeMotion, Sensitivity,
    Situation, State,
};

/// An event for a navigator.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Happening {
    /// A second passes, with a motion from odometry.
    Step,
    /// A second passes without a motion from odometry; the camera stood still.
    Lost,
    /// A fix of this kind arrives.
    Fix(Kind),
    /// The navigator is asked whether a fix is due, with an object in view or not.
    Due(bool),
    /// Half a second passes, and the images give no motion.
    Blind(bool),
    /// A pose from a recognised key frame arrives, with a small covariance or a large one.
    Settle(bool),
}

/// The kinds of fixes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A right fix of the first object.
    Right,
    /// A wrong fix of the first object, always the same.
    Wrong,
    /// Another wrong fix of the first object.
    Otherwise,
    /// A right fix of the second object, which is displaced from its survey.
    Moved,
    /// A right fix of the third object.
    Third,
    /// A right fix of the third object with few points in view.
    Imprecise,
}

impl Kind {
    /// The object, and the camera's error in shifts according to the fix and the survey.
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

/// Number of objects.
pub const OBJECTS: usize = 3;
/// Displacement of the second object from its survey (shifts).
pub const DISPLACED: i32 = 2;
/// The age (s) at which a fix is due.
pub const INTERVAL: f64 = 1.75;
/// Number of successive fixes that overrule the navigated pose.
const VOTES: usize = 3;

/// A policy by age that records its inputs.
#[derive(Debug, Default)]
pub struct Listener(Mutex<Option<Situation>>);

impl Policy for Listener {
    fn due(&self, situation: &Situation) -> bool {
        *self.0.lock().expect("no thread died") = Some(*situation);
        situation.seconds >= INTERVAL
    }
}

impl Listener {
    /// The situation since the last question.
    pub fn reported(&self) -> Option<Situation> {
        self.0.lock().expect("no thread died").take()
    }
}

/// The true poses of objects and camera.
#[derive(Debug)]
pub struct Site {
    /// The surveyed poses of the objects.
    pub surveyed: Vec<ObjectPlacement>,
    /// The odometry's motion in each second.
    pub step: RelativeMotion,
    /// The camera's pose after each number of steps.
    cameras: Vec<Transform<World, Camera>>,
}

/// A shift of the world (m).
const SHIFT: [f64; 3] = [2.0, -1.0, 1.5];
/// Standard deviation of the position of a fix (m), of a fix with few points, and of a surveyed position.
const FIX: f64 = 0.005;
const IMPRECISE: f64 = 0.05;
const SURVEY: f64 = 0.02;
/// The part of a fix's variance that all fixes of its object share.
const MODEL: f64 = 0.0045;
/// Standard deviations of a settled pose, for a small covariance and for a large one.
const SETTLED: f64 = 0.004;
const HARDLY: f64 = 1.0;

impl Site {
    /// A site, and a route of `steps` steps through it.
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

    /// The pose of an object, displaced from its survey by a number of shifts.
    pub fn place(&self, object: usize, shifts: i32) -> Transform<World, Object> {
        shifted(shifts) * self.surveyed[object].world_from_object
    }

    /// The camera's pose relative to an object after a number of steps, with an error in shifts by the survey.
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

/// The result of an event for a navigator.
#[derive(Debug, Clone, PartialEq)]
pub enum Did {
    /// The navigator's event for a fix.
    Fix(Event),
    /// The answer to a question.
    Said(bool),
    /// No answer.
    Went,
}

/// The expected event of a fix.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Must {
    /// [`Event::Taken`].
    Taken,
    /// [`Event::LessAccurate`].
    Left,
    /// [`Event::Doubted`].
    Doubted,
    /// [`Event::Relocated`].
    Relocated,
    /// [`Event::Disputed`] of these two; the second is displaced by this number of shifts if the first is right.
    Disputed([usize; 2], i32),
    /// [`Event::Displaced`] of this object by this number of shifts.
    Displaced(usize, i32),
    /// The answer to a question.
    Said(bool),
    /// No event.
    Went,
}

impl Must {
    /// Whether the result is as expected.
    pub fn is(self, did: &Did, site: &Site) -> bool {
        let near = |x: f64, y: f64| (x - y).abs() < 1e-9;
        let shift = Vector3::from(SHIFT).norm();
        match (self, did) {
            (Self::Taken, Did::Fix(Event::Taken))
            | (Self::Left, Did::Fix(Event::LessAccurate))
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

/// Two objects of which one is displaced, and the pose of each if the other is right.
#[derive(Debug, Clone)]
struct Dispute {
    objects: [usize; 2],
    moved: [i32; 2],
}

/// The expected state of the navigator, in integers.
#[derive(Debug, Clone)]
pub struct Ledger {
    /// The object of the last accepted fix, and the camera's error in shifts by it and the survey.
    pub known: Option<(usize, i32)>,
    /// The poses of the objects.
    pub places: [i32; OBJECTS],
    /// For each object, the doubted fixes: the last one, and the number of successive ones.
    doubts: [Option<(i32, usize)>; OBJECTS],
    agreed: Vec<[usize; 2]>,
    disputes: Vec<Dispute>,
    /// The basis of the pose.
    pub state: State,
    /// Seconds, and seconds with a motion, since the last accepted fix; `None` before.
    pub since: Option<(f64, usize)>,
    /// Number of steps.
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
    /// Applies an event and returns the expected result; `better` states whether a settled pose is better known than
    /// the current one.
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

    /// Whether an object is one of two of which one is displaced.
    pub fn is_disputed(&self, object: usize) -> bool {
        self.disputes.iter().any(|dispute| dispute.objects.contains(&object))
    }

    /// The camera's error in shifts by the survey of an object.
    pub fn known_at(&self, object: usize) -> Option<i32> {
        self.known.map(|(known, off)| self.places[known] + off - self.seen_from(known, object))
    }

    /// The pose of an object relative to another one that is at its surveyed or corrected position.
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
        // The camera in the world by either object, and the other object's pose from it.
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

    /// The displaced object of two: a third confirms either the survey of one of them or its displacement, and not
    /// both.
    fn verdict(&self, object: usize, off: i32) -> Option<(usize, i32)> {
        let (known, by) = self.known.filter(|(known, _)| *known != object)?;
        self.disputes.iter().find_map(|dispute| {
            let [first, second] = dispute.objects;
            let side = match (known == first || object == first, known == second || object == second) {
                (true, false) => 0,
                (false, true) => 1,
                _ => return None,
            };
            // The difference of the camera's poses by both objects; the suspect's pose belongs to one of them.
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

/// Duration of a gap without images (s).
pub const BLIND: f64 = 0.5;

/// Applies an event to a navigator after a number of steps.
pub fn happens(navigator: &mut Navigator<'_>, site: &Site, steps: usize, happening: Happening) -> Did {
    match happening {
        Happening::Step => navigator.advance(1.0, Some(&site.step)),
        Happening::Lost => navigator.advance(1.0, None),
        Happening::Fix(kind) => return Did::Fix(navigator.fix(&site.fix(kind, steps))),
        Happening::Due(in_view) => return Did::Said(navigator.due(in_view)),
        Happening::Blind(in_view) => return Did::Said(navigator.due_without_motion(BLIND, in_view)),
        Happening::Settle(well) => {
            return Did::Said(navigator.settle(&site.settled(steps, well), "found again".to_owned()));
        }
    }
    Did::Went
}

/// Whether a settled pose is better known than this pose of the same object.
pub fn is_better(well: bool, known: Option<&Navigated>) -> bool {
    let sigma = settled(well).position_rms();
    known.is_none_or(|known| sigma < known.object_pose.covariance.position_rms())
}

fn settled(well: bool) -> Covariance6<Object, Camera> {
    Covariance6::isotropic(1e-3, if well { SETTLED } else { HARDLY })
}
