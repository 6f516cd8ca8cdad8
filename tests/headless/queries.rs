//! Spatial queries in Bevy's types: rays, shapes and points.

use bevy::ecs::system::RunSystemOnce;
use bevy::math::Isometry3d;
use bevy::prelude::*;
use bevy_taw::prelude::*;
use bevy_taw::spatial_query::RayHit;

use crate::scene;

#[derive(PhysicsLayer)]
enum Layer {
    Floor,
    Ghost,
}

/// Asks after the app's last frame.
fn ask<R: 'static>(
    app: &mut App,
    mut question: impl FnMut(&SpatialQuery) -> R + Send + Sync + 'static,
) -> R {
    app.world_mut().run_system_once(move |spatial: SpatialQuery| question(&spatial)).unwrap()
}

fn ray(origin: Vec3, toward: Vec3) -> Ray3d {
    Ray3d::new(origin, Dir3::new(toward).unwrap())
}

fn all<'a>() -> SpatialQueryFilter<'a> {
    SpatialQueryFilter::default()
}

/// An app without gravity, with marbles at random places.
fn cloud(count: u64) -> (App, Vec<(Entity, Vec3, f32)>) {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let marbles = (0..count).map(|i| {
        let random = |k: u64| scene::random(11 * i + k);
        let at = Vec3::new(random(0), random(1), random(2)) * 40.0 - 20.0;
        let radius = 0.1 + random(3);
        (scene::drop_marble(&mut app, radius, at), at, radius)
    });
    let marbles = marbles.collect();
    app.update();
    (app, marbles)
}

/// Distance along a ray to a sphere, by the quadratic formula in `f64`.
fn distance_to_sphere(ray: Ray3d, center: Vec3, radius: f32) -> Option<f64> {
    let offset = (ray.origin - center).as_dvec3();
    // A unit vector of single precision is off by 1e-7, which counts where a ray grazes.
    let (direction, radius) = (ray.direction.as_dvec3().normalize(), f64::from(radius));
    let (half, rest) = (offset.dot(direction), offset.length_squared() - radius * radius);
    let under = half * half - rest;
    if rest <= 0.0 {
        return Some(0.0);
    }
    (under >= 0.0 && half < 0.0).then(|| -half - under.sqrt())
}

#[test]
fn rays_hit_what_the_formula_says() {
    let (mut app, _) = cloud(300);
    let places: Vec<_> = app
        .world_mut()
        .query::<(Entity, &Transform, &Marble)>()
        .iter(app.world())
        .map(|(entity, place, marble)| (entity, place.translation, marble.radius))
        .collect();
    let rays: Vec<_> = (0..2_000_u64)
        .map(|i| {
            let random = |k: u64| scene::random(1_000_000 + 7 * i + k) - 0.5;
            let origin = Vec3::new(random(0), random(1), random(2)) * 60.0;
            let target = Vec3::new(random(3), random(4), random(5)) * 40.0;
            ray(origin, target - origin)
        })
        .collect();
    let asked = rays.clone();
    let hits: Vec<Vec<RayHit>> = ask(&mut app, move |spatial| {
        asked.iter().map(|ray| spatial.cast_ray_all(*ray, 50.0, &all())).collect()
    });
    let mut count = 0;
    for (ray, hits) in rays.iter().zip(hits) {
        let mut expected: Vec<_> = places
            .iter()
            .filter_map(|(entity, at, radius)| {
                Some((*entity, distance_to_sphere(*ray, *at, *radius)?))
            })
            .filter(|(_, distance)| *distance <= 50.0)
            .collect();
        expected.sort_by(|a, b| a.1.total_cmp(&b.1));
        let found: Vec<_> = hits.iter().map(|hit| hit.entity).collect();
        assert_eq!(found, expected.iter().map(|it| it.0).collect::<Vec<_>>(), "{ray:?}");
        for (hit, (_, distance)) in hits.iter().zip(&expected) {
            assert!((f64::from(hit.distance) - distance).abs() < 1e-4, "{hit:?}: {distance}");
            assert!(hit.distance == 0.0 || hit.normal.dot(*ray.direction) <= 0.0, "{hit:?}");
        }
        count += hits.len();
    }
    assert!(count > 300, "{count} hits say little");
}

#[test]
fn filters_choose_by_kind_layer_entity_and_predicate() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let floor = scene::floor(&mut app);
    app.world_mut().entity_mut(floor).insert(CollisionLayers::new(Layer::Floor, LayerMask::ALL));
    let ghost = scene::drop_marble(&mut app, 0.5, Vec3::Y * 3.0);
    app.world_mut().entity_mut(ghost).insert(CollisionLayers::new(Layer::Ghost, Layer::Floor));
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::Y * 1.5);
    app.world_mut().entity_mut(marble).insert(CollisionLayers::new(0_u32, LayerMask::ALL));
    app.update();
    let seen = ask(&mut app, move |spatial| {
        let down = ray(Vec3::Y * 5.0, Vec3::NEG_Y);
        let through = |filter: &SpatialQueryFilter| -> Vec<Entity> {
            spatial.cast_ray_all(down, f32::INFINITY, filter).iter().map(|hit| hit.entity).collect()
        };
        let is_not_ghost = |entity| entity != ghost;
        [
            through(&all()),
            through(&SpatialQueryFilter::marbles()),
            through(&SpatialQueryFilter::walls()),
            through(&all().with_mask(Layer::Ghost)),
            through(&all().with_mask([Layer::Ghost, Layer::Floor])),
            through(&all().with_excluded_entities([ghost, floor])),
            through(&all().with_predicate(&is_not_ghost)),
            through(&SpatialQueryFilter::walls().with_mask(Layer::Ghost)),
        ]
    });
    let expected = [
        vec![ghost, marble, floor],
        vec![ghost, marble],
        vec![floor],
        vec![ghost],
        vec![ghost, floor],
        vec![marble],
        vec![marble, floor],
        vec![],
    ];
    assert_eq!(seen, expected);
}

#[test]
fn shapes_and_points_find_what_is_there() {
    let mut app = scene::app();
    app.insert_resource(Gravity(Vec3::ZERO));
    let floor = scene::floor(&mut app);
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::new(0.0, 2.0, 0.0));
    app.update();
    let at = |x: f32, y: f32| Isometry3d::from_xyz(x, y, 0.0);
    let (hit, capsule, inside, outside, near, within) = ask(&mut app, move |spatial| {
        let fall = Vec3::NEG_Y * 10.0;
        (
            spatial.cast_shape(&Sphere::new(0.25), at(0.0, 5.0), fall, &all()),
            spatial.cast_shape(&Capsule3d::new(0.25, 1.0), at(3.0, 5.0), fall, &all()),
            spatial.overlaps(&Cuboid::new(9.0, 5.0, 1.0), at(0.0, 0.0), &all()),
            spatial.overlaps(&Cuboid::new(1.0, 0.1, 1.0), at(5.0, 5.0), &all()),
            spatial.project_point(Vec3::new(0.0, 3.0, 0.0), 10.0, &all()),
            spatial.project_point(Vec3::new(0.0, 9.0, 0.0), 1.0, &all()),
        )
    });
    let hit = hit.unwrap().unwrap();
    assert_eq!((hit.entity, hit.normal), (marble, Vec3::Y));
    assert!((hit.fraction - 0.225).abs() < 1e-5, "{hit:?}");
    let hit = capsule.unwrap().unwrap();
    // Its lowest point is three quarters of a metre below its center.
    assert_eq!(hit.entity, floor);
    assert!((hit.fraction - 0.425).abs() < 1e-5, "{hit:?}");
    let mut inside = inside.unwrap();
    inside.sort_unstable();
    let mut both = vec![floor, marble];
    both.sort_unstable();
    assert_eq!((inside, outside.unwrap()), (both, vec![]));
    let near = near.unwrap();
    assert_eq!((near.entity, near.normal, within), (marble, Vec3::Y, None));
    assert!((near.distance - 0.5).abs() < 1e-5, "{near:?}");
}

/// The tree follows the world: steps, teleports, despawns.
#[test]
fn queries_see_the_world_as_it_is_now() {
    let (mut app, marbles) = cloud(50);
    let eye = Vec3::Y * 100.0;
    let down = ray(eye, Vec3::NEG_Y);
    let first = |app: &mut App| ask(app, move |spatial| spatial.cast_ray(down, 300.0, &all()));
    let (gone, moved) = (marbles[0].0, marbles[1].0);
    app.world_mut().get_mut::<Transform>(gone).unwrap().translation = Vec3::Y * 60.0;
    app.world_mut().get_mut::<Transform>(moved).unwrap().translation = Vec3::Y * 50.0;
    app.update();
    assert_eq!(first(&mut app).unwrap().entity, gone);
    app.world_mut().despawn(gone);
    assert_eq!(first(&mut app).unwrap().entity, moved, "before the next step, too");
    app.update();
    assert_eq!(first(&mut app).unwrap().entity, moved);
    app.world_mut().get_mut::<Transform>(moved).unwrap().translation.x = 50.0;
    app.update();
    assert_ne!(first(&mut app).map(|hit| hit.entity), Some(moved));
    let spawned = scene::drop_marble(&mut app, 0.5, Vec3::Y * 70.0);
    app.update();
    assert_eq!(first(&mut app).unwrap().entity, spawned);
}

#[test]
fn a_predicate_may_ask_again_and_systems_ask_side_by_side() {
    #[derive(Resource, Default)]
    struct Count(u32);
    let (mut app, _) = cloud(100);
    app.init_resource::<Count>();
    let asks = |spatial: SpatialQuery, places: Query<&Transform>| {
        let lonely = |entity: Entity| {
            let Ok(place) = places.get(entity) else { return false };
            let others = all().with_excluded_entities([entity]);
            let near = spatial.project_point(place.translation, f32::INFINITY, &others);
            near.is_none_or(|near| near.distance > 3.0)
        };
        let filter = SpatialQueryFilter::marbles().with_predicate(&lonely);
        for i in 0..50 {
            let origin = Vec3::new(scene::random(i), scene::random(i + 50), 2.0) * 30.0 - 15.0;
            let _ = spatial.cast_ray(ray(origin, Vec3::NEG_Z), 60.0, &filter);
        }
    };
    let counts = |mut count: ResMut<Count>| count.0 += 1;
    app.add_systems(Update, (asks, asks, asks, counts));
    scene::frames(&mut app, 20);
    assert_eq!(app.world().resource::<Count>().0, 20);
}

#[test]
fn bad_shapes_and_rays_are_refused_or_find_nothing() {
    let (mut app, marbles) = cloud(20);
    let entity = marbles[0].0;
    let odd = [f32::NAN, f32::INFINITY, -1.0, f32::MAX, 0.0];
    let (refused, hits) = ask(&mut app, move |spatial| {
        let here = Isometry3d::IDENTITY;
        let refused = odd.map(|x| spatial.overlaps(&Sphere { radius: x }, here, &all()).is_err());
        let mut hits = 0;
        for x in odd.into_iter().filter(|x| !(*x >= 0.0 && x.is_finite())) {
            let from = Vec3::splat(x);
            hits += spatial.cast_ray_all(ray(from, Vec3::X), f32::INFINITY, &all()).len()
                * usize::from(x.is_nan());
            hits += spatial.cast_ray_all(ray(Vec3::ZERO, Vec3::X), x, &all()).len()
                * usize::from(x.is_nan() || x <= 0.0);
            let _ = spatial.project_point(from, x, &all());
            let there = Isometry3d::from_translation(from);
            let _ = spatial.cast_shape(&Sphere::new(1.0), there, Vec3::splat(x), &all());
            let _ = spatial.cast_shape(&Cuboid::new(x, x, x), here, Vec3::X, &all());
        }
        assert!(spatial.collider(entity).is_some());
        (refused, hits)
    });
    assert_eq!(refused[..3], [true; 3]);
    assert_eq!(hits, 0);
}

#[test]
fn who_is_despawned_is_hit_no_more_and_the_tree_stays() {
    let (mut app, marbles) = cloud(300);
    let changed = |app: &App| app.world().resource_ref::<TawWorld>().last_changed();
    let before = changed(&app);
    let places = marbles.iter().map(|it| (it.0, scene::position(&app, it.0), it.2));
    let mut left: Vec<(Entity, Vec3, f32)> = places.collect();
    let _ = ask(&mut app, |spatial| spatial.cast_ray(ray(Vec3::ZERO, Vec3::X), 1.0, &all()));
    for i in 0..100_usize {
        let (gone, target, _) = left.swap_remove(i * 7 % left.len());
        app.world_mut().entity_mut(gone).despawn();
        let from = Vec3::new(30.0, 40.0, 50.0);
        let direction = (target - from).normalize();
        let hits =
            ask(&mut app, move |spatial| spatial.cast_ray_all(ray(from, direction), 200.0, &all()));
        let found: Vec<_> = hits.iter().map(|hit| hit.entity).collect();
        assert!(found.iter().all(|hit| left.iter().any(|it| it.0 == *hit)), "{i}");
        for (marble, at, radius) in &left {
            let beside = (*at - from).reject_from(direction).length();
            assert!(beside > 0.99 * radius || found.contains(marble), "{i}: {beside} m beside");
        }
        let near = ask(&mut app, move |spatial| spatial.project_point(target, 1e3, &all()));
        let distance = |it: &(Entity, Vec3, f32)| it.1.distance(target) - it.2;
        let nearest = left.iter().map(distance).fold(f32::INFINITY, f32::min);
        assert!((near.unwrap().distance - nearest).abs() < 1e-4, "{i}");
    }
    assert_eq!(changed(&app), before, "the tree was fitted anew");
}

/// Prints what it costs: `cargo test -p taw_examples --test headless -- --ignored --nocapture despawning`.
#[test]
#[ignore = "a measurement"]
fn picking_and_despawning_fifty_of_ten_thousand() {
    let (mut app, _) = cloud(10_000);
    app.update();
    let start = std::time::Instant::now();
    for i in 0..50_u16 {
        let from = Vec3::new(f32::from(i) - 25.0, 100.0, 0.0);
        let hit = ask(&mut app, move |spatial| {
            spatial.cast_ray(ray(from, Vec3::NEG_Y + Vec3::X * 1e-3), 200.0, &all())
        });
        if let Some(hit) = hit {
            app.world_mut().entity_mut(hit.entity).despawn();
        }
    }
    println!("marbles: {:?} each", start.elapsed() / 50);
    let start = std::time::Instant::now();
    app.update();
    println!("marbles: {:?} in the next frame", start.elapsed());
    let region = bevy::math::bounding::Aabb3d::new(Vec3::Y * 200.0, Vec3::splat(10.0));
    let swarm = app.world_mut().spawn(Swarm::filling(region, 10_000, 0.3..=0.4, 1)).id();
    scene::frames(&mut app, 2);
    let start = std::time::Instant::now();
    app.update();
    println!("{:?} in a frame without removals", start.elapsed());
    let ids = app.world().get::<Swarm>(swarm).unwrap().balls().to_vec();
    let start = std::time::Instant::now();
    for ball in ids.iter().step_by(200) {
        app.world_mut().get_mut::<Swarm>(swarm).unwrap().remove(*ball);
    }
    println!("balls of a swarm: {:?} each", start.elapsed() / 50);
    let start = std::time::Instant::now();
    app.update();
    println!("balls of a swarm: {:?} in the next frame", start.elapsed());
    let start = std::time::Instant::now();
    for ball in ids.iter().skip(1).step_by(200) {
        let mut world = app.world_mut().resource_mut::<TawWorld>();
        world.swarm.remove(&[*ball]).unwrap();
    }
    println!("balls through the world: {:?} each", start.elapsed() / 50);
}

/// A box that stands on its edge, below a marble.
#[test]
fn a_turned_body_is_found_by_its_entity() {
    let mut app = scene::app();
    app.insert_resource(TawModel(Model::GAME)).insert_resource(Gravity(Vec3::ZERO));
    let turned = Transform::from_rotation(Quat::from_rotation_z(std::f32::consts::FRAC_PI_4));
    let layers = CollisionLayers::new(1_u32, LayerMask::ALL);
    let body = app.world_mut().spawn((Body::from(Cuboid::from_length(2.0)), turned, layers)).id();
    let marble = scene::drop_marble(&mut app, 0.5, Vec3::new(0.5, 5.0, 0.0));
    app.update();
    let edge = std::f32::consts::SQRT_2;
    let down = ray(Vec3::new(0.5, 9.0, 0.0), Vec3::NEG_Y);
    let hits = ask(&mut app, move |spatial| spatial.cast_ray_all(down, 20.0, &all()));
    assert_eq!(hits.iter().map(|hit| hit.entity).collect::<Vec<_>>(), [marble, body]);
    assert!((hits[1].distance - (9.0 - (edge - 0.5))).abs() < 1e-5, "{hits:?}");
    assert!(hits[1].normal.distance(vec3(1.0, 1.0, 0.0).normalize()) < 1e-5, "{hits:?}");
    let of_kind = |app: &mut App, filter: fn() -> SpatialQueryFilter<'static>| {
        let hits = ask(app, move |spatial| spatial.cast_ray_all(down, 20.0, &filter()));
        hits.into_iter().map(|hit| hit.entity).collect::<Vec<_>>()
    };
    assert_eq!(of_kind(&mut app, SpatialQueryFilter::bodies), [body]);
    assert_eq!(of_kind(&mut app, SpatialQueryFilter::marbles), [marble]);
    assert!(of_kind(&mut app, SpatialQueryFilter::walls).is_empty());
    assert!(of_kind(&mut app, SpatialQueryFilter::balls).is_empty());
    assert_eq!(of_kind(&mut app, || all().without_balls()), [marble, body]);
    assert_eq!(of_kind(&mut app, || SpatialQueryFilter::bodies().with_mask(1_u32)), [body]);
    assert!(of_kind(&mut app, || SpatialQueryFilter::bodies().with_mask(2_u32)).is_empty());
    let others = ask(&mut app, move |spatial| {
        let filter = all().with_excluded_entities([body]);
        spatial.cast_ray_all(down, 20.0, &filter).len()
    });
    assert_eq!(others, 1);
    // The sphere is beside the edge on the right, and in a corner of the bounding box.
    let overlaps = [vec3(1.3, 0.0, 0.0), vec3(1.2, 1.2, 0.0)].map(|at| {
        let find = move |spatial: &SpatialQuery| {
            spatial.overlaps(&Sphere::new(0.1), Isometry3d::from_translation(at), &all()).unwrap()
        };
        ask(&mut app, find)
    });
    assert_eq!(overlaps, [vec![body], vec![]]);
    let hit = ask(&mut app, |spatial| {
        let from = Isometry3d::from_translation(Vec3::Y * 9.0);
        let filter = SpatialQueryFilter::bodies();
        spatial.cast_shape(&Sphere::new(0.5), from, Vec3::NEG_Y * 20.0, &filter).unwrap().unwrap()
    });
    assert_eq!(hit.entity, body);
    assert!((20.0 * hit.fraction - (8.5 - edge)).abs() < 1e-4, "{hit:?}");
    let near = ask(&mut app, |spatial| spatial.project_point(Vec3::X * 3.0, 9.0, &all()).unwrap());
    assert_eq!(near.entity, body);
    assert!((near.distance - (3.0 - edge)).abs() < 1e-5, "{near:?}");
    let collider = ask(&mut app, move |spatial| spatial.collider(body)).unwrap();
    assert_eq!(app.world().resource::<TawWorld>().collider_entity(collider), Some(body));
    app.world_mut().despawn(body);
    assert!(of_kind(&mut app, SpatialQueryFilter::bodies).is_empty());
    assert_eq!(of_kind(&mut app, SpatialQueryFilter::default), [marble]);
}
