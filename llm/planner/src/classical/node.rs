//! Ground conditions: connectives over numbered literals.

/// A fact, or that it is not so: twice the fact's number, and one more where it is negated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(super) struct Lit(pub u32);

impl Lit {
    pub fn new(fact: usize, negated: bool) -> Lit {
        Lit(fact as u32 * 2 + u32::from(negated))
    }
    pub fn fact(self) -> usize {
        (self.0 / 2) as usize
    }
    pub fn negated(self) -> bool {
        self.0 % 2 == 1
    }
    pub fn negate(self) -> Lit {
        Lit(self.0 ^ 1)
    }
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Which facts hold.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct State(Box<[u64]>);

impl State {
    pub fn empty(facts: usize) -> State {
        State(vec![0; facts.div_ceil(64)].into())
    }
    pub fn contains(&self, fact: usize) -> bool {
        self.0[fact / 64] >> (fact % 64) & 1 == 1
    }
    pub fn set(&mut self, fact: usize, holds: bool) {
        let bit = 1 << (fact % 64);
        match holds {
            true => self.0[fact / 64] |= bit,
            false => self.0[fact / 64] &= !bit,
        }
    }
    pub fn holds(&self, lit: Lit) -> bool {
        self.contains(lit.fact()) != lit.negated()
    }
}

/// A ground condition without negation but in its literals.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Node {
    Literal(Lit),
    All(Vec<Node>),
    Any(Vec<Node>),
    AtLeast(usize, Vec<Node>),
}

impl Node {
    pub const TRUE: Node = Node::All(Vec::new());
    pub const FALSE: Node = Node::Any(Vec::new());

    pub fn is_true(&self) -> bool {
        matches!(self, Node::All(list) if list.is_empty())
    }
    pub fn is_false(&self) -> bool {
        matches!(self, Node::Any(list) if list.is_empty())
    }
    /// All of them, as short as can be.
    pub fn all(list: impl IntoIterator<Item = Node>) -> Node {
        let mut kept = Vec::new();
        for node in list {
            match node {
                node if node.is_false() => return Node::FALSE,
                Node::All(inner) => kept.extend(inner),
                other => kept.push(other),
            }
        }
        single(kept, Node::All)
    }
    /// One of them, as short as can be.
    pub fn any(list: impl IntoIterator<Item = Node>) -> Node {
        let mut kept = Vec::new();
        for node in list {
            match node {
                node if node.is_true() => return Node::TRUE,
                Node::Any(inner) => kept.extend(inner),
                other => kept.push(other),
            }
        }
        single(kept, Node::Any)
    }
    /// So many of them, as short as can be.
    pub fn at_least(count: usize, list: Vec<Node>) -> Node {
        let sure = list.iter().filter(|node| node.is_true()).count();
        let open: Vec<Node> = list.into_iter().filter(|node| !node.is_true() && !node.is_false()).collect();
        match count.saturating_sub(sure) {
            0 => Node::TRUE,
            1 => Node::any(open),
            n if n > open.len() => Node::FALSE,
            n if n == open.len() => Node::all(open),
            n => Node::AtLeast(n, open),
        }
    }
    pub fn holds(&self, state: &State) -> bool {
        match self {
            Node::Literal(lit) => state.holds(*lit),
            Node::All(list) => list.iter().all(|node| node.holds(state)),
            Node::Any(list) => list.iter().any(|node| node.holds(state)),
            Node::AtLeast(n, list) => list.iter().filter(|node| node.holds(state)).count() >= *n,
        }
    }
    /// The same over other literals, or over constants where `change` gives them.
    pub fn map(&self, change: &dyn Fn(Lit) -> Node) -> Node {
        let each = |list: &[Node]| list.iter().map(|node| node.map(change)).collect::<Vec<Node>>();
        match self {
            Node::Literal(lit) => change(*lit),
            Node::All(list) => Node::all(each(list)),
            Node::Any(list) => Node::any(each(list)),
            Node::AtLeast(n, list) => Node::at_least(*n, each(list)),
        }
    }
    pub fn for_each(&self, visit: &mut dyn FnMut(Lit)) {
        match self {
            Node::Literal(lit) => visit(*lit),
            Node::All(list) | Node::Any(list) | Node::AtLeast(_, list) => {
                list.iter().for_each(|node| node.for_each(visit));
            }
        }
    }
    /// Literals that together make the condition hold in a state in which it does.
    pub fn support(&self, state: &State, found: &mut Vec<Lit>) {
        match self {
            Node::Literal(lit) => found.push(*lit),
            Node::All(list) => list.iter().for_each(|node| node.support(state, found)),
            Node::Any(list) => {
                if let Some(first) = list.iter().find(|node| node.holds(state)) {
                    first.support(state, found);
                }
            }
            Node::AtLeast(n, list) => {
                list.iter().filter(|node| node.holds(state)).take(*n).for_each(|node| node.support(state, found));
            }
        }
    }
    /// The condition as alternatives, each a sorted list of literals; `None` if there are more than `limit`.
    pub fn alternatives(&self, limit: usize) -> Option<Vec<Vec<Lit>>> {
        match self {
            Node::Literal(lit) => Some(vec![vec![*lit]]),
            Node::Any(list) => {
                let mut all = Vec::new();
                for node in list {
                    all.extend(node.alternatives(limit)?);
                }
                (all.len() <= limit).then_some(all)
            }
            Node::All(list) => product(list.iter(), limit),
            Node::AtLeast(n, list) => {
                let mut all = Vec::new();
                for chosen in combinations(list.len(), *n, limit)? {
                    all.extend(product(chosen.iter().map(|index| &list[*index]), limit)?);
                    if all.len() > limit {
                        return None;
                    }
                }
                Some(all)
            }
        }
    }
}

fn single(mut list: Vec<Node>, join: fn(Vec<Node>) -> Node) -> Node {
    match (list.len(), list.pop()) {
        (1, Some(only)) => only,
        (_, Some(last)) => {
            list.push(last);
            join(list)
        }
        (_, None) => join(list),
    }
}

/// One alternative of each, in every combination that does not contradict itself.
fn product<'n>(nodes: impl Iterator<Item = &'n Node>, limit: usize) -> Option<Vec<Vec<Lit>>> {
    let mut all = vec![Vec::new()];
    for node in nodes {
        let mut next: Vec<Vec<Lit>> = Vec::new();
        let alternatives = node.alternatives(limit)?;
        for so_far in &all {
            for more in &alternatives {
                let mut joined: Vec<Lit> = so_far.iter().chain(more).copied().collect();
                joined.sort_unstable();
                joined.dedup();
                if joined.windows(2).all(|pair| pair[0].fact() != pair[1].fact()) {
                    next.push(joined);
                }
            }
            if next.len() > limit {
                return None;
            }
        }
        all = next;
    }
    Some(all)
}

/// Every choice of `count` out of `number`; `None` if there are more than `limit`.
fn combinations(number: usize, count: usize, limit: usize) -> Option<Vec<Vec<usize>>> {
    let mut all: Vec<Vec<usize>> = vec![Vec::new()];
    for _ in 0..count {
        let longer = |chosen: &Vec<usize>| {
            let from = chosen.last().map_or(0, |last| last + 1);
            let chosen = chosen.clone();
            (from..number).map(move |next| chosen.iter().copied().chain([next]).collect()).collect::<Vec<Vec<usize>>>()
        };
        all = all.iter().flat_map(longer).collect();
        if all.len() > limit * number.max(1) {
            return None;
        }
    }
    (all.len() <= limit).then_some(all)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)] // a failed step is a failed test
    use super::*;

    fn lit(fact: usize) -> Node {
        Node::Literal(Lit::new(fact, false))
    }

    #[test]
    fn constants_vanish() {
        assert_eq!(Node::all([Node::TRUE, lit(1)]), lit(1));
        assert!(Node::all([Node::FALSE, lit(1)]).is_false() && Node::any([Node::TRUE, lit(1)]).is_true());
        assert_eq!(Node::at_least(2, vec![Node::TRUE, lit(1), lit(2), Node::FALSE]), Node::any([lit(1), lit(2)]));
        assert!(Node::at_least(3, vec![lit(1), lit(2), Node::FALSE]).is_false());
    }

    #[test]
    fn alternatives_and_truth_agree_in_every_state() {
        let not_two = Node::Literal(Lit::new(2, true));
        let node = Node::all([Node::at_least(2, vec![lit(0), lit(1), lit(2)]), Node::any([lit(3), not_two])]);
        let alternatives = node.alternatives(100).unwrap();
        for bits in 0..16_usize {
            let mut state = State::empty(4);
            (0..4).for_each(|fact| state.set(fact, bits >> fact & 1 == 1));
            let some = alternatives.iter().any(|all| all.iter().all(|lit| state.holds(*lit)));
            assert_eq!(node.holds(&state), some, "{bits:04b}");
            let mut support = Vec::new();
            node.support(&state, &mut support);
            assert!(!some || support.iter().all(|lit| state.holds(*lit)), "{bits:04b}");
        }
        assert_eq!(node.alternatives(2), None);
    }
}
