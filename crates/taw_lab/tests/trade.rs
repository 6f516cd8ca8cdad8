//! The sweep: its metrics tell right from wrong, and its files survive whatever happens to them.

use std::path::PathBuf;

use taw::prelude::*;
use taw_lab::trade::scenes::{ReferenceCase, SCENES};
use taw_lab::trade::sweep::{Job, Plan, in_order, read_points, sweep, write_points};
use taw_lab::trade::trace::{Frame, RunConfig, ScalarType, trace};
use taw_lab::trade::{Failure, Point, curves, front, write_report, write_tables};

const EXACT: Model = taw_lab::scene::EXACT;

fn scene(name: &str) -> &'static ReferenceCase {
    SCENES.iter().find(|scene| scene.name == name).unwrap()
}

fn error(name: &str, model: Model, number: ScalarType, step: f64) -> f64 {
    let judged = scene(name);
    judged.error(&trace(judged.scene(), RunConfig { model, number, step }).unwrap())
}

/// A folder of this test alone.
fn folder(name: &str) -> PathBuf {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A clock that always says the same about the same job.
fn clock(job: &Job) -> f64 {
    f64::from(job.setting.model.substeps) / job.setting.step * 1e-6
}

#[test]
fn the_exact_model_is_right_wherever_the_outcome_is_known() {
    for judged in SCENES.iter().filter(|judged| judged.has_contacts) {
        let error = error(judged.name, EXACT, ScalarType::F64, 1.0 / 240.0);
        let most = match judged.name {
            "pit" => 0.3,
            // Compared with itself in shorter steps, of which the tilt takes notice.
            "maze" => 1e-4,
            "pachinko" => 1e-3,
            _ => 1e-6,
        };
        assert!(error < most, "{}: {error:.1e}", judged.name);
    }
    for name in ["throw", "orbit"] {
        let rk4 = Model { integrator: Integrator::Rk4, ..Model::default() };
        assert!(error(name, rk4, ScalarType::F64, 0.001) < 1e-8, "{name}");
    }
}

#[test]
fn an_explicit_step_is_off_by_its_own_recurrence() {
    // An explicit step h of v' = g - k v is off by about t h a / 2: by its own recurrence.
    let (h, mass) = (1.0 / 60.0, 2500.0 * 4.0 / 3.0 * std::f64::consts::PI * 0.008_f64.powi(3));
    let (mut at, mut velocity) = (Vec3::new(0.0, 1.0, 0.0), Vec3::new(3.0, 4.0, 0.0));
    let mut frames = vec![Frame { at: vec![at], ..Frame::default() }];
    for step in 1..=60 {
        let acceleration = Vec3::new(0.0, -9.81, 0.0) - velocity * (0.004 / mass);
        at += velocity * h;
        velocity += acceleration * h;
        if step % 6 == 0 {
            frames.push(Frame { time: f64::from(step) * h, at: vec![at], ..Frame::default() });
        }
    }
    let by_hand = scene("throw").error(&frames);
    let euler = Model { integrator: Integrator::ExplicitEuler, ..Model::default() };
    let measured = error("throw", euler, ScalarType::F64, h);
    assert!((measured / by_hand - 1.0).abs() < 1e-9, "{measured:e}, {by_hand:e}");
    assert!(by_hand > 1e-3);
}

#[test]
fn displacement_shows_the_fall_without_the_bounce() {
    // Displacement knows no restitution: of a bounce of 0.8 it shows the fall alone.
    let judged = scene("bounce");
    let mut frames = trace(
        judged.scene(),
        RunConfig { model: EXACT, number: ScalarType::F64, step: 1.0 / 60.0 },
    )
    .unwrap();
    assert!(judged.error(&frames) < 1e-9);
    for frame in frames.iter_mut().filter(|frame| frame.time > 0.45) {
        frame.at[0].y = 0.05;
    }
    let without = judged.error(&frames);
    let lab = error("bounce", Model::default(), ScalarType::F64, 0.001);
    assert!((lab - without).abs() < 0.01, "{lab}, {without}");
}

#[test]
fn what_slides_instead_of_rolling_is_off_by_as_much() {
    // A marble that slides down a slope instead of rolling is 7/5 as far.
    let slides = Model { response: Response::Displacement, ..EXACT };
    let expected = {
        let way = |t: f64| 0.5 * 9.81 * 0.6 * t * t * (1.0 - 5.0 / 7.0);
        let squares: f64 = (0..=10).map(|i| way(f64::from(i) * 0.1).powi(2)).sum();
        (squares / 11.0).sqrt() / 2.0
    };
    let measured = error("ramp", slides, ScalarType::F64, 0.001);
    assert!((measured / expected - 1.0).abs() < 0.01, "{measured}, {expected}");

    // A marble that a turning disc does not turn goes straight on: 0.2 m/s for 4 s, which the
    // circle has bent by 2/7 of two turns.
    let expected = {
        let rate = 2.0 / 7.0 * std::f64::consts::PI;
        let radius = 0.2 / rate;
        let apart = |t: f64| {
            let (sin, cos) = (rate * t).sin_cos();
            (0.2 * t - radius * sin).powi(2) + (radius * (1.0 - cos)).powi(2)
        };
        let squares: f64 = (0..=40).map(|i| apart(f64::from(i) * 0.1)).sum();
        (squares / 41.0).sqrt() / radius
    };
    let measured = error("turntable", slides, ScalarType::F64, 0.001);
    assert!((measured / expected - 1.0).abs() < 0.01, "{measured}, {expected}");
}

#[test]
fn what_passes_through_or_falls_is_far_off() {
    // Balls that pass through each other, and towers that fall.
    for (name, least) in [("carom", 0.2), ("cradle", 0.2), ("tower", 10.0), ("skid", 0.05)] {
        let judged = scene(name);
        let setting = RunConfig { model: EXACT, number: ScalarType::F64, step: 1.0 / 60.0 };
        let mut frames = trace(judged.scene(), setting).unwrap();
        let (at, velocity) = (frames[0].at.clone(), frames[0].velocity.clone());
        for frame in &mut frames {
            let free = |(at, v): (&Vec3<f64>, &Vec3<f64>)| {
                at + v * frame.time + judged.scene_gravity() * (0.5 * frame.time * frame.time)
            };
            frame.at = at.iter().zip(&velocity).map(free).collect();
        }
        let error = judged.error(&frames);
        assert!(error > least, "{name}: {error}");
    }
}

#[test]
fn a_heap_that_is_too_high_is_off_by_that() {
    // A heap that is 1 mm too high everywhere is a tenth of a radius off.
    let judged = scene("pit");
    let setting = RunConfig { model: EXACT, number: ScalarType::F64, step: 1.0 / 480.0 };
    let mut frames = trace(judged.scene(), setting).unwrap();
    assert_eq!(judged.error(&frames), judged.noise_floor(), "the reference itself");
    assert!(judged.noise_floor() < 0.01);
    for at in frames.iter_mut().flat_map(|frame| &mut frame.at) {
        at.y += 0.001;
    }
    // The overlap of the reference comes on top: of the last five frames, for each marble.
    let last = frames.iter().rev().take(5);
    let overlap = last.map(|frame| frame.overlap / frame.at.len() as f64 / 5.0).sum::<f64>();
    let error = judged.error(&frames);
    assert!((error - 0.1 - overlap / 0.01).abs() < 1e-12, "{error}, overlap {overlap}");
}

#[test]
fn pachinko_that_falls_behind_is_off_by_that() {
    let setting = RunConfig { model: EXACT, number: ScalarType::F64, step: 1.0 / 480.0 };
    // Pachinko that falls 3 cm behind all the time is a tenth off.
    let judged = scene("pachinko");
    let mut frames = trace(judged.scene(), setting).unwrap();
    assert!(judged.error(&frames) <= judged.noise_floor() && judged.noise_floor() < 1e-2);
    for at in frames.iter_mut().flat_map(|frame| &mut frame.at) {
        at.y += 0.03;
    }
    let error = judged.error(&frames);
    assert!((error - 0.1).abs() < 1e-9, "{error}");
}

#[test]
fn a_ball_that_stays_in_a_maze_is_far_off() {
    let setting = RunConfig { model: EXACT, number: ScalarType::F64, step: 1.0 / 480.0 };
    // A maze in which the ball stays where it began.
    let judged = scene("maze");
    let mut frames = trace(judged.scene(), setting).unwrap();
    let start = frames[0].at.clone();
    for frame in &mut frames {
        frame.at.clone_from(&start);
    }
    assert!(judged.error(&frames) > 0.1);
}

fn plan() -> Plan {
    Plan { quick: true, scene: "throw".into(), model: "Euler".into() }
}

#[test]
fn an_interrupted_sweep_goes_on_to_the_same_report() {
    let folder = folder("resumed");
    let [whole, resumed] = ["whole.jsonl", "resumed.jsonl"].map(|name| folder.join(name));
    let points = sweep(&plan(), [1, 1], &whole, clock, |_, _, _| ()).unwrap();
    assert_eq!(points.len(), 2 * 2 * 2 * 2);

    // It ends in the middle of a line.
    let text = std::fs::read_to_string(&whole).unwrap();
    std::fs::write(&resumed, &text[..text.len() / 2]).unwrap();
    let mut begun = Vec::new();
    let again =
        sweep(&plan(), [1, 1], &resumed, clock, |done, all, _| begun.push((done, all))).unwrap();
    assert!(begun[0].0 > 3 && begun[0].1 == 16, "{begun:?}");
    assert_eq!(again, points);
    assert_eq!(std::fs::read_to_string(&resumed).unwrap(), text);

    // And nothing more to do the next time.
    sweep(&plan(), [1, 1], &resumed, clock, |_, _, job| panic!("{}", job.key())).unwrap();

    let reports = ["a", "b"].map(|name| folder.join(name));
    for (points, folder) in [&points, &again].into_iter().zip(&reports) {
        write_tables(points, folder).unwrap();
        write_report(points, &folder.join("all.md")).unwrap();
    }
    for file in ["all.md", "points.csv", "points.json", "all/throw.svg", "all/throw.png"] {
        let [a, b] = reports.each_ref().map(|folder| std::fs::read(folder.join(file)).unwrap());
        assert!(a == b && a.len() > 100, "{file}");
    }
}

#[test]
fn parts_join_to_the_whole() {
    let folder = folder("parts");
    let whole = sweep(&plan(), [1, 1], &folder.join("whole"), clock, |_, _, _| ()).unwrap();
    let mut parts = Vec::new();
    for number in 1..=3 {
        let part =
            sweep(&plan(), [number, 3], &folder.join(number.to_string()), clock, |_, _, _| ());
        let part = part.unwrap();
        assert!((5..=6).contains(&part.len()));
        parts.extend(part);
    }
    assert_eq!(in_order(parts), whole);
}

#[test]
fn a_broken_file_is_refused_with_its_line() {
    let file = folder("broken").join("points.jsonl");
    assert_eq!(read_points(&file).unwrap(), []);
    let points = sweep(&plan(), [1, 1], &file, clock, |_, _, _| ()).unwrap();
    let text = std::fs::read_to_string(&file).unwrap().replacen("\"throw\"", "7", 2);
    std::fs::write(&file, text).unwrap();
    let error = read_points(&file).unwrap_err().to_string();
    assert!(error.contains("points.jsonl:1:"), "{error}");
    write_points(&file, &points).unwrap();
    assert_eq!(in_order(read_points(&file).unwrap()), points);
}

fn point(model: &str, substeps: u32, error: f64, cost: f64) -> Point {
    Point {
        engine: "taw".into(),
        scene: "throw".into(),
        model: model.into(),
        number: "f64".into(),
        step: "1/60".into(),
        seconds: 1.0 / 60.0,
        substeps,
        iterations: 1,
        error: Some(error),
        failure: None,
        cost,
        real_time: 1e9 / cost,
        note: String::new(),
    }
}

#[test]
fn orders_fronts_and_costs_are_as_counted_by_hand() {
    let mut points: Vec<_> = [1, 2, 4, 8]
        .map(|n| point("second", n, 0.01 / f64::from(n * n), f64::from(n) * 100.0))
        .to_vec();
    points
        .extend([1, 2, 4, 8].map(|n| point("first", n, 0.04 / f64::from(n), f64::from(n) * 40.0)));
    points.push(Point { failure: Some(Failure::Wrong), ..point("wild", 1, 3.0, 1.0) });
    let curves = curves(&points, "throw");
    let order = |name: &str| curves.iter().find(|curve| curve.name == name).unwrap().order;
    assert!((order("second, f64").unwrap() - 2.0).abs() < 1e-9);
    assert!((order("first, f64").unwrap() - 1.0).abs() < 1e-9);
    assert_eq!(order("wild, f64"), None);
    assert!(curves.iter().all(|curve| curve.monotone));
    let second = curves.iter().find(|curve| curve.name == "second, f64").unwrap();
    assert_eq!(second.cost_of(1e-3).unwrap().substeps, 4);
    assert!(second.cost_of(1e-6).is_none());
    let front: Vec<_> = front(&points).iter().map(|p| (p.model.as_str(), p.substeps)).collect();
    let expected =
        [("first", 1), ("first", 2), ("second", 1), ("second", 2), ("second", 4), ("second", 8)];
    assert_eq!(front, expected);
}

/// A setting has to be right in all scenes of a kind of game, and the cheapest such is named.
#[test]
fn the_guide_names_what_is_right_in_all_scenes_of_a_kind() {
    let at = |scene: &str, model: &str, error, cost| Point {
        scene: scene.into(),
        number: "f32".into(),
        ..point(model, 1, error, cost)
    };
    let points = [
        at("skid", "cheap", 0.001, 10.0),
        at("carom", "cheap", 0.2, 10.0),
        at("skid", "good", 0.004, 200.0),
        at("carom", "good", 0.008, 100.0),
        at("skid", "best", 1e-5, 3000.0),
        at("carom", "best", 1e-6, 5000.0),
        at("orbit", "good", 0.04, 7.0),
        Point { scene: "orbit".into(), ..point("other numbers", 1, 0.0, 1.0) },
    ];
    let file = folder("guide").join("guide.md");
    write_report(&points, &file).unwrap();
    let text = std::fs::read_to_string(&file).unwrap();
    let line =
        |kind: &str| text.lines().find(|line| line.starts_with(&format!("| {kind}"))).unwrap();
    let good = "good, 1 × 1: 150";
    let expected = format!("| billiards | skid, carom | {good} | {good} | best, 1 × 1: 4000 |");
    assert_eq!(line("billiards"), expected);
    assert_eq!(line("planets"), "| planets | orbit | good, 1 × 1: 7 | – | – |");
    assert_eq!(line("ball pit"), "| ball pit | pit, tower | – | – | – |");
}
