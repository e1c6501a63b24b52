//! Worlds of any size: rooms in a row, categories of unequal frequency, three parts an object.

use crate::{
    Event, Id, Nanos, Op,
    event::{Object, Part, Sure},
    query::{Near, Query},
    symbols::{Kind, Symbol},
    testing::Draw,
};

/// The words of a world.
#[derive(Debug, Clone, Default)]
pub struct Words {
    /// Categories, most frequent first.
    pub categories: Vec<Symbol>,
    /// Templates.
    pub templates: Vec<Symbol>,
    /// Affordances.
    pub affordances: Vec<Symbol>,
    /// States.
    pub states: Vec<Symbol>,
    /// Rooms.
    pub regions: Vec<Symbol>,
    /// Relations: on, inside.
    pub relations: Vec<Symbol>,
    /// Numbers.
    pub fluents: Vec<Symbol>,
    /// Who says so.
    pub source: Symbol,
}

/// A world that is being drawn.
#[derive(Debug, Clone)]
pub struct World {
    /// The words.
    pub words: Words,
    /// How the numbers go on.
    pub draw: Draw,
    /// Side of a room, metres.
    pub room_m: f32,
    /// Cumulated frequencies of the categories.
    frequencies: Vec<f32>,
}

impl World {
    /// Draws the words: so many rooms and categories; frequencies fall as 1/rank.
    pub fn new(seed: u64, rooms: usize, categories: usize) -> (World, Event) {
        let mut ops = Vec::new();
        let mut next: Symbol = 0;
        let mut define = |kind: Kind, count: usize, name: &str| -> Vec<Symbol> {
            let one = |number: usize| {
                next += 1;
                ops.push(Op::Define(kind, format!("{name}-{number}")));
                next
            };
            (0..count).map(one).collect()
        };
        // Fields are evaluated in this order: the numbers of the words follow it.
        let words = Words {
            source: define(Kind::Source, 1, "camera").first().copied().unwrap_or_default(),
            categories: define(Kind::Category, categories, "category"),
            templates: define(Kind::Template, 40, "template"),
            affordances: define(Kind::Affordance, 16, "affordance"),
            states: define(Kind::State, 20, "state"),
            regions: define(Kind::Region, rooms, "room"),
            relations: define(Kind::Relation, 2, "relation"),
            fluents: define(Kind::Fluent, 2, "fluent"),
        };
        let mut sum = 0.0;
        let mut frequencies: Vec<f32> = (0..categories)
            .map(|rank| {
                sum += 1.0 / (rank + 1) as f32;
                sum
            })
            .collect();
        frequencies.iter_mut().for_each(|value| *value /= sum);
        let source = words.source;
        (World { words, draw: Draw::new(seed), room_m: 6.0, frequencies }, Event::new(0, source, 1.0, ops))
    }
    fn pick(&mut self, of: fn(&Words) -> &[Symbol]) -> Symbol {
        let all = of(&self.words);
        all.get(self.draw.below(all.len())).copied().unwrap_or_default()
    }
    /// A category by its frequency.
    pub fn category(&mut self) -> (usize, Symbol) {
        let unit = self.draw.unit();
        let rank = self.frequencies.partition_point(|sum| *sum < unit).min(self.words.categories.len() - 1);
        (rank, self.words.categories[rank])
    }
    /// A place in a room.
    pub fn place(&mut self, room: usize) -> [f32; 3] {
        let (row, column) = (room / 8, room % 8);
        let m = self.room_m;
        let [x, y, z] = [self.draw.unit(), self.draw.unit(), self.draw.unit()];
        [(column as f32 + x) * m, (row as f32 + y) * m, 2.0 * z]
    }
    /// An object with three parts. Which templates and affordances it has follows from its category.
    pub fn object(&mut self, id: Id) -> Object {
        let (rank, category) = self.category();
        let room = self.draw.below(self.words.regions.len());
        let position = self.place(room);
        let mut parts = Vec::with_capacity(3);
        for number in 0..3 {
            let mut theta = [0.0; 8];
            theta.iter_mut().take(3).for_each(|value| *value = 0.02 + self.draw.unit());
            let offset = [self.draw.unit() * 0.1, self.draw.unit() * 0.1, self.draw.unit() * 0.1];
            parts.push(Part {
                template: self.words.templates[(rank * 7 + number * 3) % self.words.templates.len()],
                name: 0,
                theta,
                position: [position[0] + offset[0], position[1] + offset[1], position[2] + offset[2]],
                rotation: [0.0, 0.0, 0.3],
                affordances: [self.words.affordances[(rank * 5 + number) % self.words.affordances.len()], 0],
            });
        }
        let mut states = Vec::new();
        for _ in 0..1 + self.draw.below(3) {
            let state = self.pick(|words| &words.states);
            if !states.contains(&state) {
                states.push(state);
            }
        }
        Object {
            id,
            category,
            region: self.words.regions[room],
            position,
            rotation: [0.0, 0.0, self.draw.unit() * 0.9],
            confidence: 0.3 + 0.7 * self.draw.unit(),
            parts,
            affordances: Vec::new(),
            states,
        }
    }
    /// An event that puts an object.
    pub fn put(&mut self, id: Id, valid: Nanos) -> Event {
        let object = self.object(id);
        Event::new(valid, self.words.source, 0.9, vec![Op::Put(Box::new(object))])
    }
    /// A change of one of `objects` objects that are there: six of ten move, three change a state, one its confidence.
    pub fn change(&mut self, objects: usize, valid: Nanos) -> Event {
        let id = self.draw.below(objects) as Id;
        let op = match self.draw.below(10) {
            0..6 => {
                let room = self.draw.below(self.words.regions.len());
                Op::Move(id, self.place(room), [0.0, 0.0, self.draw.unit() * 0.9])
            }
            6..9 => {
                let sure = if self.draw.chance(0.5) { Sure::Yes } else { Sure::No };
                Op::State(id, self.pick(|words| &words.states), sure)
            }
            _ => Op::Confidence(id, 0.3 + 0.7 * self.draw.unit()),
        };
        Event::new(valid, self.words.source, 0.9, vec![op])
    }
    /// A query of a room for a category with an affordance and a state, near a place in the room: of the kind that an
    /// object of this world would ask for.
    pub fn scoped(&mut self) -> Query {
        let like = self.object(0);
        Query {
            categories: vec![like.category],
            region: Some(like.region),
            affordances: vec![like.parts[0].affordances[0]],
            states: vec![(like.states[0], true)],
            near: Some(Near { at: like.position, scale_m: 1.0, within_m: None }),
            ..Query::default()
        }
    }
    /// A query of everything for two templates, an affordance and a state; every other one near a place.
    pub fn unscoped(&mut self) -> Query {
        let like = self.object(0);
        let near = Near { at: like.position, scale_m: 1.0, within_m: None };
        Query {
            templates: vec![like.parts[0].template, like.parts[1].template],
            affordances: vec![like.parts[0].affordances[0]],
            states: vec![(like.states[0], true)],
            near: self.draw.chance(0.5).then_some(near),
            ..Query::default()
        }
    }
}
