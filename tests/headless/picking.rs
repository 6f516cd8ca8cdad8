//! Pointers on marbles, walls and bodies, through a camera.

use bevy::asset::uuid::Uuid;
use bevy::camera::visibility::RenderLayers;
use bevy::camera::{
    CameraProjection, ComputedCameraValues, NormalizedRenderTarget, RenderTarget, RenderTargetInfo,
};
use bevy::picking::backend::PointerHits;
use bevy::picking::events::{Click, Out, Over, Pointer};
use bevy::picking::pointer::{Location, PointerAction, PointerButton, PointerId, PointerInput};
use bevy::picking::{InteractionPlugin, Pickable, PickingPlugin};
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_taw::prelude::*;

use crate::scene::{self, frames};

const POINTER: PointerId = PointerId::Custom(Uuid::from_u128(7));
const SIZE: UVec2 = UVec2::new(400, 300);

/// Events that were heard, in order.
#[derive(Resource, Default)]
struct Heard(Vec<(&'static str, Entity)>);

/// An app with a camera ten metres before the origin, that looks at it.
fn app() -> App {
    let mut app = scene::app_with((TawPlugin, PickingPlugin, InteractionPlugin, TawPickingPlugin));
    app.insert_resource(Gravity(Vec3::ZERO)).init_resource::<Heard>();
    app.world_mut().spawn(PrimaryWindow);
    app.world_mut().spawn(POINTER);
    let target = RenderTargetInfo { physical_size: SIZE, scale_factor: 1.0 };
    let clip_from_view =
        PerspectiveProjection { aspect_ratio: SIZE.x as f32 / SIZE.y as f32, ..default() }
            .get_clip_from_view();
    let computed = ComputedCameraValues { clip_from_view, target_info: Some(target), ..default() };
    let camera = Camera { computed, ..default() };
    let place = Transform::from_xyz(0.0, 0.0, 10.0);
    app.world_mut().spawn((camera, RenderTarget::None { size: SIZE }, place));
    app.add_observer(|over: On<Pointer<Over>>, mut heard: ResMut<Heard>| {
        heard.0.push(("over", over.entity));
    });
    app.add_observer(|out: On<Pointer<Out>>, mut heard: ResMut<Heard>| {
        heard.0.push(("out", out.entity));
    });
    app.add_observer(|click: On<Pointer<Click>>, mut heard: ResMut<Heard>| {
        heard.0.push(("click", click.entity));
    });
    frames(&mut app, 2);
    app
}

fn send(app: &mut App, at: Vec2, action: PointerAction) {
    let target = NormalizedRenderTarget::None { width: SIZE.x, height: SIZE.y };
    let location = Location { target, position: at };
    app.world_mut().write_message(PointerInput::new(POINTER, location, action));
}

/// Moves the pointer to where the camera sees a point of the plane z = 0. Returns what is heard.
fn point_at(app: &mut App, x: f32, y: f32) -> Vec<(&'static str, Entity)> {
    let per_metre = SIZE.y as f32 / (2.0 * 10.0 * (std::f32::consts::FRAC_PI_8).tan());
    let at = SIZE.as_vec2() / 2.0 + vec2(x, -y) * per_metre;
    send(app, at, PointerAction::Move { delta: Vec2::ZERO });
    frames(app, 2);
    std::mem::take(&mut app.world_mut().resource_mut::<Heard>().0)
}

fn marble(app: &mut App, at: Vec3) -> Entity {
    let marble = scene::drop_marble(app, 0.5, at);
    frames(app, 2);
    marble
}

#[test]
fn a_pointer_is_over_the_nearest_marble_or_wall() {
    let mut app = app();
    let wall = (Wall::from(Cuboid::new(2.0, 2.0, 0.2)), Transform::from_xyz(0.0, 0.0, -3.0));
    let wall = app.world_mut().spawn(wall).id();
    let near = marble(&mut app, Vec3::ZERO);
    let beside = marble(&mut app, Vec3::X * 3.0);
    assert_eq!(point_at(&mut app, 0.0, 0.0), [("over", near)]);
    assert_eq!(point_at(&mut app, 0.48, 0.0), []);
    // Past the marble, onto the wall behind it.
    assert_eq!(point_at(&mut app, 0.6, 0.0), [("out", near), ("over", wall)]);
    assert_eq!(point_at(&mut app, 3.0, 0.4), [("out", wall), ("over", beside)]);
    assert_eq!(point_at(&mut app, 3.0, 0.7), [("out", beside)]);
    // It follows marbles that move.
    app.world_mut().entity_mut(beside).insert(Transform::from_xyz(3.0, 0.7, 0.0));
    assert_eq!(point_at(&mut app, 3.0, 0.7), [("over", beside)]);
}

#[test]
fn a_pointer_is_over_a_crate() {
    let mut app = app();
    app.world_mut().resource_mut::<TawModel>().response = Response::SoftStep;
    let body = app.world_mut().spawn(Body::from(Cuboid::from_length(1.0))).id();
    frames(&mut app, 2);
    assert_eq!(point_at(&mut app, 0.0, 0.0), [("over", body)]);
    // Near a corner, where a ball would not be.
    assert_eq!(point_at(&mut app, 0.48, 0.48), []);
    assert_eq!(point_at(&mut app, 0.6, 0.0), [("out", body)]);
}

#[test]
fn what_is_hit_is_told_in_metres_of_the_world() {
    let mut app = app();
    let target = marble(&mut app, Vec3::ZERO);
    point_at(&mut app, 0.0, 0.0);
    let hits = app.world().resource::<Messages<PointerHits>>();
    let hits: Vec<_> = hits.iter_current_update_messages().flat_map(|it| &it.picks).collect();
    let [(entity, hit)] = hits[..] else { panic!("{hits:?}") };
    assert_eq!(*entity, target);
    let (position, normal) = (hit.position.unwrap(), hit.normal.unwrap());
    assert!(position.distance(Vec3::Z * 0.5) < 1e-3, "{position}");
    assert!(normal.distance(Vec3::Z) < 1e-3, "{normal}");
    // From the near plane of the camera, a tenth of a metre before it.
    assert!((hit.depth - 9.4).abs() < 1e-3, "{}", hit.depth);
}

#[test]
fn a_click_reaches_the_marble() {
    let mut app = app();
    let target = marble(&mut app, Vec3::ZERO);
    point_at(&mut app, 0.0, 0.0);
    let center = SIZE.as_vec2() / 2.0;
    send(&mut app, center, PointerAction::Press(PointerButton::Primary));
    frames(&mut app, 1);
    send(&mut app, center, PointerAction::Release(PointerButton::Primary));
    frames(&mut app, 1);
    assert_eq!(app.world().resource::<Heard>().0, [("click", target)]);
}

#[test]
fn what_is_not_pickable_is_looked_through_and_what_does_not_block_lets_others_be_hovered() {
    let mut app = app();
    let back = marble(&mut app, Vec3::NEG_Z * 2.0);
    let front = marble(&mut app, Vec3::ZERO);
    app.world_mut().entity_mut(front).insert(Pickable::IGNORE);
    assert_eq!(point_at(&mut app, 0.0, 0.0), [("over", back)]);
    let glass = Pickable { should_block_lower: false, is_hoverable: true };
    app.world_mut().entity_mut(front).insert(glass);
    assert_eq!(point_at(&mut app, 0.0, 0.1), [("over", front)]);
    app.world_mut().entity_mut(front).insert(Pickable::default());
    assert_eq!(point_at(&mut app, 0.0, 0.0), [("out", back)]);
}

/// Rays from within walls, from pointers that are nowhere and through cameras that are gone do no harm.
#[test]
fn a_pointer_that_is_nowhere_hits_nothing() {
    let mut app = app();
    marble(&mut app, Vec3::ZERO);
    assert!(!point_at(&mut app, 0.0, 0.0).is_empty());
    assert!(point_at(&mut app, 1e6, 0.0).iter().all(|(what, _)| *what == "out"));
    let is_over = |app: &mut App| !point_at(app, 0.0, 0.0).is_empty();
    assert!(is_over(&mut app));
    let camera = app.world_mut().query_filtered::<Entity, With<Camera>>().single(app.world());
    app.world_mut().entity_mut(camera.unwrap()).despawn();
    frames(&mut app, 2);
    app.world_mut().resource_mut::<Heard>().0.clear();
    assert!(!is_over(&mut app));
}

#[test]
fn what_the_camera_does_not_draw_by_its_render_layers_is_looked_through() {
    let mut app = app();
    let back = marble(&mut app, Vec3::NEG_Z * 2.0);
    let front = marble(&mut app, Vec3::ZERO);
    app.world_mut().entity_mut(front).insert(RenderLayers::layer(1));
    assert_eq!(point_at(&mut app, 0.0, 0.0), [("over", back)]);
    let camera = app.world_mut().query_filtered::<Entity, With<Camera>>().single(app.world());
    app.world_mut().entity_mut(camera.unwrap()).insert(RenderLayers::from_layers(&[1, 2]));
    assert_eq!(point_at(&mut app, 0.0, 0.1), [("out", back), ("over", front)]);
    app.world_mut().entity_mut(front).insert(RenderLayers::layer(3));
    assert_eq!(point_at(&mut app, 0.0, 0.0), [("out", front)]);
    app.world_mut().entity_mut(back).insert(RenderLayers::from_layers(&[0, 2]));
    assert_eq!(point_at(&mut app, 0.0, 0.1), [("over", back)]);
}

#[test]
fn a_camera_within_a_wall_looks_out_of_it() {
    let mut app = app();
    let wall = (Wall::from(Cuboid::new(4.0, 4.0, 4.0)), Transform::from_xyz(0.0, 0.0, 10.0));
    app.world_mut().spawn(wall);
    let target = marble(&mut app, Vec3::ZERO);
    assert_eq!(point_at(&mut app, 0.0, 0.0), [("over", target)]);
}
