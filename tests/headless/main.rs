//! Whole scenes in Bevy apps without a window: `MinimalPlugins`, `TawPlugins`, and
//! a clock that the test turns.

mod balls;
mod board;
mod capsules;
mod contact_forces;
mod contacts;
mod disabling;
mod first_contact;
mod games;
mod heroes;
mod ignore;
mod input;
mod interpolation;
mod layers;
mod lifts;
mod mesh_walls;
mod motion;
mod moving_walls;
mod nasty;
mod panels;
mod picking;
mod previews;
mod queries;
mod scene;
mod schedules;
mod sensors;
mod snapshots;
mod soft_step;
mod spawning;
mod storm;
mod swarms;
mod teleports;
mod trade;
mod transforms;
mod walls;
mod zones;
