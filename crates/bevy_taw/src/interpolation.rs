//! Smooth motion between fixed steps, by [`bevy_transform_interpolation`].
//!
//! What is on the screen lies between the last two steps, so it lags by up to one:
//! outside the fixed schedules, read a marble's true place from the
//! [`TawWorld`](crate::resources::TawWorld), or leave this plugin out.
//! Marbles get it by themselves; give moving walls a
//! [`TransformInterpolation`].

use bevy::prelude::*;
use bevy_transform_interpolation::prelude::*;
use bevy_transform_interpolation::{
    TransformEasingSystems, TranslationEasingState, reset_easing_states_on_transform_change,
};

use crate::TawSystems;
use crate::components::Marble;

pub use bevy_transform_interpolation as transform_interpolation;

/// Interpolates every marble's translation. A marble with `NoTranslationEasing` is
/// left out.
#[derive(Debug, Default)]
pub struct TawInterpolationPlugin;

impl Plugin for TawInterpolationPlugin {
    fn build(&self, app: &mut App) {
        if !app.is_plugin_added::<TransformInterpolationPlugin>() {
            app.add_plugins(TransformInterpolationPlugin::default());
        }
        app.register_required_components::<Marble, TranslationInterpolation>();
        app.add_systems(FixedUpdate, forget_refused_places.after(TawSystems::Scatter));
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
        (&mut Transform, &mut TranslationEasingState),
        (With<Marble>, Without<NoTranslationEasing>),
    >,
    eased: Res<EasedAt>,
) {
    for (mut transform, mut easing) in &mut marbles {
        if let (Some(start), Some(end)) = (easing.start, easing.end) {
            if transform.translation == start.lerp(end, eased.0) {
                transform.translation = end;
            } else {
                *easing = TranslationEasingState::default();
            }
        }
    }
}
