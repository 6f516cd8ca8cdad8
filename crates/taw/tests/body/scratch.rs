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
        println!("{i} dv {:?} over g mu dt {} y {} spin {:?}", w - v, (w - v).x / (9.81 * 0.4 / 60.0), place(&world, id).y, spin(&world, id));
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
        println!("{i} E {} v {:?} w {:?} y {}", energy(&world), velocity(&world, id), spin(&world, id), place(&world, id).y);
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
        println!("{i} {:?} {:?}", world.marbles.get(marble).unwrap().velocity, velocity(&world, body));
    }
}
