//! `acm run --live`: how a run goes on, while it does.
//!
//! On a terminal a block of a few lines is drawn anew as messages come, and what is worth telling scrolls by above it.
//! Elsewhere what is worth telling is a line of plain text each. It only listens: the run is the same without it.

mod progress;

use acm_actors::message::Message;
use acm_runtime::{
    envelope::Envelope,
    journal::{Journal, JournalError},
};
use console::{Term, truncate_str};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use progress::{Progress, plain};
use std::{
    io::{self, Write},
    sync::{Arc, Mutex, MutexGuard, PoisonError},
    time::Duration,
};

/// Between two pictures of the block while no message comes.
const REDRAW: Duration = Duration::from_millis(100);

/// The progress of runs, one after the other. Once it is dropped, nothing of the block is left on the terminal.
pub struct Live(Arc<Watch>);

/// What listens to the messages.
struct Watch(Mutex<Shown>);

struct Shown {
    progress: Progress,
    screen: Screen,
}

enum Screen {
    /// A terminal whose last lines are drawn anew.
    Terminal { block: ProgressBar, term: Term },
    /// A pipe, a file, or a terminal that cannot move its cursor.
    Plain(Box<dyn Write + Send>),
}

impl Live {
    /// Shows runs on standard output, or on standard error where that is wanted for something else.
    pub fn new(on_stderr: bool) -> Live {
        let (term, target, sink): (_, _, Box<dyn Write + Send>) = match on_stderr {
            true => (Term::stderr(), ProgressDrawTarget::stderr(), Box::new(io::stderr())),
            false => (Term::stdout(), ProgressDrawTarget::stdout(), Box::new(io::stdout())),
        };
        let dumb = std::env::var_os("TERM").is_some_and(|name| name == "dumb");
        if dumb || target.is_hidden() {
            return Live::on(Screen::Plain(sink));
        }
        let block = ProgressBar::with_draw_target(None, target);
        // The one template has no error to make; with the usual one the block would have a bar too.
        if let Ok(style) = ProgressStyle::with_template("{msg}") {
            block.set_style(style);
        }
        block.enable_steady_tick(REDRAW);
        Live::on(Screen::Terminal { block, term })
    }

    fn on(screen: Screen) -> Live {
        Live(Arc::new(Watch(Mutex::new(Shown { progress: Progress::default(), screen }))))
    }

    /// Begins a run; gives what listens to its messages.
    ///
    /// # Errors
    /// The title cannot be written.
    pub fn begin(&self, title: &str) -> io::Result<Arc<dyn Journal<Message>>> {
        let mut shown = self.0.locked();
        shown.progress = Progress::of(title);
        shown.tell(&plain(title))?;
        shown.draw();
        Ok(Arc::clone(&self.0) as Arc<dyn Journal<Message>>)
    }

    /// Tells a line that no message says.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn tell(&self, line: &str) -> io::Result<()> {
        self.0.locked().tell(&plain(line))
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        if let Screen::Terminal { block, .. } = &self.0.locked().screen {
            block.finish_and_clear();
        }
    }
}

impl Watch {
    fn locked(&self) -> MutexGuard<'_, Shown> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Journal<Message> for Watch {
    fn record(&self, message: &Envelope<Message>) -> Result<(), JournalError> {
        let mut shown = self.locked();
        let told = shown.progress.take(message);
        if let Some(line) = told {
            shown.tell(&line).map_err(|error| JournalError(error.to_string()))?;
        }
        shown.draw();
        Ok(())
    }
}

impl Shown {
    /// One line that stays.
    fn tell(&mut self, line: &str) -> io::Result<()> {
        match &mut self.screen {
            Screen::Terminal { block, .. } => {
                block.println(line);
                Ok(())
            }
            Screen::Plain(sink) => writeln!(sink, "{line}").and_then(|()| sink.flush()),
        }
    }

    /// Lines that do not fit the terminal are cut, so that the block keeps its height.
    fn draw(&self) {
        let Screen::Terminal { block, term } = &self.screen else { return };
        let columns = usize::from(term.size().1).saturating_sub(1);
        let lines = self.progress.lines();
        let fitted: Vec<_> = lines.iter().map(|line| truncate_str(line, columns, "...")).collect();
        block.set_message(fitted.join("\n"));
    }
}
