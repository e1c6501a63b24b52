//! A function kind as a list of steps, each of which begins a primitive, passes, or ends the function.

use crate::{
    hand::Hand,
    primitives::Outcome,
    run::{Function, Next, Notes, WayOut},
};
use acm_concept::{embodiment::Feedback, ids::ObjectId};

/// What a step gets to see, and where it notes what it measured.
pub(crate) struct Moment<'a> {
    pub hand: &'a Hand,
    pub feedback: &'a Feedback,
    /// The outcome of the primitive that the step before began.
    pub last: Option<Outcome>,
    pub notes: &'a mut Notes,
}

/// A step: what is to be done next, or `None` to go on with the step after it.
pub(crate) type Step<S> = fn(&mut S, &mut Moment<'_>) -> Option<Next>;

/// A function kind whose steps follow one another. After the last one the function is done.
pub(crate) trait Steps: Send + 'static {
    /// The steps, in order.
    const STEPS: &'static [Step<Self>];
    /// As [`Function::way_out`].
    fn way_out(&self) -> WayOut;
    /// As [`Function::object`].
    fn object(&self) -> ObjectId;
}

/// Runs the steps.
pub(crate) struct Sequence<S> {
    function: S,
    next: usize,
}

impl<S: Steps> Sequence<S> {
    pub fn new(function: S) -> Sequence<S> {
        Sequence { function, next: 0 }
    }
}

impl<S: Steps> Function for Sequence<S> {
    fn next(&mut self, hand: &Hand, feedback: &Feedback, last: Option<Outcome>, notes: &mut Notes) -> Next {
        let mut moment = Moment { hand, feedback, last, notes };
        while let Some(step) = S::STEPS.get(self.next) {
            self.next += 1;
            if let Some(next) = step(&mut self.function, &mut moment) {
                return next;
            }
        }
        Next::Done
    }
    fn way_out(&self) -> WayOut {
        self.function.way_out()
    }
    fn object(&self) -> ObjectId {
        self.function.object()
    }
}
