// Spheres without meshes: a quad for each, and in each of its pixels the ray of the eye against
// the sphere. The marbles come from a storage buffer, 16 bytes each.

#import bevy_pbr::{
    mesh_functions::get_tag,
    mesh_view_bindings::view,
    view_transformations::position_world_to_clip,
}
#ifndef PREPASS_PIPELINE
#import bevy_pbr::{
    mesh_types::MESH_FLAGS_SHADOW_RECEIVER_BIT,
    pbr_functions,
    pbr_types,
}
#endif

// How many quads are in the mesh.
const BLOCK: u32 = 4096u;

// Center; radius as a half float, and above it the colour: 5 bits red, 6 green, 5 blue.
@group(#{MATERIAL_BIND_GROUP}) @binding(0) var<storage, read> marbles: array<vec4<u32>>;

struct Vertex {
    @builtin(instance_index) instance: u32,
    // A corner of the quad, and its number in the block.
    @location(0) corner: vec3<f32>,
}

struct Corner {
    @builtin(position) position: vec4<f32>,
    @location(0) world_position: vec3<f32>,
    @location(1) corner: vec2<f32>,
    @location(2) @interpolate(flat) sphere: vec4<f32>,
    @location(3) @interpolate(flat) color: u32,
}

fn is_orthographic() -> bool {
    return view.clip_from_view[3].w == 1.0;
}

@vertex
fn vertex(in: Vertex) -> Corner {
    let packed = marbles[get_tag(in.instance) * BLOCK + u32(in.corner.z)];
    let center = bitcast<vec3<f32>>(packed.xyz);
    let radius = unpack2x16float(packed.w).x;

    // Across the line of sight, and as wide as the sphere looks from there.
    var right = view.world_from_view[0].xyz;
    var up = view.world_from_view[1].xyz;
    var seen = radius;
    if !is_orthographic() {
        let way = center - view.world_position;
        let distance = length(way);
        let ahead = way / distance;
        right = normalize(cross(ahead, up));
        up = cross(right, ahead);
        seen = radius / sqrt(max(1.0 - radius * radius / (distance * distance), 0.01));
    }

    var out: Corner;
    out.world_position = center + (right * in.corner.x + up * in.corner.y) * seen;
    out.position = position_world_to_clip(out.world_position);
#ifdef UNCLIPPED_DEPTH_ORTHO_EMULATION
    out.position.z = min(out.position.z, 1.0);
#endif
    out.corner = in.corner.xy;
    out.sphere = vec4(center, radius);
    out.color = packed.w >> 16u;
    return out;
}

#ifdef PREPASS_PIPELINE

// To a light, a sphere is a disc at its center: what is before it is lit, what is behind is not.
@fragment
fn fragment(in: Corner) {
    if dot(in.corner, in.corner) > 1.0 {
        discard;
    }
}

#else

struct Pixel {
    @location(0) color: vec4<f32>,
    @builtin(frag_depth) depth: f32,
}

@fragment
fn fragment(in: Corner) -> Pixel {
    let center = in.sphere.xyz;
    let radius = in.sphere.w;
    var ray = -view.world_from_view[2].xyz;
    if !is_orthographic() {
        ray = normalize(in.world_position - view.world_position);
    }
    // Where the ray is nearest to the center, and how far before that it enters.
    let to_center = center - in.world_position;
    let nearest = ray * dot(to_center, ray) - to_center;
    let squared = radius * radius - dot(nearest, nearest);
    if squared < 0.0 {
        discard;
    }
    let normal = (nearest - ray * sqrt(squared)) / radius;
    let place = vec4(center + normal * radius, 1.0);
    let clip = position_world_to_clip(place.xyz);

    var input = pbr_types::pbr_input_new();
    input.flags = MESH_FLAGS_SHADOW_RECEIVER_BIT;
    input.is_orthographic = is_orthographic();
    input.frag_coord = vec4(in.position.xy, clip.z / clip.w, clip.w);
    input.world_position = place;
    input.world_normal = normal;
    input.N = normal;
    input.V = pbr_functions::calculate_view(place, input.is_orthographic);
    let color = vec3<u32>(in.color >> 11u, (in.color >> 5u) & 63u, in.color & 31u);
    input.material.base_color = vec4(vec3<f32>(color) / vec3(31.0, 63.0, 31.0), 1.0);
    input.material.perceptual_roughness = 0.35;

    var out: Pixel;
    out.color = pbr_functions::apply_pbr_lighting(input);
    out.color = pbr_functions::main_pass_post_lighting_processing(input, out.color);
    out.depth = clip.z / clip.w;
    return out;
}

#endif
