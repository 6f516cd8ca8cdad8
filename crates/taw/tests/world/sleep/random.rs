//! Random changes beside what sleeps.

use super::*;

/// Marbles that a wall touches.
fn beside(world: &World<f32>, ids: &[MarbleId], wall: &Aabb<Point3<f32>>) -> Vec<MarbleId> {
    let touches = |id: &&MarbleId| {
        world.marbles.get(**id).is_ok_and(|marble| {
            wall.distance_to_point(marble.position) <= marble.radius
                || wall.contains_point(marble.position)
        })
    };
    ids.iter().filter(touches).copied().collect()
}

/// Changes something at random. Returns the marbles that must be awake after the next step.
fn change(
    world: &mut World<f32>,
    random: &mut Random,
    walls: &mut Vec<(WallId, Aabb<Point3<f32>>)>,
    ids: &mut Vec<MarbleId>,
) -> Vec<MarbleId> {
    let (wall, marble) = (random.below(walls.len()), random.below(ids.len()));
    let (wall_id, shape) = walls[wall];
    let id = ids[marble];
    match random.below(8) {
        0 => {
            let new = random.block();
            let touched = [beside(world, ids, &shape), beside(world, ids, &new)].concat();
            world.walls.set(wall_id, new).unwrap();
            walls[wall].1 = new;
            touched
        }
        1 => {
            let new = random.block();
            walls.push((world.walls.insert(new).unwrap(), new));
            beside(world, ids, &new)
        }
        2 if walls.len() > 2 => {
            walls.swap_remove(wall);
            world.walls.remove(wall_id).unwrap();
            beside(world, ids, &shape)
        }
        3 => {
            let motion = sliding(Vec3::new(random.next(), 0.0, random.next()));
            world.walls.set_motion(wall_id, Some(motion)).unwrap();
            beside(world, ids, &shape)
        }
        4 => {
            world.walls.set_motion(wall_id, None).unwrap();
            let material = Material { friction: random.next(), ..Material::default() };
            world.walls.set_material(wall_id, Some(material)).unwrap();
            beside(world, ids, &shape)
        }
        5 => {
            world.marbles.apply_impulse(id, Vec3::new(0.0, 9.0 * random.next(), 0.0)).unwrap();
            vec![id]
        }
        6 if ids.len() > 10 => {
            let gone = world.marbles.remove(id).unwrap();
            ids.swap_remove(marble);
            let near = |id: &&MarbleId| {
                let other = world.marbles.get(**id).unwrap();
                let apart = (other.position - gone.position).magnitude();
                apart < (gone.radius + other.radius) * 1.01
            };
            ids.iter().filter(near).copied().collect()
        }
        _ => {
            let at = Point3::new(random.next(), 1.0 + random.next(), random.next());
            ids.push(world.marbles.insert(Marble::new(at, 0.05 + 0.1 * random.next())).unwrap());
            vec![]
        }
    }
}

#[test]
pub fn who_must_wake_wakes_and_who_sleeps_does_not_move() {
    let mut slept = 0;
    for seed in 1..=rounds(40) {
        let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut world = world();
        world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        let mut walls: Vec<_> = (0..4)
            .map(|_| {
                let shape = random.block();
                (world.walls.insert(shape).unwrap(), shape)
            })
            .collect();
        let material = Material { rolling_resistance: 0.1, ..Material::default() };
        let mut ids: Vec<_> = (0..40)
            .map(|_| {
                let at =
                    [4.0 * random.next() - 2.0, 3.0 * random.next(), 4.0 * random.next() - 2.0];
                let mut ball = Marble::new(Point3::from(at), 0.05 + 0.1 * random.next());
                ball.material = Some(material);
                world.marbles.insert(ball).unwrap()
            })
            .collect();
        for _ in 0..12 {
            for _ in 0..40 {
                let before: Vec<_> = ids
                    .iter()
                    .filter(|id| world.is_asleep(**id).unwrap())
                    .map(|id| (*id, world.marbles.get(*id).unwrap()))
                    .collect();
                steps(&mut world, 1);
                for (id, marble) in before {
                    if world.is_asleep(id).unwrap() {
                        slept += 1;
                        assert_eq!(world.marbles.get(id).unwrap(), marble, "seed {seed}");
                    }
                }
            }
            let must_wake = change(&mut world, &mut random, &mut walls, &mut ids);
            // Any number of threads, and a clone.
            let mut other = world.clone();
            let model = SwarmModel { threads: 3, ..other.swarm.model() };
            other.swarm.set_model(model).unwrap();
            let mut same = world.clone();
            same.swarm.set_model(world.swarm.model()).unwrap(); // which wakes all, too
            steps(&mut other, 20);
            steps(&mut same, 20);
            assert_eq!(other.marbles, same.marbles, "seed {seed}: threads");
            steps(&mut world, 1);
            for id in must_wake.into_iter().filter(|id| world.marbles.row(*id).is_ok()) {
                assert!(!world.is_asleep(id).unwrap(), "seed {seed}: {id:?} sleeps on");
            }
        }
    }
    assert!(slept > 250 * rounds(40), "only {slept} times did any sleep");
}
