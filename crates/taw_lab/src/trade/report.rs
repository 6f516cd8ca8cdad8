//! Summary of points.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use super::scenes::SCENES;
use super::{Point, chart};

/// The points of one model in one scalar on one scene.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Engine, model and scalar.
    pub name: String,
    /// By cost.
    pub points: Vec<Point>,
    /// Order of convergence: slope of the error over the length of the substep on logarithmic axes,
    /// if it falls over at least three lengths, from the longest one on.
    pub order: Option<f64>,
    /// The error never grew by more than a hundredth for a shorter substep.
    pub monotone: bool,
}

impl Curve {
    /// The least that an error of at most this much cost, with the setting.
    #[must_use]
    pub fn cost_of(&self, error: f64) -> Option<&Point> {
        let good =
            |point: &&Point| point.failure.is_none() && point.error.is_some_and(|e| e <= error);
        self.points.iter().filter(good).min_by(|a, b| a.cost.total_cmp(&b.cost))
    }
}

/// All curves of a scene, by name.
#[must_use]
pub fn curves(points: &[Point], scene: &str) -> Vec<Curve> {
    let mut groups: Vec<(String, Vec<Point>)> = Vec::new();
    for point in points.iter().filter(|point| point.scene == scene) {
        let engine =
            if point.engine == "taw" { String::new() } else { format!("{}: ", point.engine) };
        let name = format!("{engine}{}, {}", point.model, point.number);
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, group)) => group.push(point.clone()),
            None => groups.push((name, vec![point.clone()])),
        }
    }
    groups
        .into_iter()
        .map(|(name, mut points)| {
            let (order, monotone) = convergence(&points);
            points.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            Curve { name, points, order, monotone }
        })
        .collect()
}

/// The order, and whether it is monotone: with most iterations, and one substep in a step, so
/// that only its length changes.
fn convergence(points: &[Point]) -> (Option<f64>, bool) {
    let most = points.iter().map(|point| point.iterations).max().unwrap_or(0);
    let mut line: Vec<(f64, f64)> = points
        .iter()
        .filter(|point| point.iterations == most && point.failure.is_none())
        .filter_map(|point| Some((point.seconds / f64::from(point.substeps), point.error?)))
        .collect();
    line.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
    line.dedup_by(|a, b| (a.0 / b.0 - 1.0).abs() < 1e-4);
    let monotone = line.windows(2).all(|pair| pair[1].1 <= pair[0].1 * 1.01);
    // At the floor of the scalar or of the model nothing falls any more.
    let falls = line.windows(2).take_while(|pair| pair[1].1 < 0.8 * pair[0].1).count();
    line.truncate(falls + 1);
    (slope(&line), monotone)
}

/// Slope of the regression line of the logarithms.
fn slope(line: &[(f64, f64)]) -> Option<f64> {
    if line.len() < 3 {
        return None;
    }
    let logs: Vec<_> = line.iter().map(|(h, error)| (h.ln(), error.ln())).collect();
    let count = logs.len() as f64;
    let (sum_x, sum_y) = logs.iter().fold((0.0, 0.0), |(x, y), log| (x + log.0, y + log.1));
    let (mean_x, mean_y) = (sum_x / count, sum_y / count);
    let across: f64 = logs.iter().map(|(x, y)| (x - mean_x) * (y - mean_y)).sum();
    let along: f64 = logs.iter().map(|(x, _)| (x - mean_x).powi(2)).sum();
    Some(across / along)
}

/// The points that no other one beats in both: by cost, each more exact by a hundredth than all
/// before.
#[must_use]
pub fn front<'a>(points: impl IntoIterator<Item = &'a Point>) -> Vec<&'a Point> {
    let mut points: Vec<_> = points
        .into_iter()
        .filter(|point| point.failure.is_none() && point.error.is_some())
        .collect();
    let error = |point: &Point| point.error.unwrap_or(f64::MAX);
    points.sort_by(|a, b| a.cost.total_cmp(&b.cost).then(error(a).total_cmp(&error(b))));
    let mut best = f64::MAX;
    points.retain(|point| {
        let better = error(point) < 0.99 * best;
        if better {
            best = error(point);
        }
        better
    });
    points
}

/// Writes `points.csv` and `points.json` into a folder.
///
/// # Errors
/// Errors of writing.
pub fn write_tables(points: &[Point], folder: &Path) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder)?;
    let mut csv = csv::Writer::from_path(folder.join("points.csv"))?;
    for point in points {
        csv.serialize(point)?;
    }
    csv.flush()?;
    std::fs::write(folder.join("points.json"), serde_json::to_string_pretty(points)?)?;
    Ok(())
}

/// Writes a report in Markdown, and beside it, in a folder of its name, a chart of each scene as
/// SVG and PNG.
///
/// # Errors
/// Errors of writing and drawing.
pub fn write_report(points: &[Point], file: &Path) -> Result<(), Box<dyn std::error::Error>> {
    let folder = file.with_extension("");
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    std::fs::create_dir_all(&folder)?;
    let mut scenes: Vec<&str> = points.iter().map(|point| point.scene.as_str()).collect();
    scenes.dedup();
    let mut text = String::from(HEAD);
    writeln!(text, "\nMeasured on: {}.\n", machine())?;
    guide(&mut text, points)?;
    let noted = points.iter().filter(|point| !point.note.is_empty());
    let notes: BTreeSet<_> =
        noted.map(|point| format!("- {}: {}.\n", point.engine, point.note)).collect();
    if !notes.is_empty() {
        text += "\n## Other engines\n\n";
        text.extend(notes);
    }
    for scene in scenes {
        let curves = curves(points, scene);
        chart::draw(scene, &curves, &folder)?;
        describe(&mut text, scene, &name, &curves)?;
    }
    std::fs::write(file, text)?;
    Ok(())
}

/// The processor, as far as the system tells.
fn machine() -> String {
    let told = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name = told.lines().find_map(|line| line.strip_prefix("model name")?.split_once(": "));
    let name = name.map_or(std::env::consts::ARCH, |(_, name)| name);
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    format!("{name}, {cores} cores")
}

/// Kinds of games, and the scenes that have what counts in them.
const KINDS: [(&str, &[&str]); 7] = [
    ("billiards", &["skid", "carom"]),
    ("pachinko", &["pachinko", "bounce"]),
    ("marble run", &["ramp", "bounce"]),
    ("ball pit", &["pit", "tower"]),
    ("tilting maze", &["maze"]),
    ("planets", &["orbit"]),
    ("machines", &["turntable", "cradle"]),
];
/// The errors that it asks for: what looks right, what is right.
const ASKED: [f64; 3] = [5e-2, 1e-2, 1e-3];

/// For each kind of game the cheapest settings that are right enough in all of its scenes, at
/// sixty steps a second.
fn guide(text: &mut String, points: &[Point]) -> std::fmt::Result {
    writeln!(
        text,
        "## Which model for my scene?\n\nThe cheapest setting at 60 steps a second in `f32`, as \
         the plugin counts, whose error is at most this in all scenes of its kind (substeps × \
         iterations; nanoseconds for each marble and simulated second, the mean of the \
         scenes).\n\n| game | scenes | 5 % | 1 % | 0.1 % |\n|---|---|---|---|---|"
    )?;
    for (kind, scenes) in KINDS {
        write!(text, "| {kind} | {} |", scenes.join(", "))?;
        for asked in ASKED {
            match cheapest(points, scenes, asked) {
                Some((cost, Point { model, substeps, iterations, .. })) => {
                    write!(text, " {model}, {substeps} × {iterations}: {cost:.0} |")?;
                }
                None => write!(text, " – |")?,
            }
        }
        writeln!(text)?;
    }
    Ok(())
}

/// The cheapest setting of ours at 1/60 s in `f32` that errs by `error` at most in all of the
/// scenes, with its mean cost.
fn cheapest<'a>(points: &'a [Point], scenes: &[&str], most: f64) -> Option<(f64, &'a Point)> {
    let good = |point: &&Point| {
        point.engine == "taw"
            && (point.step == "1/60" && point.number == "f32")
            && point.failure.is_none()
            && point.error.is_some_and(|error| error <= most)
    };
    let of = |scene: &str| {
        points.iter().filter(move |point| point.scene == scene).filter(good).collect::<Vec<_>>()
    };
    let groups: Vec<_> = scenes.iter().map(|scene| of(scene)).collect();
    let (first, others) = groups.split_first()?;
    let all = first.iter().filter_map(|point| {
        let same = |other: &&&Point| {
            (&other.model, other.substeps, other.iterations)
                == (&point.model, point.substeps, point.iterations)
        };
        let costs = others.iter().map(|group| group.iter().find(same).map(|other| other.cost));
        let sum = costs.sum::<Option<f64>>()? + point.cost;
        Some((sum / scenes.len() as f64, *point))
    });
    all.min_by(|a, b| a.0.total_cmp(&b.0))
}

const HEAD: &str = "\
# Error against cost

Written by `taw-lab trade`. Cost is nanoseconds of one thread's processor time for each marble and
simulated second, on the machine that it was measured on; error is a part of what the scene is about. Settings are step ×
substeps × iterations. *Order* is the slope of the error over the length of a substep, with most
iterations; a curve is *monotone* if a shorter substep is never worse by more than a hundredth.
Each line of a chart joins the settings of a model that no other one of its settings beats. Compare
where errors are equal, not where steps are.
";

fn describe(text: &mut String, scene: &str, folder: &str, curves: &[Curve]) -> std::fmt::Result {
    let judged = SCENES.iter().find(|judged| judged.name == scene);
    writeln!(text, "\n## {scene}\n")?;
    if let Some(judged) = judged {
        write!(text, "{}. Error: {}.", judged.scene().description, judged.metric)?;
        if judged.noise_floor() > 0.0 {
            let noise_floor = judged.noise_floor();
            write!(text, " The last bit of where marbles begin makes {noise_floor:.1e} of it.")?;
        }
        writeln!(text, "\n")?;
    }
    writeln!(text, "![{scene}]({folder}/{scene}.svg)\n")?;
    writeln!(text, "| model | at 1/60 | order | monotone | cost of 1e-2 | of 1e-3 | of 1e-4 |")?;
    writeln!(text, "|---|---|---|---|---|---|---|")?;
    for curve in curves {
        let at_sixty = curve
            .points
            .iter()
            .filter(|point| point.step == "1/60" && point.substeps == 1)
            .max_by_key(|point| point.iterations);
        let at_sixty = match at_sixty {
            Some(point) if point.failure.is_some() => "failed".into(),
            Some(point) => point.error.map_or("–".into(), |error| format!("{error:.1e}")),
            None => "–".into(),
        };
        let order = curve.order.map_or("–".into(), |order| format!("{order:.1}"));
        let monotone = if curve.monotone { "yes" } else { "no" };
        write!(text, "| {} | {at_sixty} | {order} | {monotone} |", curve.name)?;
        for error in [1e-2, 1e-3, 1e-4] {
            match curve.cost_of(error) {
                Some(point) => write!(text, " {:.0} ({}) |", point.cost, point.setting())?,
                None => write!(text, " – |")?,
            }
        }
        writeln!(text)?;
    }
    writeln!(text, "\nThe front:\n\n| cost | error | model | setting |\n|---|---|---|---|")?;
    for point in front(curves.iter().flat_map(|curve| &curve.points)) {
        let Point { cost, error, model, number, .. } = point;
        let (error, setting) = (error.unwrap_or(f64::NAN), point.setting());
        writeln!(text, "| {cost:.0} | {error:.1e} | {model}, {number} | {setting} |")?;
    }
    Ok(())
}
