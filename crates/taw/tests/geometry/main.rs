//! Tests in one program, since each program compiles the core anew.

#[macro_use]
#[path = "../common/things.rs"]
mod things;

mod degenerate;
mod frame;
mod height_fields;
mod pairs;
mod queries;
mod shapes;
mod surfaces;
mod touching;
