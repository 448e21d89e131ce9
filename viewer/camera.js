// A camera that orbits around a point, upright. Azimuth and elevation are those of `prolate render --view`.
import {add, clamp, cross, dot, ends, most, normalised, scaled, subtract} from './vector.js';

const kSlope = Math.tan(Math.PI / 180 * 15); // half the picture's height, at distance 1
const kMargin = 0.9; // of the picture is used
// Where the viewer stands at first, degrees.
const kStart = {
  azimuth: 30,
  elevation: 18
};
const radians = (degrees) => degrees * Math.PI / 180;

export class Camera {
  constructor(up) {
    const index = 'xyz'.indexOf(up.at(-1));
    this.worldUp = [0, 0, 0];
    this.worldUp[index] = up.startsWith('-') ? -1 : 1;
    this.front = [[0, 1, 0], [0, 0, 1], [0, -1, 0]][index];
    Object.assign(this, kStart);
    this.target = [0, 0, 0];
    this.distance = 1;
    this.ball = {center: [0, 0, 0], radius: 1};
  }

  /// Shows all of some bodies in a picture of this shape. `extents(direction)`: of each part, how far it reaches along
  /// the direction, [least, most].
  fit(extents, aspect) {
    Object.assign(this, kStart);
    const axes = this.axes(), [right, up, near] = [axes.right, axes.up, scaled(axes.forward, -1)].map(extents);
    const middle = [right, up, near].map(ends).map(([low, high]) => (low + high) / 2);
    this.target = add(add(scaled(axes.right, middle[0]), scaled(axes.up, middle[1])), scaled(axes.forward, -middle[2]));
    // A part whose image is to end within the border needs so much distance at its nearest point.
    const needed = (list, center, slope) => most(
        list,
        ([low, high], i) => Math.max(Math.abs(low - center), Math.abs(high - center)) / slope +
            (near[i][0] + near[i][1]) / 2 - middle[2]);
    this.distance =
        Math.max(needed(right, middle[0], kMargin * kSlope * aspect), needed(up, middle[1], kMargin * kSlope));
  }

  orbit(right, up) { // degrees
    this.azimuth = (this.azimuth + right) % 360;
    this.elevation = clamp(this.elevation + up, -89, 89);
  }
  pan(right, up) { // in heights of the picture, at the target
    const axes = this.axes(), size = 2 * kSlope * this.distance;
    this.target = add(this.target, add(scaled(axes.right, -right * size), scaled(axes.up, -up * size)));
  }
  zoom(factor) { this.distance = clamp(this.distance * factor, 1e-3 * this.ball.radius, 40 * this.ball.radius); }

  axes() {
    const a = radians(this.azimuth), e = radians(this.elevation);
    const level = add(scaled(this.front, Math.cos(a)), scaled(cross(this.worldUp, this.front), Math.sin(a)));
    const forward = scaled(add(scaled(level, Math.cos(e)), scaled(this.worldUp, Math.sin(e))), -1);
    const right = normalised(cross(forward, this.worldUp));
    return {forward, right, up: cross(right, forward), eye: subtract(this.target, scaled(forward, this.distance))};
  }

  /// What shaders need: axes, slopes at the picture's borders, and the range of depths that `ball` takes up.
  lens(aspect) {
    const axes = this.axes();
    const middle = dot(subtract(this.ball.center, axes.eye), axes.forward), reach = 1.02 * this.ball.radius;
    const far = Math.max(middle + reach, 1e-3 * reach);
    return {...axes, slopes: [kSlope * aspect, kSlope], near: Math.max(middle - reach, 1e-3 * far), far};
  }

  /// World length of one picture height at the depth of `p`.
  heightAt(p) {
    const axes = this.axes();
    return 2 * kSlope * Math.max(dot(subtract(p, axes.eye), axes.forward), 1e-3 * this.distance);
  }
}

/// A point of the world in the picture: x, y in -1 ... 1, and its depth; behind the eye the depth is not positive.
export function projected(lens, p) {
  const d = subtract(p, lens.eye), depth = dot(d, lens.forward);
  return {x: dot(d, lens.right) / (depth * lens.slopes[0]), y: dot(d, lens.up) / (depth * lens.slopes[1]), depth};
}
