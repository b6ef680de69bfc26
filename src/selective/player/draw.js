"use strict";
// Draws a recording with WebGL 2. The index buffer is an attribute that names vertices; a texture says at which place each stands, another where the places are.

const PLACES = 2048;
const VERTICES = 1024;

const SURFACE = [
  `#version 300 es
precision highp float; precision highp int; precision highp sampler2D; precision highp usampler2D;
layout(location = 0) in uint corner;
uniform usampler2D standing;
uniform sampler2D places;
uniform mat4 toClip, toEye, toFrozen;
out vec3 eye, side;
out vec4 frozen;
void main() {
  uint k = texelFetch(standing, ivec2(int(corner % ${VERTICES}u), int(corner / ${VERTICES}u)), 0).r;
  vec4 p = vec4(texelFetch(places, ivec2(int(k % ${PLACES}u), int(k / ${PLACES}u)), 0).rgb, 1.0);
  gl_Position = toClip * p;
  eye = (toEye * p).xyz;
  frozen = toFrozen * p;
  int c = gl_VertexID % 3;
  side = vec3(c == 0, c == 1, c == 2);
}`,
  `#version 300 es
precision highp float;
in vec3 eye, side;
in vec4 frozen;
uniform vec3 surface, inside, line;
uniform float wire, tint;
out vec4 color;
void main() {
  vec3 n = cross(dFdx(eye), dFdy(eye));
  n = length(n) > 0.0 ? normalize(n) : vec3(0.0, 0.0, 1.0);
  if (n.z < 0.0) n = -n;
  float lamp = 0.25 + 0.75 * max(dot(n, normalize(vec3(-0.4, 0.7, 0.8))), 0.0);
  bool within = frozen.w > 0.0 && all(lessThanEqual(abs(frozen.xy), vec2(frozen.w)));
  vec3 base = tint > 0.5 && within ? inside : surface;
  vec3 c = sqrt(base * base * lamp);
  vec3 width = fwidth(side);
  vec3 near = smoothstep(vec3(0.3), vec3(1.1), side / max(width, vec3(1e-9)));
  float edge = 1.0 - min(near.x, min(near.y, near.z));
  // Edges of triangles of a few pixels would cover all.
  edge *= 1.0 - 0.85 * smoothstep(0.12, 0.5, max(width.x, max(width.y, width.z)));
  color = vec4(mix(c, line, wire * 0.7 * edge), 1.0);
}`,
];

const LINES = [
  `#version 300 es
layout(location = 0) in vec3 p;
uniform mat4 toClip;
void main() { gl_Position = toClip * vec4(p, 1.0); }`,
  `#version 300 es
precision mediump float;
uniform vec3 line;
out vec4 color;
void main() { color = vec4(line, 1.0); }`,
];

// Matrices are columns, in doubles until they are handed over.
const multiply = (a, b) => {
  const out = new Array(16).fill(0);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
};
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unit = (a) => {
  const l = Math.hypot(...a);
  return l > 0 ? a.map((x) => x / l) : [0, 0, 1];
};

const viewOf = (c) => {
  const rows = [c.right, c.up, c.look.map((x) => -x)];
  const out = [];
  for (let k = 0; k < 3; k++) out.push(rows[0][k], rows[1][k], rows[2][k], 0);
  out.push(...rows.map((r) => -dot(r, c.eye)), 1);
  return out;
};

const projectionOf = (c, aspect) => {
  const far = c.far ?? 1e5 * c.near;
  const y = 1 / c.half;
  const x = y / aspect;
  const d = far - c.near;
  return c.perspective
    ? [x, 0, 0, 0, 0, y, 0, 0, 0, 0, -(far + c.near) / d, -1, 0, 0, (-2 * far * c.near) / d, 0]
    : [x, 0, 0, 0, 0, y, 0, 0, 0, 0, -2 / d, 0, 0, 0, -(far + c.near) / d, 1];
};

const aspectOf = (c) => c.size[0] / c.size[1];

class Renderer {
  constructor(canvas, recording) {
    const gl = canvas.getContext("webgl2", { antialias: true });
    if (!gl) throw new Error("this browser has no WebGL 2");
    this.gl = gl;
    this.canvas = canvas;
    this.recording = recording;
    this.surface = this.program(SURFACE, ["standing", "places", "toClip", "toEye", "toFrozen", "surface", "inside", "line", "wire", "tint"]);
    this.lines = this.program(LINES, ["toClip", "line"]);
    this.frustum = this.array();
    const largest = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.meshes = recording.header.meshes.map((m, k) => {
      if (Math.ceil(m.places / PLACES) > largest || Math.ceil(m.vertices / VERTICES) > largest)
        throw new Error("the flight has more vertices than this device can hold");
      return {
        corners: this.array(),
        capacity: 0,
        places: this.placesTexture(recording.places[k]),
        standing: this.texture(),
        rows: Math.max(1, Math.ceil(m.vertices / VERTICES)),
        shadow: new Uint32Array(VERTICES * Math.max(1, Math.ceil(m.vertices / VERTICES))),
        fresh: true,
      };
    });
    gl.enable(gl.DEPTH_TEST);
  }

  program([vertex, fragment], uniforms) {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader) || "shader");
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program) || "program");
    return { program, at: Object.fromEntries(uniforms.map((u) => [u, gl.getUniformLocation(program, u)])) };
  }

  array() {
    const gl = this.gl;
    const out = { vao: gl.createVertexArray(), buffer: gl.createBuffer() };
    gl.bindVertexArray(out.vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, out.buffer);
    gl.enableVertexAttribArray(0);
    return out;
  }

  texture() {
    const gl = this.gl;
    const texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
    return texture;
  }

  // Static: uploaded once.
  placesTexture(places) {
    const gl = this.gl;
    const texture = this.texture();
    const rows = Math.max(1, Math.ceil(places.length / 3 / PLACES));
    const all = new Float32Array(3 * PLACES * rows);
    all.set(places);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB32F, PLACES, rows, 0, gl.RGB, gl.FLOAT, all);
    return texture;
  }

  // Brings the buffers of a mesh up to the track's frame: what changed, or all.
  upload(own, state) {
    const gl = this.gl;
    gl.bindVertexArray(own.corners.vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, own.corners.buffer);
    if (own.fresh || !state.ranges || state.corners.byteLength > own.capacity) {
      gl.bufferData(gl.ARRAY_BUFFER, state.corners, gl.DYNAMIC_DRAW);
      gl.vertexAttribIPointer(0, 1, gl.UNSIGNED_INT, 0, 0);
      own.capacity = state.corners.byteLength;
    } else {
      for (const [from, to] of state.ranges) gl.bufferSubData(gl.ARRAY_BUFFER, 12 * from, state.corners, 3 * from, 3 * (to - from));
    }
    gl.bindTexture(gl.TEXTURE_2D, own.standing);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    if (own.fresh || !state.vertices) {
      own.shadow.set(state.at);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32UI, VERTICES, own.rows, 0, gl.RED_INTEGER, gl.UNSIGNED_INT, own.shadow);
    } else {
      const rows = new Set();
      for (const v of state.vertices) {
        own.shadow[v] = state.at[v];
        rows.add(Math.floor(v / VERTICES));
      }
      for (const row of rows)
        gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, row, VERTICES, 1, gl.RED_INTEGER, gl.UNSIGNED_INT, own.shadow, row * VERTICES);
    }
    own.fresh = false;
    state.ranges = [];
    state.vertices = [];
  }

  // `camera` draws; `frozen` is the recorded one, whose frustum is shown if it is another.
  draw(track, camera, frozen, look) {
    const gl = this.gl;
    const ratio = Math.min(devicePixelRatio || 1, 2);
    const [w, h] = [this.canvas.clientWidth, this.canvas.clientHeight].map((x) => Math.max(1, Math.round(x * ratio)));
    if (this.canvas.width !== w || this.canvas.height !== h) [this.canvas.width, this.canvas.height] = [w, h];
    let [x, y, width, height] = [0, 0, w, h];
    const outside = camera !== frozen;
    if (!outside) {
      // The recorded picture, as large as fits.
      const aspect = aspectOf(camera);
      [width, height] = w / h > aspect ? [Math.round(h * aspect), h] : [w, Math.round(w / aspect)];
      [x, y] = [(w - width) >> 1, (h - height) >> 1];
    }
    gl.disable(gl.SCISSOR_TEST);
    gl.clearColor(...look.around, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.enable(gl.SCISSOR_TEST);
    gl.viewport(x, y, width, height);
    gl.scissor(x, y, width, height);
    gl.clearColor(...look.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    const view = viewOf(camera);
    const projection = projectionOf(camera, width / height);
    const seen = multiply(projectionOf(frozen, aspectOf(frozen)), viewOf(frozen));
    const s = this.surface;
    gl.useProgram(s.program);
    gl.uniform3fv(s.at.surface, look.surface);
    gl.uniform3fv(s.at.inside, look.inside);
    gl.uniform3fv(s.at.line, look.line);
    gl.uniform1f(s.at.wire, look.wire ? 1 : 0);
    gl.uniform1f(s.at.tint, outside ? 1 : 0);
    gl.uniform1i(s.at.standing, 0);
    gl.uniform1i(s.at.places, 1);
    this.recording.header.meshes.forEach((m, k) => {
      const [own, state] = [this.meshes[k], track.meshes[k]];
      gl.activeTexture(gl.TEXTURE0);
      this.upload(own, state);
      gl.activeTexture(gl.TEXTURE1);
      gl.bindTexture(gl.TEXTURE_2D, own.places);
      const origin = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...m.origin, 1];
      for (const instance of m.instances) {
        const placed = multiply(instance, origin);
        const toEye = multiply(view, placed);
        gl.uniformMatrix4fv(s.at.toEye, false, toEye);
        gl.uniformMatrix4fv(s.at.toClip, false, multiply(projection, toEye));
        gl.uniformMatrix4fv(s.at.toFrozen, false, multiply(seen, placed));
        gl.drawArrays(gl.TRIANGLES, 0, 3 * state.slots);
      }
    });
    if (outside) this.drawFrustum(frozen, camera, multiply(projection, view), look);
  }

  drawFrustum(c, from, toClip, look) {
    const gl = this.gl;
    const corner = (depth, sx, sy) => {
      const half = c.perspective ? c.half * depth : c.half;
      return add(add(add(add(c.eye, c.look, depth), c.right, sx * half * aspectOf(c)), c.up, sy * half), from.eye, -1);
    };
    const depth = Math.min(c.far ?? Infinity, look.reach);
    const signs = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
    const points = [];
    signs.forEach(([x, y], k) => {
      const [nx, ny] = signs[(k + 1) % 4];
      points.push(corner(c.near, x, y), corner(depth, x, y));
      for (const d of [c.near, depth]) points.push(corner(d, x, y), corner(d, nx, ny));
    });
    // About the camera, so that nothing is lost far from the origin.
    const shift = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, ...from.eye, 1];
    gl.useProgram(this.lines.program);
    gl.bindVertexArray(this.frustum.vao);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.frustum.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(points.flat()), gl.DYNAMIC_DRAW);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 0, 0);
    gl.uniformMatrix4fv(this.lines.at.toClip, false, multiply(toClip, shift));
    gl.uniform3fv(this.lines.at.line, look.frustum);
    gl.drawArrays(gl.LINES, 0, points.length);
  }

  // Another track: nothing on the GPU is its own.
  renew() {
    for (const m of this.meshes) m.fresh = true;
  }
}
