//! Everything that is derived from the log: the fold of its events.

use crate::{
    Id, MAX_ID, NONE, Nanos,
    block::ROWS,
    cow::Shared,
    event::{self, Event, Object, Op, Part, Sure},
    history::{self, FIRST, History, Key, Past},
    page::{DISORDERED, Heads, KNOWN, Page},
    region::{Regions, Search},
    relation::{Edge, Number, Relations, Sorted},
    space::{Point, Space},
    symbols::{Kind, MAX_SYMBOLS, MAX_WORD_BYTES, Symbol, Symbols},
    table::{Row, Table, weight},
};
use std::{collections::BTreeSet, sync::Arc};

/// Columns, relations, regions, history. A clone costs microseconds and shares all lists until they are written.
#[derive(Debug, Clone, Default)]
pub struct State {
    /// Words.
    pub symbols: Arc<Symbols>,
    /// Rows.
    pub table: Table,
    /// By id.
    pub pages: Shared<Page>,
    /// Changes.
    pub history: History,
    /// Relations.
    pub relations: Relations,
    /// Numbers.
    pub numbers: Sorted<Number>,
    /// What was searched.
    pub regions: Arc<Regions>,
    /// Positions.
    pub space: Space,
    /// Sequence number of the next event.
    pub next: u64,
    /// When the last batch came to be known.
    pub now: Nanos,
    /// Whether every point of the space index is where its object is.
    pub(crate) is_still: bool,
    /// Objects that moved since the space index knows.
    pub(crate) moved: Vec<Id>,
}

/// What all operations of one event share.
#[derive(Debug, Clone, Copy)]
struct Context {
    valid: Nanos,
    known: Nanos,
    sequence: u32,
    origin: [u8; 2],
}

impl State {
    /// Whether a batch has a meaning here; if not, why. `time` is when it comes to be known.
    pub fn check(&self, events: &[Event], time: Nanos) -> Result<(), String> {
        if time < self.now {
            return Err(format!("a batch of {time} ns comes after one of {} ns", self.now));
        }
        if self.next + events.len() as u64 > u64::from(u32::MAX) - 1 {
            return Err("more than 4,294,967,294 events: begin a new memory".into());
        }
        let mut checker =
            Checker { state: self, put: BTreeSet::new(), gone: BTreeSet::new(), words: Vec::new(), cleared: false };
        events.iter().try_for_each(|event| checker.event(event))
    }

    /// Takes in an event that was checked. Equal events lead to equal states.
    pub fn apply(&mut self, event: &Event, known: Nanos) {
        let origin = [event.source.min(255) as u8, event::coarse(event.confidence)];
        let context = Context { valid: event.valid, known, sequence: self.next as u32, origin };
        for op in &event.ops {
            self.apply_op(op, context);
        }
        self.next += 1;
    }
    /// Ends a batch.
    pub fn commit(&mut self, time: Nanos) {
        self.now = time;
        self.history.commits.push(history::Known { next: self.next, time });
    }
    /// Sorts what has become loose; `all`: everything. Answers are the same before and after.
    pub fn settle(&mut self, all: bool) {
        if all || self.table.is_loose() {
            let State { table, pages, .. } = self;
            *table = table.sorted(&mut |id, row| {
                if let Some(page) = pages.get_mut(id as usize / ROWS) {
                    page.heads.get_mut().of[id as usize % ROWS].row = row;
                }
            });
        }
        if self.history.is_loose() || all && !self.history.is_sorted() {
            let State { history, pages, .. } = self;
            history
                .sort(pages.all_mut().flat_map(|page| page.heads.get_mut().of.iter_mut().map(|head| &mut head.last)));
        }
        let most = if all { 0 } else { usize::MAX };
        if all {
            self.relations.forth.settle(most);
            self.relations.back.settle(most);
            self.numbers.settle(most);
        }
        self.settle_space(all);
    }
    fn settle_space(&mut self, all: bool) {
        let moved = std::mem::take(&mut self.moved);
        let mut space = self.space.clone();
        let place = |id| self.position(id);
        if all && !moved.is_empty() || !moved.is_empty() && !space.moved(&moved, &place) {
            let mut points = Vec::with_capacity(self.table.live);
            for block in self.table.blocks.iter() {
                let hot = block.hot.get();
                let rows = crate::block::rows(hot.live);
                points
                    .extend(rows.map(|row| Point { position: [hot.x[row], hot.y[row], hot.z[row]], id: hot.id[row] }));
            }
            space = Space::build(points);
            self.is_still = true;
        }
        self.space = space;
    }
    /// Takes over a space index in which every point is where its object is.
    pub(crate) fn set_space(&mut self, space: Space) {
        (self.space, self.is_still) = (space, true);
    }
    /// Whether reads have to wait for [`State::settle`].
    pub fn is_unsettled(&self) -> bool {
        !self.moved.is_empty() || self.table.is_loose()
    }

    /// The columns of an object that was ever put.
    #[inline]
    pub fn head(&self, id: Id) -> Option<(&Heads, usize)> {
        let heads = self.pages.get(id as usize / ROWS)?.heads.get();
        let at = id as usize % ROWS;
        (heads.of[at].flags & KNOWN != 0).then_some((heads, at))
    }
    /// The row of an object that is there.
    #[inline]
    pub fn row(&self, id: Id) -> Option<u32> {
        let row = self.pages.get(id as usize / ROWS)?.heads.get().of[id as usize % ROWS].row;
        (row != NONE).then_some(row)
    }
    /// The position of an object that is there.
    #[inline]
    pub fn position(&self, id: Id) -> Option<[f32; 3]> {
        let (block, row) = self.table.at(self.row(id)?)?;
        Some(block.position(row))
    }
    /// The parts of an object.
    pub fn parts(&self, id: Id) -> &[Part] {
        self.pages.get(id as usize / ROWS).map_or(&[], |page| page.parts_of(id as usize % ROWS))
    }
    /// What is known of a state of an object.
    #[inline]
    pub fn sure(&self, id: Id, state: Symbol) -> Sure {
        let Some((block, row)) = self.row(id).and_then(|row| self.table.at(row)) else { return Sure::Unknown };
        if block.bits.has(self.symbols.bit(state, false), row) {
            Sure::Yes
        } else if block.bits.has(self.symbols.bit(state, true), row) {
            Sure::No
        } else {
            Sure::Unknown
        }
    }
    /// A number of an object.
    pub fn number(&self, id: Id, fluent: Symbol) -> Option<f64> {
        self.numbers.get((id, fluent)).map(|number| number.value)
    }
    /// An object that is there as it is now, whole. Affordances that it shares with its parts are theirs.
    pub fn object(&self, id: Id) -> Option<Object> {
        let (heads, at) = self.head(id)?;
        let (block, row) = self.table.at(self.row(id)?)?;
        let hot = block.hot.get();
        let members = |kind: Kind| -> Vec<Symbol> {
            let all = self.symbols.of_kind(kind).map(|(symbol, _)| symbol);
            all.filter(|symbol| block.bits.has(self.symbols.bit(*symbol, false), row)).collect()
        };
        let parts = self.parts(id).to_vec();
        let of_parts: Vec<Symbol> = parts.iter().flat_map(|part| part.affordances).collect();
        let affordances = members(Kind::Affordance).into_iter().filter(|symbol| !of_parts.contains(symbol)).collect();
        Some(Object {
            id,
            category: hot.category[row],
            region: hot.region[row],
            position: block.position(row),
            rotation: heads.of[at].rotation,
            confidence: hot.weight[row].exp(),
            affordances,
            states: members(Kind::State),
            parts,
        })
    }
    /// Ids of all objects that are there, in order.
    pub fn ids(&self) -> impl Iterator<Item = Id> {
        (0..).zip(self.pages.iter()).flat_map(|(page, heads): (u32, &Page)| {
            let rows = heads.heads.get().of.iter().map(|head| head.row).enumerate();
            rows.filter(|(_, row)| *row != NONE).map(move |(at, _)| page * ROWS as u32 + at as u32)
        })
    }

    /// The nearest objects that pass a test, nearest first, equally near ones in the order of their ids: ids with distances
    /// in metres.
    pub fn nearest(
        &self,
        at: [f32; 3],
        most: usize,
        radius_m: f32,
        passes: Option<&dyn Fn(Id) -> bool>,
    ) -> Vec<(Id, f32)> {
        let still = self.is_still && self.moved.is_empty();
        let accept = |point: &Point| {
            (still || self.position(point.id) == Some(point.position)) && passes.is_none_or(|passes| passes(point.id))
        };
        let mut found = self.space.nearest(at, most, radius_m, &accept);
        if !self.moved.is_empty() {
            for id in &self.moved {
                if let Some(position) = self.position(*id)
                    && passes.is_none_or(|passes| passes(*id))
                {
                    let distance = crate::query::distance(position, at);
                    if distance <= radius_m && !found.contains(&(*id, distance)) {
                        found.push((*id, distance));
                    }
                }
            }
            found.sort_unstable_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
            found.truncate(most);
        }
        found
    }

    /// An object as it was at `valid`, from what was known at `known`; `None` if it was not put by then.
    pub fn as_of(&self, id: Id, valid: Nanos, known: Nanos) -> Option<Past> {
        let (heads, at) = self.head(id)?;
        if heads.of[at].born > valid || u64::from(heads.of[at].first) >= self.history.until(known) {
            return None;
        }
        let ordered = heads.of[at].flags & DISORDERED == 0;
        let keys = [
            history::POSITION,
            history::ROTATION,
            history::REGION,
            history::CATEGORY,
            history::CONFIDENCE,
            history::THERE,
        ];
        let last = heads.of[at].last;
        let touched = heads.of[at].touched;
        let never = |key: Key| touched & 1 << key == 0;
        let found = if last == 0 { [None; 6] } else { self.history.at(last, ordered, keys, never, (valid, known)) };
        let row = self.row(id).and_then(|row| self.table.at(row));
        // What never changed is what it is now; before it was dropped, all that could be lost was written down.
        let now = |get: fn(&crate::block::Hot, usize) -> u32| row.map_or(0, |(block, row)| get(block.hot.get(), row));
        let [position, rotation, region, category, confidence, there] = found;
        Some(Past {
            position: position
                .map_or_else(|| row.map_or([0.0; 3], |(block, row)| block.position(row)), history::position),
            rotation: rotation.map_or(heads.of[at].rotation, history::position),
            region: region.map_or_else(|| now(|hot, row| hot.region[row].into()), |value| value[0]) as Symbol,
            category: category.map_or_else(|| now(|hot, row| hot.category[row].into()), |value| value[0]) as Symbol,
            confidence: confidence.map_or_else(
                || row.map_or(0.0, |(block, row)| block.hot.get().weight[row].exp()),
                |value| f32::from_bits(value[0]).exp(),
            ),
            there: there.is_none_or(|value| value[0] != 0),
        })
    }
    /// A state of an object as it was at `valid`, from what was known at `known`.
    pub fn sure_as_of(&self, id: Id, state: Symbol, valid: Nanos, known: Nanos) -> Sure {
        let Some((heads, at)) = self.head(id) else { return Sure::Unknown };
        if heads.of[at].born > valid || u64::from(heads.of[at].first) >= self.history.until(known) {
            return Sure::Unknown;
        }
        let ordered = heads.of[at].flags & DISORDERED == 0;
        match self.history.at(heads.of[at].last, ordered, [FIRST + state], |_| false, (valid, known)) {
            [Some(value)] => history::sure(value),
            // It never changed, or only later: then its first value was written down.
            [None] if self.changed(heads.of[at].last, FIRST + state) => Sure::Unknown,
            [None] => self.sure(id, state),
        }
    }
    fn changed(&self, last: u32, key: Key) -> bool {
        self.history.chain(last).any(|step| step.key() == key)
    }

    fn apply_op(&mut self, op: &Op, context: Context) {
        match op {
            Op::Define(kind, word) => Arc::make_mut(&mut self.symbols).define(*kind, word),
            Op::IsA(child, parent) => {
                Arc::make_mut(&mut self.symbols).is_kind_of(*child, *parent);
            }
            Op::Put(object) => self.put(object, context),
            Op::Move(id, position, rotation) => self.shift(*id, *position, *rotation, context),
            Op::Region(id, region) => self.set_region(*id, *region, context),
            Op::State(id, state, sure) => self.set_state(*id, *state, *sure, context),
            Op::Fluent(id, fluent, value) => {
                let bits = value.to_bits();
                let new = [bits as u32, (bits >> 32) as u32, 1];
                let old = self.number(*id, *fluent).map(f64::to_bits);
                let old = old.map(|bits| [bits as u32, (bits >> 32) as u32, 1]);
                if self.change(*id, FIRST + fluent, new, old, context) {
                    self.numbers.put(Number { id: *id, fluent: *fluent, padding: 0, value: *value });
                }
            }
            Op::Relate(subject, relation, object, sure) => {
                self.change(*subject, FIRST + relation, history::of_sure(*sure, *object), None, context);
                let [_, confidence] = context.origin;
                let sure = *sure as u8;
                self.relations.put(Edge { subject: *subject, object: *object, relation: *relation, sure, confidence });
            }
            Op::Confidence(id, confidence) => {
                let weight = weight(*confidence);
                let old =
                    self.row(*id).and_then(|row| self.table.at(row)).map(|(block, row)| block.hot.get().weight[row]);
                let old = old.map(|weight| [weight.to_bits(), 0, 0]);
                if self.change(*id, history::CONFIDENCE, [weight.to_bits(), 0, 0], old, context)
                    && let Some(row) = self.row(*id)
                {
                    self.table.weigh(row, weight);
                }
            }
            Op::Remove(id) => self.remove(*id, context),
            Op::Searched(region, category, share) => {
                let search = Search { valid: context.valid, sequence: self.next, share: *share };
                Arc::make_mut(&mut self.regions).add(*region, *category, search);
            }
            Op::Clear => {
                let (symbols, next, now) = (self.symbols.clone(), self.next, self.now);
                let commits = std::mem::take(&mut self.history.commits);
                *self = State { symbols, next, now, ..State::default() };
                self.history.commits = commits;
            }
        }
    }

    /// Writes a change down; whether it is the latest of its property, so that the columns follow it. `old` is the value
    /// before the first change.
    fn change(&mut self, id: Id, key: Key, new: [u32; 3], old: Option<[u32; 3]>, context: Context) -> bool {
        let Some(page) = self.pages.get_mut(id as usize / ROWS) else { return false };
        let (heads, at) = (page.heads.get_mut(), id as usize % ROWS);
        let bit = bit(key);
        let mut last = heads.of[at].last;
        let history = &mut self.history;
        // The chain is walked last: it costs more than all the rest.
        let is_first =
            || heads.of[at].touched & bit == 0 || key >= FIRST && !history.chain(last).any(|step| step.key() == key);
        if let Some(old) = old
            && is_first()
        {
            let (born, first) = (heads.of[at].born, heads.of[at].first);
            let known = history.known_or(u64::from(first), context.known);
            last = history.add((born, known), first, key, heads.of[at].origin, old, last);
        }
        heads.of[at].touched |= bit;
        let late = context.valid < heads.of[at].latest;
        let newest = !late || {
            heads.of[at].flags |= DISORDERED;
            // A position stands for the rotation too.
            let tells = |of: Key| of == key || key == history::ROTATION && of == history::POSITION;
            let newer =
                |step: history::Step| tells(step.key()) && history.valid_or(&step, context.known) > context.valid;
            !history.chain(last).any(newer)
        };
        last = history.add((context.valid, context.known), context.sequence, key, context.origin, new, last);
        heads.of[at].last = last;
        heads.of[at].latest = heads.of[at].latest.max(context.valid);
        newest
    }

    fn put(&mut self, object: &Object, context: Context) {
        let id = object.id;
        while self.pages.len() <= id as usize / ROWS {
            self.pages.push(Page::empty());
        }
        if let Some(row) = self.row(id) {
            self.replace(object, row, context);
            return;
        }
        let Some(page) = self.pages.get_mut(id as usize / ROWS) else { return };
        let at = id as usize % ROWS;
        let came_back = page.heads.get().of[at].flags & KNOWN != 0;
        page.set_parts(at, &object.parts);
        let row = Row {
            id,
            category: object.category,
            region: object.region,
            position: object.position,
            weight: weight(object.confidence),
        };
        let row = self.table.add(row);
        let heads = page.heads.get_mut();
        heads.of[at].row = row;
        heads.of[at].rotation = object.rotation;
        if !came_back {
            heads.of[at].flags = KNOWN;
            (heads.of[at].born, heads.of[at].latest) = (context.valid, context.valid);
            (heads.of[at].first, heads.of[at].origin) = (context.sequence, context.origin);
        }
        self.members(object, row);
        (self.is_still, _) = (false, self.moved.push(id));
        if came_back {
            // Everything was written down when it went; what it is now is written down as well.
            let weight = weight(object.confidence).to_bits();
            for (key, value) in [
                (history::THERE, [1, 0, 0]),
                (history::POSITION, history::of_position(object.position)),
                (history::ROTATION, history::of_position(object.rotation)),
                (history::REGION, [object.region.into(), 0, 0]),
                (history::CATEGORY, [object.category.into(), 0, 0]),
                (history::CONFIDENCE, [weight, 0, 0]),
            ] {
                self.change(id, key, value, None, context);
            }
            for state in &object.states {
                self.change(id, FIRST + state, history::of_sure(Sure::Yes, 0), None, context);
            }
        }
    }

    /// Another description of an object that is there. All of it is written down, even what is as it was: a change of an
    /// earlier moment that comes to be known later must not get past it.
    fn replace(&mut self, object: &Object, row: u32, context: Context) {
        let id = object.id;
        let Some((block, at)) = self.table.at(row) else { return };
        let hot = block.hot.get();
        let (old_category, old_weight) = (hot.category[at], hot.weight[at]);
        self.shift(id, object.position, object.rotation, context);
        self.set_region(id, object.region, context);
        let weight = weight(object.confidence);
        if self.change(id, history::CONFIDENCE, [weight.to_bits(), 0, 0], Some([old_weight.to_bits(), 0, 0]), context)
            && let Some(row) = self.row(id)
        {
            self.table.weigh(row, weight);
        }
        for state in &object.states {
            self.set_state(id, *state, Sure::Yes, context);
        }
        if let Some(page) = self.pages.get_mut(id as usize / ROWS)
            && page.parts_of(id as usize % ROWS) != object.parts.as_slice()
        {
            page.set_parts(id as usize % ROWS, &object.parts);
        }
        // Templates and affordances anew; states stay.
        if let Some(row) = self.row(id) {
            let of_kind = |kind: Kind| self.symbols.of_kind(kind).map(|(symbol, _)| symbol);
            let described = of_kind(Kind::Template).chain(of_kind(Kind::Affordance));
            let sets: Vec<u16> = described.map(|symbol| self.symbols.bit(symbol, false)).collect();
            sets.into_iter().for_each(|set| self.table.put(row, set, false));
            self.members(&Object { states: Vec::new(), ..object.clone() }, row);
        }
        let category = object.category;
        if self.change(id, history::CATEGORY, [category.into(), 0, 0], Some([old_category.into(), 0, 0]), context)
            && category != old_category
        {
            self.resettle(id, |row| row.category = category);
        }
    }

    /// Puts a row into the sets of its templates, affordances and states.
    fn members(&mut self, object: &Object, row: u32) {
        let of_parts = object.parts.iter().flat_map(|part| [part.template, part.affordances[0], part.affordances[1]]);
        let all = of_parts.chain(object.affordances.iter().copied()).chain(object.states.iter().copied());
        for symbol in all.filter(|symbol| *symbol > 0) {
            let set = match self.symbols.bit(symbol, false) {
                0 => Arc::make_mut(&mut self.symbols).make_bit(symbol, false),
                set => set,
            };
            self.table.put(row, set, true);
        }
    }

    fn shift(&mut self, id: Id, position: [f32; 3], rotation: [f32; 3], context: Context) {
        let Some((row, (heads, at))) = self.row(id).zip(self.head(id)) else { return };
        let old_rotation = heads.of[at].rotation;
        let in_order = heads.of[at].flags & DISORDERED == 0 && context.valid >= heads.of[at].latest;
        let Some(old) = self.table.at(row).map(|(block, at)| block.position(at)) else { return };
        let (new, before) = (history::of_position(position), history::of_position(old));
        if self.change(id, history::POSITION, new, Some(before), context) && old != position {
            self.table.shift(row, position);
            (self.is_still, _) = (false, self.moved.push(id));
        }
        // A rotation that stays is left out, as most things are moved upright: the position stands for it.
        let turned = old_rotation != rotation || !in_order;
        let (new, old) = (history::of_position(rotation), history::of_position(old_rotation));
        if turned
            && self.change(id, history::ROTATION, new, Some(old), context)
            && let Some(page) = self.pages.get_mut(id as usize / ROWS)
        {
            page.heads.get_mut().of[id as usize % ROWS].rotation = rotation;
        }
    }

    fn set_region(&mut self, id: Id, region: Symbol, context: Context) {
        let Some((block, at)) = self.row(id).and_then(|row| self.table.at(row)) else { return };
        let old = block.hot.get().region[at];
        if self.change(id, history::REGION, [region.into(), 0, 0], Some([old.into(), 0, 0]), context) && old != region {
            self.resettle(id, |row| row.region = region);
        }
    }

    /// Gives an object a fresh row, as its region or category is part of the order of the base.
    fn resettle(&mut self, id: Id, edit: impl FnOnce(&mut Row)) {
        let Some(old) = self.row(id) else { return };
        let Some((block, at)) = self.table.at(old) else { return };
        let hot = block.hot.get();
        let mut row = Row {
            id,
            category: hot.category[at],
            region: hot.region[at],
            position: block.position(at),
            weight: hot.weight[at],
        };
        edit(&mut row);
        let sets: Vec<u16> = block.bits.of_row(at).collect();
        self.table.kill(old);
        let new = self.table.add(row);
        sets.into_iter().for_each(|set| self.table.put(new, set, true));
        if let Some(page) = self.pages.get_mut(id as usize / ROWS) {
            page.heads.get_mut().of[id as usize % ROWS].row = new;
        }
    }

    fn set_state(&mut self, id: Id, state: Symbol, sure: Sure, context: Context) {
        let old = self.sure(id, state);
        let first = (old != Sure::Unknown).then(|| history::of_sure(old, 0));
        if !self.change(id, FIRST + state, history::of_sure(sure, 0), first, context) {
            return;
        }
        for (set, member) in [(false, sure == Sure::Yes), (true, sure == Sure::No)] {
            let number = match self.symbols.bit(state, set) {
                0 if !member => continue,
                0 => Arc::make_mut(&mut self.symbols).make_bit(state, set),
                number => number,
            };
            if let Some(row) = self.row(id) {
                self.table.put(row, number, member);
            }
        }
    }

    fn remove(&mut self, id: Id, context: Context) {
        let Some((block, at)) = self.row(id).and_then(|row| self.table.at(row)) else { return };
        let hot = block.hot.get();
        let values = [
            (history::POSITION, history::of_position(block.position(at))),
            (history::REGION, [hot.region[at].into(), 0, 0]),
            (history::CATEGORY, [hot.category[at].into(), 0, 0]),
            (history::CONFIDENCE, [hot.weight[at].to_bits(), 0, 0]),
        ];
        let states: Vec<(Symbol, Sure)> = self
            .symbols
            .of_kind(Kind::State)
            .map(|(symbol, _)| (symbol, self.sure(id, symbol)))
            .filter(|(_, sure)| *sure != Sure::Unknown)
            .collect();
        let newest = self.change(id, history::THERE, [0, 0, 0], Some([1, 0, 0]), context);
        if !newest {
            return;
        }
        let Some(page) = self.pages.get(id as usize / ROWS) else { return };
        let rotation = page.heads.get().of[id as usize % ROWS].rotation;
        // What the columns alone knew is lost with the row.
        for (key, value) in values.into_iter().chain([(history::ROTATION, history::of_position(rotation))]) {
            self.keep_first(id, key, value);
        }
        for (state, sure) in states {
            self.keep_first(id, FIRST + state, history::of_sure(sure, 0));
            self.change(id, FIRST + state, history::of_sure(Sure::Unknown, 0), None, context);
        }
        if let Some(row) = self.row(id) {
            self.table.kill(row);
            self.is_still = false;
        }
        if let Some(page) = self.pages.get_mut(id as usize / ROWS) {
            page.set_parts(id as usize % ROWS, &[]);
            page.heads.get_mut().of[id as usize % ROWS].row = NONE;
        }
    }

    /// Writes down the value that a property has had from the beginning, if it never changed.
    fn keep_first(&mut self, id: Id, key: Key, value: [u32; 3]) {
        let Some((heads, at)) = self.head(id) else { return };
        if self.changed(heads.of[at].last, key) {
            return;
        }
        let (born, first, origin, last) =
            (heads.of[at].born, heads.of[at].first, heads.of[at].origin, heads.of[at].last);
        let known = self.history.known_or(first.into(), self.now.max(born));
        let last = self.history.add((born, known), first, key, origin, value, last);
        if let Some(page) = self.pages.get_mut(id as usize / ROWS) {
            let heads = page.heads.get_mut();
            heads.of[id as usize % ROWS].last = last;
            heads.of[id as usize % ROWS].touched |= bit(key);
        }
    }
}

/// The bit of a property in `touched`; symbols share the last ten.
fn bit(key: Key) -> u16 {
    1 << if key < FIRST { key } else { 6 + (key - FIRST) % 10 }
}

struct Checker<'s> {
    state: &'s State,
    put: BTreeSet<Id>,
    gone: BTreeSet<Id>,
    words: Vec<(Kind, String)>,
    cleared: bool,
}

impl Checker<'_> {
    fn event(&mut self, event: &Event) -> Result<(), String> {
        if event.ops.len() > event::MAX_OPS
            || event.evidence.len() > event::MAX_EVIDENCE
            || event.about.len() > event::MAX_OPS
        {
            return Err("an event has more operations or evidence than it may".into());
        }
        if !event.confidence.is_finite() {
            return Err("an event's confidence is not a number".into());
        }
        event.ops.iter().try_for_each(|op| self.op(op))?;
        match event.source {
            0..=255 => self.word(event.source, Kind::Source, true),
            _ => Err("the words of sources must be among the first 255".into()),
        }
    }
    fn op(&mut self, op: &Op) -> Result<(), String> {
        match op {
            Op::Define(kind, word) => {
                if word.is_empty() || word.len() > MAX_WORD_BYTES {
                    return Err(format!("a word of {} bytes: 1 to {MAX_WORD_BYTES} are allowed", word.len()));
                }
                if self.state.symbols.len() + self.words.len() >= MAX_SYMBOLS {
                    return Err(format!("more than {MAX_SYMBOLS} words"));
                }
                let pair = (*kind, word.clone());
                if self.state.symbols.find(*kind, word).is_some() || self.words.contains(&pair) {
                    return Err(format!("the {} `{word}` is there already", kind.word()));
                }
                self.words.push(pair);
                Ok(())
            }
            Op::IsA(child, parent) => {
                self.word(*child, Kind::Category, false)?;
                self.word(*parent, Kind::Category, false)?;
                if self.state.symbols.is_a(*parent, *child) {
                    return Err("a category cannot be a kind of its own kinds".into());
                }
                Ok(())
            }
            Op::Put(object) => self.object(object),
            Op::Move(id, position, rotation) => {
                self.there(*id)?;
                finite(position.iter().chain(rotation))
            }
            Op::Region(id, region) => {
                self.there(*id)?;
                self.word(*region, Kind::Region, true)
            }
            Op::State(id, state, _) => {
                self.there(*id)?;
                self.word(*state, Kind::State, false)
            }
            Op::Fluent(id, fluent, value) => {
                self.there(*id)?;
                if !value.is_finite() {
                    return Err(format!("a number of object {id} is not finite"));
                }
                self.word(*fluent, Kind::Fluent, false)
            }
            Op::Relate(subject, relation, object, _) => {
                self.there(*subject)?;
                self.there(*object)?;
                self.word(*relation, Kind::Relation, false)
            }
            Op::Confidence(id, confidence) => {
                self.there(*id)?;
                finite(std::iter::once(confidence))
            }
            Op::Remove(id) => {
                self.there(*id)?;
                self.put.remove(id);
                self.gone.insert(*id);
                Ok(())
            }
            Op::Searched(region, category, share) => {
                finite(std::iter::once(share))?;
                self.word(*region, Kind::Region, false)?;
                self.word(*category, Kind::Category, true)
            }
            Op::Clear => {
                self.cleared = true;
                self.put.clear();
                Ok(())
            }
        }
    }
    fn object(&mut self, object: &Object) -> Result<(), String> {
        if object.id > MAX_ID {
            return Err(format!("object {} has too large an id: at most {MAX_ID}", object.id));
        }
        // Ids are given one after the other: a page for each 256 of them must not be made for nothing.
        let room = (self.state.pages.len() + 4096) * ROWS;
        if object.id as usize >= room {
            return Err(format!("object {} leaves too large a gap in the ids: below {room} is room", object.id));
        }
        if object.parts.len() > event::MAX_PARTS || object.affordances.len() > 255 || object.states.len() > 255 {
            return Err(format!("object {} has more parts, affordances or states than it may", object.id));
        }
        self.word(object.category, Kind::Category, true)?;
        self.word(object.region, Kind::Region, true)?;
        for part in &object.parts {
            self.word(part.template, Kind::Template, false)?;
            self.word(part.name, Kind::Name, true)?;
            part.affordances.iter().try_for_each(|word| self.word(*word, Kind::Affordance, true))?;
            finite(part.theta.iter().chain(&part.position).chain(&part.rotation))?;
        }
        object.affordances.iter().try_for_each(|word| self.word(*word, Kind::Affordance, false))?;
        object.states.iter().try_for_each(|word| self.word(*word, Kind::State, false))?;
        finite(object.position.iter().chain(&object.rotation).chain([&object.confidence]))?;
        if self.cleared || !self.gone.is_empty() || self.state.row(object.id).is_none() {
            self.put.insert(object.id);
            self.gone.remove(&object.id);
        }
        Ok(())
    }
    fn there(&self, id: Id) -> Result<(), String> {
        let before = !self.cleared && !self.gone.contains(&id) && self.state.row(id).is_some();
        let known = before || self.put.contains(&id);
        if known { Ok(()) } else { Err(format!("there is no object {id}")) }
    }
    fn word(&self, symbol: Symbol, kind: Kind, none: bool) -> Result<(), String> {
        let found = match usize::from(symbol).checked_sub(self.state.symbols.len() + 1) {
            Some(new) => self.words.get(new).map(|(kind, _)| *kind),
            None => self.state.symbols.kind(symbol),
        };
        match found {
            Some(found) if found == kind => Ok(()),
            None if symbol == 0 && none => Ok(()),
            _ => Err(format!("{symbol} is not the number of a {}", kind.word())),
        }
    }
}

fn finite<'a>(values: impl IntoIterator<Item = &'a f32>) -> Result<(), String> {
    if values.into_iter().all(|value| value.is_finite()) { Ok(()) } else { Err("a number is not finite".into()) }
}

/// Bytes of memory that a state takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bytes {
    /// What queries read: columns, bitsets, positions, ids, relations, numbers, words.
    pub hot: usize,
    /// Parts.
    pub parts: usize,
    /// Changes.
    pub history: usize,
}

impl State {
    /// How much memory this state takes.
    pub fn bytes(&self) -> Bytes {
        let heads = self.pages.len() * (size_of::<Heads>() + 64);
        let related = self.relations.forth.bytes() + self.relations.back.bytes() + self.numbers.bytes();
        Bytes {
            hot: self.table.bytes() + self.space.bytes() + heads + related + self.symbols.bytes(),
            parts: self.pages.iter().map(|page| size_of_val(page.parts.get())).sum(),
            history: self.history.bytes(),
        }
    }
}
