//! Marbles and walls that go take only their own contacts with them.

use taw::prelude::*;
use taw::response::ContactLaw;
use taw::shape::Aabb;

const DT: f64 = 1.0 / 60.0;

/// A heap in a valley of rough boards, and marbles and walls far away, of which the first rows are.
struct Scene {
    world: World<f64>,
    heap: Vec<MarbleId>,
    far: Vec<MarbleId>,
    far_walls: Vec<WallId>,
}

fn far_block(i: u32) -> Aabb<Point3<f64>> {
    let x = 500.0 + 3.0 * f64::from(i);
    Aabb { min: Point3::new(x, 0.0, -1.0), max: Point3::new(x + 2.0, 1.0, 1.0) }
}

fn scene(response: Response) -> Scene {
    let mut world = World::default();
    let model = Model {
        response,
        rotation: Rotation::Dynamic,
        substeps: 4,
        iterations: 30,
        ..Model::default()
    };
    world.set_model(model).unwrap();
    world.set_gravity(Vec3::new(0.0, -9.81, 0.0)).unwrap();
    let mut far_walls: Vec<_> = (0..8).map(|i| world.walls.insert(far_block(i)).unwrap()).collect();
    let far_marble = |world: &mut World<f64>, i: u32| {
        let at = Point3::new(501.0 + 3.0 * f64::from(i), 1.1, 0.0);
        world.marbles.insert(Marble::new(at, 0.1)).unwrap()
    };
    let mut far: Vec<_> = (0..4).map(|i| far_marble(&mut world, i)).collect();
    let rough = Material { friction: 0.8, rolling_resistance: 0.1, ..Material::default() };
    for normal in [[0.5, 1.0, 0.0], [-0.5, 1.0, 0.1], [0.0, 0.3, 1.0], [0.0, 0.3, -1.0]] {
        let [x, y, z] = normal;
        let away = if y < 0.5 { -0.3 } else { 0.0 };
        let at = Point3::new(0.0, 0.0, away * z);
        let wall = world.walls.insert(Plane::through(at, Vec3::new(x, y, z)).unwrap()).unwrap();
        world.walls.set_material(wall, Some(rough)).unwrap();
    }
    let heap = (0..24_u32)
        .map(|i| {
            let [x, y, z] = [i % 4, i / 8, i / 4 % 2].map(f64::from);
            let at = Point3::new(0.23 * x - 0.35, 0.5 + 0.25 * y, 0.25 * z - 0.13 + 0.01 * x);
            let marble = Marble { material: Some(rough), ..Marble::new(at, 0.1) };
            world.marbles.insert(marble).unwrap()
        })
        .collect();
    far.extend((4..8).map(|i| far_marble(&mut world, i)));
    far_walls.push(world.walls.insert(far_block(20)).unwrap());
    let mut scene = Scene { world, heap, far, far_walls };
    for _ in 0..600 {
        scene.world.step(DT).unwrap();
    }
    scene
}

impl Scene {
    /// The largest speed in the heap within a second.
    fn restlessness(&mut self, mut each: impl FnMut(&mut Self, u32)) -> f64 {
        let mut fastest: f64 = 0.0;
        for step in 0..60 {
            each(self, step);
            self.world.step(DT).unwrap();
            for id in &self.heap {
                fastest = fastest.max(self.world.marbles.get(*id).unwrap().velocity.magnitude());
            }
        }
        fastest
    }
}

const RESPONSES: [Response; 5] = [
    Response::Displacement,
    Response::Impulse,
    Response::Penalty(ContactLaw::SpringDashpot),
    Response::Penalty(ContactLaw::HertzMindlin),
    Response::EventDriven,
];

#[test]
fn a_heap_does_not_notice_what_goes_elsewhere() {
    for response in RESPONSES {
        let resting = scene(response);
        let clone = || Scene {
            world: resting.world.clone(),
            heap: resting.heap.clone(),
            far: resting.far.clone(),
            far_walls: resting.far_walls.clone(),
        };
        let alone = clone().restlessness(|_, _| ());
        let beside = clone().restlessness(|scene, step| {
            // First rows and last ones, so that others move into theirs.
            let at = if step % 2 == 0 { 0 } else { scene.far.len().saturating_sub(1) };
            if step % 7 == 0 && !scene.far.is_empty() {
                scene.world.marbles.remove(scene.far.remove(at)).unwrap();
            }
            if step % 7 == 3 && !scene.far_walls.is_empty() {
                let at = at.min(scene.far_walls.len() - 1);
                scene.world.walls.remove(scene.far_walls.remove(at)).unwrap();
            }
        });
        println!("{response:?}: {alone:.2e} m/s alone, {beside:.2e} m/s");
        assert!(beside < 1.2 * alone + 1e-5, "{response:?}: {alone} m/s alone, {beside} m/s");
    }
}
