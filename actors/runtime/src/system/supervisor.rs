//! Restarts failed actors and says so.

use super::{Factory, Failure, FailureNotice, Shared, SystemError, shell::Shell};
use crate::envelope::{OUTSIDE, Payload, Role};
use ractor::{Actor, ActorCell, ActorId, ActorProcessingErr, ActorRef, SupervisionEvent};
use std::{
    collections::BTreeMap,
    sync::{Arc, PoisonError},
};

/// The supervisor takes no messages.
#[derive(Debug)]
pub(super) enum Never {}

pub(super) struct Supervisor<M> {
    shared: Arc<Shared<M>>,
    factories: BTreeMap<Role, Factory<M>>,
    notice: Option<(Role, FailureNotice<M>)>,
    max_restarts: u32,
}

#[derive(Default)]
pub(super) struct Children {
    roles: BTreeMap<ActorId, Role>,
    restarts: BTreeMap<Role, u32>,
}

impl<M: Payload> Supervisor<M> {
    pub(super) async fn start(
        shared: Arc<Shared<M>>,
        factories: BTreeMap<Role, Factory<M>>,
        notice: Option<(Role, FailureNotice<M>)>,
        max_restarts: u32,
    ) -> Result<ActorRef<Never>, SystemError> {
        let supervisor = Supervisor { shared, factories, notice, max_restarts };
        let started = Actor::spawn(None, supervisor, ()).await;
        let (address, _) =
            started.map_err(|e| SystemError::Start { role: Role("supervisor"), reason: e.to_string() })?;
        Ok(address)
    }

    async fn spawn(&self, role: Role, supervisor: ActorCell, children: &mut Children) -> Result<(), SystemError> {
        let start_error = |reason: String| SystemError::Start { role, reason };
        let factory = self.factories.get(&role).ok_or_else(|| start_error("no such actor".into()))?;
        let shell = Shell { role, shared: Arc::clone(&self.shared) };
        let spawned = Actor::spawn_linked(None, shell, factory(), supervisor).await;
        let (address, _) = spawned.map_err(|e| start_error(e.to_string()))?;
        children.roles.insert(address.get_id(), role);
        self.shared.addresses.lock().unwrap_or_else(PoisonError::into_inner).insert(role, address);
        Ok(())
    }

    async fn take_over(&self, failed: ActorId, reason: String, own: ActorCell, children: &mut Children) {
        let Some(role) = children.roles.remove(&failed) else { return };
        let restarts = children.restarts.entry(role).or_default();
        *restarts += 1;
        // What an actor was handling is lost with it; whoever waits for its answer is told by the notice.
        let restarted = *restarts <= self.max_restarts && self.spawn(role, own, children).await.is_ok();
        tracing::warn!(%role, %reason, restarted, "an actor failed");
        if self.shared.last_failure.set(format!("{role}: {reason}")).is_err() {
            tracing::debug!("an earlier failure is already kept");
        }
        if let Some((to, notice)) = &self.notice {
            let to = if *to == role { OUTSIDE } else { *to };
            let now = self.shared.latest_ns();
            self.shared.deliver(Role("supervisor"), to, None, now, notice(Failure { role, reason, restarted }));
        }
    }
}

impl<M: Payload> Actor for Supervisor<M> {
    type Msg = Never;
    type State = Children;
    type Arguments = ();

    async fn pre_start(&self, own: ActorRef<Never>, (): ()) -> Result<Children, ActorProcessingErr> {
        let mut children = Children::default();
        for role in self.factories.keys() {
            self.spawn(*role, own.get_cell(), &mut children).await?;
        }
        Ok(children)
    }

    async fn handle_supervisor_evt(
        &self,
        own: ActorRef<Never>,
        event: SupervisionEvent,
        children: &mut Children,
    ) -> Result<(), ActorProcessingErr> {
        if let SupervisionEvent::ActorFailed(cell, error) = event {
            self.take_over(cell.get_id(), error.to_string(), own.get_cell(), children).await;
        }
        Ok(())
    }
}
