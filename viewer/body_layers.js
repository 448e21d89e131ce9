// A body's buffers: the ellipsoids of the cut that is shown, the mesh, and the distances around the solid.
import {kBodyColours, kContact, kInner, kMesh, kMeshInside, kOuter} from './colours.js';
import {bindTexture, vertexArray} from './gl.js';

const kRowBits = 28; // of an id: the node's row + 1; above it the body, ...
const kInnerBit = 8; // ... and this bit if it is one of the inner cover

export const idOf = (body, row) => (body << kRowBits | (row + 1)) >>> 0;
// Of an inner cover, which the pointer passes over.
const idOfInner = (body, row) => idOf(body | kInnerBit, row);
export const nodeOf = (id) =>
    (id === 0 || id >>> kRowBits & kInnerBit ? null : {body: id >>> kRowBits, row: (id & ((1 << kRowBits) - 1)) - 1});

export class BodyLayers {
  constructor(gl, body, index) { Object.assign(this, {gl, body, index, level: -1}); }

  /// Shows the cut at `level`; `marked` holds rows of nodes to be marked.
  show(level, marked) {
    const {ellipsoid, version} = this.body, {colour} = this.body.nodes;
    if (level === this.level && marked === this.marked && version === this.version) return;
    const rows = this.body.cut(level);
    if (level !== this.level || version !== this.version) {
      const shapes = new Float32Array(9 * rows.length), colours = new Uint8Array(3 * rows.length);
      rows.forEach((row, i) => {
        shapes.set(ellipsoid.subarray(9 * row, 9 * row + 9), 9 * i);
        colours.set(colour.subarray(3 * row, 3 * row + 3), 3 * i);
      });
      this.coverArray?.free();
      this.coverArray = ellipsoidArray(this.gl, shapes, colours, rows.map((row) => idOf(this.index, row)));
      Object.assign(this, {level, version, count: rows.length, marked: undefined});
    }
    if (marked !== this.marked) {
      this.gl.bindBuffer(this.gl.ARRAY_BUFFER, this.coverArray.buffers[5]);
      this.gl.bufferSubData(this.gl.ARRAY_BUFFER, 0, Uint8Array.from(rows, (row) => (marked?.has(row) ? 1 : 0)));
      this.marked = marked;
    }
  }

  /// The inner cover at the same level, before all else in a section. It is that of the body at rest.
  drawInner(programWith, view, look) {
    if (!this.body.inner || this.body.moved) return;
    if (this.innerLevel !== this.level) {
      const rows = this.body.innerCut(this.level), {ellipsoid} = this.body.inner.nodes;
      const shapes = new Float32Array(9 * rows.length);
      rows.forEach((row, i) => shapes.set(ellipsoid.subarray(9 * row, 9 * row + 9), 9 * i));
      this.innerArray?.free();
      const colours = new Uint8Array(3 * rows.length), ids = rows.map((row) => idOfInner(this.index, row));
      this.innerArray = ellipsoidArray(this.gl, shapes, colours, ids);
      Object.assign(this, {innerLevel: this.level, innerCount: rows.length});
    }
    const program = programWith({WIRE: false, SECTION: Boolean(look.section), HAS_DISTANCE: false, OUTSIDE: false});
    program.use({
      ...view,
      u_of_body: true,
      u_body_colour: kInner,
      u_mark_colour: kContact,
      u_distance: 0, // not looked at, but samplers of two kinds must not share a unit
      u_ramp: 1,
      u_ahead: 1,
    });
    this.gl.bindVertexArray(this.innerArray.array);
    this.gl.drawArraysInstanced(this.gl.TRIANGLE_STRIP, 0, 4, this.innerCount);
  }

  /// `programWith(switches)` gives the program: what is not asked for must not cost time in each pixel.
  drawCover(programWith, view, look) {
    const {gl, body} = this, {lattice} = body, outside = look.colouring === 'outside';
    // Made when first needed: the first picture comes sooner.
    const distances = Boolean(lattice && !body.moved && (outside || look.section)); // they are of the body at rest
    if (distances) {
      this.distances ??= distanceTexture(gl, lattice);
      bindTexture(gl, 0, this.distances, gl.TEXTURE_3D);
    }
    const program = programWith({
      WIRE: look.wire,
      SECTION: Boolean(look.section),
      HAS_DISTANCE: distances,
      OUTSIDE: outside && distances,
    });
    program.use({
      ...view,
      u_line: 0.6 * look.line,
      u_of_body: look.colouring === 'body' || look.colouring === 'covers' || (outside && !body.moved),
      u_body_colour: {body: kBodyColours[this.index], covers: kOuter}[look.colouring] ?? kMesh,
      u_mark_colour: kContact,
      u_solid_colour: kMesh,
      u_distance: 0,
      u_distance_origin: lattice ? lattice.origin.map((x) => x - lattice.pitch / 2) : [0, 0, 0],
      u_distance_step: lattice ? lattice.size.map((n) => 1 / (n * lattice.pitch)) : [0, 0, 0],
      u_ramp: 1,
      u_ramp_end: look.rampEnd,
      u_ahead: 0,
    });
    gl.bindVertexArray(this.coverArray.array);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, this.count);
  }

  drawMesh(program, view, look) {
    if (!this.body.showsMesh) return;
    this.bindMesh();
    program.use({...view, u_wire: look.wire, u_line: 0.8 * look.line, u_colour: kMesh, u_inside_colour: kMeshInside});
    this.gl.drawArrays(this.gl.TRIANGLES, 0, this.body.mesh.triangles.length);
  }

  /// Fills what a section has cut open of a mesh that moved: nothing knows distances from it.
  drawCap(meshProgram, capProgram, view, nothing) {
    const {gl, body} = this;
    if (!body.moved || !body.showsMesh || !body.mesh.closed) return;
    gl.clearBufferiv(gl.STENCIL, 0, [0]);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.ALWAYS, 0, 255);
    gl.stencilOpSeparate(gl.FRONT, gl.KEEP, gl.KEEP, gl.DECR_WRAP);
    gl.stencilOpSeparate(gl.BACK, gl.KEEP, gl.KEEP, gl.INCR_WRAP);
    gl.depthFunc(gl.ALWAYS);
    gl.depthMask(false);
    gl.colorMask(false, false, false, false);
    meshProgram.use({...view, u_wire: false});
    this.bindMesh();
    gl.drawArrays(gl.TRIANGLES, 0, body.mesh.triangles.length);
    gl.colorMask(true, true, true, true);
    gl.depthMask(true);
    gl.depthFunc(gl.LESS);
    gl.stencilFunc(gl.NOTEQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.KEEP);
    capProgram.use({...view, u_colour: kMesh});
    gl.bindVertexArray(nothing);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
    gl.disable(gl.STENCIL_TEST);
  }

  bindMesh() {
    const {gl, body} = this;
    if (this.meshVertices !== body.vertices) {
      const corners = cornersOf(body.vertices, body.mesh.triangles);
      if (this.meshArray) {
        gl.bindBuffer(gl.ARRAY_BUFFER, this.meshArray.buffers[0]);
        gl.bufferSubData(gl.ARRAY_BUFFER, 0, corners);
      }
      this.meshArray ??= vertexArray(gl, {0: {data: corners, size: 3}});
      this.meshVertices = body.vertices;
    }
    gl.bindVertexArray(this.meshArray.array);
  }
}

// One instance for each ellipsoid, nine numbers each; none is marked.
function ellipsoidArray(gl, shapes, colours, ids) {
  return vertexArray(gl, {
    0: {data: shapes, size: 9, divisor: 1}, // takes up locations 0 to 2
    3: {data: colours, size: 3, divisor: 1, normalised: true},
    4: {data: Uint32Array.from(ids), size: 1, divisor: 1, integer: true},
    5: {data: new Uint8Array(ids.length), size: 1, divisor: 1},
  });
}

function cornersOf(vertices, triangles) {
  const out = new Float32Array(3 * triangles.length);
  for (let i = 0; i < triangles.length; ++i)
    for (let k = 0; k < 3; ++k) out[3 * i + k] = vertices[3 * triangles[i] + k];
  return out;
}

function distanceTexture(gl, {size, distance}) {
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_3D, texture);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
  gl.texImage3D(gl.TEXTURE_3D, 0, gl.R16F, ...size, 0, gl.RED, gl.HALF_FLOAT, distance);
  gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
  for (const [name, value] of [
           [gl.TEXTURE_MIN_FILTER, gl.LINEAR], [gl.TEXTURE_MAG_FILTER, gl.LINEAR],
           [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE],
           [gl.TEXTURE_WRAP_R, gl.CLAMP_TO_EDGE]])
    gl.texParameteri(gl.TEXTURE_3D, name, value);
  return texture;
}
