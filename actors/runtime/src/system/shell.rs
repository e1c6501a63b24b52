//! One actor: takes a message, writes it down, lets the core handle it, sends what the core wants sent.

use super::{PanicAt, Shared};
use crate::{
    core::{Core, Outbox},
    envelope::{Envelope, Payload, Role},
    journal::Handled,
};
use ractor::{Actor, ActorProcessingErr, ActorRef};
use std::sync::{Arc, PoisonError};

pub(super) struct Shell<M> {
    pub role: Role,
    pub shared: Arc<Shared<M>>,
}

impl<M: Payload> Actor for Shell<M> {
    type Msg = Envelope<M>;
    type State = Box<dyn Core<M>>;
    type Arguments = Box<dyn Core<M>>;

    async fn pre_start(
        &self,
        _: ActorRef<Self::Msg>,
        core: Self::Arguments,
    ) -> Result<Self::State, ActorProcessingErr> {
        Ok(core)
    }

    async fn handle(
        &self,
        _: ActorRef<Self::Msg>,
        message: Envelope<M>,
        core: &mut Self::State,
    ) -> Result<(), ActorProcessingErr> {
        self.shared.journal.record(&message)?;
        self.panic_if_told();
        let (seq, sent_ns, routine) = (message.seq, message.time_ns, message.body.routine());
        let mut outbox = Outbox::new(sent_ns);
        // The one place where handlers are timed: the figure goes to the report, never to a core.
        #[allow(clippy::disallowed_methods)]
        let started = std::time::Instant::now();
        let outcome = core.handle(message, &mut outbox);
        let elapsed = started.elapsed();
        *self.shared.spent.lock().unwrap_or_else(PoisonError::into_inner).entry(self.role).or_default() += elapsed;
        outcome?;
        let state = (!routine && self.shared.journal.keeps_states()).then(|| core.state()).flatten();
        self.shared.journal.handled(&Handled { seq, by: self.role, time_ns: sent_ns, took: elapsed, state })?;
        let (time_ns, messages) = outbox.into_messages();
        for (to, body) in messages {
            self.shared.deliver(self.role, to, Some(seq), time_ns, body);
        }
        Ok(())
    }
}

impl<M> Shell<M> {
    fn panic_if_told(&self) {
        let Some(PanicAt { role, message }) = self.shared.panic_at else { return };
        if role != self.role {
            return;
        }
        let mut handled = self.shared.handled.lock().unwrap_or_else(PoisonError::into_inner);
        let count = handled.entry(role).or_default();
        *count += 1;
        let due = *count == message;
        drop(handled);
        assert!(!due, "fault set for a test: {role} fails at its message {message}");
    }
}
