// Draws the scene: ellipsoids into one layer, meshes into another, and the two into a picture. While something moves,
// at the screen's own resolution, or half of it where that is slow; once at rest, at twice: smooth edges.
import {BodyLayers, nodeOf} from './body_layers.js';
import {ramp} from './colours.js';
import {kCoverFragment, kCoverVertex} from './cover_shader.js';
import {bindTexture, Program, Target} from './gl.js';
import {Marks} from './marks.js';
import {kCapFragment, kCapVertex, kMeshFragment, kMeshVertex} from './mesh_shader.js';
import {kPictureFragment, kScalingFragment, kWholeVertex} from './picture_shader.js';
import {add, directionToBody, dot, normalised, scaled, toBody} from './vector.js';

const kMostPixels = 9e6; // of a smooth picture
const kSources = {
  cover: [kCoverVertex, kCoverFragment],
  mesh: [kMeshVertex, kMeshFragment],
  cap: [kCapVertex, kCapFragment],
  picture: [kWholeVertex, kPictureFragment],
  scaling: [kWholeVertex, kScalingFragment],
};

export class Renderer {
  constructor(canvas, scene) {
    const gl = this.gl = canvas.getContext(
        'webgl2', {alpha: false, antialias: false, depth: false, powerPreference: 'high-performance'});
    if (!gl) throw new Error('This page needs WebGL 2, which this browser or its settings do not offer.');
    this.canvas = canvas;
    this.bodies = scene.bodies;
    this.layers = scene.bodies.map((body, i) => new BodyLayers(gl, body, i));
    this.programs = {};
    this.cover = new Target(gl, {colour: gl.RGBA8, id: gl.R32UI, depth: gl.DEPTH_COMPONENT24});
    this.mesh = new Target(gl, {colour: gl.RGBA8, depth: gl.DEPTH24_STENCIL8});
    this.other = new Target(gl, {colour: gl.RGBA8}); // the picture, if it is not drawn at the screen's size
    this.marks = new Marks(gl);
    this.ramp = gl.createTexture();
    bindTexture(gl, 1, this.ramp);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, ramp(256));
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
    this.nothing = gl.createVertexArray(); // WebGL wants one even where no attribute is read
  }

  /// Compiled when first needed.
  program(name, switches = {}) {
    return this.programs[name + JSON.stringify(switches)] ??= new Program(this.gl, ...kSources[name], switches);
  }

  /// Pixels of the screen for one of the page, and the picture's shape.
  get pixelRatio() { return this.canvas.width / Math.max(1, this.canvas.clientWidth); }
  get aspect() { return this.canvas.width / this.canvas.height; }

  /// True if the canvas has changed its size.
  fitCanvas() {
    const ratio = window.devicePixelRatio || 1;
    const width = Math.max(1, Math.round(this.canvas.clientWidth * ratio)),
          height = Math.max(1, Math.round(this.canvas.clientHeight * ratio));
    if (this.canvas.width === width && this.canvas.height === height) return false;
    Object.assign(this.canvas, {width, height});
    return true;
  }

  /// `look`: what is shown and how (App.look()). `wanted`: pixels drawn for one of the screen, along each side: 2 gives
  /// smooth edges, 1/2 is fast.
  draw(camera, look, wanted) {
    const gl = this.gl, {width, height} = this.canvas;
    const scale = this.scale = wanted > 1 && wanted ** 2 * width * height > kMostPixels ? 1 : wanted;
    for (const target of [this.cover, this.mesh]) target.resize(Math.ceil(scale * width), Math.ceil(scale * height));
    const lens = this.lens = camera.lens(this.aspect);
    this.layers.forEach((layers, i) => layers.show(look.level, look.marked?.[i]));

    const line = scale * this.pixelRatio; // one pixel of the page
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LESS);
    this.cover.bind();
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferuiv(gl.COLOR, 1, [0, 0, 0, 0]);
    gl.clearBufferfv(gl.DEPTH, 0, [1]);
    bindTexture(gl, 1, this.ramp);
    if (look.coverOpacity > 0)
      for (const layers of this.layers)
        layers.drawCover(
            (switches) => this.program('cover', switches), this.viewOf(layers.body, lens, look.section),
            {...look, wire: look.coverWire, line});
    // Elsewhere the cover hides what is inside.
    if (look.coverOpacity > 0 && look.inner && (look.section || look.coverWire))
      for (const layers of this.layers)
        layers.drawInner(
            (switches) => this.program('cover', switches), this.viewOf(layers.body, lens, look.section), look);
    this.mesh.bind();
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.clearBufferfi(gl.DEPTH_STENCIL, 0, 1, 0);
    // A proved cover hides its mesh.
    const hidden =
        look.coverOpacity === 1 && !look.coverWire && !look.section && this.bodies.every((body) => body.covers);
    if (look.meshOpacity > 0 && !hidden)
      for (const layers of this.layers) {
        const view = this.viewOf(layers.body, lens, look.section);
        layers.drawMesh(this.program('mesh'), view, {wire: look.meshWire, line});
        if (look.section && dot(look.section.normal, lens.eye) > look.section.offset)
          layers.drawCap(this.program('mesh'), this.program('cap'), view, this.nothing);
      }
    this.compose(look);
  }

  /// The picture anew from the layers as they were drawn.
  compose(look) {
    const gl = this.gl, {width, height} = this.canvas, {scale, lens} = this;
    gl.disable(gl.DEPTH_TEST);
    gl.bindVertexArray(this.nothing);
    if (scale !== 1) {
      this.other.resize(this.cover.width, this.cover.height);
      this.other.bind();
    } else {
      this.bindCanvas();
    }
    [this.cover.textures.colour, this.cover.textures.depth, this.cover.textures.id, this.mesh.textures.colour,
     this.mesh.textures.depth]
        .forEach((texture, unit) => bindTexture(gl, unit, texture));
    this.program('picture').use({
      u_cover: 0,
      u_cover_depth: 1,
      u_id: 2,
      u_mesh: 3,
      u_mesh_depth: 4,
      u_opacity: [look.coverOpacity, look.meshOpacity],
      u_hover: look.hover ?? 0,
      u_line: Math.max(1, Math.round(scale * this.pixelRatio / 2)),
      u_outlines: !look.coverWire,
      u_mesh_outlines: !look.meshWire,
    });
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    if (scale !== 1) {
      this.bindCanvas();
      bindTexture(gl, 0, this.other.textures.colour);
      this.program('scaling').use({u_picture: 0});
      gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    }
    this.marks.draw(look.marks ?? [], lens, width, height, this.pixelRatio);
  }

  /// Waits until all that was drawn is there: only reading makes sure of that.
  finish() {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));
  }

  bindCanvas() {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, null);
    this.gl.viewport(0, 0, this.canvas.width, this.canvas.height);
  }

  // The camera, the light and the section as a body sees them.
  viewOf({pose}, lens, section) {
    const turned = (v) => directionToBody(pose, v);
    const key = normalised(add(add(scaled(lens.right, -0.45), scaled(lens.up, 0.62)), scaled(lens.forward, -0.65)));
    const cut =
        section ? [...turned(section.normal), section.offset - dot(section.normal, pose.translation)] : [0, 0, 0, 0];
    return {
      u_eye: toBody(pose, lens.eye),
      u_right: scaled(turned(lens.right), lens.slopes[0]),
      u_up: scaled(turned(lens.up), lens.slopes[1]),
      u_forward: turned(lens.forward),
      u_depth: [lens.far / (lens.far - lens.near), lens.far * lens.near / (lens.far - lens.near)],
      u_range: [lens.near, lens.far],
      u_key: turned(key),
      u_sky: turned(lens.up),
      u_section: cut,
    };
  }

  /// The node that the last picture shows at a pixel of the page: {body, row}, or null.
  pick(x, y) {
    const gl = this.gl, size = this.scale * this.pixelRatio, id = new Uint32Array(1);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.cover.frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT1);
    gl.readPixels(
        Math.floor(x * size), this.cover.height - 1 - Math.floor(y * size), 1, 1, gl.RED_INTEGER, gl.UNSIGNED_INT, id);
    return nodeOf(id[0]);
  }

  /// How many different nodes the last picture shows.
  visibleNodes() {
    const gl = this.gl, {width, height} = this.cover, ids = new Uint32Array(width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.cover.frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT1);
    gl.readPixels(0, 0, width, height, gl.RED_INTEGER, gl.UNSIGNED_INT, ids);
    const seen = new Set(ids);
    seen.delete(0);
    return seen.size;
  }

  /// Ellipsoids that are drawn, seen or hidden.
  get drawn() { return this.layers.reduce((sum, layers) => sum + layers.count, 0); }
}
