//! What the agent is asked, one instruction after the other.

use acm_concept::{task::TaskSpec, time::Time};

/// The instruction of the moment, and those that follow.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Asked {
    task: TaskSpec,
    /// Which one, from 0.
    at: usize,
    /// When it is given.
    due: Time,
    /// When its time is up.
    deadline: Time,
    /// Frames and skills that were used up before it.
    used: (u32, u32),
}

impl Asked {
    pub(super) fn new(task: TaskSpec) -> Asked {
        let due = Time::from_seconds(task.instruction_at_s);
        Asked { deadline: due + task.budgets.seconds, due, at: 0, used: (0, 0), task }
    }

    pub(super) fn text(&self) -> &str {
        match self.at.checked_sub(1).and_then(|at| self.task.then.get(at)) {
            Some(further) => &further.instruction,
            None => &self.task.instruction,
        }
    }
    pub(super) fn deadline(&self) -> Time {
        self.deadline
    }
    pub(super) fn is_due(&self, now: Time) -> bool {
        now >= self.due
    }
    /// How many instructions were done before this one.
    pub(super) fn done_before(&self) -> u32 {
        self.at as u32
    }

    /// Goes on to the next instruction, given `used` frames and skills so far; `false` if there is none.
    pub(super) fn go_on(&mut self, now: Time, used: (u32, u32)) -> bool {
        let Some(further) = self.task.then.get(self.at) else { return false };
        self.due = now + further.after_s;
        (self.deadline, self.used) = (self.due + self.task.budgets.seconds, used);
        self.at += 1;
        true
    }
    /// Gives the whole time from now on: the agent has come after the instruction was due.
    pub(super) fn begins_late(&mut self, now: Time) {
        self.deadline = self.deadline.max(now + self.task.budgets.seconds);
    }

    /// Frames that may still be perceived, after `used` in all.
    pub(super) fn frames_left(&self, used: u32) -> u32 {
        self.task.budgets.frames.saturating_sub(used.saturating_sub(self.used.0))
    }
    /// Skills that may still be run, after `used` in all.
    pub(super) fn skills_left(&self, used: u32) -> u32 {
        self.task.budgets.skills.saturating_sub(used.saturating_sub(self.used.1))
    }
    /// Frames that each instruction may take.
    pub(super) fn frames(&self) -> u32 {
        self.task.budgets.frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use acm_concept::task::{Budgets, Further};

    #[test]
    fn each_instruction_has_the_budgets_anew() {
        let budgets = Budgets { seconds: 10.0, skills: 3, frames: 20 };
        let then = vec![Further { instruction: "And back.".into(), after_s: 2.0 }];
        let task = TaskSpec { instruction: "There.".into(), instruction_at_s: 1.0, budgets, then, cameras: vec![] };
        let mut asked = Asked::new(task);
        assert_eq!((asked.text(), asked.is_due(Time::from_seconds(0.9))), ("There.", false));
        assert_eq!((asked.frames_left(15), asked.skills_left(3)), (5, 0));
        assert!(asked.go_on(Time::from_seconds(6.0), (15, 3)));
        assert_eq!((asked.text(), asked.done_before()), ("And back.", 1));
        assert!(!asked.is_due(Time::from_seconds(7.9)) && asked.is_due(Time::from_seconds(8.0)));
        assert_eq!((asked.frames_left(16), asked.skills_left(4)), (19, 2));
        assert_eq!(asked.deadline(), Time::from_seconds(18.0));
        assert!(!asked.go_on(Time::from_seconds(9.0), (16, 4)));
    }
}
