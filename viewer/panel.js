// The controls beside the picture, and the figures of what is shown.
import {ramp} from './colours.js';
import {element, fillFigures} from './dom.js';
import {grouped, percent, plural, short} from './format.js';

export class Panel {
  constructor(app) {
    this.app = app;
    const {scene, state} = app;
    this.names();
    this.range('level', 'level', (x) => x);
    element('level').max = app.levelCount - 1;
    for (let l = 0; l < app.levelCount; ++l) element('level-marks').append(new Option('', l));
    this.range('cover-opacity', 'coverOpacity', (x) => x);
    this.range('mesh-opacity', 'meshOpacity', (x) => x);
    this.range('section-at', 'sectionAt', (x) => x, {section: true});
    this.check('cover-wire', 'coverWire');
    this.check('mesh-wire', 'meshWire');
    this.check('section-on', 'section');
    this.check('inner-on', 'inner');
    element('section-flip')
        .addEventListener('click', () => state.set({section: true, sectionFlip: !state.sectionFlip}));
    element('reset-view').addEventListener('click', () => app.resetView());
    element('help-open').addEventListener('click', () => app.toggleHelp());
    for (const group of document.querySelectorAll('[data-state]')) this.choice(group);

    if (app.deforms) this.modes();
    const hasMesh = scene.bodies.some((body) => body.mesh), hasDistances = scene.bodies.some((body) => body.lattice);
    element('mesh-row').hidden = !hasMesh;
    const hasInner = scene.bodies.some((body) => body.inner);
    element('inner-row').hidden = !hasInner;
    this.button('colour', 'covers').hidden = !hasInner || scene.bodies.length > 1;
    this.button('colour', 'body').hidden = scene.bodies.length < 2;
    this.button('colour', 'outside').disabled = !hasDistances;
    if (!hasDistances)
      element('colour-note').textContent = 'Name the mesh after the tree to see how far ellipsoids stick out.';
    const legend = element('legend-ramp').getContext('2d'), pixels = legend.createImageData(256, 1);
    pixels.data.set(ramp(256));
    legend.putImageData(pixels, 0, 0);
    state.onChange(() => this.refresh());
    this.refresh();
  }

  names() {
    const {bodies} = this.app.scene;
    const plain = (body) => body.tree + (body.mesh_name ? ` with ${body.mesh_name}` : '');
    const title = bodies.map((body) => body.tree).join(' and ');
    document.title = `${title} – prolate`;
    element('title').textContent = title;
    const kind = (body) => (body.exact ? 'exact tree' : `ellipsoid tree${body.proved ? ', cover proved' : ''}`) +
        (body.surface ? ', open mesh' : '');
    element('subtitle').textContent = bodies.length > 1 ?
        bodies.map((body, i) => `${'AB'[i]}: ${plain(body)}`).join('; ') :
        kind(bodies[0]) + (bodies[0].mesh ? ` · ${grouped(bodies[0].mesh.triangles.length / 3)} triangles` : '');
  }

  // A slider for each mode, over its range, and for each bone.
  modes() {
    const {app} = this, {ranges, skin} = app.scene.bodies[0].deformation;
    element('deformation').hidden = false;
    element('bone-axis').hidden = !skin;
    this.moves = [
      ...Array.from(ranges, (range, m) => ({name: `mode ${m + 1}`, range, at: () => m})),
      ...Array.from(
          skin?.bones ?? [], (name, b) => ({name, range: 1.5, at: () => ranges.length + 3 * b + app.state.boneAxis})),
    ];
    element('modes').append(...this.moves.map(({name, range, at}, i) => {
      const row = document.createElement('div'), label = document.createElement('label'),
            input = document.createElement('input'), text = document.createElement('output');
      row.className = 'row';
      Object.assign(label, {htmlFor: `mode-${i}`, textContent: name, title: name});
      Object.assign(input, {id: `mode-${i}`, type: 'range', min: -range, max: range, step: range / 100, value: 0});
      input.addEventListener('input', () => {
        const value = Math.abs(input.valueAsNumber) < range / 200 ? 0 : input.valueAsNumber, place = at();
        app.deform(app.state.coordinates.map((x, k) => (k === place ? value : x)));
      });
      row.append(label, input, text);
      return row;
    }));
    element('play').addEventListener('click', () => app.togglePlay());
    element('at-rest').addEventListener('click', () => app.rest());
  }

  range(id, name, read, also = {}) {
    const input = element(id);
    input.addEventListener('input', () => this.app.state.set({...also, [name]: read(input.valueAsNumber)}));
  }
  check(id, name) {
    const input = element(id);
    input.addEventListener('change', () => this.app.state.set({[name]: input.checked}));
  }
  choice(group) {
    const name = group.dataset.state;
    for (const button of group.children)
      button.addEventListener('click', () => {
        const value = typeof this.app.state[name] === 'number' ? Number(button.dataset.value) : button.dataset.value;
        this.app.state.set({[name]: value, ...(name === 'sectionAxis' ? {section: true} : {})});
      });
  }
  button(group, value) { return document.querySelector(`[data-state=${group}] [data-value=${value}]`); }

  refresh() {
    const {state, scene} = this.app;
    const values = {
      'level': state.level,
      'cover-opacity': state.coverOpacity,
      'mesh-opacity': state.meshOpacity,
      'section-at': state.sectionAt
    };
    for (const [id, value] of Object.entries(values)) element(id).value = value;
    for (const [id, value] of [
             ['cover-wire', state.coverWire], ['mesh-wire', state.meshWire], ['section-on', state.section],
             ['inner-on', state.inner]])
      element(id).checked = value;
    for (const group of document.querySelectorAll('[data-state]'))
      for (const button of group.children)
        button.setAttribute('aria-checked', String(state[group.dataset.state]) === button.dataset.value);

    const {moved} = scene.bodies[0];
    if (this.app.deforms) this.refreshModes();

    const levels = scene.bodies.map((body) => body.levels[Math.min(state.level, body.levels.length - 1)]);
    const count = levels.map((level) => grouped(level.cut)).join(' + ');
    const text = document.createElement('b');
    text.textContent = state.level;
    const words = levels.length > 1 ? count : plural(levels[0].cut, 'ellipsoid');
    element('level-text').replaceChildren(text, ` of ${this.app.levelCount - 1} · ${words}`);
    if (scene.bodies.length === 1) {
      const {outside_ratio: ratio, percent_of_diagonal: far} = levels[0], {inner} = scene.bodies[0];
      const within = inner && inner.cuts[Math.min(state.level, inner.levels - 1)];
      fillFigures(element('level-figures'), moved ? [] : [
        // which are of the body at rest
        ['inside the solid', within && `${plural(within.nodes, 'ellipsoid')}, ${percent(within.share)} of it`],
        ['outside volume', ratio === null ? undefined : `${percent(ratio)} of the solid`],
        ['farthest out', far.hausdorff_max === null ? undefined : `${short(far.hausdorff_max, 3)} % of diagonal`],
        ['on average', far.hausdorff_mean === null ? undefined : `${short(far.hausdorff_mean, 3)} % of diagonal`],
      ]);
    }
    element('legend-covers').hidden = state.colour !== 'covers';
    element('legend').hidden = state.colour !== 'outside' || moved;
    const end = this.app.rampEnd();
    [...element('legend-ticks').children].forEach((tick, i) => {
      tick.textContent = (i === 2 ? '≥ ' : '') + short(end * i / 2, 2);
    });
  }

  refreshModes() {
    const {state, scene} = this.app, [{moved, mesh, showsMesh, levels}] = scene.bodies;
    const modes = scene.bodies[0].deformation.ranges.length;
    [...element('modes').children].forEach((row, i) => {
      const value = state.coordinates[this.moves[i].at()];
      row.children[1].value = value;
      row.children[2].textContent = i < modes ? short(value, 3) : `${Math.round(180 / Math.PI * value)}°`;
    });
    element('play').textContent = state.playing ? 'pause' : 'play';
    const words = ['Each ellipsoid holds its part of the mesh, wherever these move it.'];
    if (moved && state.level < levels.length - 1) words.push('Above the last level they hold all leaves below, too.');
    if (moved && mesh && !showsMesh) words.push('To see the mesh move, name its modes: view --modes.');
    if (moved && scene.bodies[0].inner) words.push('Its inner cover is known at rest only.');
    if (moved && state.colour === 'outside') words.push('Distances are known at rest only.');
    element('deformation-note').textContent = words.join(' ');
  }
}
