// How a body moves by its modes (include/prolate/deformation.hpp): at coordinates q its vertices are at x + sum q U(x),
// and what a node stands for lies within r = sum |q| radius of the ellipsoid with center c + sum q shift and factor
// (1 + sum |q| growth) L, where c and L are those of its bound.

const kMotion = 5; // numbers of a node and mode: the shift, growth and radius

/// The factor of a small ellipsoid that holds all points within `radius` of {L u: |u| <= 1}: for every p > 0 that with
/// the matrix (1 + p) L L^T + (1 + 1 / p) radius^2 I does, and of some p the one of least volume is taken.
export function widened([l11, l21, l22, l31, l32, l33], radius) {
  const m = [
    l11 * l11, l21 * l11, l21 * l21 + l22 * l22, l31 * l11, l31 * l21 + l32 * l22, l31 * l31 + l32 * l32 + l33 * l33
  ];
  const p0 = radius * Math.sqrt(3 / (m[0] + m[2] + m[5]));
  let best, least = Infinity;
  for (let step = -4; step <= 4; ++step) {
    const p = p0 * 2 ** step, a = 1 + p, b = (1 + 1 / p) * radius * radius;
    const k11 = Math.sqrt(a * m[0] + b), k21 = a * m[1] / k11, k31 = a * m[3] / k11;
    const k22 = Math.sqrt(a * m[2] + b - k21 * k21), k32 = (a * m[4] - k31 * k21) / k22;
    const k33 = Math.sqrt(a * m[5] + b - k31 * k31 - k32 * k32);
    if (k11 * k22 * k33 < least) least = k11 * k22 * k33, best = [k11, k21, k22, k31, k32, k33];
  }
  return best;
}

/// What holds node `row` at coordinates `q`: how far its bound moves, by what share of itself it grows, and the radius.
export function motionOf({motions}, row, q) {
  const shift = [0, 0, 0];
  let growth = 0, radius = 0;
  for (let m = 0; m < q.length; ++m) {
    if (q[m] === 0) continue;
    const at = kMotion * (row * q.length + m);
    for (let k = 0; k < 3; ++k) shift[k] += q[m] * motions[at + k];
    growth += Math.abs(q[m]) * motions[at + 3];
    radius += Math.abs(q[m]) * motions[at + 4];
  }
  return {shift, growth, radius};
}

/// Nine numbers for each of these rows, where `nodes.ellipsoid` has them.
export function movedEllipsoids(deformation, q, rows) {
  const {bound} = deformation, out = new Float32Array(bound.length);
  for (const row of rows) {
    const {shift, growth, radius} = motionOf(deformation, row, q);
    for (let k = 0; k < 3; ++k) out[9 * row + k] = bound[9 * row + k] + shift[k];
    const factor = Array.from(bound.subarray(9 * row + 3, 9 * row + 9), (x) => (1 + growth) * x);
    out.set(radius > 0 ? widened(factor, radius) : factor, 9 * row + 3);
  }
  return out;
}

/// The mesh's vertices at coordinates `q`.
export function movedVertices(vertices, displacements, q) {
  const out = vertices.slice();
  for (let m = 0; m < q.length; ++m) {
    if (q[m] === 0) continue;
    const from = m * vertices.length;
    for (let i = 0; i < out.length; ++i) out[i] += q[m] * displacements[from + i];
  }
  return out;
}

const kPeriod = 3; // seconds in which a mode goes to one end of its range, to the other, and back

/// Swings one mode after the other through its range.
export class Player {
  constructor(ranges, onCoordinates) { Object.assign(this, {ranges, onCoordinates, phase: 0}); }
  get playing() { return this.frame !== undefined; }

  play() {
    let last;
    const step = (now) => {
      this.frame = requestAnimationFrame(step);
      // Pictures that take long must not become leaps.
      this.phase = (this.phase + Math.min(now - (last ?? now), 100) / 1000 / kPeriod) % this.ranges.length;
      last = now;
      const mode = Math.floor(this.phase), q = this.ranges[mode] * Math.sin(2 * Math.PI * (this.phase - mode));
      this.onCoordinates(Array.from(this.ranges, (_, m) => (m === mode ? q : 0)));
    };
    this.frame = requestAnimationFrame(step);
  }
  pause() {
    cancelAnimationFrame(this.frame);
    this.frame = undefined;
  }
}
