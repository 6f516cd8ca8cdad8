//! Springs and ropes.

use super::*;
use taw::joint::JointSpring;

/// A marble on a spring along x, drawn out by .1 m: its offset after each step.
fn offsets(damping_ratio: f64, count: u32) -> Vec<f64> {
    let mut world = world::<f64>(4);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    let id = marble(&mut world, 1.1, 0.0, 0.0);
    let spring = JointSpring { frequency: 1.0, damping_ratio };
    let kind = JointKind::Spring { length: 1.0, spring };
    join(&mut world, kind, [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(0.0, 0.0, 0.0))]);
    let offset = |_| {
        step(&mut world);
        position(&world, id).x - 1.0
    };
    (0..count).map(offset).collect()
}

#[test]
fn a_spring_has_its_frequency_and_decay() {
    for damping in [0.0, 0.05, 0.2] {
        let offsets = offsets(damping, 600);
        let mut crossings = Vec::new();
        for (i, [a, b]) in offsets.array_windows().enumerate() {
            if *a > 0.0 && *b <= 0.0 {
                crossings.push((i as f64 + a / (a - b)) / 60.0);
            }
        }
        let periods = (crossings.len() - 1) as f64;
        let period = (crossings[crossings.len() - 1] - crossings[0]) / periods;
        let wanted = 1.0 / (1.0_f64 - damping * damping).sqrt();
        assert!((period / wanted - 1.0).abs() < 1e-3, "damping {damping}: {period}");
        // From the second to the fifth period, peak by peak.
        let peak = |k: usize| offsets[k * 60..(k + 1) * 60].iter().copied().fold(0.0, f64::max);
        let decay = (peak(4) / peak(1)).ln() / (3.0 * std::f64::consts::TAU);
        assert!((decay + damping * wanted).abs() < 1e-3, "damping {damping}: {decay}");
    }
}

#[test]
fn a_rope_is_slack_and_then_holds() {
    let mut world = world::<f32>(4);
    let id = marble(&mut world, 0.0, -0.5, 0.0);
    let kind = JointKind::Distance([0.0, 1.0]);
    let joint =
        join(&mut world, kind, [place(0.0, 0.0, 0.0), JointEnd::marble(id, vector(0.0, 0.0, 0.0))]);
    for _ in 0..15 {
        step(&mut world);
        assert_eq!(world.joints.force(joint).unwrap(), 0.0);
    }
    let free = -0.5 - 0.5 * 9.81 * 0.25 * 0.25;
    assert!((position(&world, id).y - free).abs() < 1e-5);
    for _ in 0..60 {
        step(&mut world);
        assert!(position(&world, id).magnitude() < 1.0 + 1e-5);
    }
    assert!(velocity(&world, id).magnitude() < 1e-5);
    assert!((world.joints.force(joint).unwrap() - 9.81).abs() < 1e-3);
}

/// A sheet of springs hangs by two corners and swings.
#[test]
fn a_cloth_makes_no_energy() {
    let mut world = world::<f32>(4);
    let mut ids = Vec::new();
    for i in 0..8_u8 {
        for k in 0..8_u8 {
            ids.push(marble(&mut world, f64::from(i) * 0.25, 0.0, f64::from(k) * 0.25));
        }
    }
    let center = |id: MarbleId| JointEnd::marble(id, vector(0.0, 0.0, 0.0));
    for (frequency, damping_ratio) in [(4.0, 0.0), (8.0, 0.3), (100.0, 0.0)] {
        let mut world = world.clone();
        let spring = JointSpring { frequency, damping_ratio };
        let kind = JointKind::Spring { length: 0.25, spring };
        for at in 0..64 {
            for to in [at + 1, at + 8] {
                if to < 64 && (to == at + 8 || to % 8 != 0) {
                    join(&mut world, kind, [ids[at], ids[to]].map(center));
                }
            }
        }
        for (corner, z) in [(0, 0.0), (7, 1.75)] {
            join(&mut world, JointKind::BallAndSocket, [place(0.0, 0.0, z), center(ids[corner])]);
        }
        let (mut most, mut least) = (f64::MIN, 0.0_f64);
        for _ in 0..1200 {
            step(&mut world);
            most = most.max(super::chains::energy(&world, &ids));
            least = ids.iter().map(|id| position(&world, *id).y).fold(least, f64::min);
        }
        // The springs are at rest in the beginning, and have energy later; 600 J is a fall by a metre.
        assert!(most < 1.0 && least < -1.0, "{frequency} Hz: {most} J, {least} m");
    }
}
