// The mesh, flat shaded. Its corners are not shared, so that each knows which of its triangle's it is: the distances to
// the three edges follow, and wires have the same width everywhere and the same depth as the faces.
import {kShading} from './cover_shader.js';

export const kMeshVertex = /* glsl */ `
precision highp float;
layout(location = 0) in vec3 a_position;
uniform vec3 u_eye, u_right, u_up, u_forward;
uniform vec2 u_depth;
uniform vec4 u_section;
${kShading}
out vec3 v_position, v_corner;
void main() {
  int corner = gl_VertexID % 3;
  v_corner = vec3(corner == 0, corner == 1, corner == 2);
  v_position = a_position;
  vec3 d = a_position - u_eye;
  float t = dot(d, u_forward);
  gl_Position = vec4(dot(d, u_right) / dot(u_right, u_right), dot(d, u_up) / dot(u_up, u_up),
                     2.0 * (u_depth.x * t - u_depth.y) - t, t);
  if (u_section.xyz != vec3(0)) gl_Position.z += 2.0 * SECTION_DEPTH * t; // as ellipsoids do
}`;

export const kMeshFragment = /* glsl */ `
precision highp float;
in vec3 v_position, v_corner;
layout(location = 0) out vec4 o_colour;
uniform vec3 u_eye, u_key, u_sky, u_colour, u_inside_colour;
uniform vec4 u_section;
uniform bool u_wire;
uniform float u_line; // width in pixels
${kShading}
void main() {
  vec3 n = normalize(cross(dFdx(v_position), dFdy(v_position)));
  vec3 edge = v_corner / max(fwidth(v_corner), 1e-6);
  float line = clamp(0.5 * (u_line + 1.0) - min(edge.x, min(edge.y, edge.z)), 0.0, 1.0);
  if (u_section.xyz != vec3(0) && dot(u_section.xyz, v_position) > u_section.w) discard;
  if (dot(n, v_position - u_eye) > 0.0) n = -n;
  vec3 colour = linear(gl_FrontFacing ? u_colour : u_inside_colour);
  // Between wires nothing is seen, but what lies behind stays hidden: the depth is written.
  o_colour = u_wire ? vec4(vec3(0.25), line) : stored(shade(colour, n, u_key, u_sky));
}`;

// Where a section cuts the solid: the stencil holds, for each pixel, how often the mesh is left minus how often it is
// entered behind the plane, which is the winding number of the plane's point.
export const kCapVertex = /* glsl */ `
precision highp float;
uniform vec3 u_right, u_up, u_forward;
out vec3 v_direction;
void main() {
  vec2 at = 2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0;
  v_direction = u_forward + at.x * u_right + at.y * u_up;
  gl_Position = vec4(at, 0.0, 1.0);
}`;

export const kCapFragment = /* glsl */ `
precision highp float;
in vec3 v_direction;
layout(location = 0) out vec4 o_colour;
uniform vec3 u_eye, u_colour;
uniform vec2 u_depth;
uniform vec4 u_section;
${kShading}
void main() {
  float t = (u_section.w - dot(u_section.xyz, u_eye)) / dot(u_section.xyz, v_direction);
  if (t <= 0.0) discard;
  gl_FragDepth = u_depth.x - u_depth.y / t - 0.5 * SECTION_DEPTH; // before what ellipsoids show there
  o_colour = stored(0.9 * linear(u_colour)); // as they show the solid
}`;
