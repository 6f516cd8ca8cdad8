//! Long random sequences of calls with numbers that nobody means among them: nothing panics, what
//! is refused has changed nothing, what overflows is named, and sane marbles far away never learn
//! of it, to the bit.

use cgmath::{EuclideanSpace, InnerSpace};
use proptest::prelude::*;
use taw::math::Quat;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::{Aabb, Shape};
use taw::swarm::SwarmModel;
use taw::world::Damping;

/// One call: which, on whom, and with which numbers.
#[derive(Clone, Debug)]
struct Call {
    which: u8,
    whom: u8,
    numbers: [f64; 4],
}

fn number() -> impl Strategy<Value = f64> {
    let nasty = vec![
        f64::NAN,
        f64::INFINITY,
        -f64::INFINITY,
        0.0,
        -0.0,
        -1.0,
        1e-45,
        1e-39,
        1e-30,
        1e-20,
        1e-10,
        1e10,
        1e19,
        1e20,
        1e30,
        -1e30,
        3e38,
        -3e38,
        1e39,
        1e300,
    ];
    prop_oneof![5 => -2.0..2.0_f64, 3 => 0.01..1.0_f64, 1 => prop::sample::select(nasty)]
}

fn call() -> impl Strategy<Value = Call> {
    (0..40_u8, 0..12_u8, [number(), number(), number(), number()])
        .prop_map(|(which, whom, numbers)| Call { which, whom, numbers })
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
    all.push(Model { precision: Precision::Compensated, substeps: 3, ..all[1] });
    all.push(Model { detection: Detection::Swept, ..all[1] });
    all
}

const FAR: [[f64; 3]; 4] =
    [[900.0, 0.5, 0.0], [901.5, 2.0, 0.0], [902.0, 0.5, 0.1], [-900.0, 3.0, 900.0]];

struct Trial<S: Scalar> {
    world: World<S>,
    /// With those far away alone.
    alone: World<S>,
    far: Vec<[MarbleId; 2]>,
    near: Vec<MarbleId>,
    walls: Vec<WallId>,
    /// Set if a marble or a wall may have got to those far away.
    reaches_far: bool,
}

/// A marble one of whose fields is odd.
fn odd_marble<S: Scalar>(call: &Call) -> Marble<S> {
    let [a, b, c, d] = call.numbers.map(S::from_f64);
    let v = Vec3::new(a, b, c);
    let mut marble = Marble::new(Point3::new(a, b.abs(), c), d);
    match call.whom {
        0 => marble.velocity = v,
        1 => marble.angular_velocity = v,
        2 => marble.mass = Mass::Density(a),
        3 => marble.mass = Mass::Kilograms(b),
        4 => marble.damping = Damping { linear: a, angular: b },
        5 => marble.gravity_scale = b,
        6 => marble.mass = Mass::Infinite,
        7 => {
            marble.material = Some(Material { friction: a, restitution: b, ..Material::default() });
        }
        8 => marble.rotation = Quat::new(a, b, c, d),
        _ => {}
    }
    marble
}

impl<S: Scalar> Trial<S> {
    fn new(model: Model) -> Self {
        let mut worlds = [World::default(), World::default()];
        for world in &mut worlds {
            world.set_model(model).unwrap();
            // Marbles by `SoftStep` fall asleep in chunks, wherever they are.
            world.swarm.set_model(SwarmModel { sleeps: false, ..SwarmModel::default() }).unwrap();
            world.walls.insert(Plane::new(Vec3::unit_y(), S::zero()).unwrap()).unwrap();
        }
        let [mut world, mut alone] = worlds;
        let far = FAR.map(|at| {
            let marble = Marble::new(Point3::from(at.map(S::from_f64)), S::from_f64(0.5));
            [world.marbles.insert(marble).unwrap(), alone.marbles.insert(marble).unwrap()]
        });
        let (near, walls) = (Vec::new(), Vec::new());
        // What rests is looked for as far as the farthest marble rounds, so all know of that one.
        // The rows of `SoftStep` are sorted anew when some come, and all bounce in as many rounds as the
        // busiest needs, so those far away differ by some roundings (over ten steps: every_entry).
        let reaches_far = matches!(model.response, Response::EventDriven | Response::SoftStep);
        Self { world, alone, far: far.to_vec(), near, walls, reaches_far }
    }

    /// Does it; whether it was accepted.
    fn call(&mut self, call: &Call) -> bool {
        let [a, b, c, d] = call.numbers.map(S::from_f64);
        let v = Vec3::new(a, b, c);
        let marbles = &mut self.world.marbles;
        let id = self.near.get(usize::from(call.whom) % self.near.len().max(1)).copied();
        let wall = self.walls.get(usize::from(call.whom) % self.walls.len().max(1)).copied();
        let outcome = match (call.which, id) {
            (0..8, _) | (_, None) => marbles.insert(odd_marble(call)).map(|id| self.near.push(id)),
            (8, Some(id)) => marbles.remove(id).map(|_| {
                self.near.retain(|it| *it != id);
            }),
            (9, Some(id)) => marbles.set_position(id, Point3::from_vec(v)),
            (10, Some(id)) => marbles.set_velocity(id, v),
            (11, Some(id)) => marbles.set_radius(id, a),
            (12, Some(id)) => marbles.set_angular_velocity(id, v),
            (13, Some(id)) => marbles.set_mass(id, Mass::Density(a)),
            (14, Some(id)) => marbles.set_rotation(id, Quat::new(a, b, c, d)),
            (15, Some(id)) => marbles.apply_force_at(id, v, Point3::new(d, a, b)),
            (16, Some(id)) => marbles.apply_impulse_at(id, v, Point3::new(d, a, b)),
            (17, Some(id)) => marbles.apply_angular_impulse(id, v),
            (18, Some(id)) => marbles.set_momentum(id, v),
            (19, Some(id)) => marbles.set_gravity_scale(id, a),
            (20, Some(id)) => marbles.apply_torque(id, v),
            (21, _) => {
                let center = Point3::from_vec(v);
                let shape = Shape::Sphere(Sphere { center, radius: d });
                self.world.walls.insert(shape).map(|id| self.walls.push(id))
            }
            (22, _) => {
                let shape =
                    Shape::Aabb(Aabb { min: Point3::from_vec(-v), max: Point3::new(d, d, a) });
                self.world.walls.insert(shape).map(|id| self.walls.push(id))
            }
            (23, _) => {
                let motion = WallMotion {
                    velocity: v,
                    angular_velocity: Vec3::new(d, a, b),
                    pivot: Point3::new(c, d, a),
                };
                wall.map_or(Ok(()), |wall| self.world.walls.set_motion(wall, Some(motion)))
            }
            (24, _) => wall.map_or(Ok(()), |wall| {
                self.walls.retain(|it| *it != wall);
                self.world.walls.remove(wall).map(|_| ())
            }),
            (25, _) => {
                let dt = a * S::from_f64(1e-30);
                // Impulses look ahead by as much as gravity closes in two steps.
                self.reaches_far |= dt.as_f64() > 6.0;
                self.world.step(dt).inspect(|()| self.alone.step(dt).unwrap())
            }
            (_, _) => {
                let dt = S::from_f64(1.0 / 64.0);
                self.take_out_unsupported();
                self.alone.step(dt).unwrap();
                self.world.step(dt).unwrap();
                Ok(())
            }
        };
        outcome.is_ok()
    }

    /// Takes out marbles that the response has no numbers for: a step is refused for them, and changes
    /// nothing.
    fn take_out_unsupported(&mut self) {
        let unsupported = self.world.unsupported_marbles();
        if unsupported.is_empty() {
            return;
        }
        let before = self.world.clone();
        assert!(self.world.step(S::from_f64(1.0 / 64.0)).is_err(), "{unsupported:?}, and goes on");
        assert!(self.world == before, "{unsupported:?} was refused and has changed something");
        for (id, _) in unsupported {
            self.world.marbles.remove(id).unwrap();
            self.near.retain(|it| *it != id);
        }
    }

    fn look(&mut self) {
        let all = (0..self.world.marbles.len()).filter_map(|row| self.world.marbles.id(row));
        for id in all {
            let m = self.world.marbles.get(id).unwrap();
            let rotation = [m.rotation.s, m.rotation.v.x, m.rotation.v.y, m.rotation.v.z];
            let rows =
                [m.position.to_vec(), m.velocity, m.angular_velocity].map(|v| [v.x, v.y, v.z]);
            assert!(rows.iter().flatten().chain(&rotation).all(|x| x.is_finite()), "{m:?}");
        }
        for id in &self.near {
            let m = self.world.marbles.get(*id).unwrap();
            let far = [m.position.x, m.position.y, m.position.z].map(|x| x.abs().as_f64());
            self.reaches_far |= far.into_iter().fold(m.radius.as_f64(), f64::max) > 300.0;
        }
        for shape in self.world.walls.shapes() {
            if let WallShape::Solid(shape) = shape {
                let Aabb { min, max } = taw::shape::BoundedShape::bounding_box(shape);
                let most = [min.x, min.y, min.z, max.x, max.y, max.z];
                self.reaches_far |= most.into_iter().any(|x| x.abs().as_f64() > 300.0);
            }
        }
        if !self.reaches_far {
            for [id, alone] in &self.far {
                let (here, there) = (self.world.marbles.get(*id), self.alone.marbles.get(*alone));
                assert_eq!(here, there, "far from all that");
            }
        }
    }
}

fn goes_well<S: Scalar>(model: Model, calls: &[Call]) {
    let mut trial = Trial::<S>::new(model);
    for call in calls {
        let before = trial.world.clone();
        if !trial.call(call) {
            assert!(trial.world == before, "{call:?} was refused and has changed something");
        }
        trial.look();
    }
}

proptest! {
    #![proptest_config(ProptestConfig { max_shrink_iters: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_panics_lies_or_reaches_others(
        calls in prop::collection::vec(call(), 1..120),
        model in prop::sample::select(models()),
    ) {
        goes_well::<f32>(model, &calls);
        goes_well::<f64>(model, &calls);
    }
}

/// Found by the test above: impulses that stopped a ball of infinite mass threw it 1e23 m far once it had
/// another mass.
#[test]
#[expect(clippy::unreadable_literal, reason = "as they were found")]
fn what_was_of_infinite_mass_stays_where_it_is() {
    let calls = [
        (0, 0, [0.0, 0.0, 1.0345056903262422, 0.01]),
        (0, 0, [0.0, 0.0, 0.0, 0.01]),
        (0, 0, [0.0, 0.01, -0.9167549365496286, 0.9901304785154693]),
        (9, 0, [0.0; 4]),
        (19, 0, [0.0; 4]),
        (0, 6, [-0.11068043946404425, 0.01, 0.11857535786687987, 0.5790936122987911]),
        (26, 0, [0.0; 4]),
        (21, 0, [-0.32019032587056423, 0.784269560868871, 0.458375913867535, 0.8324597092477246]),
        (8, 5, [0.0; 4]),
        (26, 0, [0.0; 4]),
        (13, 2, [0.01, 0.0, 0.0, 0.0]),
        (26, 0, [0.0; 4]),
    ];
    let response = Response::SoftStep;
    let mut trial =
        Trial::<f32>::new(Model { response, rotation: Rotation::Dynamic, ..Model::default() });
    for (which, whom, numbers) in calls {
        trial.call(&Call { which, whom, numbers });
        for id in &trial.near {
            let at = trial.world.marbles.get(*id).unwrap().position;
            assert!(at.to_vec().magnitude() < 10.0, "{at:?}");
        }
    }
}
