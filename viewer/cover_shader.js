// Ellipsoids {c + L u : |u| <= 1}, ray traced: each is one rectangle that just holds its image, and each of its pixels
// finds where the ray meets the ellipsoid. So they are round at any size, and cost four corners each.
//
// Image: in homogeneous picture coordinates the ellipsoid is T u with the rows x, y, w of T, u = (u1, u2, u3, 1). The
// line x = s w touches it where q(x - s w, x - s w) = 0, q = diag(1, 1, 1, -1): C. Sigg et al., "GPU-Based Ray-Casting
// of Quadratic Surfaces" (2006). Measured from the center's image nothing cancels.
//
// Ray: with y = L^-1 (eye - c), e = L^-1 d it meets the ellipsoid where |y + t e| = 1; y is first moved along e to
// where it is nearest to the center, so that far and thin bodies keep their digits.
//
// A section cuts along a plane. Where a ray enters through the plane, the flat cut shows; of ellipsoids that overlap
// there, the one that holds the point deepest, which has one clean border to its neighbour: depths get a small part of
// |y|^2, on round surfaces and meshes too, or these would come before the cut where they lie just behind it.
//
// The macros WIRE, SECTION, HAS_DISTANCE and OUTSIDE are true or false: where no graphics card helps, both sides of each
// branch are paid for unless the compiler can drop one.

export const kShading = /* glsl */ `
#define SECTION_DEPTH 1e-4 // of the range of depths
vec3 shade(vec3 colour, vec3 n, vec3 key, vec3 sky) { // soft light from the upper left, some from above
  float diffuse = max(dot(n, key), 0.0), ambient = 0.5 + 0.5 * dot(n, sky);
  return colour * (0.42 + 0.5 * diffuse + 0.16 * ambient);
}
vec3 linear(vec3 srgb) { return srgb * srgb; } // near enough, and what lies in the textures is its inverse
vec4 stored(vec3 colour) { return vec4(sqrt(min(colour, 1.0)), 1.0); }`;

export const kCoverVertex = /* glsl */ `
precision highp float;
layout(location = 0) in vec4 a_first; // center, l11, l21, l22, l31, l32, l33 in three groups
layout(location = 1) in vec4 a_second;
layout(location = 2) in float a_third;
layout(location = 3) in vec3 a_colour;
layout(location = 4) in uint a_id;
layout(location = 5) in float a_mark;
uniform vec3 u_eye, u_right, u_up, u_forward; // in the body's frame; right and up reach the picture's border
flat out vec3 v_center, v_colour, v_y;
flat out vec3 v_inverse_diagonal, v_inverse_below;
flat out uint v_id;
flat out float v_mark;
out vec3 v_direction, v_e;

vec2 tangents(vec4 x, vec4 w, float ww) { // of the image, along x / w
  float middle = x.w / w.w;
  vec3 around = x.xyz - middle * w.xyz;
  float b = dot(around, w.xyz), root = sqrt(max(b * b - ww * dot(around, around), 0.0));
  return middle + vec2(b + root, b - root) / ww;
}

void main() {
  v_center = a_first.xyz;
  float l11 = a_first.w, l21 = a_second.x, l22 = a_second.y, l31 = a_second.z, l32 = a_second.w, l33 = a_third;
  vec3 i = 1.0 / vec3(l11, l22, l33);
  float m21 = -l21 * i.x * i.y, m32 = -l32 * i.y * i.z, m31 = -(l31 * i.x + l32 * m21) * i.z;
  v_inverse_diagonal = i;
  v_inverse_below = vec3(m21, m31, m32);
  v_colour = a_colour;
  v_id = a_id;
  v_mark = a_mark;

  vec3 d = v_center - u_eye;
  mat3 factor = mat3(l11, l21, l31, 0.0, l22, l32, 0.0, 0.0, l33);
  vec3 right = u_right / dot(u_right, u_right), up = u_up / dot(u_up, u_up);
  vec4 x = vec4(right * factor, dot(right, d)), y = vec4(up * factor, dot(up, d));
  vec4 w = vec4(u_forward * factor, dot(u_forward, d));
  float ww = dot(w.xyz, w.xyz) - w.w * w.w;
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  vec2 at = 2.0 * corner - 1.0; // the whole picture, if the ellipsoid reaches behind the eye
  if (ww < 0.0) {
    vec2 across = tangents(x, w, ww), upright = tangents(y, w, ww);
    at = vec2(mix(across.x, across.y, corner.x), mix(upright.x, upright.y, corner.y));
    if (w.w < 0.0) at = vec2(2.0); // behind the eye
  }
  v_direction = u_forward + at.x * u_right + at.y * u_up;
  v_y = vec3(-d.x * i.x, -(m21 * d.x + i.y * d.y), -(m31 * d.x + m32 * d.y + i.z * d.z));
  vec3 e = v_direction;
  v_e = vec3(i.x * e.x, m21 * e.x + i.y * e.y, m31 * e.x + m32 * e.y + i.z * e.z);
  gl_Position = vec4(at, 0.0, 1.0);
}`;

export const kCoverFragment = /* glsl */ `
precision highp float;
precision highp sampler3D;
flat in vec3 v_center, v_colour, v_y;
flat in vec3 v_inverse_diagonal, v_inverse_below;
flat in uint v_id;
flat in float v_mark;
in vec3 v_direction, v_e;
layout(location = 0) out vec4 o_colour;
layout(location = 1) out uint o_id;
uniform vec3 u_eye, u_key, u_sky;
uniform vec2 u_depth;   // picture depth = x - y / t
uniform vec2 u_range;   // of t
uniform vec4 u_section; // kept: dot(xyz, p) < w
uniform float u_line; // half a wire's width, pixels
uniform bool u_of_body; // the body's colour, not the node's
uniform vec3 u_body_colour, u_mark_colour, u_solid_colour;
uniform sampler3D u_distance;
uniform vec3 u_distance_origin, u_distance_step; // p -> texture coordinates
uniform sampler2D u_ramp;
uniform float u_ramp_end;
uniform float u_ahead; // 1: in a section it comes before what is 0
${kShading}

float distance_at(vec3 p) { return texture(u_distance, (p - u_distance_origin) * u_distance_step).r; }

float on_wire(vec3 y, float squared) { // three great circles, and the outline
  vec3 width = max(fwidth(y), 1e-6), ring = abs(y) / width;
  float rim = (1.0 - sqrt(squared)) / max(fwidth(sqrt(squared)), 1e-6);
  return min(min(ring.x, ring.y), min(ring.z, 0.6 * rim));
}

void main() {
  float ee = dot(v_e, v_e), nearest = -dot(v_y, v_e) / ee;
  vec3 closest = v_y + nearest * v_e;
  float squared = dot(closest, closest);
  float half_chord = sqrt(max(1.0 - squared, 0.0) / ee);
  float t = nearest - half_chord, last = nearest + half_chord;
  // Here, where all pixels are on their way, so that differences to the neighbours make sense.
  float wire_front = 0.0, wire_back = 0.0;
  if (WIRE) wire_front = on_wire(v_y + t * v_e, squared), wire_back = on_wire(v_y + last * v_e, squared);
  bool cut = false;
  float speed = 0.0, start = -1.0, crossing = 0.0, solid = 1.0, width = 1.0;
  if (SECTION) {
    speed = dot(u_section.xyz, v_direction), start = dot(u_section.xyz, u_eye) - u_section.w;
    crossing = -start / speed;
    if (HAS_DISTANCE) solid = distance_at(u_eye + crossing * v_direction), width = max(fwidth(solid), 1e-6);
  }
  if (squared >= 1.0 || last < u_range.x) discard;

  if (SECTION && start + t * speed > 0.0) {
    if (speed >= 0.0 || crossing > last) discard;
    t = crossing;
    cut = true;
  }
  if (t < u_range.x) { // the eye is inside: the far wall is what it sees
    if (cut) discard;
    t = last;
    if (start + t * speed > 0.0) discard;
  }
  if (WIRE && !cut && wire_front > u_line) {
    if (wire_back > u_line || start + last * speed > 0.0) discard;
    t = last;
  }
  vec3 p = u_eye + t * v_direction, y = v_y + t * v_e;
  vec3 i = v_inverse_diagonal, m = v_inverse_below;
  vec3 n = normalize(vec3(i.x * y.x + m.x * y.y + m.y * y.z, i.y * y.y + m.z * y.z, i.z * y.z));
  if (dot(n, v_direction) > 0.0) n = -n;

  vec3 colour = linear(u_of_body ? u_body_colour : v_colour);
  if (OUTSIDE) colour = linear(texture(u_ramp, vec2(max(distance_at(p), 0.0) / u_ramp_end, 0.5)).rgb);
  else if (v_mark > 0.5) colour = linear(u_mark_colour);
  if (cut) {
    // Flat, and where the solid is known, it shows: what is coloured sticks out of it.
    if (HAS_DISTANCE) {
      colour = mix(0.9 * linear(u_solid_colour), colour, clamp(solid / width + 0.5, 0.0, 1.0));
      colour *= 1.0 - 0.6 * clamp(1.2 - abs(solid) / width, 0.0, 1.0);
    }
  } else {
    colour = shade(WIRE ? 0.55 * colour : colour, n, u_key, u_sky);
  }
  gl_FragDepth = u_depth.x - u_depth.y / t + (SECTION ? SECTION_DEPTH * (dot(y, y) - u_ahead) : 0.0);
  o_colour = stored(colour);
  o_id = v_id;
}`;
