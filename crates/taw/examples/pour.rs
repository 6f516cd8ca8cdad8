use std::time::Instant;
use taw::math::Vec3;
use taw::prelude::*;
use taw::swarm::*;
use taw::world::Walls;

fn main() {
    let arg = |name: &str, default: f32| -> f32 {
        let all: Vec<String> = std::env::args().collect();
        all.iter().position(|a| a == name).map_or(default, |i| all[i + 1].parse().unwrap())
    };
    let n = arg("-n", 10000.0) as usize;
    let steps = arg("--steps", 240.0) as usize;
    let tier = if arg("--full", 1.0) > 0.0 { Tier::Full } else { Tier::Lab };
    let model = SwarmModel {
        tier,
        substeps: arg("--substeps", if tier == Tier::Full { 2.0 } else { 1.0 }) as u32,
        threads: arg("--threads", 2.0) as u32,
        material: Material { friction: 0.3, restitution: 0.2, ..Default::default() },
        sleeps: arg("--sleeps", 0.0) > 0.0,
    };
    let mut world = World::<f32>::default();
    world.swarm.set_model(model).unwrap();
    if arg("--portable", 0.0) > 0.0 {
        world.swarm.set_instructions(Instructions::PORTABLE);
    }
    let mut rng = 12345_u64;
    let mut random = || {
        rng = rng.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (rng >> 40) as f32 / (1 << 24) as f32
    };
    let side = ((n as f32) / 12.0).sqrt().ceil() as usize;
    let pitch = 1.05;
    let half = side as f32 * pitch / 2.0;
    let mut balls = Vec::new();
    for i in 0..n {
        let (x, z, y) = (i % side, i / side % side, i / side / side);
        let at = |c: usize| (c as f32 + 0.5) * pitch - half;
        let position = Point3::new(at(x), (y as f32 + 0.5) * pitch, at(z));
        let radius = 0.3 + 0.2 * random();
        let velocity = Vec3::new(0.02 * (random() - 0.5), 0.0, 0.02 * (random() - 0.5));
        balls.push(Ball { position, radius, velocity, mass: Mass::Density(1.0) });
    }
    let t = Instant::now();
    world.swarm.insert(&balls).unwrap();
    println!("insert {:.3} ms", t.elapsed().as_secs_f64() * 1e3);
    for (d, o) in [
        (Vec3::unit_y(), 0.0),
        (Vec3::unit_x(), -half),
        (-Vec3::unit_x(), -half),
        (Vec3::unit_z(), -half),
        (-Vec3::unit_z(), -half),
    ] {
        world.walls.insert(Plane::new(d, o).unwrap()).unwrap();
    }
    let mut stages: std::collections::BTreeMap<Stage, f64> = Default::default();
    let mut times = Vec::new();
    let mut rebuilds = Vec::new();
    for step in 0..steps {
        let before = world.swarm.rebuilds();
        let t = Instant::now();
        let (mut last, mut since) = (None, Instant::now());
        world.step_swarm(1.0 / 60.0, &mut |stage| {
            let now = Instant::now();
            if let Some(last) = last {
                *stages.entry(last).or_default() += (now - since).as_secs_f64() * 1e3;
            }
            (last, since) = (Some(stage), now);
        }).unwrap();
        if let Some(last) = last {
            *stages.entry(last).or_default() += since.elapsed().as_secs_f64() * 1e3;
        }
        times.push(t.elapsed().as_secs_f64() * 1e3);
        rebuilds.push(world.swarm.rebuilds() - before);
        if (step + 1) % 60 == 0 {
            for (stage, ms) in std::mem::take(&mut stages) { print!("{stage:?} {:.3}; ", ms / 60.0); }
            report(&world.swarm, step + 1, &times[step + 1 - 60..], &rebuilds[step + 1 - 60..], half);
        }
    }
}

fn report(swarm: &Swarm, step: usize, times: &[f64], rebuilds: &[u64], half: f32) {
    let mean = times.iter().sum::<f64>() / times.len() as f64;
    let mut sorted = times.to_vec();
    sorted.sort_by(f64::total_cmp);
    let list: u64 = rebuilds.iter().sum();
    let n = swarm.len();
    let ke: f64 = swarm
        .velocities()
        .iter()
        .map(|v| 0.5 / v[3].abs() as f64 * [0, 1, 2].map(|i| (v[i] as f64).powi(2)).iter().sum::<f64>())
        .sum::<f64>()
        / n as f64;
    let mut speeds: Vec<(f32, f32)> = swarm.velocities().iter().zip(swarm.balls()).map(|(v, p)| ((v[0]*v[0]+v[1]*v[1]+v[2]*v[2]).sqrt(), p[1])).collect();
    speeds.sort_by(|a, b| a.0.total_cmp(&b.0));
    print!("speed 50% {:.4} 90% {:.4} 99% {:.4} max {:.3?}; ", speeds[n/2].0, speeds[n*9/10].0, speeds[n*99/100].0, speeds[n-1]);
    let pe: f64 = swarm.velocities().iter().zip(swarm.balls()).map(|(v, p)| 9.81 * p[1] as f64 / v[3].abs() as f64).sum::<f64>() / n as f64;
    // penetration by the grid
    let at: Vec<taw::math::Point3<f32>> =
        swarm.balls().iter().map(|p| taw::math::Point3::new(p[0], p[1], p[2])).collect();
    let radius: Vec<f32> = swarm.balls().iter().map(|p| p[3]).collect();
    let mut grid = taw::broad::Grid::default();
    grid.rebuild(&at, &radius, 0.0);
    let (mut worst, mut sum, mut count) = (0.0_f64, 0.0_f64, 0);
    grid.pairs(&at, |a, b| {
        let (a, b) = (a as usize, b as usize);
        let overlap = (radius[a] + radius[b]) as f64 - ((at[a] - at[b]).magnitude() as f64);
        if overlap > 0.0 {
            worst = worst.max(overlap);
            sum += overlap;
            count += 1;
        }
    });
    let wall = swarm.balls().iter().map(|p| p[3] - p[1].min(half - p[0].abs()).min(half - p[2].abs())).fold(0.0_f32, f32::max);
    println!("step {step}: {mean:.3} ms mean, {:.3} median, {:.3} min = {:.1} ns/ball; rebuilds {list}; pen max {worst:.4} mean {:.5} wall {wall:.4} touching/ball {:.2} pairs/ball {:.2} bytes {:.1}; KE {ke:.2e} PE {pe:.5}",
        sorted[sorted.len()/2], sorted[0], sorted[sorted.len()/2] * 1e6 / n as f64, sum / f64::from(count.max(1)), f64::from(count) / n as f64, swarm.pairs() as f64 / n as f64, swarm.bytes() as f64 / n as f64);
}
