//! Marbles with locked axes: what a lock takes, what it leaves, and who refuses it.

mod random;

use taw::Error;
use taw::joint::{Joint, JointEnd, JointKind};
use taw::math::Quat;
use taw::prelude::*;
use taw::swarm::Ball;

const DT: f64 = 1.0 / 60.0;

/// Responses that obey locks.
const RESPONSES: [Response; 5] = [
    Response::SoftStep,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::Displacement,
];

/// With velocities of the end of the step, so that energies are those of one time.
fn world<S: Scalar>(response: Response) -> World<S> {
    let mut world = World::default();
    let substeps = if matches!(response, Response::Penalty(_)) { 32 } else { 4 };
    let integrator = Integrator::VelocityVerlet;
    world.set_model(Model { response, substeps, integrator, ..Model::GAME }).unwrap();
    world
}

fn vector<S: Scalar>(x: f64, y: f64, z: f64) -> Vec3<S> {
    Vec3::new(x, y, z).map(S::from_f64)
}

fn point<S: Scalar>(x: f64, y: f64, z: f64) -> Point3<S> {
    Point3::from_vec(vector(x, y, z))
}

fn smooth<S: Scalar>(restitution: f64) -> Material<S> {
    let restitution = S::from_f64(restitution);
    Material { restitution, friction: S::zero(), ..Material::default() }
}

fn steps<S: Scalar>(world: &mut World<S>, count: usize) {
    for _ in 0..count {
        world.step(S::from_f64(DT)).unwrap();
    }
}

const RAIL_X: LockedAxes = LockedAxes::TRANSLATION_Y.with(LockedAxes::TRANSLATION_Z);

/// Speed over that before a marble on a rail along x met a wall with this normal, and its place.
fn rebound<S: Scalar>(response: Response, normal: Vec3<f64>, restitution: f64) -> (f64, Marble<S>) {
    let mut world = world::<S>(response);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    let normal = vector(normal.x, normal.y, normal.z).normalize();
    let wall = world.walls.insert(Plane::through(point(2.0, 0.0, 0.0), normal).unwrap()).unwrap();
    world.walls.set_material(wall, Some(smooth(restitution))).unwrap();
    let marble = Marble {
        velocity: vector(1.0, 0.0, 0.0),
        material: Some(smooth(restitution)),
        locked_axes: RAIL_X,
        ..Marble::new(point(0.0, 0.3, -0.7), S::from_f64(0.1))
    };
    let id = world.marbles.insert(marble).unwrap();
    steps(&mut world, 480);
    let after = world.marbles.get(id).unwrap();
    (after.velocity.x.as_f64(), after)
}

#[test]
fn a_marble_on_a_rail_rebounds_from_an_inclined_wall_with_its_restitution() {
    let normals = [[-1.0, 0.0, 0.0], [-1.0, 0.0, 1.0], [-1.0, 1.0, 0.0], [-0.6, 1.0, -2.0]];
    for normal in normals.map(|[x, y, z]| Vec3::new(x, y, z)) {
        for restitution in [1.0, 0.5] {
            for (response, error) in
                [(Response::SoftStep, 1e-6), (Response::Impulse, 1e-6), (RESPONSES[2], 0.02)]
            {
                let (speed, marble) = rebound::<f32>(response, normal, restitution);
                let case = format!("{response:?} {normal:?} {restitution}: {speed}");
                assert!((speed + restitution).abs() < error, "{case}");
                let kept = [marble.position.y, marble.position.z].map(f32::to_bits);
                assert_eq!(kept, [0.3_f32, -0.7].map(f32::to_bits), "{case}");
                let (speed, _) = rebound::<f64>(response, normal, restitution);
                assert!((speed + restitution).abs() < error.max(1e-12), "{case}, f64 {speed}");
            }
        }
        let (speed, _) = rebound::<f64>(Response::Displacement, normal, 1.0);
        assert!(speed.abs() < 1e-12, "it knows no restitution: {speed}");
    }
}

#[test]
fn planar_collisions_are_those_of_free_marbles() {
    for response in RESPONSES {
        let run = |axes: LockedAxes| {
            let mut world = world::<f64>(response);
            world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
            let material = Some(Material { friction: 0.3, ..smooth(0.7) });
            let ids: Vec<_> = [(-1.0, 0.05, 2.0), (0.0, 0.0, 0.0), (1.0, -0.1, -1.5)]
                .iter()
                .map(|(x, y, speed)| {
                    let velocity = vector(*speed, 0.0, 0.0);
                    let at = Marble::new(point(*x, *y, 0.25), 0.1);
                    let marble = Marble { velocity, material, locked_axes: axes, ..at };
                    world.marbles.insert(marble).unwrap()
                })
                .collect();
            steps(&mut world, 90);
            let marbles = ids.iter().map(|id| world.marbles.get(*id).unwrap());
            marbles.map(|m| [m.velocity, m.angular_velocity]).collect::<Vec<_>>()
        };
        let (free, locked) = (run(LockedAxes::NONE), run(LockedAxes::PLANE_XY));
        for (free, locked) in free.iter().flatten().zip(locked.iter().flatten()) {
            assert!((free - locked).magnitude() < 1e-11, "{response:?}: {free:?} {locked:?}");
        }
    }
}

#[test]
fn a_marble_locked_in_place_is_a_wall_that_may_turn() {
    for (response, error) in [(Response::SoftStep, 1e-6), (Response::Impulse, 1e-6)] {
        let mut world = world::<f32>(response);
        world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
        let peg = Marble {
            locked_axes: LockedAxes::TRANSLATION,
            material: Some(smooth(1.0)),
            ..Marble::new(point(0.0, 0.0, 0.0), 0.5)
        };
        let ball = Marble {
            velocity: vector(-3.0, 0.0, 0.0),
            locked_axes: LockedAxes::NONE,
            ..Marble { position: point(2.0, 0.0, 0.0), ..peg }
        };
        let [peg, id] = [peg, ball].map(|marble| world.marbles.insert(marble).unwrap());
        steps(&mut world, 60);
        let velocity = world.marbles.get(id).unwrap().velocity;
        assert!((velocity - vector(3.0, 0.0, 0.0)).magnitude() < error, "{velocity:?}");
        let material = Some(Material { friction: 1.0, ..smooth(1.0) });
        for id in [peg, id] {
            world.marbles.set_material(id, material).unwrap();
        }
        world.marbles.set_position(id, point(2.0, 0.3, 0.0)).unwrap();
        world.marbles.set_velocity(id, vector(-3.0, 0.0, 0.0)).unwrap();
        steps(&mut world, 60);
        let peg = world.marbles.get(peg).unwrap();
        assert!(peg.angular_velocity.z.abs() > 0.5, "friction turns it: {peg:?}");
        assert_eq!((peg.position, peg.velocity), (point(0.0, 0.0, 0.0), vector(0.0, 0.0, 0.0)));
    }
}

/// A ball that falls onto one that is locked along the height: what is below it is as a wall to it.
#[test]
fn a_free_ball_rebounds_from_a_locked_one_with_all_of_its_speed() {
    for response in [Response::SoftStep, Response::Impulse] {
        let mut world = world::<f64>(response);
        world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
        let fixed = LockedAxes::TRANSLATION_Y;
        for (y, locked_axes, speed) in [(0.0, fixed, 0.0), (2.0, LockedAxes::NONE, -2.0)] {
            let velocity = vector(0.0, speed, 0.0);
            let at = Marble::new(point(0.0, y, 0.0), 0.5);
            let material = Some(smooth(1.0));
            world.marbles.insert(Marble { velocity, locked_axes, material, ..at }).unwrap();
        }
        steps(&mut world, 60);
        let speed = world.marbles.velocity()[1].y;
        assert!((speed - 2.0).abs() < 1e-9, "{response:?}: {speed}");
    }
}

#[test]
fn what_is_set_along_a_locked_axis_ends_in_the_next_step_and_teleports_count() {
    for response in RESPONSES {
        let mut world = world::<f32>(response);
        let id = world.marbles.insert(Marble::new(point(0.0, 5.0, 0.0), 0.1)).unwrap();
        world.marbles.set_locked_axes(id, LockedAxes::PLANE_XY).unwrap();
        assert_eq!(world.marbles.get(id).unwrap().locked_axes, LockedAxes::PLANE_XY);
        world.marbles.set_velocity(id, vector(1.0, 0.0, 7.0)).unwrap();
        world.marbles.set_angular_velocity(id, vector(3.0, 2.0, 1.0)).unwrap();
        world.marbles.set_position(id, point(0.0, 5.0, 0.125)).unwrap();
        world.marbles.apply_force(id, vector(0.0, 0.0, 1e3)).unwrap();
        steps(&mut world, 10);
        let Marble { position, velocity, angular_velocity, .. } = world.marbles.get(id).unwrap();
        assert_eq!([position.z, velocity.z], [0.125, 0.0], "{response:?}");
        assert!(position.x > 0.1 && velocity.y < -1.0, "{response:?}: it is free along others");
        assert_eq!(angular_velocity, vector(0.0, 0.0, 1.0), "{response:?}");
        world.marbles.set_locked_axes(id, LockedAxes::NONE).unwrap();
        world.marbles.set_velocity(id, vector(0.0, 0.0, 7.0)).unwrap();
        steps(&mut world, 1);
        assert!(world.marbles.get(id).unwrap().position.z > 0.2, "{response:?}");
    }
}

#[test]
fn what_event_driven_cannot_run_is_refused_by_name_and_changes_nothing() {
    let mut world = world::<f32>(Response::EventDriven);
    let [free, locked] = [LockedAxes::NONE, LockedAxes::ROTATION_Y].map(|locked_axes| {
        let marble = Marble::new(point(0.0, 2.0, 0.0), 0.1);
        world.marbles.insert(Marble { locked_axes, ..marble }).unwrap()
    });
    world.marbles.set_position(free, point(1.0, 2.0, 0.0)).unwrap();
    let refused = Error::Unsupported { response: "EventDriven", feature: "locked axes" };
    let before = world.clone();
    assert_eq!(world.step(1.0 / 60.0), Err(refused));
    assert_eq!(world.integrate(1.0 / 60.0), Err(refused));
    assert!(world == before);
    assert_eq!(world.unsupported_marbles(), [(locked, refused)]);
    world.marbles.set_locked_axes(locked, LockedAxes::NONE).unwrap();
    assert_eq!(world.unsupported_marbles(), []);
    steps(&mut world, 1);
}

#[test]
fn a_locked_marble_sleeps_where_gravity_pulls_it_along_its_lock() {
    for response in [Response::SoftStep, Response::Impulse, Response::Displacement] {
        let mut world = world::<f32>(response);
        world.set_gravity(vector(0.0, -9.81, 4.0)).unwrap();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let marble = Marble::new(point(0.0, 0.1, 0.3), 0.1);
        let locked_axes = LockedAxes::PLANE_XY;
        let id = world.marbles.insert(Marble { locked_axes, ..marble }).unwrap();
        steps(&mut world, 240);
        assert!(world.is_asleep(id).unwrap(), "{response:?}");
        assert_eq!(world.marbles.get(id).unwrap().position.z, 0.3);
        world.marbles.set_locked_axes(id, LockedAxes::NONE).unwrap();
        steps(&mut world, 30);
        assert!(world.marbles.get(id).unwrap().position.z > 0.35, "{response:?}: it rolls off");
    }
}

#[test]
fn an_upright_capsule_stays_upright_and_gains_nothing() {
    for response in &RESPONSES[1..4] {
        let mut world = world::<f64>(*response);
        world.walls.insert(Plane::new(vector(0.3, 1.0, 0.1).normalize(), 0.0).unwrap()).unwrap();
        let axes = LockedAxes::ROTATION_X | LockedAxes::ROTATION_Z;
        let capsule = Marble {
            half_length: 0.3,
            locked_axes: axes,
            velocity: vector(1.0, 0.0, 0.5),
            angular_velocity: vector(2.0, 3.0, 1.0),
            ..Marble::new(point(0.0, 1.0, 0.0), 0.1)
        };
        let id = world.marbles.insert(capsule).unwrap();
        steps(&mut world, 1);
        let start = world.energy().total();
        for _ in 0..120 {
            steps(&mut world, 1);
            let now = world.energy().total();
            assert!(now < start + 1e-3 * start.abs(), "{response:?}: {now} {start}");
        }
        let Quat { v, .. } = world.marbles.get(id).unwrap().rotation;
        assert_eq!([v.x, v.z], [0.0, 0.0], "{response:?}");
    }
}

/// About two free axes, the angular momentum about the locked one is not conserved: the energy is.
#[test]
fn a_tumbling_capsule_with_a_locked_axis_keeps_its_energy() {
    let mut world = world::<f64>(Response::Impulse);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    let capsule = Marble {
        half_length: 0.4,
        locked_axes: LockedAxes::ROTATION_Y,
        rotation: Quat::new(0.8, 0.36, 0.48, 0.0),
        angular_velocity: vector(2.0, 5.0, -3.0),
        ..Marble::new(point(0.0, 0.0, 0.0), 0.1)
    };
    let id = world.marbles.insert(capsule).unwrap();
    let before = world.energy().total();
    steps(&mut world, 1);
    let start = world.energy().total();
    assert!(start < before, "the lock takes what turns about its axis");
    for _ in 0..600 {
        steps(&mut world, 1);
        let now = world.energy().total();
        assert!(now <= start * (1.0 + 1e-12) && now > 0.98 * start, "{now} {start}");
        assert_eq!(world.marbles.get(id).unwrap().angular_velocity.y, 0.0);
    }
}

#[test]
fn a_pendulum_in_a_plane_swings_as_a_free_one() {
    let run = |locked_axes: LockedAxes| {
        let mut world = world::<f64>(Response::SoftStep);
        world
            .set_gravity(vector(0.0, -9.81, if locked_axes.is_empty() { 0.0 } else { 5.0 }))
            .unwrap();
        let marble = Marble::new(point(1.0, 0.0, 0.0), 0.1);
        let id = world.marbles.insert(Marble { locked_axes, ..marble }).unwrap();
        let ends =
            [JointEnd::world(point(0.0, 0.0, 0.0)), JointEnd::marble(id, vector(-1.0, 0.0, 0.0))];
        world.joints.insert(Joint::new(JointKind::BallAndSocket, ends)).unwrap();
        steps(&mut world, 100);
        world.marbles.get(id).unwrap()
    };
    let (free, locked) = (run(LockedAxes::NONE), run(LockedAxes::PLANE_XY));
    assert_eq!(locked.position.z, 0.0);
    assert!((free.position - locked.position).magnitude() < 1e-9, "{free:?} {locked:?}");
}

#[test]
fn the_swarm_moves_a_locked_marble_along_free_axes_only() {
    for response in RESPONSES {
        let mut world = world::<f32>(response);
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let marble = Marble::new(point(0.0, 0.5, 0.0), 0.5);
        let locked_axes = LockedAxes::TRANSLATION_Z;
        let id = world.marbles.insert(Marble { locked_axes, ..marble }).unwrap();
        let balls: Vec<_> = (0..40_u8)
            .map(|i| {
                let [x, y, z] = [i % 5, i / 10, i / 5 % 2].map(f32::from);
                Ball::new(Point3::new(0.21 * x - 0.6, 1.2 + 0.3 * y, 0.2 * z + 0.1), 0.1)
            })
            .collect();
        world.swarm.insert(&balls).unwrap();
        steps(&mut world, 240);
        let Marble { position, .. } = world.marbles.get(id).unwrap();
        assert_eq!(position.z.to_bits(), 0.0_f32.to_bits(), "{response:?}");
        assert!(position.x != 0.0 && position.y > 0.3, "{response:?}: {position:?}");
    }
}
