//! Nothing passes through anything, however fast.

use super::*;

const DT: f64 = 1.0 / 60.0;

/// Uniform numbers from zero to one.
pub fn dice(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / (1_u64 << 31) as f64
    }
}

fn direction(random: &mut impl FnMut() -> f64) -> Vec3<f64> {
    loop {
        let v = Vec3::new(random(), random(), random()) * 2.0 - Vec3::new(1.0, 1.0, 1.0);
        if v.magnitude2() > 0.01 && v.magnitude2() < 1.0 {
            return v.normalize();
        }
    }
}

/// Returns true if a ball went through another one in a step, by where it is from that before and after.
fn passes([before, after]: [Vec3<f64>; 2], radii: f64) -> bool {
    let path = after - before;
    let time = (-before.dot(path) / path.magnitude2().max(f64::MIN_POSITIVE)).clamp(0.0, 1.0);
    before.dot(after) < 0.0 && (before + path * time).magnitude() < 0.5 * radii
}

/// Momentum, and the sum of the magnitudes.
fn momentum(world: &World<f64>, ids: &[MarbleId]) -> (Vec3<f64>, f64) {
    let marbles = ids.iter().map(|id| world.marbles.get(*id).unwrap());
    marbles.fold((Vec3::zero(), 0.0), |(sum, all), marble| {
        let one = marble.velocity * marble.mass.of(marble.radius);
        (sum + one, all + one.magnitude())
    })
}

fn empty(substeps: u32, restitution: f64) -> (World<f64>, Material<f64>) {
    let mut world = world::<f64>(substeps);
    world.set_gravity(Vec3::zero()).unwrap();
    (world, Material { restitution, friction: 0.0, ..Material::default() })
}

/// A ball that flies at another one, by 1 to 1,000 of its diameters a step, from up to three steps away,
/// and past its center by up to nine tenths of both radii.
#[test]
fn a_ball_that_meets_another_does_not_pass_through_it() {
    let mut random = dice(7);
    for number in 0..3_000 {
        let substeps = [1, 2, 5][number % 3];
        let restitution = [0.0, 0.5, 1.0][number / 3 % 3];
        let (mut world, material) = empty(substeps, restitution);
        let radii = [0.05, 0.05 * 8_f64.powf(random() - 0.5)];
        let masses = [1.0, 1e4_f64.powf(random() - 0.5)];
        let step = 2.0 * radii[0] * 1000_f64.powf(random());
        let (ahead, both) = (direction(&mut random), radii[0] + radii[1]);
        let aside = ahead.cross(direction(&mut random)).normalize() * (0.9 * random() * both);
        let far = (0.2 + 2.8 * random()) * step + 1.1 * both;
        // The other one goes its own way, together with the first one.
        let common = direction(&mut random) * (if number % 2 == 0 { step / DT } else { 0.0 });
        let mut insert = |i: usize, position: Vec3<f64>, velocity: Vec3<f64>| {
            let marble = Marble {
                velocity,
                mass: taw::world::Mass::Kilograms(masses[i]),
                material: Some(material),
                ..Marble::new(Point3::from_vec(position), radii[i])
            };
            world.marbles.insert(marble).unwrap()
        };
        let a = insert(0, Vec3::zero(), common + ahead * (step / DT));
        let b = insert(1, ahead * far + aside, common);
        let ids = [a, b];
        let (before, _) = momentum(&world, &ids);
        let energy = world.energy().total();
        for _ in 0..5 {
            world.step(DT).unwrap();
        }
        let (after, all) = momentum(&world, &ids);
        let [a, b] = ids.map(|id| world.marbles.get(id).unwrap());
        let speed = (b.velocity - a.velocity).dot(ahead) * DT / step;
        let about = format!("{number}: {step} a step, {substeps} substeps, {restitution}");
        // Along the normal, where they meet, they part with this much of the speed.
        let head_on = 1.0 - aside.magnitude2() / (both * both);
        let expected = -1.0 + (1.0 + restitution) * head_on;
        if restitution > 0.0 {
            assert!((speed - expected).abs() < 0.02, "{about}: {speed} in place of {expected}");
        } else {
            // It is stopped along the line of the centers before that, too.
            assert!(speed > -1.0 + 0.5 * head_on, "{about}: {speed} in place of {expected}");
        }
        assert!((after - before).magnitude() < 1e-5 * all, "{about}: {:?}", after - before);
        assert!(world.energy().total() < energy * (1.0 + 1e-5), "{about}");
    }
}

/// The first of three in a line hits the second one, and that the third one, or stops.
#[test]
fn a_ball_that_is_struck_does_not_pass_through_the_next_one() {
    let mut random = dice(3);
    for number in 0..600 {
        let restitution = [0.0, 0.5, 1.0][number % 3];
        let (mut world, material) = empty([1, 3][number / 3 % 2], restitution);
        let (radius, ahead) = (0.02, direction(&mut random));
        let step = 2.0 * radius * 1000_f64.powf(random());
        let mut x = 0.0;
        let ids = [0, 1, 2].map(|i| {
            let marble = Marble {
                velocity: ahead * (if i == 0 { step / DT } else { 0.0 }),
                mass: taw::world::Mass::Kilograms(100_f64.powf(random() - 0.5)),
                material: Some(material),
                ..Marble::new(Point3::from_vec(ahead * x), radius)
            };
            x += 2.5 * radius + step * random();
            world.marbles.insert(marble).unwrap()
        });
        let (before, _) = momentum(&world, &ids);
        let energy = world.energy().total();
        let places =
            |world: &World<f64>| ids.map(|id| world.marbles.get(id).unwrap().position.to_vec());
        let mut last = places(&world);
        for _ in 0..6 {
            world.step(DT).unwrap();
            let now = places(&world);
            for [i, j] in [[0, 1], [1, 2], [0, 2]] {
                let apart = [last[j] - last[i], now[j] - now[i]];
                assert!(!passes(apart, 2.0 * radius), "{number}: {step}: {i} {j} {apart:?}");
            }
            last = now;
        }
        let (after, all) = momentum(&world, &ids);
        assert!((after - before).magnitude() < 1e-5 * all, "{number}: {:?}", after - before);
        assert!(world.energy().total() < energy * (1.0 + 1e-5), "{number}");
    }
}

/// Two layers of balls that fly at each other, each at the one opposite: more than there may be fast
/// movers.
#[test]
fn of_many_fast_balls_none_passes_through_another() {
    for (diameters, restitution) in [(4.0, 1.0), (4.0, 0.0), (30.0, 0.5), (300.0, 1.0)] {
        for thread in [1, 3] {
            let (mut world, material) = empty(2, restitution);
            let threads = taw::swarm::SwarmModel { threads: thread, ..world.swarm.model() };
            world.swarm.set_model(threads).unwrap();
            let (radius, mut random) = (0.05, dice(5));
            let step = 2.0 * radius * diameters;
            let mut pairs = Vec::new();
            for i in 0..400_u16 {
                let [x, z] = [i % 20, i / 20].map(|k| f64::from(k) * 0.3);
                let mut insert = |side: f64, off: f64| {
                    let marble = Marble {
                        velocity: Vec3::unit_y() * (-side * 0.5 * step / DT),
                        material: Some(material),
                        ..Marble::new(Point3::new(x + off, side * (1.3 * step), z), radius)
                    };
                    world.marbles.insert(marble).unwrap()
                };
                let off = 2e-4 * random();
                pairs.push([insert(-1.0, 0.0), insert(1.0, off)]);
            }
            for _ in 0..5 {
                world.step(DT).unwrap();
            }
            for pair in pairs {
                let [a, b] = pair.map(|id| world.marbles.get(id).unwrap());
                let apart = b.position.y - a.position.y;
                assert!(apart > radius, "{diameters} {restitution}: {apart}");
            }
        }
    }
}

/// Rows of balls that sleep, 50 m along the x axis.
fn sleeping_rows() -> (World<f64>, Vec<MarbleId>) {
    let mut world = world::<f64>(1);
    floor(&mut world);
    for i in 0..2_000_u16 {
        let [x, z] = [i % 200, i / 200].map(|k| f64::from(k) * 0.25);
        world.marbles.insert(Marble::new(Point3::new(x, 0.1, z), 0.1)).unwrap();
    }
    for _ in 0..120 {
        world.step(DT).unwrap();
    }
    let ids: Vec<_> = (0..world.marbles.len()).filter_map(|row| world.marbles.id(row)).collect();
    assert!(ids.iter().all(|id| world.is_asleep(*id).unwrap()));
    (world, ids)
}

/// It comes down on the far end, several chunks from where it comes from, and does not reach the floor.
#[test]
fn a_bullet_wakes_what_it_hits_far_away() {
    let (mut world, ids) = sleeping_rows();
    let velocity = Vec3::new(65.0, -11.75, 0.0) / DT;
    world
        .marbles
        .insert(Marble { velocity, ..Marble::new(Point3::new(-20.0, 12.0, 0.0), 0.1) })
        .unwrap();
    world.step(DT).unwrap();
    let struck = ids.iter().map(|id| world.marbles.get(*id).unwrap());
    assert!(
        struck.into_iter().any(|ball| ball.position.x > 40.0 && ball.velocity.magnitude() > 100.0)
    );
}

#[test]
fn a_bullet_wakes_what_it_hits() {
    let (mut world, ids) = sleeping_rows();
    let velocity = Vec3::new(4_000.0, 0.0, 0.0);
    let bullet = Marble { velocity, ..Marble::new(Point3::new(-20.0, 0.1, 0.0), 0.1) };
    let bullet = world.marbles.insert(bullet).unwrap();
    let place = |world: &World<f64>, id| world.marbles.get(id).unwrap().position.to_vec();
    let mut last = place(&world, ids[0]) - place(&world, bullet);
    for _ in 0..3 {
        world.step(DT).unwrap();
        let now = place(&world, ids[0]) - place(&world, bullet);
        assert!(!passes([last, now], 0.2), "{last:?} {now:?}");
        last = now;
    }
    assert!(place(&world, ids[0]).magnitude() > 0.2, "{:?}", place(&world, ids[0]));
}

/// Bullets at balls that lie apart from each other, more than there may be fast movers: from one
/// quarter of a diameter in front of them to ten diameters.
#[test]
fn of_many_bullets_none_passes_through_what_lies_still() {
    for (diameters, threads) in [(3.0, 1), (30.0, 1), (30.0, 3)] {
        let (mut world, material) = empty(2, 0.5);
        let model = taw::swarm::SwarmModel { threads, ..world.swarm.model() };
        world.swarm.set_model(model).unwrap();
        let (radius, mut random) = (0.05, dice(11));
        let mut pairs = Vec::new();
        for i in 0..1_000_u16 {
            let [x, z] = [i % 40, i / 40].map(|k| f64::from(k) * 0.4);
            let mut insert = |y: f64, speed: f64| {
                let velocity = Vec3::unit_y() * speed;
                let position = Point3::new(x, y, z);
                let marble =
                    Marble { velocity, material: Some(material), ..Marble::new(position, radius) };
                world.marbles.insert(marble).unwrap()
            };
            let still = insert(0.0, 0.0);
            if i % 10 == 0 {
                let gap = 2.0 * radius * (0.25 + 9.75 * random());
                pairs.push([insert(-2.0 * radius - gap, 2.0 * radius * diameters / DT), still]);
            }
        }
        for _ in 0..5 {
            world.step(DT).unwrap();
        }
        for pair in pairs {
            let [a, b] = pair.map(|id| world.marbles.get(id).unwrap());
            let apart = b.position.y - a.position.y;
            assert!(apart > radius, "{diameters}, {threads} threads: {apart}");
        }
    }
}

#[test]
fn many_bullets_wake_what_they_hit_far_away() {
    let (mut world, ids) = sleeping_rows();
    let velocity = Vec3::new(65.0, -11.75, 0.0) / DT;
    for i in 0..200_u16 {
        let [x, z] = [i % 20, i / 20].map(|k| f64::from(k) * 0.25);
        let position = Point3::new(-20.0 + x, 12.0, z);
        world.marbles.insert(Marble { velocity, ..Marble::new(position, 0.1) }).unwrap();
    }
    world.step(DT).unwrap();
    let hit = ids.iter().map(|id| world.marbles.get(*id).unwrap());
    let hit = hit.filter(|ball| ball.velocity.magnitude() > 100.0).count();
    assert!(hit > 20, "{hit}");
}

/// Three in a line, and a thin plate behind the last one.
#[test]
fn what_a_fast_ball_strikes_goes_through_no_wall() {
    let mut random = dice(13);
    for number in 0..300 {
        let (mut world, material) = empty([1, 3][number % 2], [0.0, 0.5, 1.0][number / 2 % 3]);
        let radius = 0.02;
        let step = 2.0 * radius * 1000_f64.powf(random());
        let mut x = 0.0;
        let ids = [0, 1, 2].map(|i| {
            let marble = Marble {
                velocity: Vec3::unit_x() * (if i == 0 { step / DT } else { 0.0 }),
                mass: taw::world::Mass::Kilograms(100_f64.powf(random() - 0.5)),
                material: Some(material),
                ..Marble::new(Point3::new(x, 0.002 * random(), 0.0), radius)
            };
            x += 2.0 * radius + 0.5 * radius * random() + 0.3 * step * random();
            world.marbles.insert(marble).unwrap()
        });
        let far = 1e4;
        let plate = taw::shape::Aabb {
            min: Point3::new(x, -far, -far),
            max: Point3::new(x + 0.01, far, far),
        };
        world.walls.insert(plate).unwrap();
        for _ in 0..6 {
            world.step(DT).unwrap();
            for (i, id) in ids.iter().enumerate() {
                let at = world.marbles.get(*id).unwrap().position.x;
                assert!(at < x, "{number}: {step} a step, {i} at {at} of {x}");
            }
        }
    }
}

/// Small balls fall one above the other onto a floor, and go up to 25 radii in a substep: the lower one
/// bounces into the upper one within it. In one substep one pair may be left half inside each other,
/// where they meet more often than once.
#[test]
fn small_balls_that_follow_each_other_onto_a_floor_keep_their_order() {
    let mut random = dice(5);
    for number in 0..2_000 {
        let substeps = 1 + (4.0 * random()) as u32;
        let (mut world, plain) = empty(substeps, random());
        world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
        let floor = world.walls.insert(Plane::new(Vec3::unit_y(), 0.0).unwrap()).unwrap();
        world.walls.set_material(floor, Some(plain)).unwrap();
        let (radius, speed) = (0.005 + 0.02 * random(), 1.0 + 7.0 * random());
        let height = radius * (1.0 + 40.0 * random());
        let gap = radius * (2.0 + 4.0 * random());
        let ids = [0.0, gap].map(|gap| {
            let position = Point3::new(0.0, height + gap, 0.0);
            let velocity = Vec3::new(0.0, -speed, 0.0);
            let marble =
                Marble { velocity, material: Some(plain), ..Marble::new(position, radius) };
            world.marbles.insert(marble).unwrap()
        });
        // As where they touch: parting what overlaps lifts it.
        let energy_of = |world: &World<f64>| {
            let [lower, upper] = ids.map(|id| world.marbles.get(id).unwrap());
            let weight = 9.81 * lower.mass.of(radius);
            let sunk = (radius - lower.position.y).max(0.0);
            let overlap = (2.0 * radius - (upper.position - lower.position).magnitude()).max(0.0);
            world.energy().total() + weight * (2.0 * sunk + overlap)
        };
        let energy = energy_of(&world);
        for step in 0..60 {
            world.step(DT).unwrap();
            let [lower, upper] = ids.map(|id| world.marbles.get(id).unwrap().position);
            // The upper one tips over in the end.
            let apart = (upper - lower).magnitude() / radius;
            let about =
                format!("{number}, step {step}: {substeps} substeps, r {radius}, {speed} m/s");
            assert!(apart > 1.0, "{about}: {apart} radii apart");
            let now = energy_of(&world);
            assert!(now < energy * 1.001, "{about}: {energy} to {now} J");
        }
    }
}
