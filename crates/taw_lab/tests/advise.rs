//! Advice: what it says about shipped scenes, and what it refuses.

use futures_lite::future::block_on;
use taw::prelude::*;
use taw_lab::advise::{
    Advice, Candidate, ReplayableScene, Requirements, Snapshot, advise, literal, quantity,
    read_scene,
};
use taw_lab::trade::trace::{RunConfig, ScalarType};

const BOUNCE: &str = include_str!("../scenes/bounce.ron");
const MAZE: &str = include_str!("../scenes/maze.ron");
const CRADLE: &str = include_str!("../scenes/cradle.ron");
const NOTHING: Requirements = Requirements {
    max_error: None,
    max_cost: None,
    number: None,
    step: 1.0 / 60.0,
    time_limit: 1.0,
};

fn on(text: &str, wish: Requirements) -> (taw::scene::Scene, Advice) {
    let scene = read_scene(text).unwrap();
    let advice = block_on(advise(&scene, wish, |_, _, _| ()));
    (scene, advice)
}

/// As the README says: what is tilted or passes on a push wants the event-driven model. In a maze it is the
/// only one that one substep suffices for; in a cradle soft contacts in `f64` have the push in time, too. What
/// bounces alone on a floor, impulses have as exactly.
///
/// Costs are read from the clock, so none is judged here but by what was measured in this very run.
#[test]
fn the_documented_model_suffices_on_three_scenes() {
    let exact = Response::EventDriven;
    for (text, response) in [(BOUNCE, Response::Impulse), (MAZE, exact), (CRADLE, exact)] {
        let wish = Requirements { max_error: Some(1e-3), ..NOTHING };
        let (scene, advice) = on(text, wish);
        let suffices = |choice: &&Candidate| choice.total_error() <= 1e-3;
        let by_one_substep: Vec<_> = advice
            .candidates
            .iter()
            .filter(suffices)
            .map(|choice| choice.setting.model)
            .filter(|model| model.substeps == 1)
            .map(|model| model.response)
            .collect();
        assert!(by_one_substep.contains(&response), "{}: {by_one_substep:?}", scene.description);
        if text == MAZE {
            assert!(by_one_substep.iter().all(|by| *by == exact), "{by_one_substep:?}");
        }
        let best = advice.best(wish).unwrap();
        assert!(best.total_error() <= 1e-3);
        assert!(advice.candidates.iter().filter(suffices).all(|choice| choice.cost >= best.cost));
        assert!((advice.horizon - scene.duration).abs() < 1e-9, "{} s", advice.horizon);
        let said = advice.text(wish);
        let picked = best.setting.model.response;
        assert!(said.contains(&format!("response: Response::{picked:?}")), "{said}");
    }
}

#[test]
fn a_budget_is_kept_and_the_impossible_is_said() {
    let (_, advice) = on(BOUNCE, NOTHING);
    let front = advice.front();
    assert!(front.len() >= 3);
    assert!(
        front
            .windows(2)
            .all(|two| two[0].cost <= two[1].cost && two[0].total_error() > two[1].total_error())
    );
    // Between two of the front, the cheaper one is the best that fits.
    let budget = 0.5 * (front[0].cost + front[1].cost);
    let wish = Requirements { max_cost: Some(budget), ..NOTHING };
    let best = advice.best(wish).unwrap();
    assert!(best.cost <= budget && best.total_error() <= front[0].total_error());
    let wish = Requirements { max_cost: Some(1e-12), ..NOTHING };
    assert!(advice.best(wish).is_none());
    assert!(advice.text(wish).contains("none of"));
}

/// Worlds of Bevy games are `f32`: advice for one is not measured in anything else.
#[test]
fn advice_is_in_the_numbers_that_were_asked_for() {
    for number in [ScalarType::F32, ScalarType::F64] {
        let (_, advice) = on(BOUNCE, Requirements { number: Some(number), ..NOTHING });
        assert!(!advice.candidates.is_empty());
        assert!(advice.candidates.iter().all(|choice| choice.setting.number == number));
        assert_eq!(advice.reference.unwrap().number, ScalarType::F64);
    }
}

/// Balls that hit balls that hit balls: soon nothing can be told of one of them.
#[test]
fn chaos_is_noticed() {
    let text = "(
        duration: 8,
        gravity: (0, 0, 0),
        material: (restitution: 1, friction: 0),
        walls: [
            (shape: HalfSpace(normal: (1, 0, 0), point: (-1, 0, 0))),
            (shape: HalfSpace(normal: (-1, 0, 0), point: (1, 0, 0))),
            (shape: HalfSpace(normal: (0, 1, 0), point: (0, -1, 0))),
            (shape: HalfSpace(normal: (0, -1, 0), point: (0, 1, 0))),
            (shape: HalfSpace(normal: (0, 0, 1), point: (0, 0, -0.2))),
            (shape: HalfSpace(normal: (0, 0, -1), point: (0, 0, 0.2))),
        ],
        marbles: [(position: (-0.9, 0.31, 0), radius: 0.05, velocity: (40, 3, 0))],
        lattices: [(
            first: (position: (-0.5, -0.5, 0), radius: 0.1),
            count: (4, 4, 1),
            pitch: (0.3, 0.3, 1),
            jitter: 0.2,
        )],
    )";
    let (_, advice) = on(text, NOTHING);
    assert!(advice.horizon > 0.05 && advice.horizon < 7.0, "{} s", advice.horizon);
    assert!(advice.text(NOTHING).contains("chaotic"));
}

#[test]
fn bad_scenes_are_refused_with_line_and_field() {
    let refused = |from: &str, to: &str, say: &[&str]| {
        assert!(MAZE.contains(from));
        let error = read_scene(&MAZE.replacen(from, to, 1)).unwrap_err();
        assert!(say.iter().all(|word| error.contains(word)), "{error}");
    };
    refused("duration: 3", "duration: 0", &["4:", "duration", "above zero", "is 0"]);
    refused("restitution: 0.4", "restitution: 1.4", &["5:", "material.restitution", "[0, 1]"]);
    refused("time: 1.5", "time: NaN", &["9:", "gravity_keyframes[2].time", "NaN"]);
    refused("radius: 0.03", "radius: -0.03", &["18:", "walls[5].shape.Capsule.radius", "-0.03"]);
    refused("radius: 0.01", "radius: 0.01, mass: 3", &["20:", "mass"]);
    refused("marbles: [", "marbles: ", &["20:"]);
    refused(",\n)", ",\n) and more", &["21:"]);
}

#[test]
fn quantities_have_units() {
    let units = [("m", 1.0), ("mm", 1e-3)];
    assert_eq!(quantity("2mm", &units), Ok(0.002));
    assert_eq!(quantity("1.5e-2 m", &units), Ok(0.015));
    for bad in ["2", "mm", "-1mm", "0m", "2ms", "NaNm", "1e999m"] {
        assert!(quantity(bad, &units).is_err(), "{bad}");
    }
}

#[test]
fn a_model_is_written_as_rust_reads_it() {
    let response = Response::Penalty(ContactLaw::HertzMindlin);
    let text = literal(Model { response, ..Model::default() });
    assert!(text.contains("response: Response::Penalty(ContactLaw::HertzMindlin),"), "{text}");
    assert_eq!(text.matches(',').count(), 7);
}

/// A ball above a floor, as a game has it.
fn world(half_length: f32) -> World<f32> {
    let mut world = World::default();
    world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
    let material = Material { restitution: 0.8, ..Material::default() };
    let position = Point3::new(0.0, 1.1, 0.0);
    let marble = Marble { half_length, material: Some(material), ..Marble::new(position, 0.1) };
    world.marbles.insert(marble).unwrap();
    world
}

fn of_snapshot(mut world: World<f32>) -> Advice {
    let before = world.clone();
    let wish = Requirements { step: 1.0 / 64.0, time_limit: 0.1, ..NOTHING };
    let advice = block_on(advise(&Snapshot::new(&mut world, 1.0), wish, |_, _, _| ()));
    assert!(world == before, "the game goes on as it was");
    advice
}

#[test]
fn a_world_of_a_game_is_measured_as_it_is() {
    let advice = of_snapshot(world(0.0));
    assert!((advice.horizon - 1.0).abs() < 1e-9, "{} s", advice.horizon);
    let of = |response| move |choice: &&Candidate| choice.setting.model.response == response;
    let plain = |choice: &&Candidate| choice.setting.model.substeps == 1;
    let candidates = || advice.candidates.iter().filter(plain);
    let exact = candidates().find(of(Response::EventDriven)).unwrap();
    assert!(exact.total_error() < 1e-5, "{:.1e}", exact.total_error());
    // Touches at 0.45 s, and then goes up 4/5 as fast; or sinks in, and stays.
    for choice in candidates().filter(of(Response::Displacement)) {
        assert!(choice.total_error() > 0.05, "{}: {}", choice.name, choice.total_error());
    }
    assert!(advice.candidates.iter().all(|choice| choice.cost > 0.0));
}

/// A scene that the exact model cannot do is compared with the next best one.
#[test]
fn capsules_are_measured_without_events() {
    let advice = of_snapshot(world(0.1));
    let by_events = |c: &Candidate| c.setting.model.response == Response::EventDriven;
    assert!(!advice.candidates.is_empty() && !advice.candidates.iter().any(by_events));
    assert_eq!(advice.reference.unwrap().model.response, Response::Impulse);
    assert!(advice.text(NOTHING).contains("reference: impulse, swept"));
}

/// Walls that move in the game stand still, and do not drag along what lies on them.
#[test]
fn a_snapshot_stands_still() {
    let mut world = world(0.0);
    let id = world.walls.id(0).unwrap();
    let velocity = Vec3::new(1.0, 0.0, 0.0);
    let motion = taw::motion::WallMotion {
        velocity,
        angular_velocity: Vec3::zero(),
        pivot: Point3::origin(),
    };
    world.walls.set_motion(id, Some(motion)).unwrap();
    let snapshot = Snapshot::new(&mut world, 1.0);
    assert_eq!(world.walls.motion(id).unwrap(), Some(motion));
    let setting =
        RunConfig { model: taw_lab::scene::EXACT, number: ScalarType::F32, step: 1.0 / 64.0 };
    let film = block_on(snapshot.record(setting, false, 0.25)).unwrap();
    let last = film.frames.last().unwrap();
    assert_eq!((film.frames.len(), last.time), (5, 1.0));
    assert_eq!(last.at[0].x, 0.0);
    assert!(last.at[0].y > 0.2, "it has bounced");
}

/// Overlap that a game begins with is no model's fault: a marble that lies a little too deep.
#[test]
fn only_overlap_beyond_that_of_the_reference_counts() {
    let depth = |advice: &Advice| {
        let still = |c: &&Candidate| {
            let Model { response, rotation, substeps, .. } = c.setting.model;
            (response, rotation, substeps) == (Response::EventDriven, Rotation::Dynamic, 1)
        };
        advice.candidates.iter().find(still).unwrap().whole.overlap
    };
    let mut world = world(0.0);
    let id = world.marbles.id(0).unwrap();
    world.marbles.set_position(id, Point3::new(0.0, 0.0999, 0.0)).unwrap();
    let mean = |film: &taw_lab::trade::trace::Recording| {
        film.frames.iter().map(|frame| frame.overlap).sum::<f64>() / film.frames.len() as f64
    };
    let setting =
        RunConfig { model: taw_lab::scene::EXACT, number: ScalarType::F32, step: 1.0 / 64.0 };
    let film = block_on(Snapshot::new(&mut world, 1.0).record(setting, false, 0.1)).unwrap();
    assert!(mean(&film) > 5e-6, "there is some: {:.1e}", mean(&film));
    let advice = of_snapshot(world);
    assert!(depth(&advice) < 1e-6, "{:.1e}", depth(&advice));
}

/// Where gravity tilts, energy is that of the moment, whatever the step: no friction here, and no
/// touch.
#[test]
fn energy_is_of_gravity_as_it_is() {
    let text = "(duration: 1, marbles: [(position: (1, 2, 3), radius: 0.1, density: 1000)],
        gravity_keyframes: [(time: 0, gravity: (0, -9, 0)), (time: 1, gravity: (4, -8, 0))])";
    let scene = read_scene(text).unwrap();
    let mass = 4.0 / 3.0 * std::f64::consts::PI;
    for step in [1.0 / 10.0, 1.0 / 20.0] {
        let setting = RunConfig { model: taw_lab::scene::EXACT, number: ScalarType::F64, step };
        for frame in block_on(scene.record(setting, false, 0.1)).unwrap().frames {
            let gravity = Vec3::new(4.0 * frame.time, frame.time - 9.0, 0.0);
            let kinetic = 0.5 * frame.velocity[0].magnitude2();
            let energy = mass * (kinetic - gravity.dot(frame.at[0]));
            assert!((frame.energy - energy).abs() < 1e-9, "{} at {} s", frame.energy, frame.time);
        }
    }
}

#[test]
fn what_is_told_on_the_way_grows() {
    let scene = read_scene(BOUNCE).unwrap();
    let mut horizon = Vec::new();
    let advice = block_on(advise(&scene, NOTHING, |done, all, advice| {
        horizon.push((done, all, advice.candidates.len()));
    }));
    assert!(horizon.windows(2).all(|two| two[1].0 == two[0].0 + 1 && two[1].2 >= two[0].2));
    let (done, all, candidates) = *horizon.last().unwrap();
    assert!(done + 1 == all && candidates < advice.candidates.len());
}

#[test]
fn what_passes_a_gate_is_counted() {
    let scene = read_scene(include_str!("../scenes/hopper.ron")).unwrap();
    let setting =
        RunConfig { model: taw_lab::scene::IMPULSE, number: ScalarType::F64, step: 1.0 / 240.0 };
    let film = block_on(scene.record(setting, false, 0.1)).unwrap();
    let passed: Vec<_> = film.frames.iter().map(|frame| frame.passed).collect();
    assert_eq!(passed[0], 0);
    assert!(passed.windows(2).all(|two| two[0] <= two[1]), "none comes back: {passed:?}");
    for frame in &film.frames {
        let below = frame.at.iter().filter(|at| at.y < -0.05).count();
        assert_eq!(frame.passed, below, "at {} s", frame.time);
    }
    assert!(passed[20] >= 20, "{passed:?}");
    // What falls has less energy in gravity.
    assert!(film.frames[20].energy < film.frames[0].energy);
}
