use super::*;
#[test]
fn scratch_slide() {
    let mut world = world::<f32>(true);
    let body = Body {
        velocity: vector(3.0, 0.0, 0.0),
        material: material(0.4, 0.0),
        ..cuboid([0.3, 0.1, 0.3], point(0.0, 0.1, 0.0))
    };
    let id = world.bodies.insert(body).unwrap();
    for i in 0..20 {
        let v = velocity(&world, id);
        step(&mut world);
        let w = velocity(&world, id);
        println!(
            "{i} dv {:?} over g mu dt {} y {} spin {:?}",
            w - v,
            (w - v).x / (9.81 * 0.4 / 60.0),
            place(&world, id).y,
            spin(&world, id)
        );
    }
}
#[test]
fn scratch_bounce() {
    let mut world = world::<f32>(true);
    let body = Body {
        material: material(0.0, 1.0),
        rotation: about_z(0.3),
        ..cuboid([0.1, 0.1, 0.1], point(0.0, 1.0, 0.0))
    };
    let id = world.bodies.insert(body).unwrap();
    for i in 0..50 {
        step(&mut world);
        println!(
            "{i} E {} v {:?} w {:?} y {}",
            energy(&world),
            velocity(&world, id),
            spin(&world, id),
            place(&world, id).y
        );
    }
}
#[test]
fn scratch_ball() {
    let mut world = world::<f32>(false);
    world.set_gravity(vector(0.0, 0.0, 0.0)).unwrap();
    let elastic = material(0.0, 1.0);
    let body = Body { material: elastic, ..cuboid([0.2, 0.2, 0.2], point(1.0, 0.0, 0.0)) };
    let body = world.bodies.insert(body).unwrap();
    let marble = taw::world::Marble {
        velocity: vector(3.0, 0.0, 0.0),
        material: Some(elastic),
        mass: Mass::Kilograms(20.0),
        ..taw::world::Marble::new(point(0.0, 0.0, 0.0), 0.1)
    };
    let marble = world.marbles.insert(marble).unwrap();
    for i in 0..22 {
        step(&mut world);
        println!(
            "{i} {:?} {:?}",
            world.marbles.get(marble).unwrap().velocity,
            velocity(&world, body)
        );
    }
}
#[test]
fn scratch_stack() {
    for n in [10, 2] {
        let mut world = world::<f32>(true);
        let mut ids = Vec::new();
        for i in 0..n {
            let at = point(0.0, 0.1 + 0.2 * f64::from(i), 0.0);
            let mut body = Body { sleeping_disabled: true, ..cuboid([0.1, 0.1, 0.1], at) };
            if n == 2 && i == 1 {
                body.mass = taw::body::BodyMass::Uniform(Mass::Density(100000.0));
            }
            ids.push(world.bodies.insert(body).unwrap());
        }
        for t in 0..20 {
            run(&mut world, 1.0);
            let sink: Vec<_> = ids
                .iter()
                .enumerate()
                .map(|(i, id)| ((place(&world, *id).y - 0.1 - 0.2 * i as f64) * 1e6).round())
                .collect();
            println!("{t} {sink:?} {:?}", (place(&world, ids[n as usize - 1]).x));
        }
    }
}
#[test]
fn scratch_fall() {
    let mut world = world::<f32>(true);
    let id = world.bodies.insert(cuboid([0.1, 0.1, 0.1], point(0.0, 0.3, 0.0))).unwrap();
    for t in 0..90 {
        step(&mut world);
        println!(
            "{t} {:?} up {} v {:?} w {:?} {}",
            place(&world, id),
            upright(&world, id),
            velocity(&world, id),
            spin(&world, id),
            world.bodies.is_asleep(id).unwrap()
        );
    }
}
#[test]
fn scratch_random() {
    for seed in [740u64, 139] {
        let random::Scene { mut world, half } = random::scene(seed);
        println!(
            "seed {seed} half {half} bodies {} marbles {} g {:?}",
            world.bodies.len(),
            world.marbles.len(),
            world.gravity()
        );
        for id in world.bodies.ids() {
            let b = world.bodies.get(id).unwrap();
            println!("{:?} {:?}", b.shape, b.material);
        }
        let mut last = energy(&world);
        for t in 0..240 {
            let before = world.clone();
            step(&mut world);
            let now = energy(&world);
            let mut out = f64::NEG_INFINITY;
            for id in world.bodies.ids() {
                let center = world.bodies.mass_properties(id).unwrap().unwrap().center;
                let at = world.bodies.pose(id).unwrap().transform_point(center).map(f64::from);
                out = out.max(at.x.abs().max(at.y.abs()).max(at.z.abs()) - half);
            }
            if now > last + 0.01 * last.abs() || out > -0.01 {
                println!("{t}: {last} -> {now} out {out}");
                for id in world.bodies.ids() {
                    let (b, c) = (before.bodies.get(id).unwrap(), world.bodies.get(id).unwrap());
                    println!(
                        "   at {:?} v {:?} w {:?}\n     {:?} v {:?} w {:?}",
                        b.position,
                        b.velocity,
                        b.angular_velocity,
                        c.position,
                        c.velocity,
                        c.angular_velocity
                    );
                }
                if out > -0.01 {
                    break;
                }
            }
            last = now;
        }
    }
}
