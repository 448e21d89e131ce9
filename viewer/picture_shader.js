// Puts the two layers, ellipsoids and mesh, on white paper. Of each layer only the nearest surface counts, so that
// translucent layers need no sorting: per pixel the farther is laid down first. Thin lines where an ellipsoid borders
// on another, or on nothing, keep shapes apart whatever their colours.

export const kWholeVertex = /* glsl */ `
out vec2 v_at;
void main() {
  v_at = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  gl_Position = vec4(2.0 * v_at - 1.0, 0.0, 1.0);
}`;

export const kPictureFragment = /* glsl */ `
precision highp float;
precision highp int;
precision highp usampler2D;
precision highp sampler2D;
uniform sampler2D u_cover, u_cover_depth, u_mesh, u_mesh_depth;
uniform usampler2D u_id;
uniform vec2 u_opacity; // of ellipsoids, of the mesh
uniform uint u_hover;
uniform int u_line;
uniform bool u_outlines, u_mesh_outlines;
layout(location = 0) out vec4 o_colour;

float outline(ivec2 at, uint id) {
  ivec2 size = textureSize(u_id, 0) - 1;
  float different = 0.0;
  for (int k = 0; k < 4; ++k) {
    ivec2 step = k < 2 ? ivec2(2 * k - 1, 0) : ivec2(0, 2 * k - 5);
    different += float(texelFetch(u_id, clamp(at + u_line * step, ivec2(0), size), 0).r != id);
  }
  return min(different * 0.5, 1.0);
}
float mesh_outline(ivec2 at) {
  ivec2 size = textureSize(u_id, 0) - 1;
  float nothing = 0.0;
  for (int k = 0; k < 4; ++k) {
    ivec2 step = k < 2 ? ivec2(2 * k - 1, 0) : ivec2(0, 2 * k - 5);
    nothing += float(texelFetch(u_mesh_depth, clamp(at + u_line * step, ivec2(0), size), 0).r == 1.0);
  }
  return min(nothing * 0.5, 1.0);
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  uint id = texelFetch(u_id, at, 0).r;
  vec4 mesh_texel = texelFetch(u_mesh, at, 0);
  if (id == 0u && mesh_texel.a == 0.0) { // most of the picture
    o_colour = vec4(1.0);
    return;
  }
  vec3 cover = texelFetch(u_cover, at, 0).rgb;
  vec3 mesh = mesh_texel.rgb;
  float cover_depth = texelFetch(u_cover_depth, at, 0).r, mesh_depth = texelFetch(u_mesh_depth, at, 0).r;
  cover *= cover, mesh *= mesh;
  float has_cover = id == 0u ? 0.0 : u_opacity.x, has_mesh = mesh_texel.a * u_opacity.y; // wires have gaps
  if (u_outlines && id != 0u && u_opacity.x > 0.0) {
    float line = outline(at, id);
    cover *= 1.0 - 0.72 * line;
    has_cover = mix(has_cover, max(has_cover, 0.25 + 0.75 * has_cover), line);
  }
  if (id != 0u && id == u_hover) cover = mix(cover, vec3(1.0), 0.3), has_cover = max(has_cover, 0.75);
  if (u_mesh_outlines && has_mesh > 0.0) mesh *= 1.0 - 0.6 * mesh_outline(at);
  vec3 colour = vec3(1.0);
  if (cover_depth < mesh_depth) {
    colour = mix(colour, mesh, has_mesh);
    colour = mix(colour, cover, has_cover);
  } else {
    colour = mix(colour, cover, has_cover);
    colour = mix(colour, mesh, has_mesh);
  }
  o_colour = vec4(sqrt(colour), 1.0); // undoes linear() of cover_shader.js
}`;

/// A picture drawn at another size. At twice the size the linear filter, between four pixels, gives their mean.
export const kScalingFragment = /* glsl */ `
precision highp float;
uniform sampler2D u_picture;
in vec2 v_at;
layout(location = 0) out vec4 o_colour;
void main() { o_colour = texture(u_picture, v_at); }`;
