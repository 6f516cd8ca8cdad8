//! Smooth motion between fixed steps.
//!
//! The picture lies between the last two steps, so it lags by up to one:
//! outside the fixed schedules, read a marble's true place from the
//! [`TawWorld`], or leave this plugin out.
//! Marbles and bodies get it by themselves, in world space, whatever carries them, and so do walls that move, in
//! whatever schedule: a lift and its riders are drawn together. Of walls it is the `GlobalTransform` that is
//! drawn, with those of what carries them or is carried along; their `Transform` is what the game wrote.
//! While [`Time<Virtual>`] stands still or the physics does not run, a wall that is moved is drawn where its
//! `Transform` is.
//! A marble or wall with `NoTransformEasing` is left out. Give what carries marbles and has no wall a
//! [`TransformInterpolation`] of [`bevy_transform_interpolation`].
//!
//! # What is written between steps
//! A system in `Update` sees the `Transform` that is drawn. If it writes there,
//!
//! - coordinates that it leaves alone go on as they were;
//! - a small change, by no more than the marble's radius, or the reach of a body (or a radian), moves the marble by so
//!   much from where it truly is, so that a nudge in every frame takes nothing away from its
//!   motion;
//! - a larger one is a place: the marble is exactly there. So is a coordinate that it has or
//!   had in truth, or that was written in the last frame, too, and whatever comes together with
//!   a [`Teleport`].
//!
//! No jump is drawn as a way. In the fixed schedules a `Transform` is the truth, and what is
//! written there is a place.
//!
//! [`TransformInterpolation`]: bevy_transform_interpolation::prelude::TransformInterpolation

use std::sync::atomic::{AtomicBool, Ordering};

use bevy::ecs::schedule::ScheduleLabel;
use bevy::prelude::*;
use bevy::transform::systems::sync_simple_transforms;
use bevy_transform_interpolation::TransformEasingSystems;
use bevy_transform_interpolation::prelude::*;

use crate::TawSystems;
use crate::body::{Body, BodyState};
use crate::components::{Eased, Marble, MarbleState, Teleport, bits, rotation_bits};
use crate::convert::{from_point, to_point};
use crate::placed::{Placed, PlacedChildren};
use crate::resources::TawWorld;
use crate::scatter::{Frame, put};
use crate::schedule::TawSchedule;
use crate::wall_drawing;

pub use bevy_transform_interpolation as transform_interpolation;

/// Interpolates the translation of every marble and body, and its rotation if the model has one, and draws walls that
/// move where the marbles that are drawn meet them. What has `NoTransformEasing` is left out. Does nothing where the step is
/// [in a schedule](crate::TawPlugins::in_schedule) outside of the fixed main loop.
#[derive(Debug, Default)]
pub struct TawInterpolationPlugin;

impl Plugin for TawInterpolationPlugin {
    fn build(&self, app: &mut App) {
        let schedule = TawSchedule::of(app);
        if !schedule.is_fixed(app.world()) {
            return;
        }
        if !app.is_plugin_added::<TransformInterpolationPlugin>() {
            app.add_plugins(TransformInterpolationPlugin::default());
        }
        // That crate eases what it is told to in its parent's frame, which may move by itself.
        app.register_required_components::<Marble, Eased>();
        app.register_required_components::<Marble, NoTranslationEasing>();
        app.register_required_components::<Marble, NoRotationEasing>();
        app.register_required_components::<Body, Eased>();
        app.register_required_components::<Body, NoTranslationEasing>();
        app.register_required_components::<Body, NoRotationEasing>();
        add_easing(app, schedule.label());
        app.add_systems(
            PostUpdate,
            wall_drawing::draw.in_set(TransformSystems::Propagate).after(sync_simple_transforms),
        );
    }
}

/// Adds the easing of marbles and bodies: those that are children come after all that may carry them.
fn add_easing(app: &mut App, schedule: impl ScheduleLabel) {
    app.add_systems(
        RunFixedMainLoop,
        (
            (undo::<MarbleState>, undo::<BodyState>, undo_children)
                .chain()
                .in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop),
            (ease::<MarbleState>, ease::<BodyState>, draw_children)
                .chain()
                .in_set(RunFixedMainLoopSystems::AfterFixedMainLoop)
                .after(TransformEasingSystems::Ease),
        ),
    )
    // By then, what carries them is where its last step took it.
    .add_systems(
        FixedFirst,
        undo_children.after(TransformEasingSystems::Reset).before(TawSystems::Control),
    )
    .add_systems(
        schedule,
        (note_start::<MarbleState>, note_start::<BodyState>)
            .after(TawSystems::Gather)
            .before(TawSystems::Step),
    );
}

type Drawn<'a, T> = (&'a mut T, &'a mut Transform, &'a mut Eased, Has<Teleport>);
type Roots<'w, 's, T> =
    Query<'w, 's, Drawn<'static, T>, (Without<ChildOf>, Without<NoTransformEasing>)>;
type Child<'a, T> =
    (&'a mut T, &'a mut Transform, Option<&'a mut Eased>, Has<NoTransformEasing>, Has<Teleport>);
type ChildItem<'a, T> = (Mut<'a, T>, Mut<'a, Transform>, Option<Mut<'a, Eased>>, bool, bool);

/// Marbles and bodies, and places of what carries them.
type Children<'w, 's, 'a, 'b> = ParamSet<
    'w,
    's,
    (
        Query<'a, 'b, Child<'static, MarbleState>>,
        Query<'a, 'b, Child<'static, BodyState>>,
        TransformHelper<'a, 'b>,
    ),
>;

/// Notes where marbles are when a step begins.
fn note_start<T: Placed>(world: Res<TawWorld>, mut marbles: Query<(&T, &mut Eased)>) {
    marbles.par_iter_mut().for_each(|(state, mut eased)| {
        eased.restored = world.restored;
        eased.from = state.place(&world);
    });
}

/// Draws marbles between the last two steps, except those that somebody moved since.
fn ease<T: Placed>(world: Res<TawWorld>, time: Res<Time<Fixed>>, mut marbles: Roots<T>) {
    let part = time.overstep_fraction();
    marbles.par_iter_mut().for_each(|(state, transform, eased, _)| {
        draw(&world, Some(&eased), part, (state, transform), &Frame::WORLD);
    });
}

/// Draws marbles and bodies that are children, wherever their parents are drawn. Those that are not eased stay where
/// they are while their parents move. Those that somebody moved are left where that is.
pub(crate) fn draw_children(
    world: Res<TawWorld>,
    time: Res<Time<Fixed>>,
    mut placed: Children,
    children: PlacedChildren,
) {
    let part = time.overstep_fraction();
    for (child, parent) in children.in_order() {
        let Some(frame) = Frame::of(parent, &placed.p2()) else { continue };
        if let Ok(marble) = placed.p0().get_mut(child) {
            draw_child(&world, part, marble, &frame);
        }
        if let Ok(body) = placed.p1().get_mut(child) {
            draw_child(&world, part, body, &frame);
        }
    }
}

fn draw_child<T: Placed>(
    world: &TawWorld,
    part: f32,
    (state, transform, eased, is_left_out, _): ChildItem<T>,
    frame: &Frame,
) {
    let eased = eased.as_deref().filter(|_| !is_left_out);
    draw(world, eased, part, (state, transform), frame);
}

/// Draws what is eased between the last two steps, and the rest where it is.
fn draw<T: Placed>(
    world: &TawWorld,
    eased: Option<&Eased>,
    part: f32,
    (mut state, mut transform): (Mut<T>, Mut<Transform>),
    frame: &Frame,
) {
    let Some((mut position, mut rotation)) = state.place(world) else { return };
    if let Some(Eased { from: Some((start, turned)), restored, .. }) = eased
        && *restored == world.restored
    {
        // Who crossed a side of a periodic box did not come from the other one.
        let start = from_point(world.nearest_image(to_point(*start), to_point(position)));
        position = start + (position - start) * part; // with the bits of both where they are one
        rotation = rotation.map(|end| {
            let turned = turned.filter(|start| *start != end);
            turned.map_or(end, |start| start.slerp(end, part))
        });
    }
    let (seen, turned) = state.seen();
    let moved = bits(transform.translation) != seen;
    let turned = rotation_bits(transform.rotation) != turned;
    if !moved {
        put(&mut transform, &mut state, frame, Some(position), None);
    }
    if !turned {
        put(&mut transform, &mut state, frame, None, rotation);
    }
}

/// Takes marbles from where they are drawn to where they truly are, and takes over what was
/// written in between.
fn undo<T: Placed>(mut world: ResMut<TawWorld>, mut marbles: Roots<T>) {
    let any = AtomicBool::new(false);
    marbles.par_iter_mut().for_each(|(state, transform, eased, _)| {
        if !go_back(&world, state, transform, eased, &Frame::WORLD) {
            any.store(true, Ordering::Relaxed);
        }
    });
    if any.into_inner() {
        for marble in &mut marbles {
            take_over(world.bypass_change_detection(), marble, &Frame::WORLD);
        }
    }
}

/// Undoes the easing of children.
fn undo_children(mut world: ResMut<TawWorld>, mut placed: Children, children: PlacedChildren) {
    let world = world.bypass_change_detection();
    for (child, parent) in children.in_order() {
        let Some(frame) = Frame::of(parent, &placed.p2()) else { continue };
        if let Ok(marble) = placed.p0().get_mut(child) {
            undo_child(world, marble, &frame);
        }
        if let Ok(body) = placed.p1().get_mut(child) {
            undo_child(world, body, &frame);
        }
    }
}

fn undo_child<T: Placed>(
    world: &mut TawWorld,
    (mut state, mut transform, eased, is_left_out, teleport): ChildItem<T>,
    frame: &Frame,
) {
    let Some(mut eased) = eased.filter(|_| !is_left_out) else {
        return draw(world, None, 1.0, (state, transform), frame); // its parents went back
    };
    if !go_back(world, state.reborrow(), transform.reborrow(), eased.reborrow(), frame) {
        take_over(world, (state, transform, eased, teleport), frame);
    }
}

/// Takes a marble from where it is drawn to where it truly is. Gives whether nobody moved it.
fn go_back<T: Placed>(
    world: &TawWorld,
    mut state: Mut<T>,
    mut transform: Mut<Transform>,
    mut eased: Mut<Eased>,
    frame: &Frame,
) -> bool {
    let Some((position, rotation)) = state.place(world) else { return true };
    let (seen, turned) = state.seen();
    let moved = bits(transform.translation) != seen;
    let turned = rotation.is_some() && rotation_bits(transform.rotation) != turned;
    if !moved {
        put(&mut transform, &mut state, frame, Some(position), None);
        if eased.wrote.is_some() {
            eased.wrote = None;
        }
    }
    if !turned {
        put(&mut transform, &mut state, frame, None, rotation);
    }
    !(moved || turned)
}

type DrawnItem<'a, T> = (Mut<'a, T>, Mut<'a, Transform>, Mut<'a, Eased>, bool);

/// Takes over where somebody moved or turned a marble since it was drawn. What cannot be right
/// is left to gather, which refuses it.
fn take_over<T: Placed>(
    world: &mut TawWorld,
    (mut state, mut transform, mut eased, teleport): DrawnItem<T>,
    frame: &Frame,
) {
    let Some((end, turned)) = state.place(world) else { return };
    let seen = state.seen();
    let (start, turned_before) = eased.from.unwrap_or((end, turned));
    let exact = teleport || world.just_restored;
    let mut from = (start, turned_before);
    if bits(transform.translation) != seen.0 {
        let written = Written {
            seen: Vec3::from_array(seen.0.map(f32::from_bits)),
            now: transform.translation,
            before: eased.wrote,
            within: if exact { -1.0 } else { state.radius(world) },
        };
        let (end, start) = written.place(frame.local(end), frame.local(start));
        if !end.is_finite() || !state.set_position(world, frame.world(end)) {
            eased.from = None;
            return;
        }
        eased.wrote = Some(written.now);
        from.0 = frame.world(start);
        transform.translation = end;
        state.see_translation(bits(end));
    }
    if let Some(end) = turned
        && rotation_bits(transform.rotation) != seen.1
    {
        let seen = Quat::from_array(seen.1.map(f32::from_bits));
        let [mut end, mut start] = [end, turned_before.unwrap_or(end)].map(|q| frame.turned(q));
        let now = transform.rotation;
        if !exact && now != start && now != end && seen.angle_between(now) <= 1.0 {
            let by = now * seen.inverse();
            (end, start) = ((by * end).normalize(), (by * start).normalize());
        } else {
            (end, start) = (now, now);
        }
        if !state.set_rotation(world, frame.turned_in_world(end)) {
            eased.from = None;
            return;
        }
        from.1 = Some(frame.turned_in_world(start));
        transform.rotation = end;
        state.see_rotation(rotation_bits(end));
    }
    eased.from = Some(from);
}

/// A translation that somebody wrote.
struct Written {
    /// Position before the write, as drawn.
    seen: Vec3,
    now: Vec3,
    /// Position written in the last frame.
    before: Option<Vec3>,
    /// So far away it is a nudge.
    within: f32,
}

impl Written {
    /// Positions of a marble at the end and at the start of the last step, corrected by this write; `end`
    /// and `start` are the simulated ones.
    fn place(&self, end: Vec3, start: Vec3) -> (Vec3, Vec3) {
        let known = [Some(end), Some(start), self.before];
        let axes = [0, 1, 2].map(|i| {
            let touched = self.now[i].to_bits() != self.seen[i].to_bits();
            (touched, known.iter().flatten().any(|known| known[i] == self.now[i]))
        });
        let names_a_place = axes.iter().all(|(touched, is_known)| !touched || *is_known);
        let change = self.now - self.seen;
        let nudge = !names_a_place && change.length() <= self.within;
        let (mut after, mut began) = (end, start);
        for (i, (touched, _)) in axes.into_iter().enumerate() {
            if touched && nudge {
                (after[i], began[i]) = (end[i] + change[i], start[i] + change[i]);
            } else if touched {
                (after[i], began[i]) = (self.now[i], self.now[i]);
            }
        }
        (after, began)
    }
}
