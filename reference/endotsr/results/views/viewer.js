"use strict";
// The moving scene in WebGL 2: every Gaussian is a rectangle around its ellipse alpha >= cutoff, drawn back to front by
// the formulas of the specification: B2 covariance, B3 projection, B5 compositing without its stop and without the tiles
// of the preset legacy.
(async function () {
const element = (id) => document.getElementById(id);
const about = JSON.parse(element("about").textContent);
const WIDTH = 1024;  // Gaussians in a row of a texture

function fail(message) {
  element("failure").textContent = message;
  element("failure").hidden = false;
  element("shown").textContent = "";
}

// ---------------------------------------------------------------- the numbers
async function unpack(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

function summed(planes, row, words, K, N) {  // one row (K, N): cumulative sum of the differences between key times
  const size = K * N, out = words ? new Uint16Array(size) : new Uint8Array(size);
  for (let i = 0; i < size; i++) {
    const step = words ? planes[row * size + i] | (planes[(row + 1) * size + i] << 8) : planes[row * size + i];
    out[i] = i < N ? step : out[i - N] + step;
  }
  return out;
}

// ---------------------------------------------------------------- programs
const canvas = element("scene");
canvas.width = about.width;
canvas.height = about.height;
element("stage").style.setProperty("--widest", `calc(72vh * ${about.width / about.height})`);  // no scrolling
element("stage").style.setProperty("--whole", `calc(94vh * ${about.width / about.height})`);  // of a full screen
const gl = canvas.getContext("webgl2", {antialias: false, preserveDrawingBuffer: true});
if (!gl) return fail("This page requires WebGL 2, which this browser does not support.");
const precise = gl.getExtension("EXT_color_buffer_float") !== null;
canvas.addEventListener("webglcontextlost", () => {
  stop();
  fail("The browser has given up the graphics of this page; reload it.");
});

const SPLAT_VERTEX = `#version 300 es
precision highp float; precision highp int; precision highp usampler2DArray;
uniform usampler2DArray first, second, third;
uniform ivec2 keys; uniform float between; uniform vec3 low[3], range[3];
uniform mat3 turn; uniform vec3 move; uniform vec4 lens; uniform vec2 size, limit, depths;
uniform float near, low_pass, cutoff; uniform int layer;
in uint item;
out vec2 offset; flat out vec3 conic; flat out vec4 shade;
float signed8(uint v) { return float(v) - (v > 127u ? 256.0 : 0.0); }
vec4 rotation(uvec4 b) {
  return normalize(vec4(signed8(b.z & 255u), signed8(b.z >> 8), signed8(b.w & 255u), signed8(b.w >> 8)));
}
void main() {
  gl_Position = vec4(2, 2, 2, 1); offset = vec2(0); conic = vec3(1, 0, 1); shade = vec4(0);
  ivec2 at = ivec2(int(item) % ${WIDTH}, int(item) / ${WIDTH});
  uvec4 a0 = texelFetch(first, ivec3(at, keys.x), 0), a1 = texelFetch(first, ivec3(at, keys.y), 0);
  uvec4 b0 = texelFetch(second, ivec3(at, keys.x), 0), b1 = texelFetch(second, ivec3(at, keys.y), 0);
  uvec4 c0 = texelFetch(third, ivec3(at, keys.x), 0), c1 = texelFetch(third, ivec3(at, keys.y), 0);
  vec3 centre = low[0] + range[0] * mix(vec3(a0.xyz), vec3(a1.xyz), between) / 65535.0;
  vec3 logs = low[1] + range[1] * mix(vec3(a0.w, b0.xy), vec3(a1.w, b1.xy), between) / 65535.0;
  // A negative bias of the exposure gives colours below 0, which (B13) does not clamp.
  vec3 colour = low[2] + range[2] * mix(vec3(c0.xyz), vec3(c1.xyz), between) / 255.0;
  float opacity = mix(float(c0.w), float(c1.w), between) / 255.0;
  vec4 q = normalize(mix(rotation(b0), rotation(b1), between));
  vec3 p = turn * centre + move;
  if (p.z <= near || opacity < cutoff) return;
  mat3 r = mat3(
    1.0 - 2.0 * (q.z * q.z + q.w * q.w), 2.0 * (q.y * q.z + q.x * q.w), 2.0 * (q.y * q.w - q.x * q.z),
    2.0 * (q.y * q.z - q.x * q.w), 1.0 - 2.0 * (q.y * q.y + q.w * q.w), 2.0 * (q.z * q.w + q.x * q.y),
    2.0 * (q.y * q.w + q.x * q.z), 2.0 * (q.z * q.w - q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z));
  mat3 m = turn * r; vec3 s = exp(logs);
  m[0] *= s.x; m[1] *= s.y; m[2] *= s.z;
  vec2 slope = clamp(p.xy / p.z, -limit, limit);
  vec3 u = lens.x / p.z * (vec3(m[0].x, m[1].x, m[2].x) - slope.x * vec3(m[0].z, m[1].z, m[2].z));
  vec3 v = lens.y / p.z * (vec3(m[0].y, m[1].y, m[2].y) - slope.y * vec3(m[0].z, m[1].z, m[2].z));
  float a = low_pass + dot(u, u), b = dot(u, v), c = low_pass + dot(v, v);
  vec3 w = cross(u, v);
  float determinant = low_pass * low_pass + low_pass * (dot(u, u) + dot(v, v)) + dot(w, w);
  conic = vec3(c, -b, a) / determinant;
  float reach = 2.0 * log(opacity / cutoff);
  float middle = 0.5 * (a + c), spread = sqrt(max(0.25 * (a - c) * (a - c) + b * b, 0.0));
  float longer = middle + spread, shorter = determinant / longer;
  vec2 axis = spread < 1e-6 * middle ? vec2(1, 0) :
    normalize(abs(a - shorter) > abs(c - shorter) ? vec2(a - shorter, b) : vec2(b, c - shorter));
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  offset = corner.x * (sqrt(reach * longer) + 0.5) * axis
         + corner.y * (sqrt(reach * shorter) + 0.5) * vec2(-axis.y, axis.x);
  vec2 pixel = lens.xy * p.xy / p.z + lens.zw + offset;
  gl_Position = vec4(pixel.x / size.x * 2.0 - 1.0, 1.0 - pixel.y / size.y * 2.0, 0, 1);
  shade = vec4(layer == 1 ? vec3((p.z - depths.x) / (depths.y - depths.x)) : colour, opacity);
}`;

const SPLAT_FRAGMENT = `#version 300 es
precision highp float;
uniform float cutoff, alpha_max;
in vec2 offset; flat in vec3 conic; flat in vec4 shade;
out vec4 result;
void main() {
  float q = conic.x * offset.x * offset.x + 2.0 * conic.y * offset.x * offset.y + conic.z * offset.y * offset.y;
  float alpha = min(alpha_max, shade.a * exp(-0.5 * q));
  if (!(alpha >= cutoff)) discard;
  result = vec4(shade.rgb * alpha, alpha);
}`;

const SHOW_VERTEX = `#version 300 es
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0, 1); }`;

const SHOW_FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D drawn, later, map, truth; uniform int layer; uniform float error_scale, weight;
out vec4 result;
vec3 mapped(float level) { return texelFetch(map, ivec2(int(clamp(level, 0.0, 1.0) * 255.0 + 0.5), 0), 0).rgb; }
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  vec4 sum = texelFetch(drawn, at, 0);
  if (weight > 0.0) sum = mix(sum, texelFetch(later, at, 0), weight);
  vec3 shown = sum.rgb;
  if (layer == 1) shown = sum.a > 0.05 ? mapped(sum.r / sum.a) : vec3(0.376, 0.376, 0.4);
  if (layer == 2) shown = vec3(sum.a);
  if (layer == 3) {
    vec4 wanted = texelFetch(truth, ivec2(at.x, textureSize(truth, 0).y - 1 - at.y), 0);
    vec3 off = abs(clamp(sum.rgb, 0.0, 1.0) - wanted.rgb);
    shown = wanted.a > 0.5 ? mapped((off.r + off.g + off.b) / 3.0 / error_scale) : vec3(0.376, 0.376, 0.4);
  }
  result = vec4(shown, 1);
}`;

function program(vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const name = gl.getActiveUniform(made, i).name.replace("[0]", "");
    at[name] = gl.getUniformLocation(made, name);
  }
  return {made, at};
}

let splat, show;
try {
  splat = program(SPLAT_VERTEX, SPLAT_FRAGMENT);
  show = program(SHOW_VERTEX, SHOW_FRAGMENT);
} catch (error) { return fail("Compiling the shaders failed: " + error.message); }

// ---------------------------------------------------------------- parts: one set of Gaussians each
function layered({count: N, K, rows}, format, inside, type, fill, Kind) {
  const texture = gl.createTexture(), layer = new Kind(WIDTH * rows * 4);
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D_ARRAY, texture);
  gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, inside, WIDTH, rows, K);
  for (let k = 0; k < K; k++) {
    for (let i = 0; i < N; i++) fill(layer, 4 * i, k * N + i);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, k, WIDTH, rows, 1, format, type, layer);
  }
  gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
  gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
  return texture;
}
gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);

async function part(numbers, text) {  // numbers: count, times, low, high, cameras, held_out of one set of Gaussians
  const N = numbers.count, K = numbers.times.length, planes = await unpack(text);
  const words = [0, 2, 4, 6, 8, 10].map((row) => summed(planes, row, true, K, N));
  const small = [0, 1, 2, 3, 4, 5, 6, 7].map((row) => summed(planes, 12 + row, false, K, N));
  const made = {...numbers, K, rows: Math.max(1, Math.ceil(N / WIDTH)), position: words.slice(0, 3),
    ranges: numbers.high.map((high, row) => high - numbers.low[row])};
  made.textures = [
    layered(made, gl.RGBA_INTEGER, gl.RGBA16UI, gl.UNSIGNED_SHORT, (out, o, i) => {
      for (let c = 0; c < 4; c++) out[o + c] = words[c][i];
    }, Uint16Array),
    layered(made, gl.RGBA_INTEGER, gl.RGBA16UI, gl.UNSIGNED_SHORT, (out, o, i) => {
      out[o] = words[4][i]; out[o + 1] = words[5][i];
      out[o + 2] = small[0][i] | (small[1][i] << 8); out[o + 3] = small[2][i] | (small[3][i] << 8);
    }, Uint16Array),
    layered(made, gl.RGBA_INTEGER, gl.RGBA8UI, gl.UNSIGNED_BYTE, (out, o, i) => {
      for (let c = 0; c < 4; c++) out[o + c] = small[4 + c][i];
    }, Uint8Array)];
  if (gl.getError()) throw new Error("the graphics memory cannot hold the Gaussians.");
  made.depth = new Float32Array(N);
  made.order = [new Uint32Array(N), new Uint32Array(N)];
  return made;
}

function flat(unit) {
  const texture = gl.createTexture();
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(gl.TEXTURE_2D, texture);
  for (const key of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, key, gl.NEAREST);
  for (const key of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, key, gl.CLAMP_TO_EDGE);
  return texture;
}
const buffers = [3, 6].map((unit) => {  // the picture, and the picture of a second window to blend with
  const texture = flat(unit), buffer = gl.createFramebuffer();
  if (precise) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA16F, about.width, about.height, 0, gl.RGBA, gl.HALF_FLOAT, null);
  else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, about.width, about.height, 0, gl.RGBA, gl.UNSIGNED_BYTE, null);
  gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  return buffer;
});
const MAPS = {1: "viridis", 3: "magma"};
flat(4);
flat(5);
gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));

function useMap(name) {
  gl.activeTexture(gl.TEXTURE4);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, 256, 1, 0, gl.RGB, gl.UNSIGNED_BYTE, new Uint8Array(about.maps[name]));
}

const order = gl.createBuffer(), item = gl.getAttribLocation(splat.made, "item");
const field = gl.createVertexArray();
gl.bindVertexArray(field);
gl.bindBuffer(gl.ARRAY_BUFFER, order);
gl.enableVertexAttribArray(item);
gl.vertexAttribIPointer(item, 1, gl.UNSIGNED_INT, 0, 0);
gl.vertexAttribDivisor(item, 1);
const nothing = gl.createVertexArray();

// ---------------------------------------------------------------- windows: parts loaded on demand
// The page of a run embeds its only part. The page of a recording has a script file for each window.
const MOST_PARTS = 4;  // in memory
const spans = about.windows || [{begin: 0, end: 1}];
const loaded = new Map();  // number of a window -> its part or a promise, least recently used first

function shows(time) {  // numbers of the windows at a time: none in a gap, two in an overlap
  const found = [];
  spans.forEach((span, k) => {
    if (span.begin <= time && (time < span.end || time === span.end && !(spans[k + 1] && spans[k + 1].begin <= time)))
      found.push(k);
  });
  return found;
}

function fetched(k) {  // a promise of window k
  if (!loaded.has(k)) loaded.set(k, about.windows ? new Promise((done, failed) => {
    const script = document.createElement("script");
    script.src = spans[k].file.split("/").map(encodeURIComponent).join("/");
    script.onerror = () => failed(new Error(spans[k].file + " is missing; it must be next to the page."));
    window.endotsr_window = window.endotsr_window || {};
    window.endotsr_window[k] = (numbers, text) => part(numbers, text).then(done, failed);
    document.head.append(script);
    script.onload = () => script.remove();
  }).then((made) => {
    delete window.endotsr_window[k];
    loaded.set(k, made);
    forget();
    markWindows();
    return made;
  }).catch((error) => { loaded.delete(k); fail(error.message); throw error; }) : part(about, element("data").textContent.trim())
    .then((made) => { loaded.set(k, made); return made; }));
  return Promise.resolve(loaded.get(k));
}

function forget() {  // delete the textures of the least recently used windows
  const ready = [...loaded.keys()].filter((k) => loaded.get(k).textures && !shows(state.time).includes(k));
  for (const k of ready.slice(0, Math.max(0, loaded.size - MOST_PARTS))) {
    loaded.get(k).textures.forEach((texture) => gl.deleteTexture(texture));
    loaded.delete(k);
  }
}

function partsNow() {  // the loaded parts of this time with their weights; fetches missing parts
  const wanted = shows(state.time), found = [];
  for (const k of wanted) {
    const here = loaded.get(k);
    if (here && here.textures) {
      loaded.delete(k);  // move to the end: most recently used
      loaded.set(k, here);
      found.push([here, 1]);
    } else if (!here) fetched(k).then(() => draw(), () => stop());
  }
  const last = wanted[wanted.length - 1], span = spans[last];
  if (span && state.time > (span.begin + span.end) / 2 && last + 1 < spans.length && !loaded.has(last + 1))
    fetched(last + 1).catch(() => stop());
  if (found.length === 2) {
    const begin = spans[wanted[1]].begin, end = spans[wanted[0]].end;
    found[1][1] = (state.time - begin) / (end - begin);
  }
  return found;
}
const waiting = () => shows(state.time).some((k) => !(loaded.get(k) && loaded.get(k).textures));

function markWindows() {  // the strip below the slider: all windows, with the loaded ones marked
  for (const [k, mark] of [...element("windows").children].entries())
    mark.classList.toggle("on", Boolean(loaded.get(k) && loaded.get(k).textures));
}
if (about.windows) {
  element("windows").hidden = false;
  spans.forEach((span, k) => {
    const mark = document.createElement("button");
    mark.style.left = 100 * span.begin + "%";
    mark.style.width = 100 * (span.end - span.begin) + "%";
    mark.title = "Window " + span.name + ", frames " + span.frames;
    mark.setAttribute("aria-label", mark.title);
    mark.onclick = () => { go(span.begin); draw(); };
    element("windows").append(mark);
  });
}

// ---------------------------------------------------------------- time, camera, order
const state = {time: 0, yaw: 0, pitch: 0, closer: 1, right: 0, down: 0, layer: 0, playing: false, orbiting: false,
  phase: 0, speed: 1, clock: 0};  // right, down: shift of the picture, pixels; clock: playing time in the error layer

function keysAt({times, K}, time) {
  let k = 0;
  while (k + 2 < K && times[k + 1] <= time) k++;
  if (K < 2) return [0, 0, 0];
  return [k, k + 1, Math.min(Math.max((time - times[k]) / (times[k + 1] - times[k]), 0), 1)];
}

function nearest(times, time) {
  let best = 0;
  for (let i = 1; i < times.length; i++) if (Math.abs(times[i] - time) < Math.abs(times[best] - time)) best = i;
  return best;
}
const nearestFrame = (time) => nearest(about.frames.times, time);

function multiply(a, b) {  // row-major 3x3
  const out = new Array(9);
  for (let r = 0; r < 3; r++) for (let c = 0; c < 3; c++)
    out[3 * r + c] = a[3 * r] * b[c] + a[3 * r + 1] * b[3 + c] + a[3 * r + 2] * b[6 + c];
  return out;
}

function apply(a, v) {
  return [0, 3, 6].map((r) => a[r] * v[0] + a[r + 1] * v[1] + a[r + 2] * v[2]);
}

function cameraNow() {  // the observed camera, rotated about the pivot on its axis, zoomed and shifted
  const {cameras, first} = shownPart, frame = nearestFrame(state.time) - (first || 0);
  const numbers = cameras[Math.min(Math.max(frame, 0), cameras.length - 1)];  // a static camera is stored once
  const [sy, cy, sp, cp] = [Math.sin(state.yaw), Math.cos(state.yaw), Math.sin(state.pitch), Math.cos(state.pitch)];
  const turn = multiply([1, 0, 0, 0, cp, sp, 0, -sp, cp], [cy, 0, sy, 0, 1, 0, -sy, 0, cy]);
  const pivot = [0, 0, about.pivot_depth], t = numbers.slice(9, 12);
  const moved = apply(turn, [t[0], t[1], t[2] - pivot[2]]);
  moved[2] += pivot[2] * state.closer;
  moved[0] += state.right * pivot[2] * state.closer / numbers[12];  // pixels at the pivot
  moved[1] += state.down * pivot[2] * state.closer / numbers[13];
  return {rotation: multiply(turn, numbers.slice(0, 9)), translation: moved, lens: numbers.slice(12, 16)};
}

const counts = new Uint32Array(65537);

function sortByDepth(of, camera, [k0, k1, f]) {  // back to front: radix sort of the depth bits, two passes of 16 bits
  const {count: N, ranges, low, depth, order: [sorted, other]} = of, depthBits = new Uint32Array(depth.buffer);
  const r = camera.rotation, scale = [0, 1, 2].map((c) => r[6 + c] * ranges[c] / 65535);
  const base = camera.translation[2] + r[6] * low[0] + r[7] * low[1] + r[8] * low[2];
  const [x, y, z] = of.position, a = k0 * N, b = k1 * N, g = 1 - f;
  for (let i = 0; i < N; i++) {
    const value = base + scale[0] * (g * x[a + i] + f * x[b + i]) + scale[1] * (g * y[a + i] + f * y[b + i])
      + scale[2] * (g * z[a + i] + f * z[b + i]);
    depth[i] = value > 0 ? value : 0;
    other[i] = N - 1 - i;  // at equal depth, the later Gaussian is farther back
  }
  for (const [from, to, shift] of [[other, sorted, 0], [sorted, other, 16]]) {
    counts.fill(0);
    for (let i = 0; i < N; i++) counts[((~depthBits[from[i]] >>> shift) & 65535) + 1]++;
    for (let i = 0; i < 65536; i++) counts[i + 1] += counts[i];
    for (let i = 0; i < N; i++) to[counts[(~depthBits[from[i]] >>> shift) & 65535]++] = from[i];
  }
  return other;
}

// ---------------------------------------------------------------- a picture
function splats(of, camera, layer) {  // draw one part into the bound buffer
  const keys = keysAt(of, state.time), {made, at} = splat, raster = about.raster, size = [about.width, about.height];
  gl.viewport(0, 0, ...size);
  gl.clearColor(0, 0, 0, 0);
  gl.clear(gl.COLOR_BUFFER_BIT);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.useProgram(made);
  gl.bindVertexArray(field);
  gl.bindBuffer(gl.ARRAY_BUFFER, order);
  gl.bufferData(gl.ARRAY_BUFFER, sortByDepth(of, camera, keys), gl.STREAM_DRAW);
  for (const [unit, name] of ["first", "second", "third"].entries()) {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, of.textures[unit]);
    gl.uniform1i(at[name], unit);
  }
  gl.uniform2i(at.keys, keys[0], keys[1]);
  gl.uniform1f(at.between, keys[2]);
  gl.uniform3fv(at.low, of.low);
  gl.uniform3fv(at.range, of.ranges);
  gl.uniformMatrix3fv(at.turn, true, camera.rotation);
  gl.uniform3fv(at.move, camera.translation);
  gl.uniform4fv(at.lens, camera.lens);
  gl.uniform2fv(at.size, size);
  const clamp = raster.jacobian_clamp > 0 ? raster.jacobian_clamp / 2 : 1e9;
  gl.uniform2f(at.limit, clamp * size[0] / camera.lens[0], clamp * size[1] / camera.lens[1]);
  gl.uniform2fv(at.depths, about.depth_range);
  gl.uniform1f(at.near, raster.near);
  gl.uniform1f(at.low_pass, raster.low_pass);
  gl.uniform1f(at.cutoff, raster.alpha_cutoff);
  gl.uniform1f(at.alpha_max, raster.alpha_max);
  gl.uniform1i(at.layer, layer);
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, of.count);
  gl.disable(gl.BLEND);
}

let shownPart = null, weight = 0;  // the part whose camera is used; weight of the later of two blended parts
function draw(layer = state.layer) {
  if (layer === 3 && truth !== held) return describe();  // not decoded yet: keep the last picture
  const parts = partsNow();
  if (!parts.length) return describe();  // still loading: keep the last picture
  weight = parts.length > 1 ? parts[1][1] : 0;
  shownPart = parts[weight > 0.5 ? 1 : 0][0];
  const camera = cameraNow();
  parts.forEach(([of], i) => {
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffers[i]);
    splats(of, camera, layer);
  });
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  gl.useProgram(show.made);
  gl.bindVertexArray(nothing);
  gl.uniform1i(show.at.drawn, 3);
  gl.uniform1i(show.at.later, 6);
  gl.uniform1i(show.at.map, 4);
  gl.uniform1i(show.at.truth, 5);
  gl.uniform1i(show.at.layer, state.layer);
  gl.uniform1f(show.at.weight, weight);
  gl.uniform1f(show.at.error_scale, about.error_scale);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  describe();
}

// ---------------------------------------------------------------- the page
const LAYERS = ["colour", "depth", "opacity", "error"];
let held = null, truth = null;  // the held-out frame shown next to the scene, and the one whose picture is decoded
const moved = () => state.yaw !== 0 || state.pitch !== 0 || state.closer !== 1 || state.right !== 0 || state.down !== 0;
const short = (number) => Number(number.toPrecision(4)).toString();

function describe() {
  element("slider").value = state.time;
  const i = nearestFrame(state.time), frame = about.frames.names[i], numbers = about.frames.numbers;
  element("time").textContent = "frame " + numbers[i] + " (" + numbers[0] + " to " + numbers[numbers.length - 1]
    + "), t = " + state.time.toFixed(3)
    + (about.duration ? ", " + (state.time * about.duration).toFixed(2) + " s" : "");
  const gap = shows(state.time).length ? null : "No window covers this time" + gapReason(state.time);
  element("shown").textContent = gap || (waiting() ? "Loading window " + shows(state.time).map((k) => spans[k].name).join(" and ")
    : (moved() ? "Free view" : "Camera view") + ", nearest frame " + frame);
  chips();
  clearTimeout(addressed);
  addressed = setTimeout(address, 200);
}

function gapReason(time) {
  const gap = (about.left_out || []).find((found) => found.begin <= time && time <= found.end);
  return gap ? ": " + gap.reason : "";
}

let addressed = 0;
function address() {  // store this view in the address of the page
  const view = new URLSearchParams({t: state.time.toFixed(4)});
  if (state.layer) view.set("layer", LAYERS[state.layer]);
  for (const [name, rest] of [["yaw", 0], ["pitch", 0], ["closer", 1], ["right", 0], ["down", 0]])
    if (state[name] !== rest) view.set(name, short(state[name]));
  if (held) view.set("held_out", about.held_out.indexOf(held));
  try { history.replaceState(null, "", "#" + view); } catch (refused) { /* optional */ }
}

const nearestHeld = (time) => about.held_out[nearest(about.held_out.map((frame) => frame.time), time)];

function choose(layer) {
  state.layer = layer;
  element("layer").value = LAYERS[layer];
  element("legend").hidden = !(layer in MAPS);
  if (layer in MAPS) {
    useMap(MAPS[layer]);
    const strip = element("strip").getContext("2d"), picture = strip.createImageData(256, 1);
    about.maps[MAPS[layer]].forEach((v, i) => { picture.data[Math.floor(i / 3) * 4 + i % 3] = v; });
    for (let i = 0; i < 256; i++) picture.data[4 * i + 3] = 255;
    strip.putImageData(picture, 0, 0);
    element("low").textContent = layer === 1 ? short(about.depth_range[0]) : "0";
    element("high").textContent = layer === 1 ? short(about.depth_range[1]) + " " + about.unit : about.error_scale + " or more";
  }
}

function leave() {  // hide the held-out frame: it has another time or camera
  held = null;
  element("held_out").hidden = true;
  element("stage").classList.remove("two");
  if (state.layer === 3) choose(0);
  for (const chip of element("chips").querySelectorAll("button")) chip.classList.remove("on");
}

function go(time) {  // in the error layer: to the nearest held-out frame, because only these have an error
  if (state.layer === 3) {
    const frame = nearestHeld(time);
    if (frame !== held) visit(frame, true);
    return;
  }
  unmark();
  state.time = time;
  if (held && held.time !== time) leave();
}

async function visit(frame, error = false) {
  if (!error) stop();
  look(0, 0, 1, 0, 0);
  if (!error || state.layer !== 3) leave();
  unmark();
  state.time = frame.time;
  held = frame;
  if (error) choose(3);
  draw();  // updates the chips
  for (const chip of element("chips").querySelectorAll("button")) chip.classList.toggle("on", chip.title === frame.name);
  const source = frame.picture || await fetched(frame.window).then((of) => of.held_out[frame.place].picture, () => null);
  if (!source && held === frame) leave();  // its window is missing
  if (held !== frame) return;
  element("truth").src = source;
  element("truth_name").textContent = "Held-out frame " + frame.name + "; grey: excluded";
  element("held_out").hidden = false;
  element("stage").classList.add("two");
  const bytes = await (await fetch(source)).blob();
  const picture = await createImageBitmap(bytes, {premultiplyAlpha: "none", colorSpaceConversion: "none"});
  if (held !== frame) return;  // another frame was chosen in the meantime
  gl.activeTexture(gl.TEXTURE5);
  gl.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, picture);
  truth = frame;
  draw();
}

function look(yaw, pitch, closer, right = state.right, down = state.down) {
  const most = 1.2;
  state.yaw = Math.max(-most, Math.min(most, yaw));
  state.pitch = Math.max(-most, Math.min(most, pitch));
  state.closer = Math.max(0.2, Math.min(4, closer));
  state.right = Math.max(-about.width, Math.min(about.width, right));
  state.down = Math.max(-about.height, Math.min(about.height, down));
  unmark();
  if (moved() && held) leave();
}

function pressed(id, on) {
  element(id).classList.toggle("on", on);
  element(id).setAttribute("aria-pressed", on);
}

function stop() {
  state.playing = state.orbiting = false;
  element("play").textContent = "Play";
  pressed("orbit", false);
}

let before = 0;
function tick(now) {
  const seconds = Math.min((now - before) / 1000, 0.1);
  before = now;
  if (state.playing && !waiting()) {
    state.clock = ((state.layer === 3 ? state.clock : state.time) + state.speed * seconds / (about.duration || about.seconds)) % 1;
    if (!shows(state.clock).length) state.clock = (spans.find((span) => span.begin > state.clock) || spans[0]).begin;
    go(state.clock);
  }
  if (state.orbiting) {
    state.phase += seconds * 0.8;
    look(0.2 * Math.sin(state.phase), 0.12 * Math.cos(state.phase), state.closer);
  }
  draw();
  if (state.playing || state.orbiting) requestAnimationFrame(tick);
}

function toggle(name, button) {
  const running = state.playing || state.orbiting;
  state[name] = !state[name];
  state.clock = state.time;
  element("play").textContent = state.playing ? "Stop" : "Play";
  pressed("orbit", state.orbiting);
  if (!running) requestAnimationFrame((now) => { before = now; tick(now); });
}

element("play").onclick = () => toggle("playing");
element("orbit").onclick = () => toggle("orbiting");
element("reset").onclick = () => { state.orbiting = false; pressed("orbit", false); look(0, 0, 1, 0, 0); draw(); };
element("slider").oninput = (event) => { go(Number(event.target.value)); draw(); };
element("layer").onchange = (event) => {
  const layer = event.target.selectedIndex;
  if (layer === 3 && !held) return visit(nearestHeld(state.time), true);
  choose(layer);
  draw();
};
element("speed").onchange = (event) => { state.speed = Number(event.target.value); };
element("full").hidden = !document.fullscreenEnabled;
element("full").onclick = () => document.fullscreenElement ? document.exitFullscreen() : element("stage").requestFullscreen();
element("picture").onclick = () => {
  draw();
  const link = document.createElement("a");
  link.href = canvas.toDataURL("image/png");
  link.download = document.title + " t=" + state.time.toFixed(3) + " " + LAYERS[state.layer] + ".png";
  link.click();
};

// ---------------------------------------------------------------- a distance
let marks = null;  // points of a measurement in world coordinates, or null
function unmark() {
  if (!marks) return;
  marks = [];
  element("length").textContent = "Click two points on the surface.";
}

function surface(x, y) {  // the point of the rendered surface at a pixel of the picture, or null
  if (!partsNow().length) return null;  // a gap, or not loaded: the buffers hold another picture
  draw(1);
  const sum = [0, 0, 0, 0];
  [[buffers[0], 1 - weight], [buffers[1], weight]].forEach(([buffer, share]) => {
    const found = new Float32Array(4), bytes = new Uint8Array(4);
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    if (precise) gl.readPixels(x, about.height - 1 - y, 1, 1, gl.RGBA, gl.FLOAT, found);
    else {
      gl.readPixels(x, about.height - 1 - y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      found.set([...bytes].map((v) => v / 255));
    }
    if (share > 0) found.forEach((v, c) => { sum[c] += share * v; });
  });
  gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  draw();
  if (sum[3] < 0.5) return null;
  const [low, high] = about.depth_range, z = low + sum[0] / sum[3] * (high - low);
  const {rotation: r, translation: t, lens} = cameraNow();
  const p = [(x + 0.5 - lens[2]) * z / lens[0] - t[0], (y + 0.5 - lens[3]) * z / lens[1] - t[1], z - t[2]];
  return [0, 1, 2].map((k) => r[k] * p[0] + r[3 + k] * p[1] + r[6 + k] * p[2]);
}

function mark(x, y) {
  const point = surface(x, y);
  if (marks.length === 2) marks = [];
  if (point) marks.push(point);
  element("length").textContent = !point ? "No surface there: click a point on the tissue."
    : marks.length < 2 ? "First point set: click the second point."
    : "Distance " + short(Math.hypot(...marks[0].map((v, k) => v - marks[1][k]))) + " " + about.unit +
      " on the rendered surface at this time. An estimate: it is only as accurate as the prior depth used in training.";
}

element("measure").hidden = !precise;  // 8 bits hold no depth beyond the range of the depth layer
element("measure").onclick = () => {
  marks = marks ? null : [];
  pressed("measure", marks !== null);
  canvas.classList.toggle("aim", marks !== null);
  element("length").hidden = !marks;
  if (marks) { stop(); unmark(); }
};
canvas.onclick = (event) => {
  if (!marks) return;
  const box = canvas.getBoundingClientRect();
  mark(Math.min(about.width - 1, Math.floor((event.clientX - box.left) * about.width / box.width)),
    Math.min(about.height - 1, Math.floor((event.clientY - box.top) * about.height / box.height)));
};
canvas.oncontextmenu = (event) => event.preventDefault();

const fingers = new Map();  // active pointers: one rotates, two zoom
const apart = () => { const [a, b] = [...fingers.values()]; return Math.max(1, Math.hypot(a[0] - b[0], a[1] - b[1])); };
canvas.onpointerdown = (event) => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
};
canvas.onpointerup = canvas.onpointercancel = (event) => fingers.delete(event.pointerId);
canvas.onpointermove = (event) => {
  const last = fingers.get(event.pointerId), now = [event.clientX, event.clientY];
  if (!last) return;
  const before = fingers.size === 2 ? apart() : 1;
  fingers.set(event.pointerId, now);
  if (fingers.size === 2) look(state.yaw, state.pitch, state.closer * before / apart());
  const pixels = about.width / canvas.getBoundingClientRect().width;
  if (marks && fingers.size === 1) return;
  if (fingers.size === 1 && (event.shiftKey || event.buttons === 2)) look(state.yaw, state.pitch, state.closer,
    state.right + (now[0] - last[0]) * pixels, state.down + (now[1] - last[1]) * pixels);
  else if (fingers.size === 1)
    look(state.yaw - (now[0] - last[0]) * 0.004, state.pitch - (now[1] - last[1]) * 0.004, state.closer);
  draw();
};
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  look(state.yaw, state.pitch, state.closer * Math.exp(event.deltaY * 0.001));
  draw();
}, {passive: false});
function step(frames) {  // to the previous or next frame; in the error layer, held-out frame
  const times = state.layer === 3 ? about.held_out.map((frame) => frame.time) : about.frames.times;
  stop();
  go(times[(nearest(times, state.time) + frames + times.length) % times.length]);
}

const TURNS = {ArrowLeft: [-0.05, 0, 1], ArrowRight: [0.05, 0, 1], ArrowUp: [0, -0.05, 1], ArrowDown: [0, 0.05, 1],
  "+": [0, 0, 0.95], "-": [0, 0, 1 / 0.95]};
const KEYS = {" ": () => toggle("playing"), o: () => toggle("orbiting"), ",": () => step(-1), ".": () => step(1),
  0: () => element("reset").onclick()};
document.onkeydown = (event) => {  // slider and lists handle their own keys; space presses a button
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  const on = event.target.tagName;
  if (on === "INPUT" || on === "SELECT" || (on === "BUTTON" && event.key === " ")) return;
  const turn = TURNS[event.key];
  if (!turn && !KEYS[event.key]) return;
  event.preventDefault();
  if (event.repeat && (event.key === " " || event.key === "o")) return;  // a key that is held starts or stops once
  if (turn && event.shiftKey && event.key.startsWith("Arrow")) look(state.yaw, state.pitch, state.closer,
    state.right + 200 * turn[0], state.down + 200 * turn[1]);
  else if (turn) look(state.yaw + turn[0], state.pitch + turn[1], state.closer * turn[2]);
  else KEYS[event.key]();
  draw();
};
let chipped = "";  // the windows whose held-out frames have buttons
function chips() {
  const now = shows(state.time), frames = about.held_out.filter((frame) => !about.windows || now.includes(frame.window));
  if (chipped === now.join()) return;
  chipped = now.join();
  for (const chip of element("chips").querySelectorAll("button")) chip.remove();
  for (const frame of frames) {
    const chip = document.createElement("button");
    chip.textContent = frame.time.toFixed(3);
    chip.title = frame.name;
    chip.onclick = () => visit(frame, state.layer === 3);
    chip.classList.toggle("on", frame === held);
    element("chips").append(chip);
  }
  element("chips").hidden = frames.length === 0;
}
element("layer").options[3].disabled = about.held_out.length === 0;
element("note").textContent = about.count.toLocaleString("en") + (about.count === 1 ? " Gaussian" : " Gaussians") +
  (about.windows ? " at most in each of " + spans.length + " windows, loaded on demand; lengths in "
    : ", " + about.times.length + (about.times.length === 1 ? " key time" : " key times") + "; lengths in ") + about.unit +
  ". The page interpolates between key times. Drag to rotate; use the wheel or two fingers to zoom, Shift or the right " +
  "button to pan. Keys: space plays, arrows rotate, Shift and arrows pan, + and - zoom, comma and full stop step by one frame, o orbits, 0 resets.";
if (!about.windows && about.times.length < 2 && about.cameras.length < 2) for (const id of ["play", "slider", "time"]) element(id).hidden = true;

// `#t=0.4&layer=depth&yaw=0.2` opens the page at a view; `probe` adds the drawn picture and its duration as text.
const asked = new URLSearchParams(location.hash.slice(1));
state.time = Math.max(0, Math.min(1, Number(asked.get("t")) || 0));
const wish = (name, rest = 0) => Number(asked.get(name)) || rest;
look(wish("yaw"), wish("pitch"), wish("closer", 1), wish("right"), wish("down"));
const layer = LAYERS.indexOf(asked.get("layer"));
choose(layer > 0 && layer < 3 ? layer : 0);
try { await Promise.all(shows(state.time).map(fetched)); }
catch (error) { return about.windows ? null : fail("This browser cannot show the scene: " + error.message); }
draw();
if (asked.has("held_out")) {
  const frame = about.held_out[Number(asked.get("held_out"))];
  if (frame) await visit(frame, asked.get("layer") === "error");
} else if (asked.get("layer") === "error" && about.held_out.length) await visit(nearestHeld(state.time), true);
if (asked.has("measure")) {  // two pixels, `measure=10,20,30,40`
  const [a, b, c, d] = asked.get("measure").split(",").map(Number);
  element("measure").onclick();
  mark(a, b);
  mark(c, d);
}
if (asked.has("probe")) {
  const text = document.createElement("pre"), pixel = new Uint8Array(4), milliseconds = [];
  text.id = "probe";
  text.hidden = true;
  const shown = canvas.toDataURL("image/png");
  for (let k = 0; k < 20; k++) {
    const began = performance.now();
    draw();
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);  // waits until the picture is drawn
    milliseconds.push(performance.now() - began);
  }
  text.textContent = JSON.stringify({picture: shown, milliseconds, errors: gl.getError(), precise});
  document.body.append(text);
}
})();
