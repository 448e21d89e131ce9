// How bones move a body by linear blend skinning (include/prolate/skin.hpp). A transform is {linear: nine numbers, row
// by row, translation: three}.
import {add, length, scaled, subtract} from './vector.js';

const kStill = {
  linear: [1, 0, 0, 0, 1, 0, 0, 0, 1],
  translation: [0, 0, 0]
};

const times = (a, v) => [0, 3, 6].map((r) => a[r] * v[0] + a[r + 1] * v[1] + a[r + 2] * v[2]);
const product = (a, b) => a.map((_, i) => [0, 1, 2].reduce((sum, k) => sum + a[i - i % 3 + k] * b[3 * k + i % 3], 0));
const applied = (t, p) => add(times(t.linear, p), t.translation);
const plus = (a, s, b) => ({
  linear: a.linear.map((x, i) => x + s * b.linear[i]),
  translation: add(a.translation, scaled(b.translation, s)),
});
/// No less than |A v| / |v|: |A|^2 is the largest eigenvalue of A^T A, which no row sum is below.
function norm(a) {
  const column = (k) => [a[k], a[3 + k], a[6 + k]],
        entry = (i, k) => column(i).reduce((s, x, r) => s + x * column(k)[r], 0);
  const rows = [0, 1, 2].map((i) => Math.abs(entry(i, 0)) + Math.abs(entry(i, 1)) + Math.abs(entry(i, 2)));
  return Math.sqrt(Math.min(Math.max(...rows), entry(0, 0) + entry(1, 1) + entry(2, 2)));
}

/// Turns about the axes x, y, z through `joint`, one after the other.
function turned([x, y, z], joint) {
  const [a, b, c] = [x, y, z].map(Math.cos), [i, j, k] = [x, y, z].map(Math.sin);
  const linear =
      product(product([c, -k, 0, k, c, 0, 0, 0, 1], [b, 0, j, 0, 1, 0, -j, 0, b]), [1, 0, 0, 0, a, -i, 0, i, a]);
  return {linear, translation: subtract(joint, times(linear, joint))};
}

/// The bones' transforms where each is turned about its joint, and takes those below it along. `angles`: three for
/// each.
export function boneTransforms({parents, joints}, angles) {
  const out = [];
  const find = (bone) => {
    if (out[bone]) return out[bone];
    out[bone] = kStill; // what is above may be a circle
    const own = turned(angles.slice(3 * bone, 3 * bone + 3), Array.from(joints.subarray(3 * bone, 3 * bone + 3)));
    const parent = parents[bone] === bone ? kStill : find(parents[bone]);
    return out[bone] = {linear: product(parent.linear, own.linear), translation: applied(parent, own.translation)};
  };
  parents.forEach((_, bone) => find(bone));
  return out;
}

/// What holds the node `row` that {center, factor, radius} held before the bones moved it: the bound of skin.hpp.
/// `shift` and `spread`: by how much modes have moved its vertices, all alike and otherwise.
export function skinnedNode(skin, bones, row, {center, factor, radius}, shift, spread) {
  const influences = [];
  for (let n = skin.first[row]; n < skin.first[row + 1]; ++n) {
    const [weight, differs, x, y, z, r] = skin.influences.subarray(6 * n, 6 * n + 6);
    influences.push(
        {bone: bones[skin.influence_bones[n]], weight, differs, ball: add([x, y, z], shift), r: r + spread});
  }
  const nothing = {linear: Array(9).fill(0), translation: [0, 0, 0]};
  const mean = influences.reduce((sum, of) => plus(sum, of.weight, of.bone), nothing);
  const around = Math.max(...influences.map((of) => length(subtract(of.ball, center)) + of.r));
  let longest = 0, sum = 0;
  for (const of of influences) {
    const off = plus(of.bone, -1, mean), stretch = norm(off.linear);
    longest = Math.max(longest, length(applied(off, of.ball)) + stretch * of.r);
    sum += of.differs * (length(applied(off, center)) + stretch * around);
  }
  return {
    center: applied(mean, center),
    factor: product(mean.linear, factor),
    radius: norm(mean.linear) * radius + Math.min(longest, sum),
  };
}

/// Vertices where bones move them.
export function skinnedVertices(vertices, {each, indices, weights}, bones) {
  const out = new Float32Array(vertices.length);
  for (let v = 0; 3 * v < vertices.length; ++v) {
    const x = vertices[3 * v], y = vertices[3 * v + 1], z = vertices[3 * v + 2];
    let whole = 0;
    for (let i = each * v; i < each * (v + 1); ++i) whole += weights[i];
    for (let i = each * v; i < each * (v + 1); ++i) {
      if (weights[i] === 0) continue;
      const {linear: m, translation: t} = bones[indices[i]], share = weights[i] / whole;
      for (let k = 0; k < 3; ++k) out[3 * v + k] += share * (m[3 * k] * x + m[3 * k + 1] * y + m[3 * k + 2] * z + t[k]);
    }
  }
  return out;
}
