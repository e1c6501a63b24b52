//! Turns the text of a scenario file into its meaning and refuses what makes no sense.

mod fluent;

use super::{
    Scenario, ScenarioError, nearest,
    raw::*,
    spec::{DeedSpec, LightSpec, ModelChoice, PlaceAt, Reference, StageSpec, ViolationSpec},
    *,
};
use crate::{
    derived, fluent as state_of,
    mishap::MishapKind,
    model::{ModelLibrary, ObjectModel, is_name},
    oracle,
    random::{DrawKind, DrawSpec, MAX_COUNT, StreamKind, element},
    robot,
};
use acm_concept::{
    camera::{CameraModel, Intrinsics, MAX_PIXELS, Mount},
    expression::Expression,
    pose::Pose,
    suggest::suggest,
    task::{Budgets, Further},
};
use glam::{DMat3, DQuat, DVec3};
use std::{path::Path, sync::Arc};

const MAX_ITEMS: usize = 64;
const MAX_ATTEMPTS: u32 = 100_000;

pub(super) fn parse(file: &str, text: &str) -> Result<Scenario, ScenarioError> {
    let wrong = |reason: String| ScenarioError::Format { file: file.into(), reason };
    let raw: RawScenario = toml::from_str(text).map_err(|e| wrong(suggest(e.to_string())))?;
    let mut models = ModelLibrary::embedded()?;
    for model in &raw.model {
        models.add(model.meaning().map_err(|reason| ScenarioError::Model { file: file.into(), reason })?);
    }
    Meaning::new(file, &raw, models)?.scenario()
}

struct Meaning<'a> {
    file: &'a str,
    raw: &'a RawScenario,
    /// Of every object, in their order; of several to choose from the first.
    models: Vec<Arc<ObjectModel>>,
    /// Of the objects that have several to choose from, all of them.
    choices: Vec<Vec<Arc<ObjectModel>>>,
    /// Draws of one value.
    scalars: Vec<String>,
    /// Draws of several values.
    lists: Vec<String>,
}

impl<'a> Meaning<'a> {
    fn new(file: &'a str, raw: &'a RawScenario, mut library: ModelLibrary) -> Result<Self, ScenarioError> {
        let mut meaning =
            Meaning { file, raw, models: Vec::new(), choices: Vec::new(), scalars: Vec::new(), lists: Vec::new() };
        meaning.check_sizes()?;
        meaning.check_names()?;
        for object in &raw.object {
            let choice = meaning.choice(object, &library)?;
            let model = match choice.first() {
                Some(first) => first.clone(),
                None => meaning.model(object, &mut library)?,
            };
            meaning.models.push(model);
            meaning.choices.push(choice);
        }
        for draw in raw.random.iter().flat_map(|random| &random.draw) {
            let (name, is_list) = draw.name_and_shape();
            if is_list {
                meaning.lists.push(name.into());
            }
            meaning.scalars.extend(draw.scalars());
        }
        meaning.check_scalars()?;
        Ok(meaning)
    }

    fn scenario(&self) -> Result<Scenario, ScenarioError> {
        let world = self.world()?;
        let judge = self.judge()?;
        Ok(Scenario {
            name: self.raw.scenario.clone(),
            summary: self.raw.summary.clone(),
            paraphrases: self.raw.task.paraphrases.clone(),
            judge,
            world,
            task: self.task()?,
        })
    }

    fn wrong(&self, field: impl Into<String>, reason: impl Into<String>) -> ScenarioError {
        ScenarioError::Field { file: self.file.into(), field: field.into(), reason: reason.into() }
    }

    fn check_sizes(&self) -> Result<(), ScenarioError> {
        let raw = self.raw;
        let random = raw.random.as_ref();
        let sizes = [
            ("surface", raw.surface.len(), 1),
            ("camera", raw.camera.len(), 1),
            ("object", raw.object.len(), 0),
            ("place", raw.place.len(), 0),
            ("event", raw.event.len(), 0),
            ("region", raw.region.len(), 0),
            ("fluent", raw.fluent.len(), 0),
            ("rule", raw.rule.len(), 0),
            ("point", raw.point.len(), 0),
            ("derived", raw.derived.len(), 0),
            ("fault", raw.fault.len(), 0),
            ("task.then", raw.task.then.len(), 0),
            ("model", raw.model.len(), 0),
            ("random.draw", random.map_or(0, |r| r.draw.len()), 0),
            ("random.reject", random.map_or(0, |r| r.reject.len()), 0),
            ("judge.strict.stage", raw.judge.strict.stage.len(), 1),
        ];
        for (field, size, least) in sizes {
            if !(least..=MAX_ITEMS).contains(&size) {
                return Err(self.wrong(field, format!("{least} to {MAX_ITEMS} are possible, there are {size}")));
            }
        }
        Ok(())
    }

    fn check_names(&self) -> Result<(), ScenarioError> {
        let raw = self.raw;
        let draws = raw.random.iter().flat_map(|r| r.draw.iter().map(|draw| draw.name_and_shape().0));
        let objects = raw.object.iter().map(|object| object.name.as_str());
        let places = raw.place.iter().map(|place| place.name.as_str());
        let regions = raw.region.iter().map(|region| region.name.as_str());
        let fluents = raw.fluent.iter().map(|fluent| fluent.name.as_str());
        let points = raw.point.iter().map(|point| point.name.as_str());
        let derived = raw.derived.iter().map(|derived| derived.name.as_str());
        let mut seen: Vec<&str> = vec!["i", "n", "e"];
        for name in draws.chain(objects).chain(places).chain(regions).chain(fluents).chain(points).chain(derived) {
            if !is_name(name) {
                let reason = "a name needs a lower-case letter first, then lower-case letters, digits, underscores";
                return Err(self.wrong(format!("name `{name}`"), reason));
            }
            if seen.contains(&name) {
                return Err(self.wrong(
                    format!("name `{name}`"),
                    "is taken; give every draw, object, place, region, point, fluent and derived number its own",
                ));
            }
            seen.push(name);
        }
        if raw.scenario.is_empty()
            || !raw.scenario.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-')
        {
            return Err(self.wrong("scenario", "a scenario's name has lower-case letters, digits and dashes"));
        }
        Ok(())
    }

    fn task(&self) -> Result<TaskTemplate, ScenarioError> {
        let raw = &self.raw.task;
        let budgets = &raw.budgets;
        self.within("task.instruction_at_s", raw.instruction_at_s, 0.0, 3600.0)?;
        self.within("task.budgets.seconds", budgets.seconds, 1.0, 7200.0)?;
        if raw.instruction.trim().is_empty() {
            return Err(self.wrong("task.instruction", "is empty"));
        }
        Ok(TaskTemplate {
            instruction: raw.instruction.clone(),
            instruction_at_s: raw.instruction_at_s,
            budgets: Budgets { seconds: budgets.seconds, skills: budgets.skills, frames: budgets.frames },
            then: raw.then.iter().map(|then| self.then(then)).collect::<Result<_, _>>()?,
        })
    }

    fn then(&self, raw: &RawThen) -> Result<Further, ScenarioError> {
        self.within("task.then.after_s", raw.after_s, 0.0, 3600.0)?;
        if raw.instruction.trim().is_empty() {
            return Err(self.wrong("task.then.instruction", "is empty"));
        }
        Ok(Further { instruction: raw.instruction.clone(), after_s: raw.after_s })
    }

    fn world(&self) -> Result<WorldSpec, ScenarioError> {
        let raw = self.raw;
        let random = raw.random.as_ref();
        let draws: Vec<DrawSpec> = match random {
            Some(random) => random.draw.iter().enumerate().map(|(at, d)| self.draw(at, d)).collect::<Result<_, _>>()?,
            None => Vec::new(),
        };
        let attempts = random.map_or(1, |r| r.attempts);
        if attempts == 0 || attempts > MAX_ATTEMPTS {
            return Err(self.wrong("random.attempts", format!("{attempts} must lie in 1 to {MAX_ATTEMPTS}")));
        }
        let workspace = raw.robot.workspace.map(|[low, high]| [low.into(), high.into()]);
        let robot = robot::open(&raw.robot.model, raw.robot.home.map(DVec3::from), workspace)
            .map_err(|error| self.wrong("robot", error.to_string()))?;
        Ok(WorldSpec {
            surfaces: raw.surface.iter().map(|s| self.surface(s)).collect::<Result<_, _>>()?,
            lighting: raw.light.as_ref().map(|light| self.light(light)).transpose()?,
            cameras: raw.camera.iter().map(|c| self.camera(c)).collect::<Result<_, _>>()?,
            robot,
            stream: random.map_or(StreamKind::Chacha8, |r| r.stream),
            attempts,
            rejects: random.iter().flat_map(|r| &r.reject).map(|r| self.reject(r, &draws)).collect::<Result<_, _>>()?,
            draws,
            objects: (0..raw.object.len()).map(|at| self.object(at)).collect::<Result<_, _>>()?,
            places: raw.place.iter().map(|p| self.place(p)).collect::<Result<_, _>>()?,
            events: raw.event.iter().map(|e| self.event(e)).collect::<Result<_, _>>()?,
            regions: raw.region.iter().map(|r| self.region(r)).collect::<Result<_, _>>()?,
            fluents: raw.fluent.iter().map(|f| self.fluent(f)).collect::<Result<_, _>>()?,
            rules: raw.rule.iter().map(|r| self.rule(r)).collect::<Result<_, _>>()?,
            points: raw.point.iter().map(|p| self.point(p)).collect::<Result<_, _>>()?,
            derived: (0..raw.derived.len()).map(|at| self.derived(at)).collect::<Result<_, _>>()?,
            mishaps: self.mishaps()?,
        })
    }

    fn light(&self, raw: &RawLight) -> Result<LightSpec, ScenarioError> {
        let names = self.plain_names();
        let number = |number: &Number| self.number("light", number, &names);
        let triple = |numbers: &[Number; 3]| self.triple("light", numbers, &names);
        let point = |raw: &RawPointLight| Ok((triple(&raw.position)?, number(&raw.intensity)?));
        Ok(LightSpec {
            ambient: number(&raw.ambient)?,
            sun_direction: triple(&raw.sun_direction)?,
            sun: number(&raw.sun)?,
            points: raw.point.iter().map(point).collect::<Result<_, ScenarioError>>()?,
        })
    }

    fn mishaps(&self) -> Result<Vec<(MishapKind, u32)>, ScenarioError> {
        let mishap = |raw: &RawFault| match raw.at_carry {
            0 => Err(self.wrong("fault.at_carry", "carries are counted from 1")),
            carry => Ok((raw.kind, carry)),
        };
        self.raw.fault.iter().map(mishap).collect()
    }

    fn surface(&self, raw: &RawSurface) -> Result<SurfaceSpec, ScenarioError> {
        let size = DVec3::from(raw.size);
        if !(size.is_finite() && size.min_element() > 0.0 && size.max_element() <= 20.0) {
            return Err(self.wrong(format!("surface `{}`", raw.name), format!("size {size} must lie in (0, 20] m")));
        }
        Ok(SurfaceSpec {
            name: raw.name.clone(),
            size,
            position: raw.position.into(),
            color: raw.color,
            friction: raw.friction,
            support: raw.support,
            textures: self.textures(&format!("surface `{}`", raw.name), &raw.texture, &self.plain_names())?,
        })
    }

    fn textures(&self, field: &str, raw: &[RawTexture], names: &[&str]) -> Result<Vec<TextureSpec>, ScenarioError> {
        let field = format!("{field}.texture");
        let optional =
            |number: &Option<Number>| number.as_ref().map(|number| self.number(&field, number, names)).transpose();
        let texture = |raw: &RawTexture| {
            Ok(TextureSpec {
                kind: raw.kind,
                color: raw.color,
                hue_deg: optional(&raw.hue_deg)?,
                cell_m: optional(&raw.cell_m)?,
                when: raw.when.as_ref().map(|when| self.expression(&field, when, names)).transpose()?,
            })
        };
        raw.iter().map(texture).collect()
    }

    fn camera(&self, raw: &RawCamera) -> Result<CameraSpec, ScenarioError> {
        let field = format!("camera `{}`", raw.name);
        let pixels = raw.width as usize * raw.height as usize;
        if raw.width < 16 || raw.height < 16 || pixels > MAX_PIXELS {
            return Err(self.wrong(field, format!("{}x{} pixels: too few or too many", raw.width, raw.height)));
        }
        self.within(&format!("{field}.fov_y_deg"), raw.fov_y_deg, 1.0, 170.0)?;
        self.within(&format!("{field}.depth_max_m"), raw.depth_max_m, raw.depth_min_m.max(0.01), 100.0)?;
        let (forward, left) = (DVec3::from(raw.forward), DVec3::from(raw.left));
        // A camera frame has x right, y down, z forward.
        let (Some(z), Some(y)) = (forward.try_normalize(), forward.cross(-left).try_normalize()) else {
            return Err(self.wrong(field, "forward and left must be two different directions"));
        };
        let rotation = DQuat::from_mat3(&DMat3::from_cols(y.cross(z), y, z)).normalize();
        let model = CameraModel {
            name: raw.name.clone(),
            intrinsics: Intrinsics::from_vertical_fov(raw.width, raw.height, raw.fov_y_deg.to_radians()),
            pose: Pose::new(raw.position.into(), rotation),
            depth_min_m: raw.depth_min_m,
            depth_max_m: raw.depth_max_m,
            mount: match raw.mount {
                RawMount::World => Mount::World,
                RawMount::Hand => Mount::Hand,
            },
        };
        let exposure = self.number(&format!("{field}.exposure"), &raw.exposure, &self.plain_names())?;
        Ok(CameraSpec { model, sensor: raw.sensor.clone(), exposure })
    }

    fn draw(&self, at: usize, raw: &RawDraw) -> Result<DrawSpec, ScenarioError> {
        let (name, _) = raw.name_and_shape();
        let field = format!("draw `{name}`");
        // Only what was drawn before can be used.
        let before = self.scalars_of_first(at);
        let before = as_strs(&before);
        let number = |value: &Number| self.number(&field, value, &before);
        let repeat = |count: &Option<Number>| count.as_ref().map(&number).transpose();
        let (kind, count) = match raw {
            RawDraw::Uniform { low, high, count, .. } => {
                (DrawKind::Uniform { low: number(low)?, high: number(high)? }, repeat(count)?)
            }
            RawDraw::Normal { mean, deviation, count, .. } => {
                (DrawKind::Normal { mean: number(mean)?, deviation: number(deviation)? }, repeat(count)?)
            }
            RawDraw::Integer { low, high, count, .. } => {
                (DrawKind::Integer { low: number(low)?, high: number(high)? }, repeat(count)?)
            }
            RawDraw::Choice { from, count, .. } => {
                if from.is_empty() || from.len() > MAX_ITEMS {
                    return Err(self.wrong(field, format!("a choice needs 1 to {MAX_ITEMS} numbers")));
                }
                (DrawKind::Choice { from: from.clone() }, repeat(count)?)
            }
            RawDraw::Permutation { of, .. } => (DrawKind::Permutation, Some(number(of)?)),
            RawDraw::Value { is, .. } => (DrawKind::Value { is: number(is)? }, None),
        };
        Ok(DrawSpec { name: name.into(), kind, count, fixed: raw.fixed_count() })
    }

    fn reject(&self, raw: &RawReject, draws: &[DrawSpec]) -> Result<RejectSpec, ScenarioError> {
        let place_of = |field: &str, name: &String| {
            draws.iter().position(|draw| draw.name == *name).ok_or_else(|| {
                let names = draws.iter().map(|draw| draw.name.as_str());
                self.wrong(
                    format!("random.reject.{field}"),
                    format!("there is no draw `{name}`{}", nearest(name, names)),
                )
            })
        };
        let after = raw.after.as_ref().map(|name| place_of("after", name)).transpose()?;
        let redraw_from = raw.redraw_from.as_ref().map_or(Ok(0), |name| place_of("redraw_from", name))?;
        let rule = match (&raw.between, raw.nearer_than_m, &raw.when) {
            (Some(between), Some(nearer_than_m), None) if after.is_none() => self.nearness(between, nearer_than_m)?,
            (None, None, Some(when)) => {
                let known = after.map_or_else(|| self.others(), |at| self.scalars_of_first(at + 1));
                RejectRule::When(self.expression("random.reject.when", when, &as_strs(&known))?)
            }
            _ => {
                let reason = "needs either `between` and `nearer_than_m`, or `when`; `after` goes with `when`";
                return Err(self.wrong("random.reject", reason));
            }
        };
        if after.is_some_and(|after| redraw_from > after) {
            return Err(self.wrong("random.reject", "`redraw_from` is drawn only after `after`"));
        }
        Ok(RejectSpec { rule, redraw_from, after })
    }

    fn nearness(&self, between: &[String; 2], nearer_than_m: f64) -> Result<RejectRule, ScenarioError> {
        let known = || self.objects().chain(self.raw.place.iter().map(|place| place.name.as_str()));
        for name in between {
            if !known().any(|candidate| candidate == name) {
                let reason = format!("there is no object or place `{name}`{}", nearest(name, known()));
                return Err(self.wrong("random.reject.between", reason));
            }
        }
        self.within("random.reject.nearer_than_m", nearer_than_m, 0.0, 10.0)?;
        Ok(RejectRule::Near { between: between.clone(), nearer_than_m })
    }

    fn object(&self, at: usize) -> Result<ObjectSpec, ScenarioError> {
        let raw = &self.raw.object[at];
        let field = format!("object `{}`", raw.name);
        let model = &self.models[at];
        let mut names = self.plain_names();
        if raw.count.is_some() {
            names.extend(self.lists.iter().map(String::as_str));
            names.extend(["i", "n"]);
        }
        if raw.position.is_none() && raw.on.is_none() {
            return Err(self.wrong(field, "needs a position, or an object to stand `on`"));
        }
        let on = raw.on.as_ref().map(|on| {
            if !self.raw.object[..at].iter().any(|object| object.name == on.object) {
                return Err(self.wrong(&field, format!("stands on `{}`, which is not declared before it", on.object)));
            }
            self.reference(&field, on)
        });
        if let Some(perturb) = raw.perturb {
            self.within(&format!("{field}.perturb.share"), perturb.share, 0.0, 1.0)?;
            self.within(&format!("{field}.perturb.size_m"), perturb.size_m, 0.0, 0.01)?;
            self.within(&format!("{field}.perturb.bevel_m"), perturb.bevel_m, 0.0, 0.01)?;
        }
        let origin = [Number::Plain(0.0), Number::Plain(0.0), Number::Plain(0.0)];
        Ok(ObjectSpec {
            name: raw.name.clone(),
            model: model.clone(),
            choice: self.model_choice(at, &names)?,
            fixed: raw.fixed.unwrap_or(model.fixed),
            starts: self.starts(&field, raw, model, &names)?,
            shows: self.shows(&field, raw, model)?,
            count: raw.count.as_ref().map(|count| self.number(&field, count, &self.plain_names())).transpose()?,
            position: self.triple(&field, raw.position.as_ref().unwrap_or(&origin), &names)?,
            yaw: self.number(&field, raw.yaw.as_ref().unwrap_or(&Number::Plain(0.0)), &names)?,
            on: on.transpose()?,
            scale: raw.scale.as_ref().map(|scale| self.triple(&field, scale, &names)).transpose()?,
            hue_deg: raw.hue_deg.as_ref().map(|hue| self.number(&field, hue, &names)).transpose()?,
            textures: self.textures(&field, &raw.texture, &names)?,
            density_kg_m3: raw.density_kg_m3.as_ref().map(|kg| self.number(&field, kg, &names)).transpose()?,
            friction: raw.friction.as_ref().map(|mu| self.number(&field, mu, &names)).transpose()?,
            perturb: raw.perturb,
        })
    }

    /// The models of an object that has several to choose from.
    fn choice(&self, raw: &RawObject, library: &ModelLibrary) -> Result<Vec<Arc<ObjectModel>>, ScenarioError> {
        let field = format!("object `{}`.models", raw.name);
        if raw.models.is_empty() != raw.which.is_none() || raw.models.len() > MAX_ITEMS {
            return Err(self.wrong(field, format!("`models`, 1 to {MAX_ITEMS} of them, and `which` go together")));
        }
        if !raw.models.is_empty() && (raw.model.is_some() || raw.model_file.is_some()) {
            return Err(self.wrong(field, "needs either `model`, or `models` and `which`, or `model_file`"));
        }
        let find = |name: &String| {
            let found = library.get(name).cloned().ok_or_else(|| {
                self.wrong(&field, format!("there is no object model `{name}`{}", nearest(name, library.names())))
            })?;
            if found.links.len() > 1 || found.shows().next().is_some() {
                return Err(self.wrong(&field, format!("`{name}` has links or lamps; one to choose from has none")));
            }
            Ok(found)
        };
        raw.models.iter().map(find).collect()
    }

    fn model_choice(&self, at: usize, names: &[&str]) -> Result<Option<ModelChoice>, ScenarioError> {
        let raw = &self.raw.object[at];
        let Some(which) = &raw.which else { return Ok(None) };
        let which = self.number(&format!("object `{}`.which", raw.name), which, names)?;
        Ok(Some(ModelChoice { models: self.choices[at].clone(), which }))
    }

    fn model(&self, raw: &RawObject, library: &mut ModelLibrary) -> Result<Arc<ObjectModel>, ScenarioError> {
        let field = format!("object `{}`", raw.name);
        match (&raw.model, &raw.model_file) {
            (Some(name), None) => library.get(name).cloned().ok_or_else(|| {
                let known = library.names().collect::<Vec<_>>().join(", ");
                let hint = nearest(name, library.names());
                self.wrong(&field, format!("there is no object model `{name}`{hint}; known: {known}"))
            }),
            (None, Some(file)) => {
                let folder = Path::new(self.file).parent().unwrap_or(Path::new(""));
                library.load(file, folder).map_err(|reason| self.wrong(format!("{field}.model_file"), reason))
            }
            _ => Err(self.wrong(field, "needs either `model`, or `models` and `which`, or `model_file`")),
        }
    }

    fn starts(
        &self,
        field: &str,
        raw: &RawObject,
        model: &ObjectModel,
        names: &[&str],
    ) -> Result<Vec<(usize, Expression)>, ScenarioError> {
        let known = || model.joints().map(|(link, _)| model.links[link].name.as_str());
        let start = |(name, number): (&String, &Number)| {
            let found = model.joints().find(|(link, _)| model.links[*link].name == *name);
            let Some((link, _)) = found else {
                let reason = format!("there is no joint `{name}`{}", nearest(name, known()));
                return Err(self.wrong(format!("{field}.joints"), reason));
            };
            Ok((link, self.number(&format!("{field}.joints.{name}"), number, names)?))
        };
        raw.joints.iter().map(start).collect()
    }

    fn shows(
        &self,
        field: &str,
        raw: &RawObject,
        model: &ObjectModel,
    ) -> Result<Vec<(String, Expression)>, ScenarioError> {
        let known = self.variables();
        let shown = |(name, text): (&String, &String)| {
            if !model.shows().any(|(known, _)| known == name) {
                let hint = nearest(name, model.shows().map(|(known, _)| known));
                return Err(self.wrong(format!("{field}.shows"), format!("there is no lamp or gauge `{name}`{hint}")));
            }
            let expression = self.expression(&format!("{field}.shows.{name}"), text, &as_strs(&known))?;
            Ok((name.clone(), expression))
        };
        raw.shows.iter().map(shown).collect()
    }

    fn place(&self, raw: &RawPlace) -> Result<PlaceSpec, ScenarioError> {
        let field = format!("place `{}`", raw.name);
        let at = match (&raw.of, &raw.centroid_of, &raw.position) {
            (Some(of), None, None) => PlaceAt::Object(self.reference(&field, of)?),
            (None, Some(object), None) => PlaceAt::CentroidOf(self.known_object(&field, object)?),
            (None, None, Some(position)) => PlaceAt::Position(self.triple(&field, position, &self.plain_names())?),
            _ => return Err(self.wrong(field, "needs exactly one of `of`, `centroid_of`, `position`")),
        };
        Ok(PlaceSpec { name: raw.name.clone(), at })
    }

    fn event(&self, raw: &RawEvent) -> Result<EventSpec, ScenarioError> {
        let field = format!("event `{}`", raw.name);
        self.within(&format!("{field}.after_s"), raw.after_s, 0.0, 7200.0)?;
        // At once, or slowly enough to be a motion.
        if raw.over_s != 0.0 {
            self.within(&format!("{field}.over_s"), raw.over_s, 0.02, 600.0)?;
        }
        self.within(&format!("{field}.lift_m"), raw.lift_m, 0.0, 2.0)?;
        let (others, known) = (self.others(), self.variables());
        let when = raw.when.as_ref().map(|text| self.expression(&field, text, &as_strs(&known))).transpose()?;
        let others = as_strs(&others);
        Ok(EventSpec {
            name: raw.name.clone(),
            after_s: raw.after_s,
            when,
            over_s: raw.over_s,
            deed: self.deed(&field, raw, &others)?,
        })
    }

    fn deed(&self, field: &str, raw: &RawEvent, names: &[&str]) -> Result<DeedSpec, ScenarioError> {
        match (&raw.carry, &raw.to, raw.cover.as_slice(), raw.freeze.as_slice(), &raw.jam) {
            (Some(carry), Some(to), [], [], None) => Ok(DeedSpec::Carry {
                object: self.reference(field, carry)?,
                to: self.triple(field, to, names)?,
                yaw: self.number(field, raw.yaw.as_ref().unwrap_or(&Number::Plain(0.0)), names)?,
                lift_m: raw.lift_m,
            }),
            (None, None, cover @ [_, ..], [], None) => Ok(DeedSpec::Cover { cameras: self.cameras(field, cover)? }),
            (None, None, [], freeze @ [_, ..], None) => Ok(DeedSpec::Freeze { cameras: self.cameras(field, freeze)? }),
            (None, None, [], [], Some(jam)) => self.jam(field, jam),
            _ => Err(self.wrong(field, "needs either `carry` and `to`, or `cover`, or `freeze`, or `jam`")),
        }
    }

    fn jam(&self, field: &str, raw: &RawJointReference) -> Result<DeedSpec, ScenarioError> {
        let field = format!("{field}.jam");
        let object = self.known_object(&field, &raw.object)?;
        let at = self
            .raw
            .object
            .iter()
            .position(|known| known.name == object)
            .filter(|at| self.raw.object[*at].count.is_none());
        let at =
            at.ok_or_else(|| self.wrong(&field, format!("`{object}` has copies; only one without can be named")))?;
        let model = &self.models[at];
        let known = || model.joints().map(|(link, _)| model.links[link].name.as_str());
        match model.joints().find(|(link, _)| model.links[*link].name == raw.joint) {
            Some((link, _)) => Ok(DeedSpec::Jam { object, link }),
            None => {
                let reason = format!("`{object}` has no joint `{}`{}", raw.joint, nearest(&raw.joint, known()));
                Err(self.wrong(field, reason))
            }
        }
    }

    /// Indices of named cameras.
    fn cameras(&self, field: &str, names: &[String]) -> Result<Vec<usize>, ScenarioError> {
        let known = || self.raw.camera.iter().map(|camera| camera.name.as_str());
        let camera = |name: &String| {
            known()
                .position(|camera| camera == name)
                .ok_or_else(|| self.wrong(field, format!("there is no camera `{name}`{}", nearest(name, known()))))
        };
        names.iter().map(camera).collect()
    }

    fn judge(&self) -> Result<JudgeSpec, ScenarioError> {
        let raw = &self.raw.judge;
        for name in &raw.moves {
            self.known_object("judge.moves", name)?;
        }
        // A draw may be called as an object's variable is and then hides it; two objects' variables may not.
        let of_objects = self.names_with(&[]);
        if let Some(twice) = of_objects.iter().enumerate().find(|(at, name)| of_objects[..*at].contains(name)) {
            return Err(
                self.wrong(format!("name `{}`", twice.1), "stands for two things; rename the object or the joint")
            );
        }
        let known = self.variables();
        let known = as_strs(&known);
        Ok(JudgeSpec {
            moves: raw.moves.clone(),
            strict: self.predicate("judge.strict", &raw.strict, &known)?,
            faithful: raw.faithful.as_ref().map(|p| self.predicate("judge.faithful", p, &known)).transpose()?,
        })
    }

    fn predicate(&self, field: &str, raw: &RawPredicate, known: &[&str]) -> Result<PredicateSpec, ScenarioError> {
        let last = raw.stage.len().saturating_sub(1);
        let stage = |(at, raw): (usize, &RawStage)| {
            let field = format!("{field}.stage `{}`", raw.name);
            self.within(&format!("{field}.hold_s"), raw.hold_s, 0.0, 60.0)?;
            if raw.at_end && at != last {
                return Err(self.wrong(field, "only the last stage can ask for at_end"));
            }
            let when = self.expression(&field, &raw.when, known)?;
            Ok(StageSpec { name: raw.name.clone(), when, hold_s: raw.hold_s, at_end: raw.at_end })
        };
        let violation = |violation: &RawViolation| {
            let field = format!("{field}.violation `{}`", violation.name);
            let before = violation.before.as_ref().map(|name| {
                let found = raw.stage.iter().position(|stage| stage.name == *name);
                found.ok_or_else(|| self.wrong(&field, format!("there is no stage `{name}`")))
            });
            let when = self.expression(&field, &violation.when, known)?;
            Ok(ViolationSpec { name: violation.name.clone(), when, before: before.transpose()? })
        };
        Ok(PredicateSpec {
            stages: raw.stage.iter().enumerate().map(stage).collect::<Result<_, _>>()?,
            violations: raw.violation.iter().map(violation).collect::<Result<_, _>>()?,
        })
    }

    fn objects(&self) -> impl Iterator<Item = &str> {
        self.raw.object.iter().map(|object| object.name.as_str())
    }
    fn known_object(&self, field: &str, name: &str) -> Result<String, ScenarioError> {
        if self.objects().any(|known| known == name) {
            return Ok(name.into());
        }
        Err(self.wrong(field, format!("there is no object `{name}`{}", nearest(name, self.objects()))))
    }
    fn reference(&self, field: &str, raw: &RawReference) -> Result<Reference, ScenarioError> {
        let object = self.known_object(field, &raw.object)?;
        let index = raw.index.as_ref().map(|index| self.number(field, index, &self.plain_names())).transpose()?;
        Ok(Reference { object, index })
    }
    /// Names of objects' variables and of some others.
    fn names_with(&self, others: &[String]) -> Vec<String> {
        let named = |object: &'a RawObject| object.count.is_none().then_some(object.name.as_str());
        let objects = self.raw.object.iter().zip(&self.models).map(|(object, model)| (named(object), &**model));
        oracle::names(objects, others)
    }
    /// All variables of the judge, of events and of rules.
    fn variables(&self) -> Vec<String> {
        let mut names = self.names_with(&self.others());
        let single: Vec<&str> =
            self.raw.object.iter().filter(|o| o.count.is_none()).map(|object| object.name.as_str()).collect();
        let regions = self.raw.region.iter().map(|region| region.name.as_str());
        names.extend(state_of::names(regions, self.raw.fluent.iter().map(|fluent| fluent.name.as_str()), &single));
        let points = self.raw.point.iter().map(|point| point.name.as_str());
        names.extend(derived::names(points, self.raw.derived.iter().map(|derived| derived.name.as_str())));
        names
    }
    /// Constants that the judge can name: places and plain draws.
    fn others(&self) -> Vec<String> {
        let places = self.raw.place.iter().flat_map(|p| ["x", "y", "z"].map(|axis| format!("{}_{axis}", p.name)));
        places.chain(self.scalars.iter().cloned()).collect()
    }
    /// Plain draws that the first draws of the file make.
    fn scalars_of_first(&self, draws: usize) -> Vec<String> {
        self.raw.random.iter().flat_map(|r| &r.draw).take(draws).flat_map(RawDraw::scalars).collect()
    }
    /// The values of lists have names, which nothing else may have.
    fn check_scalars(&self) -> Result<(), ScenarioError> {
        let raw = self.raw;
        let named = |name: &String| {
            let twice = self.scalars.iter().filter(|scalar| *scalar == name).count() > 1;
            twice
                || self.lists.contains(name)
                || raw.object.iter().any(|object| object.name == *name)
                || raw.place.iter().any(|place| place.name == *name)
                || raw.region.iter().any(|region| region.name == *name)
                || raw.fluent.iter().any(|fluent| fluent.name == *name)
                || raw.point.iter().any(|point| point.name == *name)
                || raw.derived.iter().any(|derived| derived.name == *name)
        };
        match self.scalars.iter().find(|scalar| named(scalar)) {
            Some(name) => {
                Err(self.wrong(format!("name `{name}`"), "is that of a value in a list of draws; choose another"))
            }
            None => Ok(()),
        }
    }
    fn plain_names(&self) -> Vec<&str> {
        self.scalars.iter().map(String::as_str).collect()
    }

    fn triple(&self, field: &str, numbers: &[Number; 3], names: &[&str]) -> Result<[Expression; 3], ScenarioError> {
        let [x, y, z] = numbers;
        Ok([self.number(field, x, names)?, self.number(field, y, names)?, self.number(field, z, names)?])
    }
    fn number(&self, field: &str, number: &Number, names: &[&str]) -> Result<Expression, ScenarioError> {
        match number {
            Number::Plain(value) if !value.is_finite() => Err(self.wrong(field, format!("{value} is not finite"))),
            // The sign would be read as an operator, which is fine.
            Number::Plain(value) => self.expression(field, &format!("{value}"), names),
            Number::Expression(text) => self.expression(field, text, names),
        }
    }
    fn expression(&self, field: &str, text: &str, names: &[&str]) -> Result<Expression, ScenarioError> {
        Expression::parse(text, names).map_err(|source| ScenarioError::Expression {
            file: self.file.into(),
            field: field.into(),
            source,
        })
    }
    fn within(&self, field: &str, value: f64, low: f64, high: f64) -> Result<(), ScenarioError> {
        if (low..=high).contains(&value) {
            return Ok(());
        }
        Err(self.wrong(field, format!("{value} must lie in {low} to {high}")))
    }
}

impl RawDraw {
    /// The name, and whether it stands for several values.
    fn name_and_shape(&self) -> (&str, bool) {
        match self {
            RawDraw::Uniform { name, count, .. }
            | RawDraw::Normal { name, count, .. }
            | RawDraw::Integer { name, count, .. }
            | RawDraw::Choice { name, count, .. } => (name, count.is_some()),
            RawDraw::Permutation { name, .. } => (name, true),
            RawDraw::Value { name, .. } => (name, false),
        }
    }
    /// How many values a list has, where the file says so with a plain number.
    fn fixed_count(&self) -> Option<usize> {
        let count = match self {
            RawDraw::Uniform { count, .. }
            | RawDraw::Normal { count, .. }
            | RawDraw::Integer { count, .. }
            | RawDraw::Choice { count, .. } => count.as_ref()?,
            RawDraw::Permutation { of, .. } => of,
            RawDraw::Value { .. } => return None,
        };
        match count {
            Number::Plain(count) if (0.0..=MAX_COUNT as f64).contains(count) => Some(*count as usize),
            _ => None,
        }
    }
    /// Names of its plain values.
    fn scalars(&self) -> Vec<String> {
        match self.name_and_shape() {
            (name, false) => vec![name.into()],
            (name, true) => (0..self.fixed_count().unwrap_or(0)).map(|place| element(name, place)).collect(),
        }
    }
}

fn as_strs(names: &[String]) -> Vec<&str> {
    names.iter().map(String::as_str).collect()
}
