//! Errors by template and quantity, and what they say.

use crate::statistics::{median_and, wilson95};
use acm_learned::config::Description;
use acm_perception::given::Estimate;
use std::{
    collections::BTreeMap,
    io::{self, Write},
};

/// A way to an estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Way {
    /// The learned first guess.
    Learned,
    /// The geometric first guess.
    Geometric,
    /// The fit from the learned one.
    LearnedFit,
    /// The fit from the geometric ones, as perception does it.
    GeometricFit,
    /// Whichever of both fits explains what is seen better.
    BetterFit,
}

impl Way {
    const ALL: [Way; 5] = [Way::Learned, Way::Geometric, Way::LearnedFit, Way::GeometricFit, Way::BetterFit];

    /// Its column, and the names of its median and 90th percentile in JSON.
    fn names(self) -> [&'static str; 3] {
        match self {
            Way::Learned => ["learned", "learned_median", "learned_p90"],
            Way::Geometric => ["geometric", "geometric_median", "geometric_p90"],
            Way::LearnedFit => ["learned+fit", "learned_fit_median", "learned_fit_p90"],
            Way::GeometricFit => ["geometric+fit", "geometric_fit_median", "geometric_fit_p90"],
            Way::BetterFit => ["better fit", "better_fit_median", "better_fit_p90"],
        }
    }
}

/// Something of which estimates have errors.
pub struct Quantity<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its unit.
    pub unit: &'static str,
    /// The error of an estimate, in that unit.
    pub error: Box<dyn Fn(&Estimate) -> f64 + 'a>,
    /// Half of the 90 % interval that the learned estimate claims, in that unit.
    pub half_interval: Option<f64>,
}

/// The errors of one quantity of one template's things; infinite where there was no estimate.
#[derive(Debug, Clone, Default)]
struct Errors {
    unit: &'static str,
    by_way: BTreeMap<Way, Vec<f64>>,
    /// Of the learned first guess: within the interval that it claims, and of how many.
    inside: (usize, usize),
}

impl Errors {
    fn of(&self, way: Way) -> &[f64] {
        self.by_way.get(&way).map(Vec::as_slice).unwrap_or_default()
    }
    fn count(&self) -> usize {
        self.of(Way::Learned).len()
    }
    /// Which of two ways errs less on most things: decided only where the 95 % interval of the share leaves out a half.
    fn better(&self, one: Way, other: Way) -> Option<Way> {
        let pairs = || self.of(one).iter().zip(self.of(other));
        let (less, more) = (pairs().filter(|(a, b)| a < b).count(), pairs().filter(|(a, b)| a > b).count());
        let (low, high) = wilson95(less, less + more);
        if low > 0.5 { Some(one) } else { (high < 0.5).then_some(other) }
    }
}

/// All errors.
#[derive(Debug, Clone, Default)]
pub struct Table(BTreeMap<(String, usize), (String, Errors)>);

impl Table {
    /// Adds the errors of one thing in one quantity.
    pub fn add(
        &mut self,
        template: &str,
        quantity: &str,
        unit: &'static str,
        errors: BTreeMap<Way, f64>,
        half_interval: Option<f64>,
    ) {
        // Quantities keep the order in which they come.
        let known = self.0.iter().find(|((of, _), (name, _))| of == template && name == quantity);
        let place =
            known.map_or_else(|| self.0.keys().filter(|(of, _)| of == template).count(), |((_, place), _)| *place);
        let (_, own) = self.0.entry((template.into(), place)).or_insert_with(|| (quantity.into(), Errors::default()));
        own.unit = unit;
        if let (Some(half), Some(error)) = (half_interval, errors.get(&Way::Learned)) {
            own.inside.0 += usize::from(*error <= half);
            own.inside.1 += 1;
        }
        for (way, error) in errors {
            own.by_way.entry(way).or_default().push(error);
        }
    }

    fn quantities(&self) -> impl Iterator<Item = (&str, &str, &Errors)> {
        self.0.iter().map(|((template, _), (quantity, errors))| (template.as_str(), quantity.as_str(), errors))
    }

    /// The rows for JSON.
    pub fn rows(&self) -> impl Iterator<Item = (String, Vec<(&'static str, f64)>)> + '_ {
        self.quantities().map(|(template, quantity, errors)| {
            let name = format!("{template}/{quantity}_{}", errors.unit);
            let mut values = vec![("things", errors.count() as f64)];
            for way in Way::ALL {
                let [_, median, p90] = way.names();
                let (m, p) = median_and(0.9, errors.of(way));
                values.extend([(median, m), (p90, p)]);
            }
            if errors.inside.1 > 0 {
                values.push(("learned_interval_share", errors.inside.0 as f64 / errors.inside.1 as f64));
            }
            (name, values)
        })
    }

    /// Writes the table and what it says.
    ///
    /// # Errors
    /// The output cannot be written.
    pub fn print(&self, seeds: [u64; 2], description: &Description, out: &mut dyn Write) -> io::Result<()> {
        let origin = &description.origin;
        writeln!(
            out,
            "errors of the same clouds, median and 90th percentile; scenes {} to {}, learned from {} samples of scenes {} to {} in {} steps of {}",
            seeds[0], seeds[1], origin.samples, origin.scenes[0], origin.scenes[1], origin.steps, origin.batch
        )?;
        write!(out, "{:<24} {:>6}", "", "things")?;
        for way in Way::ALL {
            write!(out, " {:>16}", way.names()[0])?;
        }
        writeln!(out, " {:>9}", "in 90 %")?;
        for (template, quantity, errors) in self.quantities() {
            let name = format!("{template} {quantity} {}", errors.unit);
            write!(out, "{name:<24} {:>6}", errors.count())?;
            for way in Way::ALL {
                let (median, p90) = median_and(0.9, errors.of(way));
                write!(out, " {:>7} {:>8}", short(median), short(p90))?;
            }
            match errors.inside {
                (_, 0) => writeln!(out, " {:>9}", "-")?,
                (inside, all) => writeln!(out, " {:>7.0} %", 100.0 * inside as f64 / all as f64)?,
            }
        }
        for verdict in self.verdicts() {
            writeln!(out, "{verdict}")?;
        }
        Ok(())
    }

    /// Which is better, in words.
    pub fn verdicts(&self) -> Vec<String> {
        let guess = self.verdict("First guess", Way::Learned, Way::Geometric);
        let fit = self.verdict("After the same fit", Way::LearnedFit, Way::GeometricFit);
        let added = self.verdict("With the learned guess as one more start", Way::BetterFit, Way::GeometricFit);
        vec![guess, fit, added]
    }

    fn verdict(&self, what: &str, learned: Way, geometric: Way) -> String {
        let winners: Vec<Option<Way>> =
            self.quantities().map(|(_, _, errors)| errors.better(learned, geometric)).collect();
        let wins = |way: Option<Way>| winners.iter().filter(|winner| **winner == way).count();
        let (mine, other, undecided) = (wins(Some(learned)), wins(Some(geometric)), wins(None));
        let better = match mine.cmp(&other) {
            std::cmp::Ordering::Greater => learned.names()[0],
            std::cmp::Ordering::Less => geometric.names()[0],
            std::cmp::Ordering::Equal => "neither",
        };
        format!(
            "{what}: better is {better}. Of {} quantities {} errs less on most things in {mine}, {} in {other}; {undecided} are undecided (95 %).",
            winners.len(),
            learned.names()[0],
            geometric.names()[0]
        )
    }
}

fn short(error: f64) -> String {
    if error.is_finite() { format!("{error:.1}") } else { "none".into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(learned: f64, geometric: f64, fit: f64) -> BTreeMap<Way, f64> {
        BTreeMap::from([
            (Way::Learned, learned),
            (Way::Geometric, geometric),
            (Way::LearnedFit, fit),
            (Way::GeometricFit, fit),
            (Way::BetterFit, fit),
        ])
    }

    #[test]
    fn the_better_one_is_named_and_a_tie_is_no_win() {
        let mut table = Table::default();
        for at in 0..40 {
            let error = f64::from(at) * 0.1;
            table.add("box", "length", "mm", errors(error, error + 1.0, error), Some(2.0));
            table.add("box", "height", "mm", errors(error, f64::INFINITY, error), None);
            // As often better as worse.
            let other = if at % 2 == 0 { error + 1.0 } else { error - 0.1 };
            table.add("box", "heading", "deg", errors(error, other, error), None);
        }
        let [guess, fit, _] = &table.verdicts()[..] else { panic!("three verdicts") };
        assert!(
            guess.contains("better is learned.") && guess.contains("in 2, geometric in 0; 1 are undecided"),
            "{guess}"
        );
        assert!(fit.contains("better is neither") && fit.contains("3 are undecided"), "{fit}");
        let rows: Vec<_> = table.rows().collect();
        let names: Vec<&str> = rows.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["box/length_mm", "box/height_mm", "box/heading_deg"]);
        let share = rows[0].1.iter().find(|(name, _)| *name == "learned_interval_share").map(|(_, share)| *share);
        assert_eq!(share, Some(21.0 / 40.0));
        let mut text = Vec::new();
        let description = Description {
            schema: String::new(),
            shape: acm_learned::config::Shape::TINY,
            origin: Default::default(),
            heads: Vec::new(),
        };
        table.print([7000, 7009], &description, &mut text).unwrap_or_default();
        let text = String::from_utf8(text).unwrap_or_default();
        assert!(text.contains("none") && text.contains("7000 to 7009"), "{text}");
    }
}
