use std::path::PathBuf;
use std::time::Duration;

use bevy::app::PluginGroupBuilder;
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::view::screenshot::{Screenshot, ScreenshotCaptured};
use bevy::time::TimeUpdateStrategy;

/// Command line options of every example: a picture instead of a game.
#[derive(clap::Args, Resource, Clone, Debug, Default)]
pub struct Picture {
    /// Save a picture (PNG) after --frames frames, and exit
    #[arg(long, value_name = "FILE")]
    pub screenshot: Option<PathBuf>,
    /// Number of frames of 1/60 s before the picture is taken
    #[arg(long, default_value_t = 180, value_name = "N")]
    pub frames: u32,
}

/// Bevy's default plugins with a titled window, and what [`Picture`] asks for.
pub struct ExamplePlugins {
    /// The title of the window.
    pub title: &'static str,
    /// The options that the user gave.
    pub picture: Picture,
}

impl PluginGroup for ExamplePlugins {
    fn build(self) -> PluginGroupBuilder {
        let window =
            Window { title: self.title.into(), resolution: (1280, 720).into(), ..default() };
        let assets = assets().to_string_lossy().into_owned();
        DefaultPlugins
            .set(AssetPlugin { file_path: assets, ..default() })
            .set(WindowPlugin { primary_window: Some(window), ..default() })
            .set(LogPlugin { filter: "warn,taw=info,bevy_taw=info".into(), ..default() })
            .add(PicturePlugin(self.picture))
    }
}

/// Folder of textures and levels: of the checkout that Cargo runs, or, started without Cargo,
/// of the one that the example was built in.
pub fn assets() -> PathBuf {
    let built = || env!("CARGO_MANIFEST_DIR").into();
    std::env::var_os("CARGO_MANIFEST_DIR").map_or_else(built, PathBuf::from).join("assets")
}

struct PicturePlugin(Picture);

impl Plugin for PicturePlugin {
    fn build(&self, app: &mut App) {
        if self.0.screenshot.is_some() {
            // However long a frame takes to render, the picture is of the same moment.
            let frame = Duration::from_secs_f64(1.0 / 60.0);
            app.insert_resource(TimeUpdateStrategy::ManualDuration(frame))
                .insert_resource(self.0.clone())
                .add_systems(Last, take_picture)
                .add_observer(save_picture);
        }
    }
}

fn take_picture(mut commands: Commands, picture: Res<Picture>, mut frame: Local<u32>) {
    *frame += 1;
    if *frame == picture.frames.max(1) {
        commands.spawn(Screenshot::primary_window());
    }
}

fn save_picture(
    captured: On<ScreenshotCaptured>,
    picture: Res<Picture>,
    mut exit: MessageWriter<AppExit>,
) {
    let Some(path) = &picture.screenshot else { return };
    let saved = captured
        .image
        .clone()
        .try_into_dynamic()
        .map_err(|error| error.to_string())
        .and_then(|image| image.to_rgb8().save(path).map_err(|error| error.to_string()));
    exit.write(match saved {
        Ok(()) => AppExit::Success,
        Err(error) => {
            error!("cannot save {}: {error}", path.display());
            AppExit::error()
        }
    });
}
