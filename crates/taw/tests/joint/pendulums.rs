//! Pendulums: period and energy.

use super::*;

const G: f64 = 9.81;

/// Arithmetic–geometric mean.
fn agm(mut a: f64, mut b: f64) -> f64 {
    while (a - b).abs() > 1e-15 * a {
        (a, b) = (f64::midpoint(a, b), (a * b).sqrt());
    }
    a
}

/// Period of a pendulum of this length that swings up to an angle (Gauss, 1799).
fn period(length: f64, angle: f64) -> f64 {
    std::f64::consts::TAU * (length / G).sqrt() / agm(1.0, (angle / 2.0).cos())
}

/// Mean period over some swings from this angle, and the largest change of energy over that of the swing.
fn measured<S: Scalar>(kind: JointKind<S>, angle: f64, swings: u32) -> [f64; 2] {
    let mut world = world::<S>(4);
    let id = marble(&mut world, angle.sin(), -angle.cos(), 0.0);
    let hook = match kind {
        JointKind::Distance(..) => vector(0.0, 0.0, 0.0),
        _ => vector(-angle.sin(), angle.cos(), 0.0),
    };
    join(&mut world, kind, [place(0.0, 0.0, 0.0), JointEnd::marble(id, hook)]);
    let energy = |world: &World<S>| {
        let marble = world.marbles.get(id).unwrap();
        let spin = marble.angular_velocity.map(S::as_f64);
        G * position(world, id).y
            + 0.5 * (velocity(world, id).magnitude2() + 0.4 * 0.01 * spin.magnitude2())
    };
    let (start, mut worst) = (energy(&world), 0.0_f64);
    let (mut crossings, mut before) = (Vec::new(), position(&world, id).x);
    for count in 1.. {
        step(&mut world);
        let now = position(&world, id).x;
        if before > 0.0 && now <= 0.0 {
            crossings.push((f64::from(count) - 1.0 + before / (before - now)) / 60.0);
        }
        before = now;
        worst = worst.max((energy(&world) - start).abs());
        if crossings.len() > swings as usize {
            break;
        }
    }
    let mean = (crossings[crossings.len() - 1] - crossings[0]) / f64::from(swings);
    [mean, worst / (G * (1.0 - angle.cos()))]
}

/// Judges swings from angles up to nearly upright, in both scalars.
fn swings_right(kind: [JointKind<f64>; 2], single: [JointKind<f32>; 2], lengths: [f64; 2]) {
    for angle in [5.0_f64, 60.0, 170.0].map(f64::to_radians) {
        for i in 0..2 {
            for [mean, gain] in
                [measured::<f64>(kind[i], angle, 10), measured::<f32>(single[i], angle, 10)]
            {
                let off = mean / period(lengths[i], angle) - 1.0;
                assert!(off.abs() < 1e-4 && gain < 2e-4, "{angle}: {off:e}, energy {gain:e}");
            }
        }
    }
}

#[test]
fn a_ball_swings_by_the_elliptic_integral() {
    // On a rod as a point; on a stiff arm with its moment of inertia (Steiner).
    swings_right(
        [JointKind::Distance([1.0; 2]), JointKind::BallAndSocket],
        [JointKind::Distance([1.0; 2]), JointKind::BallAndSocket],
        [1.0, 1.0 + 0.4 * 0.01],
    );
}
