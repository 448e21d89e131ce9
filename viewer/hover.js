// The node under the pointer: lit up in the picture, and described beside it.
import {idOf} from './body_layers.js';
import {motionOf} from './deformation.js';
import {fillFigures} from './dom.js';
import {grouped, percent, plural, short} from './format.js';

export class Hover {
  constructor(canvas, tip, scene, renderer, state) { Object.assign(this, {canvas, tip, scene, renderer, state}); }

  /// Looks what is at (x, y) of the canvas, once a picture, and shows it.
  at(x, y) {
    if (!this.place)
      requestAnimationFrame(() => {
        const place = this.place;
        this.place = undefined;
        if (place) this.look(...place);
      });
    this.place = [x, y];
  }

  look(x, y) {
    const node = this.renderer.pick(x, y);
    this.state.set({hover: node ? idOf(node.body, node.row) : 0});
    if (!node) return this.hide();
    this.describe(node);
    this.tip.hidden = false;
    const {clientWidth, clientHeight} = this.canvas, {offsetWidth, offsetHeight} = this.tip;
    const left = x + 18 + offsetWidth > clientWidth ? x - 18 - offsetWidth : x + 18;
    const top = Math.min(y + 14, clientHeight - offsetHeight - 8);
    this.tip.style.transform = `translate(${Math.max(8, left)}px, ${Math.max(8, top)}px)`;
  }

  hide() {
    this.place = undefined;
    this.tip.hidden = true;
    this.state.set({hover: 0});
  }

  describe({body: index, row}) {
    const body = this.scene.bodies[index], {nodes} = body;
    const radii = Array.from(nodes.radii.subarray(3 * row, 3 * row + 3));
    const volume = 4 / 3 * Math.PI * radii[0] * radii[1] * radii[2];
    const outside = nodes.outside_volume?.[row], part = nodes.sub_volume?.[row];
    let below = 'leaf';
    if (nodes.children[row] > 0)
      below = plural(nodes.children[row], 'child', 'children');
    else if (nodes.triangles[row] > 0)
      below = `leaf, ${plural(nodes.triangles[row], 'triangle')}`;
    const title = document.createElement('b'), list = document.createElement('dl');
    title.textContent = `Node ${grouped(nodes.slot[row])}` + (this.scene.bodies.length > 1 ? ` of ${'AB'[index]}` : '');
    list.className = 'figures';
    const motion = body.moved && motionOf(body.deformation, row, body.coordinates);
    fillFigures(list, [
      ['level', `${nodes.level[row]}, ${below}`],
      [motion ? 'radii at rest' : 'radii', radii.map((r) => short(r, 3)).join(' · ')],
      ['moved by', motion ? short(Math.hypot(...motion.shift), 3) : undefined],
      ['grown by', motion ? percent(motion.growth, 2) : undefined],
      ['and around by', motion ? short(motion.radius, 2) : undefined],
      ['volume', motion ? undefined : short(volume)],
      [
        'outside volume', outside >= 0 && !motion ? `${short(outside, 3)} (${percent(outside / volume, 2)})` : undefined
      ],
      ['sub-volume', part >= 0 ? `${short(part, 3)} (${percent(part / body.solid_volume, 2)} of all)` : undefined],
    ]);
    this.tip.replaceChildren(title, list);
  }
}
