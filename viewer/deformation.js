// How a body moves by its modes (include/prolate/deformation.hpp): at coordinates q its vertices are at x + sum q U(x),
// and what a node stands for lies within r = sum |q| radius of the ellipsoid with center c + sum q shift and factor
// (1 + sum |q| growth) L, where c and L are those of its bound. Bones move what modes have made of it (skinning.js).
//
// A pose is a list of numbers: the coordinates q, then three angles for each bone, radians.
import {boneTransforms, skinnedNode, skinnedVertices} from './skinning.js';

const kMotion = 5; // numbers of a node and mode: the shift, growth and radius
const kMostTurn = 1.5; // radians that a bone is turned here: its bounds hold at any angle
const kSwing = 0.6; // and in play

/// How far each number of a pose goes, either way.
export function posesRanges({ranges, skin}) {
  return [...ranges, ...Array.from({length: 3 * (skin?.parents.length ?? 0)}, () => kMostTurn)];
}

/// The least of some ellipsoids that hold all points within `radius` of {L u: |u| <= 1}, as a lower triangular factor.
/// For every p > 0 that with the matrix (1 + p) L L^T + (1 + 1 / p) radius^2 I does.
export function widened(l, radius) {
  const entry = (i, k) => l[3 * i] * l[3 * k] + l[3 * i + 1] * l[3 * k + 1] + l[3 * i + 2] * l[3 * k + 2];
  const m11 = entry(0, 0), m21 = entry(1, 0), m22 = entry(1, 1), m31 = entry(2, 0), m32 = entry(2, 1),
        m33 = entry(2, 2);
  const size = m11 + m22 + m33, flat = 1e-12 * size; // matrices of bones may flatten
  const factor = (a, b) => {
    const k11 = Math.sqrt(a * m11 + b + flat), k21 = a * m21 / k11, k31 = a * m31 / k11;
    const k22 = Math.sqrt(Math.max(a * m22 + b - k21 * k21, flat)), k32 = (a * m32 - k31 * k21) / k22;
    return [k11, k21, k22, k31, k32, Math.sqrt(Math.max(a * m33 + b - k31 * k31 - k32 * k32, flat))];
  };
  if (radius === 0) return factor(1, 0);
  let best, volume = Infinity;
  for (let step = -4; step <= 4; ++step) {
    const p = radius * Math.sqrt(3 / size) * 2 ** step, k = factor(1 + p, (1 + 1 / p) * radius * radius);
    if (k[0] * k[2] * k[5] < volume) volume = k[0] * k[2] * k[5], best = k;
  }
  return best;
}

/// What modes do to node `row`: how far its bound moves, by what share of itself it grows, and the radius.
export function motionOf({motions, ranges}, row, pose) {
  const shift = [0, 0, 0];
  let growth = 0, radius = 0;
  for (let m = 0; m < ranges.length; ++m) {
    if (pose[m] === 0) continue;
    const at = kMotion * (row * ranges.length + m);
    for (let k = 0; k < 3; ++k) shift[k] += pose[m] * motions[at + k];
    growth += Math.abs(pose[m]) * motions[at + 3];
    radius += Math.abs(pose[m]) * motions[at + 4];
  }
  return {shift, growth, radius};
}

function bonesOf({ranges, skin}, pose) {
  return skin && pose.slice(ranges.length).some((angle) => angle !== 0) ?
      boneTransforms(skin, pose.slice(ranges.length)) :
      undefined;
}

/// Nine numbers for each of these rows, where `nodes.ellipsoid` has them.
export function movedEllipsoids(deformation, pose, rows) {
  const {bound, skin} = deformation, out = new Float32Array(bound.length), bones = bonesOf(deformation, pose);
  for (const row of rows) {
    const {shift, growth, radius} = motionOf(deformation, row, pose);
    const [x, y, z, ...l] = bound.subarray(9 * row, 9 * row + 9), grown = l.map((entry) => (1 + growth) * entry);
    let moved = {
      center: [x + shift[0], y + shift[1], z + shift[2]],
      factor: [grown[0], 0, 0, grown[1], grown[2], 0, grown[3], grown[4], grown[5]],
      radius,
    };
    if (bones) moved = skinnedNode(skin, bones, row, moved, shift, growth * Math.hypot(...l) + radius);
    out.set(moved.center, 9 * row);
    out.set(bones || radius > 0 ? widened(moved.factor, moved.radius) : grown, 9 * row + 3);
  }
  return out;
}

/// Are the places of the mesh's vertices known in this pose?
export function knowsVertices({ranges, displacements}, pose) {
  return Boolean(displacements) || pose.slice(0, ranges.length).every((q) => q === 0);
}

/// The mesh's vertices in a pose in which they are known.
export function movedVertices(vertices, deformation, pose) {
  const out = vertices.slice(), {ranges, displacements} = deformation, bones = bonesOf(deformation, pose);
  for (let m = 0; m < ranges.length; ++m) {
    if (pose[m] === 0) continue;
    const from = m * vertices.length;
    for (let i = 0; i < out.length; ++i) out[i] += pose[m] * displacements[from + i];
  }
  return bones ? skinnedVertices(out, deformation.skin, bones) : out;
}

const kPeriod = 3; // seconds in which a mode goes to one end of its range, to the other, and back

/// Swings one mode after the other through its range, and each bone about the axis 0, 1 or 2.
export class Player {
  constructor(deformation, axis, onPose) {
    const bones = deformation.skin?.parents.length ?? 0, modes = deformation.ranges.length;
    Object.assign(this, {onPose, phase: 0, size: modes + 3 * bones});
    this.moves = () =>
        [...Array.from(deformation.ranges, (range, m) => ({at: m, range})),
         ...Array.from({length: bones}, (_, b) => ({at: modes + 3 * b + axis(), range: kSwing})),
    ];
  }

  play() {
    let last;
    const step = (now) => {
      this.frame = requestAnimationFrame(step);
      const moves = this.moves();
      // Pictures that take long must not become leaps.
      this.phase = (this.phase + Math.min(now - (last ?? now), 100) / 1000 / kPeriod) % moves.length;
      last = now;
      const {at, range} = moves[Math.floor(this.phase)], pose = Array(this.size).fill(0);
      pose[at] = range * Math.sin(2 * Math.PI * (this.phase % 1));
      this.onPose(pose);
    };
    this.frame = requestAnimationFrame(step);
  }
  pause() { cancelAnimationFrame(this.frame); }
}
