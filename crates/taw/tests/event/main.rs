//! Tests in one program, since each program compiles the core anew.

#[path = "../common/draw.rs"]
mod draw;

mod basics;
mod budget;
mod crowds;
mod grooves;
mod knots;
mod mesh;
mod overlap;
mod paddle;
mod sound;
mod storm;
