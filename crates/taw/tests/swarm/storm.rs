//! Random scenes of swarms that nobody chose, judged by what holds in every scene.
//! `SWARM_STORM=1000 cargo test -p taw --release --test swarm storm` runs so many of them.

use taw::prelude::*;
use taw::swarm::{Ball, SimdLevel, Swarm, SwarmModel, Tier};

const DT: f32 = 1.0 / 60.0;

/// Numbers in [0, 1) that look random.
struct Random(u64);

impl Random {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 40) as f32 / (1 << 24) as f32
    }

    fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[(self.next() * from.len() as f32) as usize % from.len()]
    }

    fn around(&mut self) -> Vec3<f32> {
        let mut part = || self.next() - 0.5;
        Vec3::new(part(), part(), part()) * 2.0
    }
}

struct Scene {
    seed: u64,
    world: World<f32>,
    half: f32,
    largest: f32,
    squeezed: bool,
    about: String,
}

fn scene(seed: u64) -> Scene {
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0x4d);
    (0..8).for_each(|_| _ = random.next());
    let count = (300_f32.powf(random.next()) * random.pick(&[1.0, 1.0, 6.0])) as usize;
    let tier = random.pick(&[Tier::Full, Tier::Full, Tier::Full, Tier::Lab]);
    let substeps = random.pick(&[1, 2, 2, 3, 4, 8]);
    let restitution = random.pick(&[0.0, 0.2, 0.5, 0.9, 1.0]);
    let friction = random.pick(&[0.0, 0.3, 1.0, 1.5]);
    let ratio = random.pick(&[1.0, 2.0, 10.0, 30.0]);
    let squeezed = random.next() < 0.2;
    let weightless = squeezed || random.next() < 0.3;
    let marbles = if random.next() < 0.2 { 3 } else { 0 };
    let largest = 0.5_f32;
    let side = (count as f32).cbrt().ceil() as usize + 1;
    let pitch: f32 = if squeezed { 0.6 * largest } else { 2.02 * largest };
    let half = side as f32 * pitch / 2.0 + 1.0 + 3.0 * random.next();
    let mut world = World::default();
    let material = Material { friction, restitution, ..Material::default() };
    let model = SwarmModel { tier, substeps, threads: 1, material, ..SwarmModel::default() };
    world.swarm.set_model(model).unwrap();
    for axis in [Vec3::unit_x(), Vec3::unit_y(), Vec3::unit_z()] {
        for inward in [axis, -axis] {
            world.walls.insert(Plane::new(inward, -half).unwrap()).unwrap();
        }
    }
    if weightless {
        world.set_gravity(Vec3::new(0.0, 0.0, 0.0)).unwrap();
    }
    let speed = if squeezed { 0.0 } else { random.pick(&[0.0, 0.5, 5.0]) };
    let place = |i: usize| {
        let at = |cell: usize| (cell as f32 + 0.5 - side as f32 / 2.0) * pitch;
        Point3::new(at(i % side), at(i / side / side), at(i / side % side))
    };
    let ball = |i: usize, random: &mut Random| Ball {
        velocity: random.around() * speed,
        mass: Mass::Density(1000.0),
        ..Ball::new(place(i), largest * (1.0_f32 / ratio).powf(random.next()))
    };
    let balls: Vec<_> = (0..count).map(|i| ball(i, &mut random)).collect();
    world.swarm.insert(&balls).unwrap();
    for i in count..count + marbles {
        world.marbles.insert(Marble::new(place(i), largest)).unwrap();
    }
    let about = format!(
        "seed {seed}: {count} balls 1:{ratio}, {tier:?}, {substeps} substeps, restitution \
         {restitution}, friction {friction}, speed {speed}, {marbles} marbles, \
         squeezed {squeezed}, weightless {weightless}"
    );
    Scene { seed, world, half, largest, squeezed, about }
}

/// Energy of the swarm in J, its height counted from the floor.
fn energy(scene: &Scene) -> f64 {
    let (swarm, g) = (&scene.world.swarm, -f64::from(scene.world.gravity().y));
    let square = |v: &[f32; 4]| v[..3].iter().map(|x| f64::from(*x).powi(2)).sum::<f64>();
    let of = |row: usize| {
        let (at, velocity) = (&swarm.balls()[row], &swarm.velocities()[row]);
        let rim = swarm.spin_velocities().get(row).map_or(0.0, square);
        let height = f64::from(at[1] + scene.half);
        (0.5 * square(velocity) + 0.2 * rim + g * height) / f64::from(velocity[3].abs())
    };
    (0..swarm.len()).map(of).sum()
}

/// Invariant that does not hold in a scene.
fn fault(scene: &mut Scene) -> Option<String> {
    let full = scene.world.swarm.model().tier == Tier::Full;
    let alone = scene.world.marbles.is_empty();
    let begin = energy(scene);
    for step in 0..90 {
        scene.world.step(DT).unwrap();
        let swarm: &Swarm = &scene.world.swarm;
        let numbers = swarm.balls().iter().chain(swarm.velocities()).flatten();
        if !numbers.copied().all(f32::is_finite) {
            return Some(format!("not finite in step {step}"));
        }
        for [x, y, z, r] in swarm.balls() {
            // Half a radius of the ball beyond, and what the largest presses a small one into.
            let out = x.abs().max(y.abs()).max(z.abs()) - scene.half;
            if out > r + 0.1 * scene.largest {
                return Some(format!("a ball of {r} m is {out} m outside in step {step}"));
            }
        }
        let now = energy(scene);
        // Rounding of velocities; and what is moved apart is lifted in part.
        let more = if scene.world.gravity().y == 0.0 { 1e-5 } else { 0.01 };
        if full && alone && now > begin * (1.0 + more) + 1e-9 {
            return Some(format!("{now} J after {begin} J in step {step}"));
        }
    }
    (scene.squeezed && full && alone && energy(scene) > 0.0).then(|| "overlap is energy".into())
}

#[test]
fn random_swarms_make_no_energy() {
    let scenes = std::env::var("SWARM_STORM").ok().and_then(|count| count.parse().ok());
    let from = std::env::var("SWARM_FROM").ok().and_then(|count| count.parse().ok()).unwrap_or(0);
    let mut faults = 0;
    for seed in from..from + scenes.unwrap_or(60) {
        let mut scene = scene(seed);
        if let Some(fault) = fault(&mut scene) {
            println!("{fault}: {}", scene.about);
            faults += 1;
        }
    }
    assert_eq!(faults, 0);
}

#[test]
fn random_swarms_have_the_same_bits_with_any_threads_and_instructions() {
    for seed in 0..6 {
        let mut reference = scene(seed);
        reference.world.swarm.set_simd_level(SimdLevel::PORTABLE);
        let start = reference.world.clone();
        (0..30).for_each(|_| reference.world.step(DT).unwrap());
        for instructions in SimdLevel::available() {
            for threads in [1, 2, 3] {
                let mut other = start.clone();
                let model = SwarmModel { threads, ..other.swarm.model() };
                other.swarm.set_model(model).unwrap();
                other.swarm.set_simd_level(instructions);
                (0..30).for_each(|_| other.step(DT).unwrap());
                assert!(other.swarm == reference.world.swarm, "{} {threads}", reference.seed);
            }
        }
    }
}
