//! Chains and free machines.

use super::*;

/// Chain of ball-and-socket links along a direction, with a last ball of this mass; returns its balls.
pub fn chain<S: Scalar>(
    world: &mut World<S>,
    links: u32,
    load: f64,
    way: Vec3<f64>,
    layers: CollisionLayers,
) -> Vec<MarbleId> {
    let mut end = place(0.0, 0.0, 0.0);
    let mut ids = Vec::new();
    let half = (way * 0.1).map(S::from_f64);
    for link in 0..links {
        let at = way * (f64::from(link) * 0.2 + 0.1);
        let id = marble(world, at.x, at.y, at.z);
        world.marbles.set_layers(id, layers).unwrap();
        join(world, JointKind::BallAndSocket, [end, JointEnd::marble(id, -half)]);
        end = JointEnd::marble(id, half);
        ids.push(id);
    }
    let last = ids[ids.len() - 1];
    world.marbles.set_mass(last, Mass::Kilograms(S::from_f64(load))).unwrap();
    ids
}

/// Largest gap of the links, over their length.
pub fn stretch<S: Scalar>(world: &World<S>) -> f64 {
    let joints = world.joints.ids().map(|id| world.joints.get(id).unwrap());
    joints
        .map(|joint| (anchor(world, joint.ends[0]) - anchor(world, joint.ends[1])).magnitude())
        .fold(0.0, f64::max)
        / 0.2
}

/// Energy of balls under gravity, in J.
pub fn energy<S: Scalar>(world: &World<S>, ids: &[MarbleId]) -> f64 {
    let gravity = -world.gravity().y.as_f64();
    let of_ball = |id: &MarbleId| {
        let marble = world.marbles.get(*id).unwrap();
        let Mass::Kilograms(mass) = marble.mass else { unreachable!() };
        let spin = marble.angular_velocity.map(S::as_f64).magnitude2() * 0.4 * 0.01;
        let motion = velocity(world, *id).magnitude2() + spin;
        mass.as_f64() * (gravity * position(world, *id).y + 0.5 * motion)
    };
    ids.iter().map(of_ball).sum()
}

/// Lets a chain of a hundred links go, and returns its largest stretch, that after ten seconds, and the energy
/// that it gained over that of its fall.
fn swing(load: f64, way: Vec3<f64>, layers: CollisionLayers) -> [f64; 3] {
    let mut world = world::<f32>(4);
    let ids = chain(&mut world, 100, load, way, layers);
    let start = energy(&world, &ids);
    let (mut worst, mut gain) = (0.0_f64, 0.0_f64);
    for _ in 0..600 {
        step(&mut world);
        worst = worst.max(stretch(&world));
        gain = gain.max(energy(&world, &ids) - start);
    }
    [worst, stretch(&world), gain / (9.81 * (100.0 + load) * 20.0)]
}

const SLANT: Vec3<f64> = Vec3::new(0.6, -0.8, 0.0);
const FLAT: Vec3<f64> = Vec3::new(1.0, 0.0, 0.0);

#[test]
fn a_chain_holds_whatever_hangs_on_it() {
    for load in [1.0, 100.0, 1e3, 1e5] {
        let [worst, _, gain] = swing(load, SLANT, CollisionLayers::ALL);
        assert!(worst < 2e-5 && gain < 1e-3, "{load} kg: stretched by {worst:e}, gained {gain:e}");
    }
    for load in [100.0, 1e3] {
        let [worst, _, gain] = swing(load, FLAT, CollisionLayers::ALL);
        assert!(worst < 2e-5 && gain < 1e-3, "{load} kg: stretched by {worst:e}, gained {gain:e}");
    }
}

/// A chain let go from the horizontal cracks like a whip: some of its links turn faster than substeps can
/// follow.
#[test]
fn a_whip_gains_nothing_and_is_whole_afterwards() {
    for (load, lean) in [(1.0, 0.0), (1.0, 0.01), (10.0, 0.02), (1e4, 0.0), (1e5, 0.0), (1e5, 0.01)]
    {
        for layers in [CollisionLayers::ALL, CollisionLayers::NONE] {
            let [worst, last, gain] = swing(load, FLAT + Vec3::new(0.0, 0.0, lean), layers);
            // So heavy a load still shakes a chain that collides with itself.
            let holds = last < 0.05 || load > 1e4 && layers == CollisionLayers::ALL;
            assert!(holds && gain < 0.03, "{load} kg: {worst:e}, then {last:e}, {gain:e}");
        }
    }
}

/// Twelve balls on a free chain, thrown about.
fn free_machine<S: Scalar>() -> (World<S>, Vec<MarbleId>) {
    let mut world = world::<S>(4);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    let ids: Vec<_> = (0..12).map(|i| marble(&mut world, f64::from(i) * 0.3, 0.0, 0.0)).collect();
    for [a, b] in ids.array_windows() {
        let ends =
            [(*a, 0.15), (*b, -0.15)].map(|(id, x)| JointEnd::marble(id, vector(x, 0.0, 0.0)));
        join(&mut world, JointKind::BallAndSocket, ends);
    }
    for (i, id) in (0..).zip(&ids) {
        let i = f64::from(i);
        world.marbles.set_layers(*id, CollisionLayers::NONE).unwrap();
        let velocity = vector((i * 2.3).sin(), (i * 1.7).cos(), (i * 0.9).sin());
        world.marbles.set_velocity(*id, velocity).unwrap();
    }
    step(&mut world);
    (world, ids)
}

/// Momentum and angular momentum, and twice the energy.
fn sums<S: Scalar>(world: &World<S>, ids: &[MarbleId]) -> ([Vec3<f64>; 2], f64) {
    let mut sums = [Vec3::new(0.0, 0.0, 0.0); 2];
    let mut energy = 0.0;
    for id in ids {
        let spin = world.marbles.get(*id).unwrap().angular_velocity.map(S::as_f64);
        sums[0] += velocity(world, *id);
        sums[1] += position(world, *id).cross(velocity(world, *id)) + spin * 0.4 * 0.01;
        energy += velocity(world, *id).magnitude2() + 0.4 * 0.01 * spin.magnitude2();
    }
    (sums, energy)
}

fn keeps_its_momentum<S: Scalar>(most: [f64; 2]) {
    let (mut world, ids) = free_machine::<S>();
    let (start, energy) = sums(&world, &ids);
    for _ in 0..3600 {
        step(&mut world);
    }
    let (end, now) = sums(&world, &ids);
    let momentum: f64 = ids.iter().map(|id| velocity(&world, *id).magnitude()).sum();
    let changes = [0, 1].map(|i: usize| (end[i] - start[i]).magnitude() / momentum);
    assert!(changes.iter().zip(most).all(|(change, most)| *change < most), "{changes:?}");
    assert!((now / energy - 1.0).abs() < 2e-3, "energy {energy} became {now}");
}

#[test]
fn a_free_machine_keeps_its_momentum_and_energy_for_a_minute() {
    keeps_its_momentum::<f64>([1e-12, 1e-11]);
    // A velocity is rounded several times in each of 14,400 substeps.
    keeps_its_momentum::<f32>([5e-6, 3e-5]);
}
