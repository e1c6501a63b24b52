//! The text of the lexicon files, before their meaning is checked.

use super::*;
use acm_concept::suggest::suggest;
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawWords {
    ignored: Vec<String>,
    connectors: Vec<String>,
    lead_ins: Vec<String>,
    auxiliaries: Vec<String>,
    after_markers: Vec<String>,
    before_markers: Vec<String>,
    earlier_markers: Vec<String>,
    negations: Vec<String>,
    disturbing: Vec<String>,
    definite: Vec<String>,
    indefinite: Vec<String>,
    quantifiers: Vec<String>,
    pronouns: Vec<String>,
    things: Vec<String>,
    places: Vec<String>,
    other: Vec<String>,
    free: Vec<String>,
    same: Vec<String>,
    prepositions: Vec<String>,
    standing: Vec<String>,
    back: Vec<String>,
    relative_links: Vec<String>,
    sources: Vec<String>,
    middle: Vec<String>,
    middle_of: Vec<String>,
    between: Vec<String>,
    whole: Vec<String>,
    collectives: Vec<String>,
    plural_pronouns: Vec<String>,
    ones: Vec<String>,
    several_ones: Vec<String>,
    idle_adjectives: Vec<String>,
    partitive: Vec<String>,
    directed: Vec<String>,
    packages: Vec<String>,
    slices: Vec<String>,
    several_slices: Vec<String>,
    measures: Vec<String>,
    twins: Vec<String>,
    twin_alone: Vec<String>,
    conjunctions: Vec<String>,
    own_links: Vec<String>,
    signs: Vec<String>,
    what: Vec<String>,
    twin_links: Vec<String>,
    containing: Vec<String>,
    within_it: Vec<String>,
    inside_it: Vec<String>,
    that_you: Vec<String>,
    last: Vec<String>,
    not: Vec<String>,
    prepositions_in: Vec<String>,
    prepositions_on: Vec<String>,
    prepositions_under: Vec<String>,
    if_markers: Vec<String>,
    unless_markers: Vec<String>,
    otherwise: Vec<String>,
    once_markers: Vec<String>,
    there: Vec<String>,
    whereabouts: Vec<String>,
    above: Vec<String>,
    counts: BTreeMap<String, u32>,
    directions: BTreeMap<Direction, Vec<String>>,
    beside: BTreeMap<String, Vec<String>>,
    sizes: RawSizes,
    ordinals: BTreeMap<String, u32>,
    times: BTreeMap<String, u32>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawSizes {
    large: Vec<String>,
    small: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawNouns {
    alias: Vec<RawAlias>,
    #[serde(default)]
    plurals: BTreeMap<String, String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawStates {
    state: Vec<RawState>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawState {
    predicate: String,
    #[serde(default = "holds")]
    holds: bool,
    #[serde(default)]
    said_of_moment: bool,
    #[serde(default)]
    said_of_last: bool,
    #[serde(default)]
    adjectives: Vec<String>,
    #[serde(default)]
    forms: Vec<String>,
}

fn holds() -> bool {
    true
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModifiers {
    modifier: Vec<RawModifier>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawModifier {
    kind: ModifierKind,
    #[serde(default)]
    heading: bool,
    forms: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawAlias {
    noun: String,
    words: Vec<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawColors {
    color: Vec<RawColor>,
    shade: Vec<RawShade>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawShade {
    words: Vec<String>,
    lightness: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawColor {
    words: Vec<String>,
    srgb: [u8; 3],
    delta_e: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawVerbs {
    frame: Vec<RawFrame>,
    irregular: BTreeMap<String, Vec<String>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawFrame {
    name: String,
    goal: String,
    function: Option<String>,
    predicate: Option<String>,
    #[serde(default = "holds")]
    holds: bool,
    tool_state: Option<String>,
    #[serde(default)]
    said_of_object: bool,
    #[serde(default)]
    verbs: Vec<String>,
    #[serde(default)]
    senses: Vec<RawSense>,
    forms: Vec<RawForm>,
}

/// Verbs of a frame with what they mean beyond it.
#[derive(Deserialize, Default, Clone)]
#[serde(deny_unknown_fields)]
struct RawSense {
    verbs: Vec<String>,
    predicate: Option<String>,
    holds: Option<bool>,
    into: Option<String>,
    #[serde(default)]
    into_any: bool,
    particle: Option<String>,
    with: Option<String>,
    /// Of the forms those with a tool alone.
    #[serde(default)]
    needs_tool: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawForm {
    form: String,
    history: Option<PlaceReference>,
    times: Option<u32>,
    vary: Option<Variation>,
    #[serde(default)]
    needs_sign: bool,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHistory {
    phrase: Vec<RawHistoryPhrase>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawHistoryPhrase {
    reference: PlaceReference,
    forms: Vec<String>,
}

pub(super) fn parse(files: &BTreeMap<String, String>) -> Result<Lexicon, LexiconError> {
    let words: RawWords = read(files, "words.toml")?;
    let nouns: RawNouns = read(files, "nouns.toml")?;
    let colors: RawColors = read(files, "colors.toml")?;
    let verbs: RawVerbs = read(files, "verbs.toml")?;
    let history: RawHistory = read(files, "history.toml")?;
    let household: RawNouns = read(files, "household.toml")?;
    let states: RawStates = read(files, "states.toml")?;
    let modifiers: RawModifiers = read(files, "modifiers.toml")?;

    let senses: Vec<(&RawFrame, RawSense)> = verbs.frame.iter().flat_map(senses).collect();
    let frames = senses.iter().map(|(raw, sense)| frame(raw, sense)).collect::<Result<Vec<_>, _>>()?;
    let mut history_forms = Vec::new();
    for phrase in &history.phrase {
        for text in &phrase.forms {
            history_forms.push(HistoryForm { reference: phrase.reference, form: form("history.toml", text)? });
        }
    }
    let mut lexicon = Lexicon {
        directions: phrases_by(&words.directions, |direction| Ok(*direction))?,
        beside: phrases_by(&words.beside, |name| side(name))?,
        sizes: vec![(Size::Large, phrases(&words.sizes.large)?), (Size::Small, phrases(&words.sizes.small)?)],
        ordinals: numbers(&words.ordinals)?,
        times: numbers(&words.times)?,
        words: closed_classes(&words)?,
        colors: colors.color.iter().map(color).collect::<Result<_, _>>()?,
        shades: colors.shade.iter().map(|s| Ok((s.lightness, phrases(&s.words)?))).collect::<Result<_, _>>()?,
        counts: numbers(&words.counts)?,
        states: states.state.iter().map(state).collect::<Result<_, _>>()?,
        modifiers: modifier_forms(&modifiers)?,
        aliases: aliases(nouns.alias.iter().chain(&household.alias)),
        plurals: nouns.plurals.into_iter().chain(household.plurals).collect(),
        verbs: verb_forms(&senses, &verbs.irregular),
        frames,
        history: history_forms,
        known_words: BTreeSet::new(),
        noun_words: BTreeSet::new(),
    };
    lexicon.known_words = known_words(&lexicon);
    let nouns = lexicon.aliases.iter().flat_map(|(word, nouns)| nouns.iter().chain([word]));
    lexicon.noun_words =
        nouns.chain(lexicon.plurals.keys()).flat_map(|noun| noun.split_whitespace()).map(str::to_owned).collect();
    Ok(lexicon)
}

fn read<T: for<'de> Deserialize<'de>>(files: &BTreeMap<String, String>, file: &str) -> Result<T, LexiconError> {
    let text = files.get(file).ok_or_else(|| LexiconError::Missing { file: file.into() })?;
    toml::from_str(text).map_err(|e| LexiconError::Format { file: file.into(), reason: suggest(e.to_string()) })
}

fn closed_classes(raw: &RawWords) -> Result<Words, LexiconError> {
    Ok(Words {
        ignored: phrases(&raw.ignored)?,
        connectors: phrases(&raw.connectors)?,
        lead_ins: phrases(&raw.lead_ins)?,
        auxiliaries: phrases(&raw.auxiliaries)?,
        after_markers: phrases(&raw.after_markers)?,
        before_markers: phrases(&raw.before_markers)?,
        earlier_markers: phrases(&raw.earlier_markers)?,
        negations: phrases(&raw.negations)?,
        disturbing: phrases(&raw.disturbing)?,
        definite: phrases(&raw.definite)?,
        indefinite: phrases(&raw.indefinite)?,
        quantifiers: phrases(&raw.quantifiers)?,
        pronouns: phrases(&raw.pronouns)?,
        things: phrases(&raw.things)?,
        places: phrases(&raw.places)?,
        other: phrases(&raw.other)?,
        free: phrases(&raw.free)?,
        same: phrases(&raw.same)?,
        prepositions: phrases(&raw.prepositions)?,
        standing: phrases(&raw.standing)?,
        back: phrases(&raw.back)?,
        relative_links: phrases(&raw.relative_links)?,
        sources: phrases(&raw.sources)?,
        middle: phrases(&raw.middle)?,
        middle_of: phrases(&raw.middle_of)?,
        between: phrases(&raw.between)?,
        whole: phrases(&raw.whole)?,
        collectives: phrases(&raw.collectives)?,
        plural_pronouns: phrases(&raw.plural_pronouns)?,
        ones: phrases(&raw.ones)?,
        several_ones: phrases(&raw.several_ones)?,
        idle_adjectives: phrases(&raw.idle_adjectives)?,
        partitive: phrases(&raw.partitive)?,
        directed: phrases(&raw.directed)?,
        packages: phrases(&raw.packages)?,
        slices: phrases(&raw.slices)?,
        several_slices: phrases(&raw.several_slices)?,
        measures: phrases(&raw.measures)?,
        twins: phrases(&raw.twins)?,
        twin_alone: phrases(&raw.twin_alone)?,
        conjunctions: phrases(&raw.conjunctions)?,
        own_links: phrases(&raw.own_links)?,
        signs: phrases(&raw.signs)?,
        what: phrases(&raw.what)?,
        twin_links: phrases(&raw.twin_links)?,
        containing: phrases(&raw.containing)?,
        within_it: phrases(&raw.within_it)?,
        inside_it: phrases(&raw.inside_it)?,
        that_you: phrases(&raw.that_you)?,
        last: phrases(&raw.last)?,
        not: phrases(&raw.not)?,
        prepositions_in: phrases(&raw.prepositions_in)?,
        prepositions_on: phrases(&raw.prepositions_on)?,
        prepositions_under: phrases(&raw.prepositions_under)?,
        if_markers: phrases(&raw.if_markers)?,
        unless_markers: phrases(&raw.unless_markers)?,
        otherwise: phrases(&raw.otherwise)?,
        once_markers: phrases(&raw.once_markers)?,
        there: phrases(&raw.there)?,
        whereabouts: phrases(&raw.whereabouts)?,
        above: phrases(&raw.above)?,
    })
}

fn aliases<'a>(entries: impl Iterator<Item = &'a RawAlias>) -> BTreeMap<String, Vec<String>> {
    let mut aliases: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for alias in entries {
        for word in &alias.words {
            let nouns = aliases.entry(word.clone()).or_default();
            if !nouns.contains(&alias.noun) {
                nouns.push(alias.noun.clone());
            }
        }
    }
    aliases
}

/// A form of a state; behind the verb of "the lid is open" there may be a "not".
fn state(raw: &RawState) -> Result<StateWords, LexiconError> {
    let mut forms = Vec::with_capacity(raw.forms.len());
    for text in &raw.forms {
        let mut read = form("states.toml", text)?;
        let subject_first = matches!(read.first(), Some(Element::Slot { slot: Slot::It, .. }));
        let copula = matches!(read.get(1), Some(Element::Words { any, .. }) if any.iter().any(|word| word == "is"));
        if subject_first && copula {
            read.insert(2, Element::Slot { slot: Slot::Not, optional: true });
        }
        forms.push(read);
    }
    Ok(StateWords {
        predicate: raw.predicate.clone(),
        holds: raw.holds,
        said_of_moment: raw.said_of_moment,
        said_of_last: raw.said_of_last,
        adjectives: phrases(&raw.adjectives)?,
        forms,
    })
}

fn modifier_forms(raw: &RawModifiers) -> Result<Vec<ModifierForm>, LexiconError> {
    let mut forms = Vec::new();
    for modifier in &raw.modifier {
        for text in &modifier.forms {
            forms.push(ModifierForm {
                kind: modifier.kind,
                heading: modifier.heading,
                form: form("modifiers.toml", text)?,
            });
        }
    }
    Ok(forms)
}

/// The senses of a frame: its own where it has verbs of its own, then those it lists.
fn senses(raw: &RawFrame) -> Vec<(&RawFrame, RawSense)> {
    let own = RawSense { verbs: raw.verbs.clone(), ..RawSense::default() };
    let own = (!raw.verbs.is_empty()).then_some(own);
    own.into_iter().chain(raw.senses.iter().cloned()).map(|sense| (raw, sense)).collect()
}

/// A frame in one of its senses.
fn frame(raw: &RawFrame, sense: &RawSense) -> Result<Frame, LexiconError> {
    let wrong = |reason: &str| LexiconError::Form {
        file: "verbs.toml".into(),
        form: raw.name.clone(),
        reason: reason.to_owned(),
    };
    let holds = sense.holds.unwrap_or(raw.holds);
    let goal = match (raw.goal.as_str(), &raw.function, sense.predicate.as_ref().or(raw.predicate.as_ref())) {
        ("at", None, None) => FrameGoal::At,
        ("exchange", None, None) => FrameGoal::Exchange,
        ("holding", None, None) => FrameGoal::Holding(holds),
        ("performed", Some(function), None) => FrameGoal::Performed(function.clone()),
        ("state", None, Some(predicate)) => FrameGoal::State(predicate.clone(), holds),
        ("find", None, None) => FrameGoal::Find,
        ("await", None, None) => FrameGoal::Await,
        ("nothing", None, None) => FrameGoal::Nothing,
        _ => {
            return Err(wrong(
                "needs one of the goals at, exchange, holding, performed, state, find, await, nothing; `performed` names a `function`, `state` a `predicate`, and no other does",
            ));
        }
    };
    if raw.forms.iter().any(|form| form.vary.is_some() != (goal == FrameGoal::Find)) {
        return Err(wrong("has forms that say what they `vary` exactly if its goal is find"));
    }
    let read = |raw: &RawForm| {
        let particle = raw.form.replace("{particle}", sense.particle.as_deref().unwrap_or("{particle}"));
        let text = particle.replace("{with}", sense.with.as_deref().unwrap_or("{with}"));
        let form = form("verbs.toml", &text)?;
        Ok(FrameForm { form, history: raw.history, times: raw.times, vary: raw.vary, needs_sign: raw.needs_sign })
    };
    let usable = |raw: &&RawForm| !sense.needs_tool || raw.form.contains("{tool}");
    let forms = raw.forms.iter().filter(usable).map(read).collect::<Result<_, _>>()?;
    Ok(Frame {
        name: raw.name.clone(),
        goal,
        said_of_object: raw.said_of_object,
        tool_state: raw.tool_state.clone(),
        into: sense.into.clone(),
        into_any: sense.into_any,
        forms,
    })
}

fn verb_forms(
    senses: &[(&RawFrame, RawSense)],
    irregular: &BTreeMap<String, Vec<String>>,
) -> BTreeMap<String, Vec<usize>> {
    let mut verbs: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, (_, sense)) in senses.iter().enumerate() {
        for verb in &sense.verbs {
            let irregular = irregular.get(verb).cloned().unwrap_or_default();
            for form in inflections(verb).into_iter().chain(irregular) {
                let frames = verbs.entry(form).or_default();
                if !frames.contains(&index) {
                    frames.push(index);
                }
            }
        }
    }
    verbs
}

fn color(raw: &RawColor) -> Result<(ColorTerm, Vec<Form>), LexiconError> {
    let wrong = |reason: &str| LexiconError::Format { file: "colors.toml".into(), reason: reason.to_owned() };
    let name = raw.words.first().ok_or_else(|| wrong("a colour without words"))?.clone();
    if !(raw.delta_e.is_finite() && raw.delta_e > 0.0) {
        return Err(wrong(&format!("the colour {name} needs a positive delta_e")));
    }
    Ok((ColorTerm { name, lab: Lab::from_srgb(raw.srgb), delta_e: raw.delta_e }, phrases(&raw.words)?))
}

fn side(name: &str) -> Result<Option<Direction>, LexiconError> {
    Ok(Some(match name {
        "left" => Direction::Left,
        "right" => Direction::Right,
        "front" => Direction::Front,
        "back" => Direction::Back,
        "any" => return Ok(None),
        other => {
            let reason = format!("[beside] has `{other}`, which is not among left, right, front, back, any");
            return Err(LexiconError::Format { file: "words.toml".into(), reason });
        }
    }))
}

fn phrases(texts: &[String]) -> Result<Vec<Form>, LexiconError> {
    let mut forms = Vec::with_capacity(texts.len());
    for text in texts {
        let read = form("words.toml", text)?;
        if read.iter().any(|element| matches!(element, Element::Slot { .. })) || read.is_empty() {
            let reason = "must be words without slots".to_owned();
            return Err(LexiconError::Form { file: "words.toml".into(), form: text.clone(), reason });
        }
        forms.push(read);
    }
    Ok(forms)
}

fn phrases_by<K: Ord, T>(
    raw: &BTreeMap<K, Vec<String>>,
    key: impl Fn(&K) -> Result<T, LexiconError>,
) -> Result<Vec<(T, Vec<Form>)>, LexiconError> {
    raw.iter().map(|(name, texts)| Ok((key(name)?, phrases(texts)?))).collect()
}

fn numbers(raw: &BTreeMap<String, u32>) -> Result<Vec<(u32, Form)>, LexiconError> {
    raw.iter().map(|(text, number)| Ok((*number, form("words.toml", text)?))).collect()
}

fn form(file: &str, text: &str) -> Result<Form, LexiconError> {
    let wrong = |reason: String| LexiconError::Form { file: file.into(), form: text.into(), reason };
    let mut elements = Vec::new();
    for word in text.split_whitespace() {
        let (body, optional) = match word.strip_suffix('?') {
            Some(body) => (body, true),
            None => (word, false),
        };
        let element = match body.strip_prefix('{').and_then(|rest| rest.strip_suffix('}')) {
            Some(name) => Element::Slot {
                slot: slot(name).ok_or_else(|| wrong(format!("has the unknown slot `{{{name}}}`")))?,
                optional,
            },
            None => {
                let any: Vec<String> = body.split('|').map(str::to_owned).collect();
                if any.iter().any(String::is_empty) || body.contains(['{', '}']) {
                    return Err(wrong("has an empty alternative or a broken slot".into()));
                }
                Element::Words { any, optional }
            }
        };
        elements.push(element);
    }
    Ok(elements)
}

fn slot(name: &str) -> Option<Slot> {
    Some(match name {
        "object" => Slot::Object,
        "place" => Slot::Place,
        "thing" => Slot::Thing,
        "towards" => Slot::Towards,
        "times" => Slot::Times,
        "it" => Slot::It,
        "its" => Slot::Its,
        "spot" => Slot::Spot,
        "single" => Slot::Single,
        "tool" => Slot::Tool,
        "condition" => Slot::Condition,
        "side" => Slot::Side,
        "kind" => Slot::Kind,
        "sign" => Slot::Sign,
        "list" => Slot::List,
        _ => return None,
    })
}

fn known_words(lexicon: &Lexicon) -> BTreeSet<String> {
    let w = &lexicon.words;
    let closed = [
        &w.ignored,
        &w.connectors,
        &w.lead_ins,
        &w.auxiliaries,
        &w.after_markers,
        &w.before_markers,
        &w.negations,
        &w.disturbing,
        &w.definite,
        &w.indefinite,
        &w.quantifiers,
        &w.pronouns,
        &w.things,
        &w.places,
        &w.other,
        &w.free,
        &w.same,
        &w.prepositions,
        &w.standing,
        &w.back,
        &w.relative_links,
        &w.sources,
        &w.middle,
        &w.middle_of,
        &w.between,
        &w.whole,
        &w.collectives,
        &w.earlier_markers,
        &w.plural_pronouns,
        &w.ones,
        &w.several_ones,
        &w.idle_adjectives,
        &w.partitive,
        &w.directed,
        &w.packages,
        &w.slices,
        &w.several_slices,
        &w.measures,
        &w.twins,
        &w.twin_alone,
        &w.conjunctions,
        &w.own_links,
        &w.signs,
        &w.what,
        &w.twin_links,
        &w.containing,
        &w.within_it,
        &w.inside_it,
        &w.that_you,
        &w.last,
        &w.not,
        &w.prepositions_in,
        &w.prepositions_on,
        &w.prepositions_under,
        &w.if_markers,
        &w.unless_markers,
        &w.otherwise,
        &w.once_markers,
        &w.there,
        &w.whereabouts,
        &w.above,
    ];
    let classes = closed.into_iter().flatten();
    let directions = lexicon.directions.iter().flat_map(|(_, forms)| forms);
    let beside = lexicon.beside.iter().flat_map(|(_, forms)| forms);
    let sizes = lexicon.sizes.iter().flat_map(|(_, forms)| forms);
    let colors = lexicon.colors.iter().flat_map(|(_, forms)| forms);
    let shades = lexicon.shades.iter().flat_map(|(_, forms)| forms);
    let states = lexicon.states.iter().flat_map(|state| state.adjectives.iter().chain(&state.forms));
    let modifiers = lexicon.modifiers.iter().map(|modifier| &modifier.form);
    let numbers = lexicon.ordinals.iter().chain(&lexicon.times).chain(&lexicon.counts).map(|(_, form)| form);
    let history = lexicon.history.iter().map(|history| &history.form);
    let frames = lexicon.frames.iter().flat_map(|frame| frame.forms.iter().map(|form| &form.form));
    let forms = classes
        .chain(directions)
        .chain(beside)
        .chain(sizes)
        .chain(colors)
        .chain(shades)
        .chain(numbers)
        .chain(states)
        .chain(modifiers)
        .chain(history)
        .chain(frames);
    let mut known: BTreeSet<String> = lexicon.verbs.keys().cloned().collect();
    for element in forms.flatten() {
        if let Element::Words { any, .. } = element {
            known.extend(any.iter().cloned());
        }
    }
    known
}
