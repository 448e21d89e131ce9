// Points and lines that lie on top of the picture: the witnesses of a query. Sizes are in pixels.
import {projected} from './camera.js';
import {Program} from './gl.js';

const kVertex = /* glsl */ `
precision highp float;
uniform vec2 u_from, u_to, u_size; // ends, and the picture's size, pixels
uniform float u_radius;
out vec2 v_pixel;
void main() {
  vec2 along = u_to - u_from;
  float far = length(along);
  along = far > 0.0 ? along / far : vec2(1, 0);
  float reach = u_radius + 2.0;
  vec2 corner = 2.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0;
  v_pixel = (corner.x < 0.0 ? u_from : u_to) + reach * (corner.x * along + corner.y * vec2(-along.y, along.x));
  gl_Position = vec4(2.0 * v_pixel / u_size - 1.0, 0.0, 1.0);
}`;

const kFragment = /* glsl */ `
precision highp float;
uniform vec2 u_from, u_to;
uniform float u_radius;
uniform vec3 u_colour;
in vec2 v_pixel;
layout(location = 0) out vec4 o_colour;
void main() { // a capsule with a white rim
  vec2 along = u_to - u_from;
  float t = clamp(dot(v_pixel - u_from, along) / max(dot(along, along), 1e-6), 0.0, 1.0);
  float far = distance(v_pixel, u_from + t * along) - u_radius;
  float rim = clamp(far + 1.5, 0.0, 1.0);
  o_colour = vec4(mix(u_colour, vec3(1), rim), clamp(1.0 - far, 0.0, 1.0) * mix(1.0, 0.85, rim));
}`;

export class Marks {
  constructor(gl) {
    this.gl = gl;
    this.program = new Program(gl, kVertex, kFragment);
  }

  /// `marks`: [{from, to, radius, colour}], ends in the world; `scale` pixels of the picture for one of the page.
  draw(marks, lens, width, height, scale) {
    const gl = this.gl;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.disable(gl.DEPTH_TEST);
    for (const mark of marks) {
      const ends = [mark.from, mark.to].map((p) => projected(lens, p));
      if (ends.some((end) => !(end.depth > 0))) continue;
      const [from, to] = ends.map(({x, y}) => [(x + 1) / 2 * width, (y + 1) / 2 * height]);
      this.program.use(
          {u_from: from, u_to: to, u_size: [width, height], u_radius: mark.radius * scale, u_colour: mark.colour});
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    gl.disable(gl.BLEND);
  }
}
