'use strict';
// The page of `prolate-robot view`: forward kinematics, which covers touch, and the picture.

const robot = JSON.parse(document.getElementById('robot').textContent);
const element = (id) => document.getElementById(id);

// ---- vectors, and rigid matrices as 12 numbers, row by row ----

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
const point = (m, p) => [0, 4, 8].map((r) => m[r] * p[0] + m[r + 1] * p[1] + m[r + 2] * p[2] + m[r + 3]);
const direction = (m, v) => [0, 4, 8].map((r) => m[r] * v[0] + m[r + 1] * v[1] + m[r + 2] * v[2]);
const back = (m, v) => [0, 1, 2].map((c) => m[c] * v[0] + m[c + 4] * v[1] + m[c + 8] * v[2]);
const identity = () => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0];
function product(a, b) {
  const out = [];
  for (let r = 0; r < 12; r += 4)
    for (let c = 0; c < 4; ++c)
      out.push(a[r] * b[c] + a[r + 1] * b[c + 4] + a[r + 2] * b[c + 8] + (c === 3 ? a[r + 3] : 0));
  return out;
}
const shift = (v) => [1, 0, 0, v[0], 0, 1, 0, v[1], 0, 0, 1, v[2]];
function turn([x, y, z], angle) {
  const c = Math.cos(angle), s = Math.sin(angle), k = 1 - c;
  return [c + k * x * x, k * x * y - s * z, k * x * z + s * y, 0, k * x * y + s * z, c + k * y * y, k * y * z - s * x, 0,
    k * x * z - s * y, k * y * z + s * x, c + k * z * z, 0];
}
function turnOf(q) {
  const length = Math.hypot(...q), [x, y, z, w] = q.map((c) => c / length);
  return [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w), 0,
    2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 0,
    2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y), 0];
}

// ---- forward kinematics, as _kinematics.py has it ----

function across([x, y, z]) { // of an axis; see across() in python/src/robot_chain.cpp
  const s = z < 0 ? -1 : 1, b = -1 / (s + z), c = x * y * b;
  return [[1 + s * x * x * b, s * c, -s * x], [c, s + y * y * b, -y]];
}
function motionOf(joint, q) {
  const value = joint.scale * q[joint.at] + joint.offset;
  switch (joint.kind) {
    case 'fixed': return identity();
    case 'prismatic': return shift(scaled(joint.axis, value));
    case 'planar': {
      const [u, v] = across(joint.axis), p = [0, 1, 2].map((i) => u[i] * q[joint.at] + v[i] * q[joint.at + 1]);
      return product(shift(p), turn(joint.axis, q[joint.at + 2]));
    }
    case 'ball': return turnOf(q.slice(joint.at, joint.at + 4));
    case 'floating': return product(shift(q.slice(joint.at, joint.at + 3)), turnOf(q.slice(joint.at + 3, joint.at + 7)));
    default: return turn(joint.axis, value);
  }
}
function framesOf(q) {
  const frames = robot.links.map(identity);
  for (const joint of robot.joints) {
    const placed = product(product(joint.origin, shift(joint.anchor)), motionOf(joint, q));
    frames[joint.child] = product(frames[joint.parent], product(placed, shift(scaled(joint.anchor, -1))));
  }
  return frames;
}

// ---- do two convex bodies touch? ----

// The point of a part that is farthest along a direction, in the part's frame.
const supports = {
  ellipsoid({radii: r}, d) {
    const n = [0, 1, 2].map((i) => r[i] * d[i]), length = Math.hypot(...n) || 1;
    return n.map((c, i) => r[i] * c / length);
  },
  box: ({half}, d) => half.map((h, i) => (d[i] < 0 ? -h : h)),
  capsule({radius, half}, d) {
    const length = Math.hypot(...d) || 1, p = scaled(d, radius / length);
    return [p[0], p[1], p[2] + (d[2] < 0 ? -half : half)];
  },
  cylinder({radius, half}, d) {
    const length = Math.hypot(d[0], d[1]) || 1;
    return [radius * d[0] / length, radius * d[1] / length, d[2] < 0 ? -half : half];
  },
  hull({points}, d) {
    let best = 0, most = -Infinity;
    for (let i = 0; i < points.length; i += 3) {
      const along = points[i] * d[0] + points[i + 1] * d[1] + points[i + 2] * d[2];
      if (along > most) most = along, best = i;
    }
    return points.slice(best, best + 3);
  },
};
const support = (part, frame, d) => point(frame, supports[part.kind](part, back(frame, d)));

// Solves the symmetric system by elimination; null where it is singular.
function solve(rows) {
  const n = rows.length;
  for (let i = 0; i < n; ++i) {
    let p = i;
    for (let r = i + 1; r < n; ++r) if (Math.abs(rows[r][i]) > Math.abs(rows[p][i])) p = r;
    if (!(Math.abs(rows[p][i]) > 1e-30)) return null;
    [rows[i], rows[p]] = [rows[p], rows[i]];
    for (let r = 0; r < n; ++r)
      if (r !== i) {
        const f = rows[r][i] / rows[i][i];
        for (let c = i; c <= n; ++c) rows[r][c] -= f * rows[i][c];
      }
  }
  return rows.map((row, i) => row[n] / row[i]);
}
// The point of a simplex nearest to the origin, and the corners that it lies between: the best of all its faces.
function nearest(corners) {
  let best = null;
  for (let set = 1; set < 1 << corners.length; ++set) {
    const [first, ...others] = corners.filter((_, i) => set >> i & 1), edges = others.map((c) => minus(c, first));
    const weights = solve(edges.map((e) => [...edges.map((f) => dot(e, f)), -dot(e, first)]));
    if (!weights || weights.some((w) => w < 0) || weights.reduce((a, b) => a + b, 0) > 1) continue;
    const at = edges.reduce((p, e, i) => [0, 1, 2].map((k) => p[k] + weights[i] * e[k]), first), squares = dot(at, at);
    if (!best || squares < best.squares) best = {at, squares, corners: [first, ...others]};
  }
  return best;
}
// E. G. Gilbert, D. W. Johnson, S. S. Keerthi, "A Fast Procedure for Computing the Distance between Complex Objects in
// Three-Dimensional Space", IEEE Journal on Robotics and Automation 4, 1988. Bodies touch unless a plane lies between.
function touch(a, frameA, b, frameB) {
  let v = minus(point(frameA, [0, 0, 0]), point(frameB, [0, 0, 0])), corners = [];
  if (dot(v, v) === 0) return true;
  for (let i = 0; i < 60; ++i) {
    const w = minus(support(a, frameA, scaled(v, -1)), support(b, frameB, v));
    if (dot(v, w) > 1e-12 * Math.sqrt(dot(v, v))) return false;
    const found = nearest([...corners, w]);
    if (!found || found.squares < 1e-20) return true;
    ({at: v, corners} = found);
    if (corners.length === 4) return true;
  }
  return true;
}

// Pairs of links, by index, whose covers are not certain to be apart.
function touchingPairs(frames) {
  const placed = robot.links.map((link, i) => link.parts.map((part) => product(frames[i], part.pose)));
  return robot.pairs.filter(([i, j]) => robot.links[i].parts.some((a, k) => robot.links[j].parts.some((b, l) => {
    const fa = placed[i][k], fb = placed[j][l], d = [fa[3] - fb[3], fa[7] - fb[7], fa[11] - fb[11]];
    const near = a.bound + b.bound;
    return dot(d, d) <= near * near && touch(a, fa, b, fb);
  })));
}

// ---- the picture ----

const vertexShader = `#version 300 es
in vec3 position; in float heat;
uniform mat4 view, model;
out vec3 world; out float out_heat;
void main() { vec4 at = model * vec4(position, 1.); world = at.xyz; out_heat = heat; gl_Position = view * at; }`;
const fragmentShader = `#version 300 es
precision highp float;
in vec3 world; in float out_heat;
uniform vec4 colour; uniform vec3 eye; uniform float most;
out vec4 result;
vec3 ramp(float t) {
  vec3 a = vec3(.192, .408, .557), b = vec3(.208, .718, .475), c = vec3(.992, .906, .145), d = vec3(.839, .235, .157);
  return t < .333 ? mix(a, b, t * 3.) : t < .667 ? mix(b, c, t * 3. - 1.) : mix(c, d, min(t, 1.) * 3. - 2.);
}
void main() {
  vec3 n = normalize(cross(dFdx(world), dFdy(world))), to_eye = normalize(eye - world);
  float light = .35 + .65 * abs(dot(n, normalize(to_eye + vec3(0., 0., .6))));
  vec3 base = most > 0. ? ramp(out_heat / most) : colour.rgb;
  result = vec4(base * light, colour.a);
}`;

const canvas = element('canvas');
const gl = canvas.getContext('webgl2', {antialias: true, preserveDrawingBuffer: true});
function programOf() {
  const program = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertexShader], [gl.FRAGMENT_SHADER, fragmentShader]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(program, shader);
  }
  gl.bindAttribLocation(program, 0, 'position');
  gl.bindAttribLocation(program, 1, 'heat');
  gl.linkProgram(program);
  return program;
}
const numbers = (text, Type) => new Type(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
function bufferOf({vertices, faces, heat}) {
  const array = gl.createVertexArray();
  gl.bindVertexArray(array);
  const attribute = (index, size, data) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(index);
    gl.vertexAttribPointer(index, size, gl.FLOAT, false, 0, 0);
  };
  attribute(0, 3, numbers(vertices, Float32Array));
  if (heat) attribute(1, 1, numbers(heat, Float32Array));
  const indices = numbers(faces, Uint32Array);
  gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
  gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
  return {array, count: indices.length};
}

const kMesh = [0.62, 0.66, 0.7, 1], kTouch = [0.86, 0.15, 0.18];
const kColours = [[0, .447, .698], [.902, .624, 0], [0, .62, .451], [.8, .475, .655], [.337, .706, .914], [.835, .369, 0]];
const state = {q: [...robot.home], azimuth: robot.view[0], elevation: robot.view[1], distance: 1, pan: [0, 0, 0],
  touching: new Set(), frames: []};
const program = programOf();
gl.useProgram(program);
const at = Object.fromEntries(['view', 'model', 'colour', 'eye', 'most'].map((n) => [n, gl.getUniformLocation(program, n)]));
const meshes = robot.links.map((link) => link.mesh && bufferOf(link.mesh));
const covers = robot.links.map((link) => link.cover && bufferOf(link.cover));

// Column by column, as WebGL has it: what the eye at `eye` sees, up being z.
function viewMatrix(eye, target, aspect, near, far) {
  const unit = (v) => scaled(v, 1 / Math.hypot(...v)), z = unit(minus(eye, target)), x = unit(cross([0, 0, 1], z)), y = cross(z, x);
  const f = 2.4, a = (far + near) / (near - far), b = 2 * far * near / (near - far), d = [x, y, z].map((v) => -dot(v, eye));
  const rows = [[...scaled(x, f / aspect), d[0] * f / aspect], [...scaled(y, f), d[1] * f], [...scaled(z, a), d[2] * a + b],
    [...scaled(z, -1), -d[2]]];
  return {matrix: new Float32Array([0, 1, 2, 3].flatMap((c) => rows.map((r) => r[c]))), x, y};
}
function eyeAndTarget() {
  const target = [0, 1, 2].map((i) => robot.middle[i] + state.pan[i]), reach = 2.5 * robot.reach * state.distance;
  const c = Math.cos(state.elevation);
  const d = [c * Math.cos(state.azimuth), c * Math.sin(state.azimuth), Math.sin(state.elevation)];
  return {target, eye: [0, 1, 2].map((i) => target[i] + reach * d[i]), reach};
}
function draw() {
  const scale = window.devicePixelRatio || 1;
  canvas.width = canvas.clientWidth * scale, canvas.height = canvas.clientHeight * scale;
  gl.viewport(0, 0, canvas.width, canvas.height);
  gl.clearColor(1, 1, 1, 1);
  gl.enable(gl.DEPTH_TEST);
  gl.depthMask(true);
  gl.disable(gl.BLEND);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const {eye, target, reach} = eyeAndTarget();
  const {matrix, x, y} = viewMatrix(eye, target, canvas.width / canvas.height, 0.02 * reach, reach + 6 * robot.reach);
  Object.assign(state, {x, y});
  gl.uniformMatrix4fv(at.view, false, matrix);
  gl.uniform3fv(at.eye, eye);
  const show = element('covers').value, heat = show === 'heat' && robot.most > 0;
  const body = (buffer, link, colour, most) => {
    const m = state.frames[link];
    gl.uniformMatrix4fv(at.model, false, [0, 1, 2, 3].flatMap((c) => [m[c], m[c + 4], m[c + 8], c === 3 ? 1 : 0]));
    gl.uniform4fv(at.colour, colour);
    gl.uniform1f(at.most, most);
    gl.bindVertexArray(buffer.array);
    gl.drawElements(gl.TRIANGLES, buffer.count, gl.UNSIGNED_INT, 0);
  };
  const tint = (link, colour) => (state.touching.has(link) ? kTouch : colour);
  // Behind the covers where they lie in the same plane.
  gl.enable(gl.POLYGON_OFFSET_FILL);
  gl.polygonOffset(1, 1);
  if (element('meshes').checked)
    meshes.forEach((mesh, i) => mesh && body(mesh, i, [...tint(i, kMesh.slice(0, 3)), 1], 0));
  gl.disable(gl.POLYGON_OFFSET_FILL);
  if (show === 'none') return;
  const glass = element('meshes').checked && !heat;
  if (glass) {
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
  }
  covers.forEach((cover, i) => cover && body(cover, i, [...tint(i, kColours[i % kColours.length]), glass ? 0.38 : 1],
    heat && !state.touching.has(i) ? robot.most : 0));
}

// ---- controls ----

function update() {
  state.frames = framesOf(state.q);
  const pairs = touchingPairs(state.frames), name = (i) => robot.links[i].name;
  state.touching = new Set(pairs.flat());
  element('verdict').textContent = pairs.length ? `${pairs.length} of ${robot.pairs.length} pairs may touch` : 'No links touch';
  element('verdict').className = pairs.length ? 'touch' : '';
  element('touching').textContent = pairs.map(([i, j]) => `${name(i)} – ${name(j)}`).join(', ');
  [...element('table').rows].forEach((row) => row.classList.toggle('touch', state.touching.has(Number(row.dataset.link))));
  element('scale').hidden = element('covers').value !== 'heat';
  draw();
}
const sliders = [];
function addSlider(label, low, high, read, write) {
  const row = document.createElement('label'), text = document.createElement('span'), input = document.createElement('input'),
        output = document.createElement('output');
  row.className = 'joint';
  text.textContent = text.title = label;
  Object.assign(input, {type: 'range', min: low, max: high, step: (high - low) / 1000 || 1});
  const show = () => { input.value = read(); output.textContent = read().toFixed(3); };
  input.addEventListener('input', () => { write(Number(input.value)); show(); update(); });
  row.append(text, input, output);
  element('joints').append(row);
  sliders.push({show, random: () => write(low + Math.random() * (high - low))});
}
// Angles about the fixed axes x, then y, then z, as URDF has them; and back. Quaternions are x y z w.
function quaternionOf([roll, pitch, yaw]) {
  const [c, d, e] = [roll, pitch, yaw].map((a) => Math.cos(a / 2)), [s, t, u] = [roll, pitch, yaw].map((a) => Math.sin(a / 2));
  return [s * d * e - c * t * u, c * t * e + s * d * u, c * d * u - s * t * e, c * d * e + s * t * u];
}
function anglesOf(q) {
  const m = turnOf(q), roll = Math.atan2(m[9], m[10]), s = Math.sin(roll), c = Math.cos(roll);
  // Where the pitch is a quarter turn the roll is any, and the yaw makes up for it.
  return [roll, Math.atan2(-m[8], Math.hypot(m[0], m[4])), Math.atan2(s * m[2] - c * m[1], c * m[5] - s * m[6])];
}
// What was last set, as angles: other angles may mean the same rotation. It holds until the rotation is another one.
function addTurn(name, first) {
  let angles = [0, 0, 0], meant = [0, 0, 0, 1];
  const present = () => {
    const now = state.q.slice(first, first + 4);
    if (now.some((c, i) => c !== meant[i])) meant = now, angles = anglesOf(now);
    return angles;
  };
  ['roll', 'pitch', 'yaw'].forEach((word, k) => {
    const most = k === 1 ? Math.PI / 2 : Math.PI;
    addSlider(`${name} ${word}`, -most, most, () => present()[k], (value) => {
      angles = present().map((angle, i) => (i === k ? value : angle));
      state.q.splice(first, 4, ...(meant = quaternionOf(angles)));
    });
  });
}
for (const joint of robot.joints) {
  joint.sliders.forEach(([suffix, low, high], k) =>
    addSlider(joint.name + suffix, low, high, () => state.q[joint.at + k], (value) => { state.q[joint.at + k] = value; }));
  if (joint.quaternion !== null) addTurn(joint.name, joint.at + joint.quaternion);
}
const showAll = () => { sliders.forEach((slider) => slider.show()); update(); };
element('home').addEventListener('click', () => { state.q = [...robot.home]; showAll(); });
element('random').addEventListener('click', () => { sliders.forEach((slider) => slider.random()); showAll(); });
for (const id of ['covers', 'meshes']) element(id).addEventListener('change', update);

element('title').textContent = robot.name;
element('most').textContent = `${(1000 * robot.most).toFixed(1)} mm`;
robot.links.forEach((link, i) => {
  if (!link.row) return;
  const row = element('table').insertRow();
  row.dataset.link = i;
  for (const text of [link.name, ...link.row]) row.insertCell().textContent = text;
  row.cells[0].title = link.name;
});

canvas.addEventListener('pointerdown', (down) => {
  canvas.setPointerCapture(down.pointerId);
  const move = ({movementX: dx, movementY: dy, shiftKey}) => {
    if (shiftKey) {
      const step = 1.2 * robot.reach * state.distance / canvas.clientHeight * 2;
      state.pan = state.pan.map((p, i) => p + step * (dy * state.y[i] - dx * state.x[i]));
    } else {
      state.azimuth -= dx * 0.008;
      state.elevation = Math.max(-1.5, Math.min(1.5, state.elevation + dy * 0.008));
    }
    draw();
  };
  canvas.addEventListener('pointermove', move);
  canvas.addEventListener('pointerup', () => canvas.removeEventListener('pointermove', move), {once: true});
});
canvas.addEventListener('wheel', (event) => {
  event.preventDefault();
  state.distance *= Math.exp(event.deltaY * 0.001);
  draw();
}, {passive: false});
window.addEventListener('resize', draw);
// A page may be opened at a configuration: view.html#q=0,0.5,-1 or #covers=heat&q=...
for (const [key, value] of new URLSearchParams(location.hash.slice(1))) {
  if (key === 'q') value.split(',').slice(0, state.q.length).forEach((x, i) => { state.q[i] = Number(x) || 0; });
  if (key === 'covers') element('covers').value = value;
}
showAll();
