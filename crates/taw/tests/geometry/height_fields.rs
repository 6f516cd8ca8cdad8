//! Balls on height fields: none loses its contact, flat or hilly.

use taw::prelude::*;
use taw::shape::{BoundedShape, HeightField, Surface};
use taw::world::Marble;

const COLUMNS: u32 = 6;
const CELL: f64 = 0.4;

/// Uniform numbers from zero to one.
fn dice(mut seed: u64) -> impl FnMut() -> f64 {
    move || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / (1_u64 << 31) as f64
    }
}

/// Flat, with a single hill, or hilly all over.
fn field<S: Scalar>(kind: usize, random: &mut impl FnMut() -> f64) -> HeightField<S> {
    let mut heights = vec![0.0; (COLUMNS * COLUMNS) as usize];
    match kind {
        0 => {}
        1 => heights[(random() * 36.0) as usize % 36] = random() - 0.3,
        _ => heights.iter_mut().for_each(|height| *height = 0.5 * random()),
    }
    let heights = heights.into_iter().map(S::from_f64).collect();
    let corner = Point3::new(S::from_f64(-1.0), S::zero(), S::from_f64(-1.0));
    HeightField::new(corner, [S::from_f64(CELL); 2], COLUMNS, heights).unwrap()
}

/// Distance of the nearest triangle, in metres.
fn distance<S: Scalar>(field: &HeightField<S>, point: Point3<S>) -> f64 {
    let triangles = (0..).map_while(|number| field.triangle(number));
    triangles.map(|it| it.project_point(point).distance.as_f64()).fold(f64::MAX, f64::min)
}

fn contacts_of_random_balls<S: Scalar>(response: Response) {
    let mut random = dice(11);
    for number in 0..6_000 {
        let field = field::<S>(number % 3, &mut random);
        let radius = 0.05 + 0.15 * random();
        let [x, z] = [0.0; 2].map(|_| 1.4 * random() - 0.7);
        let ground = field.signed_height(Point3::new(S::from_f64(x), S::zero(), S::from_f64(z)));
        let y = ground.unwrap().as_f64() + radius * random();
        let center = Point3::new(x, y, z).map(S::from_f64);
        let deep = radius - distance(&field, center);
        if deep < 0.001 * radius {
            continue;
        }
        let mut world = World::<S>::default();
        world.set_model(Model { response, ..Model::default() }).unwrap();
        world.set_gravity(Vec3::new(S::zero(), S::zero(), S::zero())).unwrap();
        let id = world.marbles.insert(Marble::new(center, S::from_f64(radius))).unwrap();
        world.walls.insert(field.clone()).unwrap();
        world.step(S::from_f64(1e-6)).unwrap();
        let about = format!("{response:?} {number}: {deep} deep at {center:?}, radius {radius}");
        if response == Response::SoftStep {
            // It is moved out, but for what a contact may bear. (On slopes, one may move it
            // into another.)
            let now = radius - distance(&field, world.marbles.get(id).unwrap().position);
            assert!(number % 3 > 0 || now < 0.12 * radius, "{about}: {now} deep after a step");
        } else {
            let separations = world.contacts.wm.iter().map(|contact| contact.separation.as_f64());
            let deepest = separations.fold(f64::MAX, f64::min);
            assert!(deepest < -deep + 1e-5 * radius, "{about}: {:?}", world.contacts.wm);
        }
    }
}

/// A point on the surface may be inside by rounding, and hence on no other triangle.
#[test]
fn a_ball_that_overlaps_a_height_field_has_a_contact_that_deep() {
    for response in [Response::Impulse, Response::SoftStep] {
        contacts_of_random_balls::<f32>(response);
        contacts_of_random_balls::<f64>(response);
    }
}

/// Lets a ball fall on each of many height fields.
fn let_fall(response: Response) {
    let mut random = dice(3);
    for number in 0..1_500 {
        let field = field::<f32>(number % 3, &mut random);
        let radius = 0.06 + 0.14 * random() as f32;
        let [x, z] = [0.0; 2].map(|_| random() as f32 - 0.5);
        let mut world = World::<f32>::default();
        let model = Model {
            response,
            rotation: Rotation::Dynamic,
            substeps: 1 + number as u32 % 4,
            ..Model::default()
        };
        world.set_model(model).unwrap();
        let restitution = 0.5 * random() as f32;
        let material = Material { restitution, friction: 0.5, ..Material::default() };
        let start = Point3::new(x, 0.9 + random() as f32, z);
        let marble = Marble { material: Some(material), ..Marble::new(start, radius) };
        let id = world.marbles.insert(marble).unwrap();
        world.walls.insert(field.clone()).unwrap();
        for _ in 0..90 {
            world.step(1.0 / 60.0).unwrap();
            let center = world.marbles.get(id).unwrap().position;
            let inside = field.signed_height(center).is_some_and(|height| height > 0.0);
            let far = distance(&field, center);
            let deep = f64::from(radius) - if inside { -far } else { far };
            let part = deep / f64::from(radius);
            assert!(part < 0.2, "{response:?} {number}: {part} radii deep at {center:?}");
        }
    }
}

#[test]
fn balls_that_fall_on_a_height_field_do_not_sink_in() {
    for response in [Response::Impulse, Response::SoftStep] {
        let_fall(response);
    }
}
