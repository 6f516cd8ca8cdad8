//! One-way walls, in every response, with any detection.

use taw::Error;
use taw::frame::Pose;
use taw::math::Quat;
use taw::motion::WallMotion;
use taw::prelude::*;
use taw::shape::{Aabb, BoundedShape as _, Compound, Mesh, Obb, Shape};
use taw::swarm::SwarmModel;
use taw::world::{ColliderId, WallShape};

const RESPONSES: [Response; 6] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
    Response::SoftStep,
];
const STEP: f64 = 1.0 / 64.0;

fn models() -> impl Iterator<Item = Model> {
    RESPONSES.into_iter().flat_map(|response| {
        [Detection::Discrete, Detection::Swept].map(|detection| {
            let substeps = if response == Response::EventDriven { 1 } else { 4 };
            let rotation = Rotation::Dynamic;
            Model { response, detection, rotation, substeps, ..Model::default() }
        })
    })
}

fn point<S: Scalar>([x, y, z]: [f64; 3]) -> Point3<S> {
    Point3::new(x, y, z).map(S::from_f64)
}

fn vector<S: Scalar>([x, y, z]: [f64; 3]) -> Vec3<S> {
    Vec3::new(x, y, z).map(S::from_f64)
}

/// A platform of which the top is at height zero.
fn platform<S: Scalar>(half: f64, thickness: f64) -> WallShape<S> {
    let (min, max) = ([-half, -thickness, -half], [half, 0.0, half]);
    Obb::from_aabb(&Aabb { min: point(min), max: point(max) }).into()
}

/// A sheet of two triangles at height zero.
fn sheet<S: Scalar>() -> WallShape<S> {
    let corners = [[-6.0, 0.0, -6.0], [6.0, 0.0, -6.0], [6.0, 0.0, 6.0], [-6.0, 0.0, 6.0]];
    let corners = corners.map(point).to_vec();
    Mesh::new(corners, vec![[0, 2, 1], [0, 3, 2]]).unwrap().into()
}

fn plane<S: Scalar>() -> WallShape<S> {
    Plane::new(Vec3::unit_y(), S::zero()).unwrap().into()
}

/// A world with a wall through which marbles pass upwards.
fn world<S: Scalar>(model: Model, wall: WallShape<S>) -> (World<S>, WallId) {
    let mut world = World::default();
    world.set_model(model).unwrap();
    let wall = world.walls.insert(wall).unwrap();
    world.walls.set_one_way(wall, Some(Vec3::unit_y())).unwrap();
    (world, wall)
}

fn marble<S: Scalar>(at: [f64; 3], velocity: [f64; 3]) -> Marble<S> {
    let restitution = S::zero();
    let material = Some(Material { restitution, friction: S::zero(), ..Material::default() });
    let velocity = vector(velocity);
    Marble { velocity, material, ..Marble::new(point(at), S::from_f64(0.5)) }
}

fn run<S: Scalar>(world: &mut World<S>, seconds: f64) {
    for _ in 0..(seconds / STEP).round() as u32 {
        world.step(S::from_f64(STEP)).unwrap();
    }
}

fn height<S: Scalar>(world: &World<S>, id: MarbleId) -> f64 {
    world.marbles.get(id).unwrap().position.y.as_f64()
}

/// Of a marble in free flight, at the height at which the wall begins for it and where it ends, the
/// motion is that without the wall; then it lands on it.
fn jumps_through<S: Scalar>(model: Model, wall: WallShape<S>, speed: f64) {
    let context = format!("{model:?}, {wall:?}, {speed} m/s");
    let (mut with, _) = world::<S>(model, wall);
    let mut without = World::<S>::default();
    without.set_model(model).unwrap();
    let jumper = marble([0.2, -3.0, 0.3], [0.0, speed, 0.0]);
    let id = with.marbles.insert(jumper).unwrap();
    let free = without.marbles.insert(jumper).unwrap();
    let mut up = true;
    for step in 0..(6.0 / STEP) as u32 {
        run(&mut with, STEP);
        run(&mut without, STEP);
        let rises = with.marbles.get(id).unwrap().velocity.y > S::zero();
        up &= rises || height(&with, id) < 0.5;
        if up {
            let [a, b] = [with.marbles.get(id), without.marbles.get(free)].map(Result::unwrap);
            assert_eq!((a.position, a.velocity), (b.position, b.velocity), "{context}: {step}");
        }
    }
    let at = height(&with, id);
    assert!((at - 0.5).abs() < 0.06, "{context}: it lies at {at} m");
}

#[test]
fn a_marble_jumps_through_a_platform_and_lands_on_it() {
    for model in models() {
        for speed in [9.0, 20.0] {
            for wall in [platform(6.0, 0.3), platform(6.0, 2.0)] {
                jumps_through::<f32>(model, wall, speed);
            }
            jumps_through::<f64>(model, platform(6.0, 0.3), speed);
            jumps_through::<f64>(model, plane(), speed);
            jumps_through::<f32>(model, plane(), speed);
            jumps_through::<f32>(model, sheet(), speed);
        }
    }
}

/// Too slow to come out above: it turns round in the wall, and falls out of it again.
#[test]
fn a_marble_that_turns_round_within_a_wall_falls_back() {
    for model in models() {
        for speed in [6.9, 7.3, 7.6, 8.0] {
            let (mut world, _) = world::<f64>(model, platform(6.0, 0.3));
            let id = world.marbles.insert(marble([0.2, -3.0, 0.3], [0.0, speed, 0.0])).unwrap();
            run(&mut world, 2.0);
            let free = -3.0 + speed * 2.0 - 0.5 * 9.81 * 4.0;
            let at = height(&world, id);
            assert!((at - free).abs() < 0.3, "{model:?}, {speed} m/s: {at} m, free {free} m");
        }
    }
}

/// At 100 m/s, and back through the wall it does not go.
#[test]
fn a_fast_marble_passes_in_one_direction_only() {
    for model in models().filter(|model| model.detection == Detection::Swept) {
        for wall in [platform::<f32>(6.0, 0.1), plane(), sheet()] {
            let (mut world, _) = world(model, wall.clone());
            world.set_gravity(vector([0.0; 3])).unwrap();
            let [up, down] = [(-20.0, 100.0, -2.0), (20.0, -100.0, 2.0)].map(|(y, speed, x)| {
                world.marbles.insert(marble([x, y, 0.1], [0.0, speed, 0.0])).unwrap()
            });
            run(&mut world, 1.0);
            assert!((height(&world, up) - 80.0).abs() < 0.1, "{model:?}, {wall:?}");
            assert!(height(&world, down) > 0.3, "{model:?}, {wall:?}: {}", height(&world, down));
        }
    }
}

#[test]
fn from_the_side_a_marble_is_not_touched() {
    for model in models() {
        let (mut world, _) = world::<f32>(model, platform(3.0, 2.0));
        world.set_gravity(vector([0.0; 3])).unwrap();
        let id = world.marbles.insert(marble([-8.0, -1.0, 0.3], [6.0, 0.0, 0.0])).unwrap();
        run(&mut world, 3.0);
        let marble = world.marbles.get(id).unwrap();
        assert!((marble.position.x - 10.0).abs() < 1e-3, "{model:?}: {:?}", marble.position);
        assert_eq!(marble.velocity, vector([6.0, 0.0, 0.0]), "{model:?}");
    }
}

/// Where a marble lies on a wall that becomes a one-way wall, it goes on lying there, and where it may
/// pass no longer, it falls.
#[test]
fn one_way_changes_while_running() {
    for model in models() {
        let (mut world, wall) = world::<f32>(model, platform(6.0, 0.3));
        world.walls.set_one_way(wall, None).unwrap();
        assert_eq!(world.walls.one_way(wall).unwrap(), None);
        let id = world.marbles.insert(marble([0.0, 0.5, 0.0], [0.0; 3])).unwrap();
        run(&mut world, 2.0);
        let before = world.clone();
        world.walls.set_one_way(wall, Some(vector([0.0, 3.0, 0.0]))).unwrap();
        assert_eq!(world.walls.one_way(wall).unwrap(), Some(Vec3::unit_y()));
        assert!(world != before);
        run(&mut world, 2.0);
        assert!(height(&world, id) > 0.4, "{model:?}: {}", height(&world, id));
        world.walls.set_one_way(wall, Some(-Vec3::unit_y())).unwrap();
        run(&mut world, 1.0);
        assert!(height(&world, id) < -2.0, "{model:?}: {}", height(&world, id));
    }
}

/// A lift that moves goes down past a marble that lies below, and takes one along that lies on it.
#[test]
fn a_lift_passes_what_is_below_it_and_carries_what_lies_on_it() {
    for model in models() {
        for speed in [-2.0, -12.0] {
            let (mut world, wall) = world::<f64>(model, platform(6.0, 0.3));
            let floor = Plane::new(Vec3::unit_y(), -6.0).unwrap();
            world.walls.insert(floor).unwrap();
            let below = world.marbles.insert(marble([0.0, -5.5, 0.0], [0.0; 3])).unwrap();
            let mut lift = 0.0;
            let steps = (5.9 / -speed / STEP) as u32;
            for _ in 0..steps {
                lift += speed * STEP;
                move_lift(&mut world, wall, lift, speed);
                run(&mut world, STEP);
                let at = height(&world, below);
                assert!((at + 5.5).abs() < 0.06, "{model:?}: {at} m by {speed} m/s");
            }
        }
        let (mut world, wall) = world::<f64>(model, platform(6.0, 0.3));
        let rider = world.marbles.insert(marble([0.0, 0.5, 0.0], [0.0; 3])).unwrap();
        let (mut lift, speed) = (0.0, 2.0);
        for _ in 0..128 {
            lift += speed * STEP;
            move_lift(&mut world, wall, lift, speed);
            run(&mut world, STEP);
        }
        let at = height(&world, rider);
        assert!((at - lift - 0.5).abs() < 0.1, "{model:?}: {at} m on a lift at {lift} m");
    }
}

fn move_lift(world: &mut World<f64>, wall: WallId, height: f64, speed: f64) {
    let pose = Pose { translation: vector([0.0, height, 0.0]), ..Pose::identity() };
    world.walls.set(wall, platform(6.0, 0.3).transformed(pose).unwrap()).unwrap();
    let (velocity, pivot) = (vector([0.0, speed, 0.0]), point([0.0, height, 0.0]));
    let motion = WallMotion { velocity, angular_velocity: Vec3::zero(), pivot };
    world.walls.set_motion(wall, Some(motion)).unwrap();
}

/// A long capsule that lies across a narrow platform touches it between its ends.
#[test]
fn a_capsule_lies_across_a_platform_and_jumps_through_it() {
    let capsules = models().filter(|model| model.response.knows_capsules());
    for model in capsules {
        for (y, speed) in [(0.5, 0.0), (-3.0, 9.0)] {
            let (mut world, _) = world::<f64>(model, platform(0.6, 0.3));
            let rotation = Quat::from_angle_z(cgmath::Deg(90.0));
            let capsule =
                Marble { half_length: 3.0, rotation, ..marble([0.0, y, 0.0], [0.0, speed, 0.0]) };
            let id = world.marbles.insert(capsule).unwrap();
            run(&mut world, 3.0);
            let at = height(&world, id);
            assert!((at - 0.5).abs() < 0.1, "{model:?}, from {y} m: {at}");
        }
    }
}

/// Many marbles among tilted platforms: none makes energy, and a clone goes the same way.
#[test]
fn random_scenes_keep_their_energy_and_their_bits() {
    let mut random = fastrand::Rng::with_seed(3);
    for model in models() {
        for round in 0..20 {
            let mut world = World::<f64>::default();
            world.set_model(model).unwrap();
            let threads = 1 + round % 3;
            world.swarm.set_model(SwarmModel { threads, ..SwarmModel::default() }).unwrap();
            world.walls.insert(Plane::new(Vec3::unit_y(), -4.0).unwrap()).unwrap();
            let mut walls = Vec::new();
            for level in 0..3 {
                let turn = Quat::from_angle_z(cgmath::Rad(random.f64() - 0.5));
                let center = [4.0 * random.f64() - 2.0, 2.0 * f64::from(level) - 2.0, 0.0];
                let half = vector([1.0 + random.f64(), 0.05 + 0.3 * random.f64(), 3.0]);
                walls.push(Obb::new(point(center), turn, half).unwrap());
                let wall = world.walls.insert(walls[walls.len() - 1]).unwrap();
                world.walls.set_one_way(wall, Some(turn * Vec3::unit_y())).unwrap();
            }
            for i in 0..8 {
                let at = [random.f64() * 5.0 - 2.5, -3.4 + 1.05 * f64::from(i), 0.0];
                let velocity = [random.f64() * 4.0 - 2.0, random.f64() * 16.0, 0.0];
                // What begins in a wall would be lifted out of it.
                if walls.iter().all(|wall| wall.project_point(point(at)).distance > 0.5) {
                    world.marbles.insert(marble(at, velocity)).unwrap();
                }
            }
            judge(&mut world, model, round);
        }
    }
}

fn judge(world: &mut World<f64>, model: Model, round: u32) {
    let mut copy = world.clone();
    let mut least = world.energy().total();
    // As if all fell by the height of the scene.
    let scale = world.energy().kinetic + world.marbles.len() as f64 * 1_309.0 * 9.81 * 8.0;
    for step in 0..160 {
        run(world, STEP);
        let energy = world.energy().total();
        // Springs give back what they stored, which is not counted.
        let is_hard = matches!(model.response, Response::EventDriven | Response::Impulse);
        let bound = least + if is_hard { 1e-3 } else { 0.03 } * scale;
        // Positions that are projected may be lifted.
        let is_bound = model.response != Response::Displacement;
        assert!(energy <= bound || !is_bound, "{model:?} {round} {step}: {energy} J, {least} J");
        least = least.min(energy);
        if step == 80 {
            copy = world.clone();
        }
        if step > 80 {
            run(&mut copy, STEP);
        }
    }
    assert!(*world == copy, "{model:?} {round}");
}

/// A field of marbles sleeps at its far end while one jumps through a platform at the other.
#[test]
fn a_marble_that_passes_wakes_none_that_is_far_away() {
    let (mut world, _) = world::<f32>(Model::GAME, platform(2.0, 0.3));
    world.walls.insert(Plane::new(Vec3::unit_y(), -3.0).unwrap()).unwrap();
    let ids: Vec<_> = (0..2_400_u32)
        .map(|i| [f64::from(i / 8) * 1.2, -2.5, f64::from(i % 8) * 1.2])
        .map(|at| world.marbles.insert(marble(at, [0.0; 3])).unwrap())
        .collect();
    run(&mut world, 3.0);
    assert!(ids.iter().all(|id| world.is_asleep(*id).unwrap()));
    world.marbles.set_velocity(ids[0], vector([0.0, 11.0, 0.0])).unwrap();
    let mut highest = f64::MIN;
    for _ in 0..192 {
        run(&mut world, STEP);
        highest = highest.max(height(&world, ids[0]));
        assert!(world.is_asleep(ids[2_399]).unwrap(), "at {} m", height(&world, ids[0]));
    }
    assert!(highest > 1.0, "{highest} m");
    let at = height(&world, ids[0]);
    assert!((at - 0.5).abs() < 0.06, "it lies on the platform: {at} m");
}

#[test]
fn a_direction_has_a_length_and_a_wall() {
    let (mut world, wall) = world::<f32>(Model::default(), plane());
    let before = world.clone();
    let zero = world.walls.set_one_way(wall, Some(Vec3::zero()));
    assert_eq!(zero, Err(Error::NotUnit { field: "direction", value: 0.0 }));
    let infinite = world.walls.set_one_way(wall, Some(Vec3::unit_x() * f32::INFINITY));
    let value = f64::INFINITY;
    assert!(
        matches!(infinite, Err(Error::NotFinite { field: "direction.x", value: v }) if v == value)
    );
    assert!(world == before);
    world.walls.remove(wall).unwrap();
    assert_eq!(world.walls.set_one_way(wall, None), Err(Error::NoSuchWall(wall)));
}

#[test]
fn a_marble_that_lies_beside_a_rim_stays_on_its_platform() {
    for model in models() {
        let part =
            |min, max| Shape::Obb(Obb::from_aabb(&Aabb { min: point(min), max: point(max) }));
        let floor = part([-4.0, -0.2, -4.0], [4.0, 0.0, 4.0]);
        let rim = part([3.0, 0.0, -4.0], [4.0, 2.0, 4.0]);
        let tray = Compound::new(vec![floor, rim]).unwrap();
        let (mut world, _) = world::<f64>(model, tray.into());
        world.set_gravity(vector([6.0, -9.0, 0.0])).unwrap(); // onto the rim, too
        let id = world.marbles.insert(marble([0.0, 0.6, 0.3], [0.0; 3])).unwrap();
        run(&mut world, 4.0);
        let at = world.marbles.get(id).unwrap().position;
        assert!((at.y - 0.5).abs() < 0.06 && (at.x - 2.5).abs() < 0.06, "{model:?}: {at:?}");
    }
}

#[test]
fn one_that_no_longer_passes_by_name_falls_on_out_of_the_wall() {
    for model in models() {
        let (mut world, wall) = world::<f64>(model, platform(4.0, 0.2));
        let id = world.marbles.insert(marble([0.0, 0.5, 0.0], [0.0; 3])).unwrap();
        run(&mut world, 0.5);
        world.marbles.set_ignored(id, &[ColliderId::Wall(wall)]).unwrap();
        let mut within = height(&world, id);
        while within > 0.1 {
            run(&mut world, STEP);
            within = height(&world, id);
        }
        world.marbles.set_ignored(id, &[]).unwrap();
        run(&mut world, STEP);
        assert!(height(&world, id) < within, "{model:?}: {within} m, then {}", height(&world, id));
        run(&mut world, 2.0);
        assert!(height(&world, id) < -2.0, "{model:?}: {}", height(&world, id));
    }
}

#[test]
fn a_one_way_wall_may_collide_with_whom_it_holds() {
    for model in models() {
        let (mut world, wall) = world::<f64>(model, platform(6.0, 0.3));
        let lies = world.marbles.insert(marble([0.0, 0.5, 0.0], [0.0; 3])).unwrap();
        let jumps = world.marbles.insert(marble([3.0, -0.9, 0.0], [0.0, 9.0, 0.0])).unwrap();
        let told = |world: &World<f64>| {
            [lies, jumps].map(|id| world.may_collide(id, ColliderId::Wall(wall)).unwrap())
        };
        run(&mut world, 4.0 * STEP);
        assert_eq!(told(&world), [true, false], "{model:?}");
        run(&mut world, 3.0);
        assert_eq!(told(&world), [true, true], "{model:?}");
        world.walls.set_one_way(wall, Some(-Vec3::unit_y())).unwrap();
        run(&mut world, STEP);
        assert_eq!(told(&world), [false, false], "{model:?}");
        world.walls.set_one_way(wall, None).unwrap();
        run(&mut world, STEP);
        assert_eq!(told(&world), [true, true], "{model:?}");
    }
}
