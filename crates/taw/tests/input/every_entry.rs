//! Every public way in, with every number that cannot be right: it is refused by field and value
//! and has changed nothing, or it is accepted and does no harm.
//!
//! Public entries are read from the sources, so that one without a row fails the test.

#[macro_use]
mod rows;
mod body_rows;
mod joint_rows;
mod scenes;
mod sources;

use std::collections::BTreeSet;
use std::time::Duration;

use cpu_time::ThreadTime;
use taw::Error;
use taw::prelude::*;
use taw::scene::{MarbleDesc, Scene};
use taw::swarm::SwarmModel;

/// Processor time that ten steps of four balls may take, in a build without optimization. It is a
/// few microseconds a step. What others do on the machine does not count.
const PATIENCE: Duration = Duration::from_secs(5);

/// Numbers that nobody means, besides NaN and infinity: the least one of the scalar itself,
/// and its largest.
fn nasty<S: Scalar>() -> Vec<S> {
    let subnormal = S::min_positive_value() / S::from_f64(1024.0);
    let constants =
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, -0.0, -1.0, 1e-30, 1e30, -1e30];
    let all = constants.into_iter().map(S::from_f64);
    all.chain([subnormal, S::from_f64(f64::from(f32::MAX)), S::max_value(), S::min_value()])
        .collect()
}

fn models() -> Vec<Model> {
    let responses = [
        Response::Displacement,
        Response::Impulse,
        Response::Penalty(ContactLaw::SpringDashpot),
        Response::Penalty(ContactLaw::HertzMindlin),
        Response::EventDriven,
        Response::SoftStep,
    ];
    let model = Model { rotation: Rotation::Dynamic, ..Model::default() };
    let mut all: Vec<_> = responses.map(|response| Model { response, ..model }).to_vec();
    let precision = Precision::Compensated;
    all.push(Model { response: Response::Impulse, precision, substeps: 3, ..model });
    let detection = Detection::Swept;
    all.push(Model {
        response: Response::Impulse,
        detection,
        rotation: Rotation::Rolling,
        ..model
    });
    all
}

/// A ball on a floor to which something is done, and others far from it.
struct Place<S: Scalar> {
    world: World<S>,
    /// The one to which it is done; another one touches it.
    subject: MarbleId,
    /// Far away: one that lies, and one that falls.
    far: [MarbleId; 2],
    wall: WallId,
    sensor: SensorId,
    /// Which of several ways to do it.
    case: usize,
}

impl<S: Scalar> Place<S> {
    fn new(model: Model) -> Self {
        let point = |x: f64, y: f64, z: f64| Point3::new(x, y, z).map(S::from_f64);
        let mut world = World::default();
        world.set_model(model).unwrap();
        // Marbles by `SoftStep` fall asleep in chunks, wherever they are.
        world.swarm.set_model(SwarmModel { sleeps: false, ..SwarmModel::default() }).unwrap();
        let floor = Plane::new(Vec3::unit_y(), S::zero()).unwrap();
        let wall = world.walls.insert(floor).unwrap();
        let mut ball = |x: f64, y: f64, z: f64| {
            world.marbles.insert(Marble::new(point(x, y, z), S::from_f64(0.5))).unwrap()
        };
        let subject = ball(0.0, 0.5, 0.0);
        ball(0.9, 0.6, 0.1);
        let far = [ball(700.0, 0.5, -900.0), ball(-800.0, 3.0, 650.0)];
        let around = Sphere::new(point(0.0, 0.0, 0.0), S::one()).unwrap();
        let sensor = world.sensors.insert(around).unwrap();
        Self { world, subject, far, wall, sensor, case: 0 }
    }

    /// Steps. Marbles that a response has no numbers for are named by a step that is refused and
    /// changes nothing; without them, it goes on.
    fn step(&mut self) -> Result<(), String> {
        let dt = S::from_f64(1.0 / 64.0);
        let unsupported = self.world.unsupported_marbles();
        if !unsupported.is_empty() {
            let before = self.world.clone();
            let Err(error) = self.world.step(dt) else {
                return Err(format!("{unsupported:?}, and goes on"));
            };
            let told = unsupported.iter().any(|(_, why)| why.to_string() == error.to_string());
            if !told || named(error).0.is_empty() {
                return Err(format!("{error}, of {unsupported:?}"));
            }
            if self.world != before {
                return Err(format!("{error}, and has changed something"));
            }
            for (id, _) in unsupported {
                self.world.marbles.remove(id).map_err(|error| error.to_string())?;
            }
        }
        self.world.step(dt).map_err(|error| format!("a step is refused: {error}"))
    }

    fn knows_balls_only(&self) -> bool {
        matches!(self.world.model().response, Response::EventDriven | Response::SoftStep)
    }

    /// Returns true if all is finite, and whatever was stopped is named.
    fn is_sane(&self) -> bool {
        let marbles = (0..self.world.marbles.len()).filter_map(|row| self.world.marbles.id(row));
        let named: Vec<_> = self.world.stopped().collect();
        let once = named.iter().collect::<BTreeSet<_>>().len() == named.len();
        once && marbles.map(|id| self.world.marbles.get(id).unwrap()).all(|m| {
            let rotation = [m.rotation.s, m.rotation.v.x, m.rotation.v.y, m.rotation.v.z];
            let rows = [
                m.position - Point3::new(S::zero(), S::zero(), S::zero()),
                m.velocity,
                m.angular_velocity,
            ];
            rows.iter().flat_map(|v| [v.x, v.y, v.z]).chain(rotation).all(S::is_finite)
        })
    }

    /// Returns true if those far away cannot know of it.
    fn is_local(&self) -> bool {
        let Ok(m) = self.world.marbles.get(self.subject) else { return true };
        let largest = [m.position.x, m.position.y, m.position.z].map(|x| x.abs().as_f64());
        largest.into_iter().fold(m.radius.as_f64() + m.half_length.as_f64(), f64::max) < 300.0
    }
}

/// Part of a place that may change by it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scope {
    /// One marble, and what it touches.
    Marble,
    /// All.
    World,
}

/// One way in.
struct Row<S: Scalar> {
    /// All entries of which it is a case: functions as `Type::name`, fields as `Type.name`.
    names: &'static str,
    scope: Scope,
    /// In how many ways.
    cases: usize,
    act: fn(&mut Place<S>, S) -> Result<(), Error>,
}

/// The field that an error names, and the value.
fn named(error: Error) -> (&'static str, f64) {
    match error {
        Error::NotFinite { field, value }
        | Error::NotPositive { field, value }
        | Error::OutOfRange { field, value, .. }
        | Error::NotUnit { field, value } => (field, value),
        Error::Unsupported { feature, .. } => (feature, f64::NAN),
        other => panic!("{other}"),
    }
}

fn each_row_is_refused_or_harmless<S: Scalar>() {
    let (mut count, mut wrong) = (0, Vec::new());
    for model in models() {
        let mut calm = Place::<S>::new(model);
        calm.step().unwrap();
        let start = calm.world.clone();
        let far: Vec<_> = (0..10)
            .map(|_| {
                calm.step().unwrap();
                calm.far.map(|id| calm.world.marbles.get(id).unwrap())
            })
            .collect();
        for row in rows::rows::<S>() {
            for (x, case) in
                nasty().into_iter().flat_map(|x| (0..row.cases).map(move |case| (x, case)))
            {
                if goes_from_event_to_event(model, x) {
                    continue;
                }
                count += 1;
                let place = Place { world: start.clone(), case, ..Place::new(model) };
                if let Err(why) = try_out(&row, place, x, &far) {
                    let response = model.response;
                    wrong.push(format!("{} = {x:?}, case {case}, {response:?}: {why}", row.names));
                }
            }
        }
    }
    println!("{count} cases");
    assert!(wrong.is_empty(), "{} of {count}: {wrong:#?}", wrong.len());
}

/// Returns true if so much at once would bring a collision every few nanoseconds, which this response
/// goes through one by one up to its cap of millions: half a minute for a step.
fn goes_from_event_to_event<S: Scalar>(model: Model, x: S) -> bool {
    let huge = x.is_finite() && x.abs() > S::from_f64(1e20);
    model.response == Response::EventDriven && huge
}

/// Does it, with this number, and says what is wrong with what comes of it.
fn try_out<S: Scalar>(
    row: &Row<S>,
    mut place: Place<S>,
    x: S,
    far: &[[Marble<S>; 2]],
) -> Result<(), String> {
    let start = place.world.clone();
    if let Err(error) = (row.act)(&mut place, x) {
        let (field, value) = named(error);
        // Lengths, sums, counts and the like are named as what they are.
        let given = value.to_bits() == x.as_f64().to_bits() || value.is_nan();
        let derived = field.contains(['.', ' ']) || row.names.contains("Model.");
        // The swarm counts in a scalar of its own, and in inverse masses.
        let derived = derived || row.names.starts_with("Swarm::");
        let derived = derived || value.is_infinite() || matches!(error, Error::NotUnit { .. });
        return if field.is_empty() || !(given || derived) {
            Err(format!("{error}, which was not given"))
        } else if place.world != start {
            Err(format!("{error}, and has changed something"))
        } else {
            Ok(())
        };
    }
    let clock = ThreadTime::now();
    for (step, before) in far.iter().enumerate() {
        place.step()?;
        if clock.elapsed() > PATIENCE {
            return Err(format!("takes {:?} for {} steps", clock.elapsed(), step + 1));
        }
        if !place.is_sane() {
            return Err(format!("not finite after {step} steps"));
        }
        // What rests is looked for as far as the farthest marble rounds, so all know of that one.
        let local = start.model().response != Response::EventDriven && place.is_local();
        let now = place.far.map(|id| place.world.marbles.get(id).unwrap());
        if row.scope == Scope::Marble && local && now != *before {
            return Err(format!("others have noticed after {step} steps"));
        }
    }
    Ok(())
}

#[test]
fn every_number_is_refused_or_harmless_in_f32() {
    each_row_is_refused_or_harmless::<f32>();
}

#[test]
fn every_number_is_refused_or_harmless_in_f64() {
    each_row_is_refused_or_harmless::<f64>();
}

fn scenes_are_refused_or_run<S: Scalar>() {
    for (name, set) in scenes::rows() {
        for x in nasty::<f64>() {
            for model in models() {
                let event_driven = model.response == Response::EventDriven;
                if event_driven && x.is_finite() && x.abs() > 1e20 {
                    continue; // as above
                }
                let mut scene = scenes::one_of_each();
                set(&mut scene, x);
                let clock = ThreadTime::now();
                let mut running = match scene.run::<S>(model) {
                    Ok(running) => running,
                    Err(Error::UnsupportedShape(_)) => continue, // named as the marble that it is
                    Err(error) => {
                        let (field, _) = named(error);
                        assert!(!field.is_empty(), "{name} = {x:?}: {error}");
                        continue;
                    }
                };
                for _ in 0..10 {
                    running.step(S::from_f64(1.0 / 64.0)).unwrap_or_else(|error| {
                        panic!("{name} = {x:?} in {model:?} is refused on the way: {error}")
                    });
                    let positions = running.world.marbles.position().iter();
                    let finite = positions.flat_map(|p| [p.x, p.y, p.z]).all(S::is_finite);
                    assert!(finite, "{name} = {x:?} in {model:?}");
                }
                assert!(clock.elapsed() < PATIENCE, "{name} = {x:?} in {model:?}");
            }
        }
    }
}

#[test]
fn every_number_of_a_scene_is_refused_at_the_start_or_harmless_in_f32() {
    scenes_are_refused_or_run::<f32>();
}

#[test]
fn every_number_of_a_scene_is_refused_at_the_start_or_harmless_in_f64() {
    scenes_are_refused_or_run::<f64>();
}

#[test]
fn a_scene_without_anything_nasty_runs() {
    for model in models() {
        scenes::one_of_each().run::<f32>(model).unwrap().step(0.01).unwrap();
    }
    let ball = MarbleDesc { position: [0.0; 3], ..MarbleDesc::default() };
    Scene { marbles: vec![ball], ..Scene::default() }.run::<f64>(Model::default()).unwrap();
}

#[test]
fn every_public_entry_has_a_row() {
    let of_rows = rows::rows::<f32>().into_iter().flat_map(|row| row.names.split(' '));
    let of_scenes = scenes::rows().into_iter().flat_map(|(names, _)| names.split(' '));
    let covered: BTreeSet<_> = of_rows.chain(of_scenes).map(String::from).collect();
    let public = sources::entries();
    assert!(public.len() > 100, "only {} entries: are the sources there?", public.len());
    let missing: Vec<_> = public.difference(&covered).collect();
    assert!(missing.is_empty(), "public, but in no row of the table: {missing:#?}");
    let gone: Vec<_> = covered.difference(&public).collect();
    assert!(gone.is_empty(), "in a row of the table, but not public any more: {gone:#?}");
}
