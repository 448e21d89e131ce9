// The section plane: along an axis of the world, anywhere between the ends of the bodies.
import {ballAround} from './scene.js';

/// {normal, offset}: points p with dot(normal, p) < offset are shown. Undefined if there is no section.
export function sectionPlane(state, bodies) {
  if (!state.section) return undefined;
  const {low, high} = ballAround(bodies), axis = state.sectionAxis, side = state.sectionFlip ? -1 : 1;
  const normal = [0, 0, 0];
  normal[axis] = side;
  return {normal, offset: side * (low[axis] + state.sectionAt * (high[axis] - low[axis]))};
}
