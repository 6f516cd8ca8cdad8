//! Whole scenes in Bevy apps without a window: `MinimalPlugins`, `TawPlugins`, and
//! a clock that the test turns.

mod board;
mod capsules;
mod contacts;
mod input;
mod interpolation;
mod motion;
mod scene;
mod spawning;
mod swarms;
mod trade;
mod transforms;
mod walls;
