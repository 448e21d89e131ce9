// The little that is repeated when one talks to WebGL.

export class Program {
  /// `switches`: {name: boolean}, macros of the shaders.
  constructor(gl, vertex, fragment, switches = {}) {
    this.gl = gl;
    const macros = Object.entries(switches).map(([name, on]) => `#define ${name} ${Boolean(on)}\n`).join('');
    this.program = gl.createProgram();
    const shaders = [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]].map(([type, source]) => {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, '#version 300 es\n' + macros + source);
      gl.compileShader(shader);
      gl.attachShader(this.program, shader);
      return shader;
    });
    gl.linkProgram(this.program);
    if (!gl.getProgramParameter(this.program, gl.LINK_STATUS))
      throw new Error(
          `shader: ${[gl.getProgramInfoLog(this.program), ...shaders.map((s) => gl.getShaderInfoLog(s))].join(' ')}`);
    this.uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(this.program, gl.ACTIVE_UNIFORMS); ++i) {
      const {name, type} = gl.getActiveUniform(this.program, i);
      this.uniforms[name] = {type, at: gl.getUniformLocation(this.program, name)};
    }
  }

  /// Makes this the program in use, with these values; names that the shader does not use are passed over.
  use(values) {
    const gl = this.gl;
    gl.useProgram(this.program);
    for (const [name, value] of Object.entries(values)) {
      const uniform = this.uniforms[name];
      if (!uniform) continue;
      switch (uniform.type) {
        case gl.FLOAT: gl.uniform1f(uniform.at, value); break;
        case gl.FLOAT_VEC2: gl.uniform2fv(uniform.at, value); break;
        case gl.FLOAT_VEC3: gl.uniform3fv(uniform.at, value); break;
        case gl.FLOAT_VEC4: gl.uniform4fv(uniform.at, value); break;
        case gl.UNSIGNED_INT: gl.uniform1ui(uniform.at, value); break;
        default: gl.uniform1i(uniform.at, value); // integers, booleans, texture units
      }
    }
    return this;
  }
}

/// Textures to draw into: {attachment name: internal format}. Sized by resize().
export class Target {
  constructor(gl, formats) {
    Object.assign(this, {gl, formats, width: 0, height: 0, textures: {}, frame: gl.createFramebuffer()});
  }

  resize(width, height) {
    if (width === this.width && height === this.height) return;
    const gl = this.gl;
    Object.assign(this, {width, height});
    for (const texture of Object.values(this.textures)) gl.deleteTexture(texture);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    const colours = [];
    for (const [name, format] of Object.entries(this.formats)) {
      const texture = this.textures[name] = gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, width, height);
      const filter = format === gl.RGBA8 ? gl.LINEAR : gl.NEAREST;
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, filter);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
      const depths = {[gl.DEPTH_COMPONENT24]: gl.DEPTH_ATTACHMENT, [gl.DEPTH24_STENCIL8]: gl.DEPTH_STENCIL_ATTACHMENT};
      const attachment = depths[format] ?? gl.COLOR_ATTACHMENT0 + colours.length;
      if (!(format in depths)) colours.push(attachment);
      gl.framebufferTexture2D(gl.FRAMEBUFFER, attachment, gl.TEXTURE_2D, texture, 0);
    }
    gl.drawBuffers(colours);
  }

  bind() {
    this.gl.bindFramebuffer(this.gl.FRAMEBUFFER, this.frame);
    this.gl.viewport(0, 0, this.width, this.height);
  }
}

export function bindTexture(gl, unit, texture, kind = gl.TEXTURE_2D) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(kind, texture);
}

/// A vertex array from {location: {data, size, divisor, integer, normalised}}; returns it with its buffers.
export function vertexArray(gl, attributes) {
  const array = gl.createVertexArray(), buffers = {};
  const types = new Map([[Float32Array, gl.FLOAT], [Uint32Array, gl.UNSIGNED_INT], [Uint8Array, gl.UNSIGNED_BYTE]]);
  gl.bindVertexArray(array);
  for (const [at, a] of Object.entries(attributes)) {
    const location = Number(at), buffer = buffers[at] = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, a.data, gl.STATIC_DRAW);
    const type = types.get(a.data.constructor);
    const step = a.data.BYTES_PER_ELEMENT * a.size;
    for (let column = 0; column < a.size; column += 4) {
      const size = Math.min(4, a.size - column), offset = column * a.data.BYTES_PER_ELEMENT;
      gl.enableVertexAttribArray(location + column / 4);
      if (a.integer)
        gl.vertexAttribIPointer(location + column / 4, size, type, step, offset);
      else
        gl.vertexAttribPointer(location + column / 4, size, type, a.normalised ?? false, step, offset);
      gl.vertexAttribDivisor(location + column / 4, a.divisor ?? 0);
    }
  }
  gl.bindVertexArray(null);
  const free = () => {
    gl.deleteVertexArray(array);
    Object.values(buffers).forEach((buffer) => gl.deleteBuffer(buffer));
  };
  return {array, buffers, free};
}
