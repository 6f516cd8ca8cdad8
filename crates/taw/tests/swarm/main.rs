//! Tests in one program, since each program compiles the core anew.

#[path = "../common/draw.rs"]
mod draw;

mod basics;
mod contact_data;
mod crowding;
mod energy;
mod queries;
mod settings;
mod sleep;
mod soft_step;
mod sound;
mod storm;
