//! Smooth motion between fixed steps, by [`bevy_transform_interpolation`].
//!
//! What is on the screen lies between the last two steps, so it lags by up to one:
//! outside the fixed schedules, read a marble's true place from the
//! [`TawWorld`], or leave this plugin out.
//! Marbles get it by themselves; give moving walls a
//! [`TransformInterpolation`].

use bevy::prelude::*;
use bevy_transform_interpolation::prelude::*;
use bevy_transform_interpolation::{
    RotationEasingState, TransformEasingSystems, TranslationEasingState,
    reset_easing_states_on_transform_change,
};
use taw::motion::Rotation;

use crate::TawSystems;
use crate::components::Marble;
use crate::resources::TawWorld;

pub use bevy_transform_interpolation as transform_interpolation;

/// Interpolates every marble's translation, and its rotation if the model has one.
/// A marble with `NoTransformEasing` is left out.
#[derive(Debug, Default)]
pub struct TawInterpolationPlugin;

impl Plugin for TawInterpolationPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<TransformInterpolationPlugin>() {
            app.add_plugins(TransformInterpolationPlugin::default());
        }
        app.register_required_components::<Marble, TranslationInterpolation>();
        app.add_systems(
            FixedUpdate,
            (ease_rotation, forget_refused_places).after(TawSystems::Scatter),
        );
        app.init_resource::<EasedAt>().add_systems(
            RunFixedMainLoop,
            (
                tell_teleports_from_easing
                    .in_set(RunFixedMainLoopSystems::BeforeFixedMainLoop)
                    .before(reset_easing_states_on_transform_change),
                note_easing
                    .in_set(RunFixedMainLoopSystems::AfterFixedMainLoop)
                    .after(TransformEasingSystems::Ease),
            ),
        );
    }
}

/// Where between two steps the `Transform`s of this frame are.
#[derive(Resource, Default)]
struct EasedAt(f32);

fn note_easing(time: Res<Time<Fixed>>, mut eased: ResMut<EasedAt>) {
    eased.0 = time.overstep_fraction();
}

/// Lets marbles turn smoothly, once they turn.
fn ease_rotation(
    world: Res<TawWorld>,
    still: Query<Entity, (With<Marble>, Without<RotationInterpolation>)>,
    turning: Query<Entity, (With<Marble>, With<RotationInterpolation>)>,
    mut commands: Commands,
) {
    if world.model().rotation == Rotation::None {
        for marble in &turning {
            // By now it may be on its way out.
            commands.entity(marble).try_remove::<(RotationInterpolation, RotationEasingState)>();
        }
    } else {
        for marble in &still {
            commands.entity(marble).try_insert(RotationInterpolation);
        }
    }
}

/// A place that gather refused is no place to move on from.
fn forget_refused_places(mut marbles: Query<&mut TranslationEasingState, With<Marble>>) {
    for mut easing in &mut marbles {
        if easing.start.is_some_and(|start| !start.is_finite()) {
            easing.start = None;
        }
    }
}

/// Puts each marble back to where its last step ended, unless somebody moved it
/// since it was drawn: then that is where it is now.
///
/// The interpolation crate cannot always tell the two apart: to it, touching only
/// the scale moves the marble to where it was drawn, and a teleport may be undone
/// by the next step.
fn tell_teleports_from_easing(
    mut marbles: Query<
        (&mut Transform, &mut TranslationEasingState, Option<&mut RotationEasingState>),
        (With<Marble>, Without<NoTranslationEasing>),
    >,
    eased: Res<EasedAt>,
) {
    for (mut transform, mut easing, turning) in &mut marbles {
        if let Some(mut turning) = turning
            && let (Some(start), Some(end)) = (turning.start, turning.end)
        {
            if transform.rotation == start.slerp(end, eased.0) {
                transform.rotation = end;
            } else {
                *turning = RotationEasingState::default();
            }
        }
        if let (Some(start), Some(end)) = (easing.start, easing.end) {
            if transform.translation == start.lerp(end, eased.0) {
                transform.translation = end;
            } else {
                *easing = TranslationEasingState::default();
            }
        }
    }
}
