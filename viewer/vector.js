// Vectors are arrays of three numbers, quaternions x, y, z, w, poses {translation, rotation} as prolate::Pose: rotate,
// then translate. Matrices are arrays of 16, column by column, as WebGL takes them.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scaled = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const normalised = (a) => scaled(a, 1 / length(a));
export const clamp = (x, low, high) => Math.min(Math.max(x, low), high);

/// Of lists of any length; Math.min(...list) has as many arguments as the list is long, and browsers limit these.
export const least = (list, value) => list.reduce((soFar, item, i) => Math.min(soFar, value(item, i)), Infinity);
export const most = (list, value) => list.reduce((soFar, item, i) => Math.max(soFar, value(item, i)), -Infinity);
/// Where intervals [low, high] begin and end together.
export const ends = (list) => [least(list, (one) => one[0]), most(list, (one) => one[1])];

export const kIdentity = Object.freeze({translation: [0, 0, 0], rotation: [0, 0, 0, 1]});

export function aboutAxis(axis, angle) {
  const s = Math.sin(angle / 2);
  return [axis[0] * s, axis[1] * s, axis[2] * s, Math.cos(angle / 2)];
}

export function multiplied(p, q) { // first q, then p
  const v = add(add(scaled(q, p[3]), scaled(p, q[3])), cross(p, q));
  return [...v, p[3] * q[3] - dot(p, q)];
}

export function normalisedRotation(q) {
  const size = Math.hypot(...q);
  return q.map((x) => x / size);
}

export function rotated(q, v) {
  const t = scaled(cross(q, v), 2);
  return add(add(v, scaled(t, q[3])), cross(q, t));
}

export const toWorld = (pose, p) => add(rotated(pose.rotation, p), pose.translation);
export const directionToBody = (pose, v) =>
    rotated([-pose.rotation[0], -pose.rotation[1], -pose.rotation[2], pose.rotation[3]], v);
export const toBody = (pose, p) => directionToBody(pose, subtract(p, pose.translation));
