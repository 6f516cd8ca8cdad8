//! Heaps, and what flows.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, OnceLock};

use taw::prelude::*;

use super::{Effort, Row};
use crate::scene::{Ball, IMPULSE, Meter, box_around, overlaps, surface, wall, world};

/// Impulses in substeps so short that what they let overlap is a few hundred-thousandths
/// of a ball.
const FINE: Model = Model { rotation: Rotation::None, substeps: 8, iterations: 16, ..IMPULSE };

/// A measurement that takes minutes and serves several rows.
fn once<T: Copy>(cell: &OnceLock<T>, measure: impl FnOnce() -> T) -> T {
    *cell.get_or_init(measure)
}

/// How densely frictionless balls of diameter one pack when they settle in a box, how
/// many each touches, and the deepest overlap: off 0.64, off 6, and in metres.
fn packing(meter: &mut Meter) -> [f64; 3] {
    static PACKED: OnceLock<[f64; 3]> = OnceLock::new();
    once(&PACKED, || pack(meter))
}

/// How many random points tell how much is filled.
const POINTS: u32 = 200_000;

fn pack(meter: &mut Meter) -> [f64; 3] {
    let mut packed = world::<f32>(FINE);
    let half = 6.03; // not a whole number of balls, which would order them
    wall(&mut packed, [0.0, 1.0, 0.0], 0.0);
    box_around(&mut packed, half);
    let mut random = fastrand::Rng::with_seed(3);
    for i in 0..1800_u32 {
        let mut jitter = || (random.f64() - 0.5) * 0.2;
        let (x, y, z) = (f64::from(i % 9), f64::from(i / 81), f64::from(i / 9 % 9));
        let at = [(x - 4.0) * 1.25 + jitter(), 0.7 + y * 1.25, (z - 4.0) * 1.25 + jitter()];
        Ball { at, ..Ball::default() }.insert(&mut packed);
    }
    meter.run(&mut packed, 1.0 / 60.0, 25.0);
    let position: Vec<_> = packed.marbles.position().iter().map(|p| p.map(f64::from)).collect();
    let top = position.iter().map(|p| p.y).fold(0.0, f64::max);
    let inner = |p: &Point3<f64>| {
        p.x.abs() < half - 2.0 && p.z.abs() < half - 2.0 && p.y > 2.0 && p.y < top - 3.0
    };
    let mut hits = 0_u32;
    for _ in 0..POINTS {
        let across = |random: &mut fastrand::Rng| (random.f64() * 2.0 - 1.0) * (half - 2.0);
        let p =
            Point3::new(across(&mut random), 2.0 + random.f64() * (top - 5.0), across(&mut random));
        hits += u32::from(position.iter().any(|c| (*c - p).magnitude2() < 0.25));
    }
    let filling = f64::from(hits) / f64::from(POINTS);
    let (mut touches, mut balls) = (0.0, 0.0);
    for (i, a) in position.iter().enumerate().filter(|(_, a)| inner(a)) {
        let near = |j: &usize| *j != i && (position[*j] - a).magnitude() < 1.0 + 5e-5;
        touches += (0..position.len()).filter(near).count() as f64;
        balls += 1.0;
    }
    let deepest = overlaps(&packed).into_iter().fold(0.0, f64::max);
    [(filling - 0.64).abs(), (touches / balls - 6.0).abs(), deepest]
}

/// The slope of a heap that is poured onto a floor of glued balls, in degrees. Each is
/// poured once, however many rows ask.
fn repose(meter: &mut Meter, seed: u64, rolling_resistance: f64) -> f64 {
    static POURED: Mutex<BTreeMap<(u64, u64), f64>> = Mutex::new(BTreeMap::new());
    let key = (seed, rolling_resistance.to_bits());
    let mut poured = POURED.lock().expect("nobody panics while pouring");
    *poured.entry(key).or_insert_with(|| pour(meter, seed, rolling_resistance))
}

/// How many balls are poured.
const BALLS: u32 = 500;

fn pour(meter: &mut Meter, seed: u64, rolling_resistance: f64) -> f64 {
    let mut heap = world::<f32>(Model { rotation: Rotation::Dynamic, substeps: 2, ..FINE });
    wall(&mut heap, [0.0, 1.0, 0.0], -0.5);
    let material = Material { rolling_resistance, ..surface(0.1, 0.5) };
    for i in 0..27_u32 * 27 {
        let at = [f64::from(i % 27) - 13.0, 0.0, f64::from(i / 27) - 13.0];
        Ball { at, mass: f64::INFINITY, material, ..Ball::default() }.insert(&mut heap);
    }
    let mut random = fastrand::Rng::with_seed(seed);
    let glued = heap.marbles.len();
    for drop in 0..BALLS {
        let mut jitter = || (random.f64() - 0.5) * 2.0;
        // Just above the heap (what still falls is not part of it), so that nothing splashes.
        let rows = glued..heap.marbles.len();
        let lies = |row: &usize| heap.marbles.velocity()[*row].magnitude() < 0.5;
        let near = |p: &Point3<f32>| p.x.hypot(p.z) < 3.0;
        let place = |row: usize| heap.marbles.position()[row];
        let top =
            rows.filter(lies).map(place).filter(near).map(|p| f64::from(p.y)).fold(0.0, f64::max);
        Ball { at: [jitter(), top + 1.5, jitter()], material, ..Ball::default() }.insert(&mut heap);
        meter.run(&mut heap, 1.0 / 60.0, if drop + 1 == BALLS { 5.0 } else { 0.15 });
    }
    // The surface: the highest ball in each of the rings, and a line through them.
    let mut rings = [0.0_f64; 12];
    let mut counts = [0_u32; 12];
    for ring in 0..12_usize {
        for sector in 0..24 {
            let angle = f64::from(sector) * std::f64::consts::TAU / 24.0;
            let (x, z) = ((ring as f64 + 0.5) * angle.cos(), (ring as f64 + 0.5) * angle.sin());
            let top = heap.marbles.position()[glued..]
                .iter()
                .filter(|p| (f64::from(p.x) - x).hypot(f64::from(p.z) - z) < 0.75)
                .map(|p| f64::from(p.y))
                .fold(f64::NAN, f64::max);
            if top.is_finite() {
                rings[ring] += top;
                counts[ring] += 1;
            }
        }
    }
    let points: Vec<_> = (2..9)
        .filter(|r| counts[*r] >= 20)
        .map(|r| (r as f64 + 0.5, rings[r] / f64::from(counts[r])))
        .collect();
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (xy, xx) = points
        .iter()
        .fold((0.0, 0.0), |(a, b), (x, y)| (a + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    (-xy / xx).atan().to_degrees()
}

/// How many balls a second fall through a round hole of this diameter in the bottom of a
/// bin (balls of diameter one), in the first and in the second half of the time: the
/// bottom is made of small glued balls.
fn discharge(meter: &mut Meter, diameter: f64) -> [f64; 2] {
    const WIDTH: f64 = 16.0;
    let mut bin = world::<f32>(Model { rotation: Rotation::Dynamic, substeps: 2, ..FINE });
    box_around(&mut bin, WIDTH / 2.0);
    let material = surface(0.1, 0.5);
    let grain = 0.25;
    let half = (WIDTH / 4.0 / grain) as i32;
    for (i, k) in (-half..=half).flat_map(|i| (-half..=half).map(move |k| (i, k))) {
        let (x, z) = (f64::from(i) * 2.0 * grain, f64::from(k) * 2.0 * grain);
        if x.hypot(z) >= diameter / 2.0 + grain {
            let at = [x, 0.0, z];
            Ball { at, radius: grain, mass: f64::INFINITY, material, ..Ball::default() }
                .insert(&mut bin);
        }
    }
    // Its rim is a circle, not a part of the lattice.
    let rim = diameter / 2.0 + grain;
    let grains = (std::f64::consts::PI * rim / grain) as u32;
    for i in 0..grains {
        let (z, x) = (std::f64::consts::TAU * f64::from(i) / f64::from(grains)).sin_cos();
        let at = [x * rim, 0.0, z * rim];
        Ball { at, radius: grain, mass: f64::INFINITY, material, ..Ball::default() }
            .insert(&mut bin);
    }
    let plug = wall(&mut bin, [0.0, 1.0, 0.0], 0.0);
    let glued = bin.marbles.len();
    let mut random = fastrand::Rng::with_seed(5);
    for i in 0..6000_u32 {
        let mut jitter = || (random.f64() - 0.5) * 0.1;
        let [x, y, z] = [i % 13, i / 169, i / 13 % 13].map(f64::from);
        let at = [(x - 6.0) * 1.15 + jitter(), 1.0 + y * 1.1, (z - 6.0) * 1.15 + jitter()];
        Ball { at, material, ..Ball::default() }.insert(&mut bin);
    }
    meter.run(&mut bin, 1.0 / 60.0, 2.5);
    bin.walls.remove(plug).expect("it is there");
    let mut fallen = 0_u32;
    let mut run = |meter: &mut Meter, seconds: f64| {
        let before = fallen;
        for _ in 0..(seconds * 60.0) as u32 {
            meter.step(&mut bin, 1.0 / 60.0);
            // What fell is taken out from the end of the rows.
            for row in (glued..bin.marbles.len()).rev() {
                if bin.marbles.position()[row].y < -2.0 {
                    let id = bin.marbles.id(row).expect("a row");
                    bin.marbles.remove(id).expect("a marble");
                    fallen += 1;
                }
            }
        }
        f64::from(fallen - before) / seconds
    };
    run(meter, 1.5); // until it flows
    [run(meter, 2.5), run(meter, 2.5)]
}

/// The exponent by which the rate grows with the hole less 1.4 balls, off 2.5; and the
/// largest change of a rate from the first half to the second, relatively.
fn beverloo(meter: &mut Meter) -> [f64; 2] {
    static FLOWED: OnceLock<[f64; 2]> = OnceLock::new();
    once(&FLOWED, || {
        let rates = [5.0, 6.5, 8.0].map(|d| (f64::ln(d - 1.4), discharge(meter, d)));
        let n = rates.len() as f64;
        let log = |[a, b]: [f64; 2]| (0.5 * (a + b)).ln();
        let mx = rates.iter().map(|(x, _)| x / n).sum::<f64>();
        let my = rates.iter().map(|(_, w)| log(*w) / n).sum::<f64>();
        let xy: f64 = rates.iter().map(|(x, w)| (x - mx) * (log(*w) - my)).sum();
        let xx: f64 = rates.iter().map(|(x, _)| (x - mx).powi(2)).sum();
        let change = rates.iter().map(|(_, [a, b])| (b / a - 1.0).abs()).fold(0.0, f64::max);
        [(xy / xx - 2.5).abs(), change]
    })
}

/// The time by which everything in one spot came apart again: the smallest distance left
/// over the diameter, as a part missing from one; NaN if something is not finite.
fn all_in_one_spot(meter: &mut Meter, model: Model, count: u32, seconds: f64) -> f64 {
    let mut world = crate::scene::weightless::<f32>(model);
    for _ in 0..count {
        Ball { at: [0.3, 0.2, 0.1], ..Ball::default() }.insert(&mut world);
    }
    // Nobody is lost, though of so many each has contacts with the deepest only.
    let mut touched = world.clone();
    touched.generate_contacts();
    let named: BTreeSet<_> = touched.contacts.mm.iter().flat_map(|c| [c.a, c.b]).collect();
    if named.len() != count as usize {
        return f64::NAN;
    }
    meter.run(&mut world, 1.0 / 60.0, seconds);
    let fastest = world.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0_f32, f32::max);
    if !fastest.is_finite() || world.stopped().count() > 0 {
        return f64::NAN;
    }
    overlaps(&world).into_iter().fold(0.0, f64::max)
}

/// A face-centred lattice of 108 balls at rest, each touching twelve, without gravity, for
/// five seconds: the farthest that one moves if they just touch (`overlap` 0), else the
/// deepest overlap that is left of this part of a diameter; in diameters. NaN if the
/// recovery throws one faster than a diameter a step.
fn lattice(meter: &mut Meter, model: Model, overlap: f64) -> f64 {
    let mut packed = crate::scene::weightless::<f32>(model);
    let pitch = (1.0 - overlap) * 2.0_f64.sqrt();
    for i in 0..27_u32 {
        let cell = [i % 3, i / 3 % 3, i / 9].map(f64::from);
        for offset in [[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.5, 0.5]] {
            let at = [0, 1, 2].map(|k| (cell[k] + offset[k]) * pitch);
            Ball { at, ..Ball::default() }.insert(&mut packed);
        }
    }
    let start = packed.marbles.position().to_vec();
    meter.run(&mut packed, 1.0 / 60.0, 5.0);
    let fastest = packed.marbles.velocity().iter().map(|v| v.magnitude()).fold(0.0, f32::max);
    if fastest.is_nan() || fastest > 60.0 {
        return f64::NAN;
    }
    if overlap > 0.0 {
        return overlaps(&packed).into_iter().fold(0.0, f64::max);
    }
    let moved = packed.marbles.position().iter().zip(&start).map(|(x, s)| (x - s).magnitude());
    f64::from(moved.fold(0.0, f32::max))
}

pub const ROWS: &[Row] = &[
    Row {
        name: "granular/packing/density",
        setup: "1,800 frictionless balls settle in a box: 0.64 of the bulk filled",
        metric: "off 0.64",
        model: "impulse, 8 substeps",
        target: 5e-3,
        best: "over-pack by three times their overlap",
        source: "Scott and Kilgour 1969; references 4.27",
        effort: Effort::Long,
        measure: |meter| packing(meter)[0],
    },
    Row {
        name: "granular/packing/touches",
        setup: "the same: each ball touches 6",
        metric: "off 6",
        model: "impulse, 8 substeps",
        target: 0.1,
        best: "–",
        source: "isostatic; references 4.27",
        effort: Effort::Long,
        measure: |meter| packing(meter)[1],
    },
    Row {
        name: "granular/packing/overlap",
        setup: "the same",
        metric: "deepest overlap over the diameter",
        model: "impulse, 8 substeps",
        target: 1e-4,
        best: "2.4e-2 Rapier (pour, 10,000)",
        source: "references 4.27",
        effort: Effort::Long,
        measure: |meter| packing(meter)[2],
    },
    Row {
        name: "granular/repose/repeatable",
        setup: "500 balls poured on a rough floor, µ 0.5, three seeds: the same slope",
        metric: "spread of the angle, degrees",
        model: "impulse, 2 substeps",
        target: 2.0,
        best: "–",
        source: "references 4.29 (±1°)",
        effort: Effort::Long,
        measure: |meter| {
            let angles = [1, 2, 3].map(|seed| repose(meter, seed, 0.0));
            let (low, high) =
                angles.iter().fold((f64::MAX, f64::MIN), |(l, h), a| (l.min(*a), h.max(*a)));
            high - low
        },
    },
    Row {
        name: "granular/repose/angle",
        setup: "the same without rolling resistance: 20 to 24°",
        metric: "off 22°",
        model: "impulse, 2 substeps",
        target: 2.0,
        best: "–",
        source: "references 4.29",
        effort: Effort::Long,
        measure: |meter| (repose(meter, 1, 0.0) - 22.0).abs(),
    },
    Row {
        name: "granular/repose/rolling",
        setup: "with a rolling resistance of 0.1 and 0.3 it is steeper, and steeper again",
        metric: "degrees missing from a rise of one each",
        model: "impulse, 2 substeps",
        target: 0.0,
        best: "–",
        source: "references 4.29",
        effort: Effort::Long,
        measure: |meter| {
            let [none, some, more] = [0.0, 0.1, 0.3].map(|c| repose(meter, 1, c));
            (1.0 - (some - none)).max(1.0 - (more - some)).max(0.0)
        },
    },
    Row {
        name: "granular/beverloo/exponent",
        setup: "6,000 balls flow out of a bin through holes of 5, 6.5 and 8 balls: W ~ (D − 1.4 d)^2.5",
        metric: "off 2.5",
        model: "impulse, 2 substeps",
        target: 5e-2,
        best: "–",
        source: "Beverloo 1961; references 4.31",
        effort: Effort::Long,
        measure: |meter| beverloo(meter)[0],
    },
    Row {
        name: "granular/beverloo/steady",
        setup: "the same: the rate does not change while the bin empties",
        metric: "largest relative change",
        model: "impulse, 2 substeps",
        target: 2e-2,
        best: "–",
        source: "Beverloo 1961; references 4.31",
        effort: Effort::Long,
        measure: |meter| beverloo(meter)[1],
    },
    Row {
        name: "granular/one-spot/20",
        setup: "20 balls in one spot, 10 s without gravity: all part, none is dropped",
        metric: "deepest overlap left, m (r 0.5)",
        model: "event-driven",
        target: 1e-2,
        best: "thrown up to 78 m: Rapier; 2.4 m/s PyBullet",
        source: "references §6.3, §6.4 family 10",
        effort: Effort::Quick,
        measure: |meter| all_in_one_spot(meter, crate::scene::EXACT, 20, 10.0),
    },
    Row {
        name: "granular/one-spot/20",
        setup: "20 balls in one spot, 10 s without gravity: all part, none is dropped",
        metric: "deepest overlap left, m (r 0.5)",
        model: "impulse",
        target: 1e-2,
        best: "thrown up to 78 m: Rapier; 2.4 m/s PyBullet",
        source: "references §6.3, §6.4 family 10",
        effort: Effort::Quick,
        measure: |meter| all_in_one_spot(meter, IMPULSE, 20, 10.0),
    },
    Row {
        name: "granular/one-spot/1000",
        setup: "1,000 balls in one spot: each has contacts, and all are finite after 0.5 s",
        metric: "1 if a ball is without contact, stopped, or not finite",
        model: "impulse",
        target: 0.0,
        best: "buffers overflow elsewhere",
        source: "references §6.4 family 10, issue 4",
        effort: Effort::Quick,
        measure: |meter| {
            if all_in_one_spot(meter, IMPULSE, 1000, 0.5).is_nan() { 1.0 } else { 0.0 }
        },
    },
    Row {
        name: "granular/lattice/touching",
        setup: "108 balls in a face-centred lattice, each touches twelve, 5 s without gravity: nothing moves",
        metric: "farthest moved, diameters",
        model: "event-driven",
        target: 1e-6,
        best: "–",
        source: "references §6.4, family 10",
        effort: Effort::Quick,
        measure: |meter| lattice(meter, crate::scene::EXACT, 0.0),
    },
    Row {
        name: "granular/lattice/touching",
        setup: "the same",
        metric: "farthest moved, diameters",
        model: "impulse",
        target: 1e-6,
        best: "–",
        source: "references §6.4, family 10",
        effort: Effort::Quick,
        measure: |meter| lattice(meter, IMPULSE, 0.0),
    },
    Row {
        name: "granular/lattice/overlapping",
        setup: "the same with each overlapping twelve by a tenth: they part",
        metric: "deepest overlap left, diameters",
        model: "event-driven",
        target: 1e-2,
        best: "–",
        source: "references §6.4, family 10",
        effort: Effort::Quick,
        measure: |meter| lattice(meter, crate::scene::EXACT, 0.1),
    },
    Row {
        name: "granular/lattice/overlapping",
        setup: "the same",
        metric: "deepest overlap left, diameters",
        model: "impulse",
        target: 1e-2,
        best: "–",
        source: "references §6.4, family 10",
        effort: Effort::Quick,
        measure: |meter| lattice(meter, IMPULSE, 0.1),
    },
];
