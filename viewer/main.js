// The viewer: reads the scene, shows it, and listens.
import {Camera} from './camera.js';
import {Player} from './deformation.js';
import {element} from './dom.js';
import {Encounter} from './encounter.js';
import {Hover} from './hover.js';
import {fillSheet, listenToKeys, shortcuts} from './keyboard.js';
import {Panel} from './panel.js';
import {Pointers} from './pointer.js';
import {Renderer} from './renderer.js';
import {ballAround, beside, readScene} from './scene.js';
import {sectionPlane} from './section.js';
import {State} from './state.js';

const kRest = 160; // milliseconds without a change before edges are made smooth
const kSlowest = 1500; // and what a smooth picture may take to be worth it
const kSluggish = 70; // and between pictures that follow each other

const kManyNodes = 256; // to begin with: more are hard to tell apart

/// The finest level that has at most so many nodes.
function finestLevel(body, nodes) { return Math.max(0, body.levels.findLastIndex((level) => level.cut <= nodes)); }

class App {
  constructor() {
    const canvas = element('canvas');
    const scene = this.scene = readScene(), two = scene.bodies.length > 1;
    this.levelCount = Math.max(...scene.bodies.map((body) => body.levels.length));
    const hasMesh = scene.bodies.some((body) => body.mesh), hasInner = scene.bodies.some((body) => body.inner);
    this.deforms = !two && Boolean(scene.bodies[0].deformation);
    this.state = new State({
      level: two ? this.levelCount - 1 : finestLevel(scene.bodies[0], kManyNodes),
      colour: two  ? 'body' :
          hasInner ? 'covers' :
                     'branch',
      coverOpacity: this.deforms && hasMesh && !hasInner ? 0.5 : 1, // so that the mesh is seen to move within
      coverWire: false,
      meshOpacity: hasMesh ? 1 : 0,
      meshWire: false,
      inner: hasInner,
      section: hasInner && !two, // elsewhere the outer cover hides the inner one
      sectionAxis: scene.up.endsWith('y') ? 2 : 1,
      sectionFlip: scene.up.endsWith('z'),
      sectionAt: 0.5,
      coordinates: scene.bodies[0].coordinates,
      playing: false,
      boneAxis: 2,
      drag: 'move',
      hover: 0,
    });
    this.state.onChange((changed) => { // the first to hear: others ask the body
      if (changed.includes('coordinates') || (changed.includes('level') && scene.bodies[0].moved))
        scene.bodies[0].deform(this.state.coordinates, this.state.level);
    });
    this.camera = new Camera(scene.up);
    if (two) { // beside the first as one sees it, so that a drag across the picture brings them together
      scene.startPose ??= beside(...scene.bodies, this.camera.axes().right);
      scene.bodies[1].pose = scene.startPose;
    }
    this.renderer = new Renderer(canvas, scene);
    this.renderer.fitCanvas();
    this.hover = new Hover(canvas, element('tip'), scene, this.renderer, this.state);
    this.pointers = new Pointers(canvas, scene, this.camera, this.renderer, this.state, {
      view: () => this.viewChanged(),
      pose: () => this.poseChanged(),
      hover: (x, y) => this.hover.at(x, y),
      leave: () => this.hover.hide(),
    });
    if (this.deforms)
      this.player = new Player(
          scene.bodies[0].deformation, () => this.state.boneAxis, (coordinates) => this.state.set({coordinates}));
    this.panel = new Panel(this);
    const groups = shortcuts(this);
    fillSheet(element('help-groups'), groups);
    listenToKeys(groups);
    this.state.onChange((changed) => {
      if (changed.includes('level'))
        this.poseChanged();
      else if (changed.length > 1 || changed[0] !== 'hover')
        this.viewChanged();
      else
        this.hoverChanged();
    });
    new ResizeObserver(() => this.renderer.fitCanvas() && this.draw(false)).observe(canvas);
    this.resetView();
  }

  resetView() {
    this.camera.fit((direction) => this.scene.bodies.flatMap((body) => body.extents(direction)), this.renderer.aspect);
    this.viewChanged();
  }
  viewChanged() {
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = undefined;
      if (this.asked) this.encounter?.update();
      this.asked = false;
      this.draw(false);
    });
  }
  hoverChanged() { // what the layers show stays
    if (this.frame || this.glance) return;
    this.glance = requestAnimationFrame(() => {
      this.glance = undefined;
      if (!this.frame) this.renderer.compose(this.look());
    });
  }
  poseChanged() {
    this.asked = true; // once a picture, however many events there are
    this.viewChanged();
  }
  /// With two bodies: the queries between them, once the picture is there.
  async meet() {
    this.encounter = await Encounter.start(this);
    this.poseChanged();
  }
  resetPose() {
    this.scene.bodies[1].pose = this.scene.startPose;
    this.poseChanged();
  }

  togglePlay() {
    const playing = !this.state.playing;
    this.player[playing ? 'play' : 'pause']();
    this.state.set({playing});
  }
  /// Stops, and takes these coordinates.
  deform(coordinates) {
    this.player.pause();
    this.state.set({playing: false, coordinates});
  }
  rest() { this.deform(this.state.coordinates.map(() => 0)); }

  colourings() {
    return [...document.querySelectorAll('[data-state=colour] button')]
        .filter((b) => !b.hidden && !b.disabled)
        .map((b) => b.dataset.value);
  }
  nextColouring() {
    const all = this.colourings();
    this.state.set({colour: all[(all.indexOf(this.state.colour) + 1) % all.length]});
  }
  toggleHelp() {
    const sheet = element('help');
    if (sheet.open)
      sheet.close();
    else
      sheet.showModal();
  }

  /// Where the ramp of outside distances ends at the level shown, % of the diagonal: what is farther is as dark.
  rampEnd() { return Math.max(...this.scene.bodies.map((body) => body.farthest(this.state.level))); }

  /// What is shown, and how.
  look() {
    const {state} = this;
    return {
      level: state.level,
      colouring: state.colour,
      rampEnd: this.rampEnd(),
      coverOpacity: state.coverOpacity,
      coverWire: state.coverWire,
      meshOpacity: state.meshOpacity,
      meshWire: state.meshWire,
      inner: state.inner,
      section: sectionPlane(state, this.scene.bodies),
      hover: state.hover,
      marked: this.marked,
      marks: this.marks,
    };
  }

  /// Smooth pictures would take too long.
  get tooSlow() { return this.smoothTime > kSlowest; }
  /// Nothing will change until the user does something.
  get atRest() { return !this.frame && !this.glance && (this.smooth || (this.tooSlow && this.scale === 1)); }

  draw(smooth) {
    const {camera, renderer} = this, start = performance.now();
    camera.ball = ballAround(this.scene.bodies, 'reach');
    this.scale = smooth ? (this.tooSlow ? 1 : 2) : this.pace(start);
    renderer.draw(camera, this.look(), this.scale);
    clearTimeout(this.resting);
    if (smooth && !this.tooSlow) {
      renderer.finish();
      this.smoothTime = performance.now() - start;
    } else if (!smooth) {
      this.resting = setTimeout(() => this.draw(true), kRest);
    }
    this.smooth = smooth;
  }

  /// The scale of a picture in motion: one half as soon as pictures follow each other too slowly.
  pace(now) {
    const interval = now - this.lastDrawn;
    this.lastDrawn = now;
    if (interval < kRest)
      this.interval = interval; // else it was a pause
    else if (!this.smooth && interval < 1000)
      this.interval = interval;
    return this.interval > kSluggish ? 0.5 : 1;
  }
}

function fail(error) {
  const failure = element('failure');
  failure.textContent = error.message;
  failure.hidden = false;
  throw error;
}

try {
  const app = new App();
  app.draw(false);
  app.renderer.finish();
  performance.mark('first-frame');
  window.viewer = app; // for scripts, and the curious
  if (app.scene.bodies.length > 1) app.meet().catch(fail);
} catch (error) {
  fail(error);
}
