// Colours that are not the nodes' own. Readers with any common colour vision can tell them apart: bodies and marks come
// from the palette of Okabe and Ito, as the nodes' colours do, and the ramp is ColorBrewer's YlGnBu (C. Brewer 2003):
// what is near the solid is light.
import {clamp} from './vector.js';

const rgb = (hex) => [16, 8, 0].map((shift) => ((hex >> shift) & 255) / 255);

export const kBodyColours = [rgb(0x56b4e9), rgb(0xc9b38c)];
export const kContact = rgb(0xd55e00);
export const kOuter = rgb(0xe69f00); // of covers that are told apart from inner ones, not node from node
export const kInner = rgb(0x2b7196); // as `prolate render` has it
export const kMesh = rgb(0xc9c7c2);
export const kMeshInside = rgb(0x8d8a84);
export const kWitness = rgb(0x1c2126);

const kYellowToBlue = [0xffffd9, 0xedf8b1, 0xc7e9b4, 0x7fcdbb, 0x41b6c4, 0x1d91c0, 0x225ea8, 0x253494, 0x081d58];

/// Red, green and blue bytes of the ramp at `size` places from 0 to 1, with an opaque alpha.
export function ramp(size) {
  const out = new Uint8Array(4 * size), stops = kYellowToBlue.map(rgb);
  for (let i = 0; i < size; ++i) {
    const at = i / (size - 1) * (stops.length - 1), k = clamp(Math.floor(at), 0, stops.length - 2);
    for (let c = 0; c < 3; ++c)
      out[4 * i + c] = Math.round(255 * (stops[k][c] + (at - k) * (stops[k + 1][c] - stops[k][c])));
    out[4 * i + 3] = 255;
  }
  return out;
}
