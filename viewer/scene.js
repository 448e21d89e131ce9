// The scene that `prolate view` has put into the page: a description in JSON, and a block of numbers that it refers to.
import {knowsVertices, movedEllipsoids, movedVertices, posesRanges} from './deformation.js';
import {element} from './dom.js';
import {add, clamp, directionToBody, dot, ends, kIdentity, scaled, subtract, toWorld} from './vector.js';

const kArrays = {
  f32: Float32Array,
  u32: Uint32Array,
  u16: Uint16Array,
  u8: Uint8Array
};

export function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64); // of 2025, and many times as fast
  const text = atob(base64.trim());
  return Uint8Array.from({length: text.length}, (_, i) => text.charCodeAt(i));
}

function fromHalf(bits) {
  const exponent = bits >> 10 & 31, fraction = bits & 1023, sign = bits & 0x8000 ? -1 : 1;
  return sign * (exponent === 0 ? fraction * 2 ** -24 : (1 + fraction / 1024) * 2 ** (exponent - 15));
}

// Rows of the nodes of the level `last` and of the leaves above it.
function cutOf(nodes, last) {
  const rows = [];
  for (let row = 0; row < nodes.slot.length; ++row) {
    const own = nodes.level[row];
    if (own === last || (own < last && nodes.children[row] === 0)) rows.push(row);
  }
  return rows;
}

/// A body: its description, with typed arrays in place of references; boxes; and where it is.
class Body {
  constructor(description, buffer) {
    const resolve = (value) => {
      if (Array.isArray(value)) return value.map(resolve);
      if (value === null || typeof value !== 'object') return value;
      if (value.type in kArrays && 'at' in value) return new kArrays[value.type](buffer, value.at, value.count);
      return Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, resolve(inner)]));
    };
    Object.assign(this, resolve(description));
    this.pose = kIdentity;
    this.version = 0; // another one for each change of shape
    // What the camera looks at: all but the root, which by far sticks out the most; and what it must not cut off.
    const rows = Array.from(this.nodes.slot.keys());
    this.deform(this.deformation ? posesRanges(this.deformation).map(() => 0) : [], 0);
    this.box = this.boxOf(rows.length > 1 ? rows.slice(1) : rows);
  }

  /// Moves the body by its modes and bones: what `ellipsoid` and `vertices` hold from now on. At rest, ellipsoids are
  /// those of the levels; else the bounds, which queries of deforming bodies ask, and only those of the cut at `level`:
  /// the others would take too long where a body moves.
  deform(pose, level) {
    const {deformation, mesh, nodes} = this;
    this.coordinates = pose;
    this.moved = pose.some((x) => x !== 0);
    const shown = this.moved ? this.cut(level) : Array.from(nodes.slot.keys());
    this.ellipsoid = this.moved ? movedEllipsoids(deformation, pose, shown) : nodes.ellipsoid;
    this.showsMesh = Boolean(mesh && (!this.moved || knowsVertices(deformation, pose)));
    this.vertices = this.moved && this.showsMesh ? movedVertices(mesh.vertices, deformation, pose) : mesh?.vertices;
    this.reach = this.boxOf(shown);
    ++this.version;
  }

  get nodeCount() { return this.nodes.slot.length; }

  /// Rows of the nodes of the cut at `level`, and of that of the inner cover.
  cut(level) { return cutOf(this.nodes, Math.min(level, this.levels.length - 1)); }
  innerCut(level) { return cutOf(this.inner.nodes, Math.min(level, this.inner.levels - 1)); }

  center(row) { return Array.from(this.ellipsoid.subarray(9 * row, 9 * row + 3)); }

  /// Axis-aligned box of these nodes' ellipsoids, in the body's frame.
  boxOf(rows) {
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    for (const row of rows) {
      const e = this.ellipsoid.subarray(9 * row, 9 * row + 9);
      const half = [e[3], Math.hypot(e[4], e[5]), Math.hypot(e[6], e[7], e[8])];
      for (let i = 0; i < 3; ++i) {
        low[i] = Math.min(low[i], e[i] - half[i]);
        high[i] = Math.max(high[i], e[i] + half[i]);
      }
    }
    return {low, high};
  }

  /// How far nearly all of the cut at `level` is from the solid at most, % of the diagonal: the 99th percentile that
  /// the bake has measured, or else what the tips of its ellipsoids tell.
  farthest(level) {
    const known = this.levels[Math.min(level, this.levels.length - 1)].percent_of_diagonal.hausdorff_p99;
    if (known > 0) return known;
    this.tips ??= [];
    if (this.tips[level]) return this.tips[level];
    let most = 1e-3;
    if (this.lattice)
      for (const row of this.cut(level)) {
        const [x, y, z, l11, l21, l22, l31, l32, l33] = this.nodes.ellipsoid.subarray(9 * row, 9 * row + 9);
        for (const side of [-1, 1])
          for (const column of [[l11, l21, l31], [0, l22, l32], [0, 0, l33]])
            most = Math.max(most, this.distanceAt(add([x, y, z], scaled(column, side))));
      }
    return (this.tips[level] = most);
  }

  /// Of the lattice node that is nearest to `p`, % of the diagonal.
  distanceAt(p) {
    const {origin, pitch, size, distance} = this.lattice;
    const [i, j, k] = p.map((x, a) => clamp(Math.round((x - origin[a]) / pitch), 0, size[a] - 1));
    return fromHalf(distance[(k * size[1] + j) * size[0] + i]);
  }

  /// How far each ellipsoid but the root's reaches along a direction of the world: [[least, most], ...]; of a body that
  /// deforms, at the ends of each mode's range, too, those of few nodes.
  extents(direction) {
    const {nodes, deformation, coordinates} = this;
    const rows = Array.from(nodes.slot.keys()).slice(this.nodeCount > 1 ? 1 : 0);
    const out = this.extentsOf(nodes.ellipsoid, rows, direction);
    const level = Math.max(1, this.levels.findLastIndex((one) => one.cut <= 64));
    const few = deformation ? this.cut(level) : [];
    for (const end of few.length > 0 ? [-1, 1] : [])
      for (let m = 0; m < deformation.ranges.length; ++m) {
        const q = coordinates.map((_, i) => (i === m ? end * deformation.ranges[m] : 0));
        out.push(...this.extentsOf(movedEllipsoids(deformation, q, few), few, direction));
      }
    return out;
  }
  extentsOf(ellipsoids, rows, direction) {
    const d = directionToBody(this.pose, direction), start = dot(direction, this.pose.translation), out = [];
    for (const row of rows) {
      const [x, y, z, l11, l21, l22, l31, l32, l33] = ellipsoids.subarray(9 * row, 9 * row + 9);
      const middle = start + d[0] * x + d[1] * y + d[2] * z;
      const half = Math.hypot(l11 * d[0] + l21 * d[1] + l31 * d[2], l22 * d[1] + l32 * d[2], l33 * d[2]);
      out.push([middle - half, middle + half]);
    }
    return out;
  }

  get middle() { return scaled(add(this.box.low, this.box.high), 0.5); }
}

export function readScene() {
  const text = (id) => element(id).textContent;
  const description = JSON.parse(text('scene')), buffer = bytesOf(text('numbers')).buffer;
  const bodies = description.bodies.map((one) => new Body(one, buffer));
  const pose = description.pose && {translation: description.pose.slice(0, 3), rotation: description.pose.slice(3)};
  return {version: description.version, up: description.up, bodies, startPose: pose, queries: text('queries').trim()};
}

/// A pose for body b beside body a, in this direction of the world, and clear of it.
export function beside(a, b, direction) {
  const [lowA, highA] = ends(a.extents(direction)), [lowB, highB] = ends(b.extents(direction));
  const apart = subtract(a.middle, b.middle);
  const push = highA - lowB + 0.15 * (highA - lowA + highB - lowB) - dot(apart, direction);
  return {translation: add(apart, scaled(direction, push)), rotation: [0, 0, 0, 1]};
}

/// A ball around all bodies where they are; `box` names the boxes to go by.
export function ballAround(bodies, box = 'box') {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const body of bodies)
    for (let corner = 0; corner < 8; ++corner) {
      const p = toWorld(body.pose, [0, 1, 2].map((i) => (corner >> i & 1 ? body[box].high : body[box].low)[i]));
      for (let i = 0; i < 3; ++i) low[i] = Math.min(low[i], p[i]), high[i] = Math.max(high[i], p[i]);
    }
  const center = scaled(add(low, high), 0.5);
  return {center, low, high, radius: Math.hypot(...[0, 1, 2].map((i) => high[i] - low[i])) / 2};
}
