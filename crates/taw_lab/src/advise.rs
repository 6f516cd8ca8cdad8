//! Which model for a scene of one's own.
//!
//! The reference is the scene in `f64` by the most exact model, in steps that are halved until
//! two runs agree. How long places can be told beforehand is measured too: by two references that
//! differ in the last bit. Until then places are compared, marble by marble; after it what
//! remains meaningful: heights and speeds of all together, the energy, how deep things overlap.

use std::fmt::Write;
use std::time::{Duration, Instant};

use taw::prelude::*;
use taw::scene::Scene;

use crate::scene::EXACT;
use crate::trade::models::MODELS;
use crate::trade::sweep::COUNTS;
use crate::trade::trace::{Frame, Number, Setting, time, trace};

/// Reads a scene.
///
/// # Errors
/// Line, column, field and reason, as text.
pub fn read_scene(text: &str) -> Result<Scene, String> {
    let options =
        ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
    let mut reader =
        ron::Deserializer::from_str_with_options(text, &options).map_err(|e| e.to_string())?;
    let scene: Scene = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let field = error.path().to_string();
        let spanned = reader.span_error(error.into_inner());
        let ron::error::Position { line, col } = spanned.span.end;
        format!("{line}:{col}: {field}: {}", spanned.code)
    })?;
    reader.end().map_err(|error| reader.span_error(error).to_string())?;
    // What no single number shows: a world tells.
    scene.run::<f64>(Model::default()).map_err(|error| error.to_string())?;
    Ok(scene)
}

/// What is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wish {
    /// How wrong places may be, in metres.
    pub most: Option<f64>,
    /// How long a step may take, in seconds.
    pub budget: Option<f64>,
    /// The step of the game, in seconds.
    pub step: f64,
}

/// How a setting did.
#[derive(Clone, Debug)]
pub struct Choice {
    /// The name of the model.
    pub name: &'static str,
    /// All of it.
    pub setting: Setting,
    /// The furthest that a marble was from where it should be while that can be told, in metres.
    pub error: f64,
    /// What remains meaningful at any time.
    pub whole: Whole,
    /// Seconds for a step.
    pub cost: f64,
}

/// How far all marbles together are from the reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Whole {
    /// Of the heights, from the lowest to the highest marble: the mean difference, in metres.
    pub heights: f64,
    /// The same of the speeds, in m/s.
    pub speeds: f64,
    /// The mean overlap of a marble, in metres.
    pub overlap: f64,
}

/// What came out.
#[derive(Clone, Debug)]
pub struct Advice {
    /// Until when places can be told, in seconds; the scene's length if always.
    pub told: f64,
    /// Up to how much the references agree until then, in metres.
    pub sure: f64,
    /// The step of the reference, in seconds.
    pub reference: f64,
    /// All settings, the cheapest first.
    pub choices: Vec<Choice>,
}

/// Steps of the reference, the longest first.
const REFINED: [f64; 4] = [1.0 / 240.0, 1.0 / 480.0, 1.0 / 960.0, 1.0 / 1920.0];
/// A model that takes so long for a scene is not tried with more substeps.
const LONG: Duration = Duration::from_secs(1);
/// What counts as the same place, as a part of the smallest radius.
const SAME: f64 = 0.01;

/// Measures all models on a scene.
#[must_use]
pub fn advise(scene: &Scene, wish: Wish, mut tell: impl FnMut(usize, usize)) -> Advice {
    let radius = scene.balls().map(|ball| ball.radius).fold(f64::MAX, f64::min);
    let same = wish.most.map_or(SAME * radius, |most| (0.25 * most).min(SAME * radius));
    let run = |scene: &Scene, step| {
        trace(scene, Setting { model: EXACT, number: Number::F64, step }).unwrap_or_default()
    };
    let mut reference = run(scene, REFINED[0]);
    let (mut told, mut sure, mut used) = (0.0, 0.0, REFINED[0]);
    for step in &REFINED[1..] {
        let (finer, before) = (run(scene, *step), told);
        (told, sure) = agreement(&reference, &finer, same);
        (reference, used) = (finer, *step);
        // What is chaotic does not become less so.
        if told >= scene.seconds || told > 0.0 && told < 1.2 * before {
            break;
        }
    }
    let (other, _) = agreement(&reference, &run(&nudged(scene), used), same);
    told = told.min(other);
    let groups = settings(wish);
    let count = groups.len();
    let mut choices = Vec::new();
    for (i, (name, settings)) in groups.into_iter().enumerate() {
        tell(i, count);
        for setting in settings {
            let begin = Instant::now();
            let Some(frames) = trace(scene, setting) else { continue };
            let until = frames.iter().take_while(|frame| frame.time <= told + 1e-9).count();
            let error = distances(&frames[..until], &reference).fold(0.0, f64::max);
            let whole = Whole::between(&frames, &reference);
            let long = begin.elapsed();
            let mut times: Vec<_> = (0..3)
                .take_while(|i| *i == 0 || long < LONG / 10)
                .map(|_| time(scene, setting) / (scene.seconds / setting.step).round())
                .collect();
            times.sort_unstable_by(f64::total_cmp);
            choices.push(Choice { name, setting, error, whole, cost: times[times.len() / 2] });
            if long > LONG {
                break;
            }
        }
    }
    choices.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    Advice { told, sure, reference: used, choices }
}

/// For each model, number and count of iterations, its settings from the cheapest on.
fn settings(wish: Wish) -> Vec<(&'static str, Vec<Setting>)> {
    let mut groups = Vec::new();
    for named in &MODELS {
        let iterations: &[u32] =
            if named.iterates { &[4, 8, 32] } else { &[named.model.iterations] };
        for number in [Number::F32, Number::F64] {
            for iterations in iterations {
                let setting = |substeps| {
                    let model = Model { substeps, iterations: *iterations, ..named.model };
                    Setting { model, number, step: wish.step }
                };
                groups.push((named.name, COUNTS.map(setting).to_vec()));
            }
        }
    }
    groups
}

/// Until when two runs agree, and up to how much until then.
fn agreement(a: &[Frame], b: &[Frame], same: f64) -> (f64, f64) {
    let (mut told, mut sure) = (0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let apart = distances(std::slice::from_ref(a), std::slice::from_ref(b)).fold(0.0, f64::max);
        if apart > same {
            break;
        }
        (told, sure) = (a.time, f64::max(sure, apart));
    }
    (told, sure)
}

fn distances<'a>(a: &'a [Frame], b: &'a [Frame]) -> impl Iterator<Item = f64> + 'a {
    a.iter().zip(b).flat_map(|(a, b)| a.at.iter().zip(&b.at).map(|(a, b)| a.distance(*b)))
}

/// The scene with every marble moved by the last bit of its place.
fn nudged(scene: &Scene) -> Scene {
    let marbles = scene.balls().map(|mut ball| {
        ball.position = ball.position.map(|x| if x == 0.0 { 1e-17 } else { x.next_up() });
        ball
    });
    Scene { marbles: marbles.collect(), lattices: Vec::new(), ..scene.clone() }
}

impl Whole {
    fn between(a: &[Frame], b: &[Frame]) -> Self {
        let frames = a.len().min(b.len()).max(1) as f64;
        let mut whole = Self::default();
        for (a, b) in a.iter().zip(b) {
            let heights = |frame: &Frame| frame.at.iter().map(|at| at.y).collect();
            let speeds = |frame: &Frame| frame.velocity.iter().map(|v| v.magnitude()).collect();
            whole.heights += apart(heights(a), heights(b)) / frames;
            whole.speeds += apart(speeds(a), speeds(b)) / frames;
            whole.overlap += a.overlap / a.at.len().max(1) as f64 / frames;
        }
        whole
    }
}

/// How far two distributions are apart: what has to be moved how far (Wasserstein).
fn apart(mut a: Vec<f64>, mut b: Vec<f64>) -> f64 {
    a.sort_unstable_by(f64::total_cmp);
    b.sort_unstable_by(f64::total_cmp);
    a.iter().zip(&b).map(|(a, b)| (a - b).abs()).sum::<f64>() / a.len().max(1) as f64
}

impl Choice {
    /// How wrong it is, in metres: of places while these can be told, of heights and overlaps
    /// always.
    #[must_use]
    pub fn wrong(&self) -> f64 {
        self.error.max(self.whole.heights).max(self.whole.overlap)
    }
}

impl Advice {
    /// The cheapest that is right enough, or the most exact that is cheap enough.
    #[must_use]
    pub fn best(&self, wish: Wish) -> Option<&Choice> {
        let affordable =
            self.choices.iter().filter(|choice| wish.budget.is_none_or(|most| choice.cost <= most));
        let right = affordable.filter(|choice| wish.most.is_none_or(|most| choice.wrong() <= most));
        match wish.most {
            Some(_) => right.min_by(|a, b| a.cost.total_cmp(&b.cost)),
            None => right.min_by(|a, b| a.wrong().total_cmp(&b.wrong())),
        }
    }

    /// Those that no other one beats in both.
    #[must_use]
    pub fn front(&self) -> Vec<&Choice> {
        let mut best = f64::MAX;
        let better = |choice: &&Choice| {
            let better = choice.wrong() < 0.99 * best;
            if better {
                best = choice.wrong();
            }
            better
        };
        self.choices.iter().filter(better).collect()
    }

    /// All of it in words.
    #[must_use]
    pub fn text(&self, scene: &Scene, wish: Wish) -> String {
        let mut text = String::new();
        let _ = self.write(&mut text, scene, wish);
        text
    }

    fn write(&self, text: &mut String, scene: &Scene, wish: Wish) -> std::fmt::Result {
        let Self { told, sure, reference, choices } = self;
        writeln!(text, "reference: event-driven, f64, {:.2} ms a step", reference * 1e3)?;
        if *told >= scene.seconds - 1e-9 {
            writeln!(text, "places can be told to the end; references agree to {sure:.1e} m")?;
        } else {
            writeln!(
                text,
                "chaotic: places can be told for {told:.1} of {:.1} s (to {sure:.1e} m); after that \
                 heights, speeds and overlaps of all marbles are compared",
                scene.seconds
            )?;
        }
        writeln!(
            text,
            "\n| model | number | substeps × iterations | µs a step | place, m | heights, m | speeds, m/s | overlap, m |"
        )?;
        writeln!(text, "|---|---|---|---|---|---|---|---|")?;
        for choice in self.front() {
            let Choice { name, setting, error, whole, cost } = choice;
            let Model { substeps, iterations, .. } = setting.model;
            writeln!(
                text,
                "| {name} | {} | {substeps} × {iterations} | {:.1} | {error:.1e} | {:.1e} | {:.1e} | {:.1e} |",
                setting.number,
                cost * 1e6,
                whole.heights,
                whole.speeds,
                whole.overlap
            )?;
        }
        if wish.most.is_none() && wish.budget.is_none() {
            return Ok(());
        }
        match self.best(wish) {
            Some(choice) => {
                let Choice { name, setting, cost, .. } = choice;
                writeln!(
                    text,
                    "\n{name} in {}: {:.1e} m for {:.1} µs a step of {:.2} ms\n\n{}",
                    setting.number,
                    choice.wrong(),
                    cost * 1e6,
                    wish.step * 1e3,
                    literal(setting.model)
                )
            }
            None => writeln!(text, "\nnone of {} settings does what was asked for", choices.len()),
        }
    }
}

/// A model as one writes it in Rust.
#[must_use]
pub fn literal(model: Model) -> String {
    let Model { integrator, response, rotation, precision, detection, substeps, iterations } =
        model;
    let response = match response {
        Response::Penalty(law) => format!("Penalty(ContactLaw::{law:?})"),
        other => format!("{other:?}"),
    };
    format!(
        "Model {{\n    integrator: Integrator::{integrator:?},\n    response: \
         Response::{response},\n    rotation: Rotation::{rotation:?},\n    precision: \
         Precision::{precision:?},\n    detection: Detection::{detection:?},\n    substeps: \
         {substeps},\n    iterations: {iterations},\n}}"
    )
}

/// A number with a unit, of those that are given with what each is worth.
///
/// # Errors
/// Why it is none, as text.
pub fn quantity(text: &str, units: &[(&str, f64)]) -> Result<f64, String> {
    let begin =
        text.find(|c: char| c.is_alphabetic() && c != 'e' && c != 'E').unwrap_or(text.len());
    let (number, unit) = text.split_at(begin);
    let names = || units.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
    let worth = units.iter().find(|(name, _)| *name == unit.trim()).map(|(_, worth)| *worth);
    match (number.trim().parse::<f64>(), worth) {
        (Ok(number), Some(worth)) if number > 0.0 && number.is_finite() => Ok(number * worth),
        _ => Err(format!("{text:?} is not a number above zero with one of the units {}", names())),
    }
}
