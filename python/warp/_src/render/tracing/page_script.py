"""The page that shows a scene: WebGL 2 without libraries."""

PAGE = r"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>@TITLE@</title>
<style>
:root { color-scheme: light dark; --ink: #222; --back: #eef1f5; --bar: #ffffffd0; }
@media (prefers-color-scheme: dark) { :root { --ink: #ddd; --back: #16181d; --bar: #22262ed0; } }
html, body { margin: 0; height: 100%; background: var(--back); overflow: hidden;
  font: 14px/1.4 system-ui, sans-serif; color: var(--ink); }
canvas { width: 100vw; height: 100vh; display: block; touch-action: none; cursor: grab; }
#bar { position: fixed; left: 12px; right: 12px; bottom: 12px; padding: 8px 12px; display: flex;
  gap: 12px; align-items: center; background: var(--bar); border-radius: 10px; }
[hidden] { display: none !important; }
#bar input { flex: 1; min-width: 60px; }
button { font: inherit; min-width: 64px; padding: 4px 10px; }
#title { position: fixed; left: 12px; top: 12px; padding: 2px 10px; font-weight: 600;
  background: var(--bar); border-radius: 10px; }
#problem { position: fixed; inset: 40% 10%; text-align: center; }
</style>
</head>
<body>
<canvas id="view" tabindex="0" aria-label="scene: drag to turn, wheel to zoom"></canvas>
<div id="title">@TITLE@</div>
<div id="bar" hidden><button id="play">Play</button>
<input id="scrub" type="range" min="0" value="0" aria-label="frame"><span id="number"></span></div>
<div id="problem" hidden></div>
<script type="application/json" id="data">@DATA@</script>
<script type="text/plain" id="blob">@BLOB@</script>
<script>
"use strict";
const byId = name => document.getElementById(name);
const data = JSON.parse(byId("data").textContent);
const packed = atob(byId("blob").textContent.trim());
const bytes = new Uint8Array(packed.length);
for (let i = 0; i < packed.length; ++i) bytes[i] = packed.charCodeAt(i);
const types = {uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array, float32: Float32Array};
const read = ([start, size, type]) => new types[type](bytes.buffer, start, size);

// The ground fades into the background, before its pattern is finer than pixels.
const LIGHT = `
uniform vec3 sun, zenith, eye, back;
uniform float shine, metal, glow, alpha, reach;
vec3 lit(vec3 color, vec3 n, vec3 p) {
  vec3 v = normalize(eye - p);
  if (dot(n, v) < 0.0) n = -n;
  float sky = 0.5 + 0.5 * dot(n, zenith);
  vec3 around = mix(vec3(0.30, 0.28, 0.26), vec3(0.62, 0.72, 0.85), sky);
  float direct = max(dot(n, sun), 0.0);
  vec3 h = normalize(sun + v);
  float gloss = pow(max(dot(n, h), 0.0), 4.0 + 200.0 * shine * shine) * (0.1 + shine);
  vec3 mirror = mix(vec3(1.0), color, metal);
  vec3 c = color * (around * 0.6 + direct * 0.9 * (1.0 - 0.6 * metal)) + mirror * gloss;
  float edge = pow(1.0 - max(dot(n, v), 0.0), 5.0);
  c += mirror * edge * 0.4 * (0.2 + shine) * sky;
  c = pow(mix(c / (1.0 + 0.25 * c), color, glow), vec3(1.0 / 2.2));
  return mix(c, back, smoothstep(4.0, 30.0, distance(eye, p) / reach));
}`;
const MESH_VERTEX = `#version 300 es
layout(location=0) in vec3 place; layout(location=1) in vec3 normal;
layout(location=2) in vec3 color; layout(location=3) in vec3 tint;
layout(location=4) in mat4 model;
uniform mat4 view, lens; uniform vec3 low, step_, base;
out vec3 p, n, c;
void main() {
  vec4 w = model * vec4(low + step_ * place, 1.0);
  p = w.xyz; n = mat3(model) * normal; c = base * color * tint;
  gl_Position = lens * view * w;
}`;
const MESH_PIXEL = `#version 300 es
precision highp float;
in vec3 p, n, c; out vec4 pixel; uniform float smooth_, checker; uniform vec3 east, north;
${LIGHT}
void main() {
  vec3 flat_ = normalize(cross(dFdx(p), dFdy(p)));
  vec3 m = smooth_ > 0.5 && dot(n, n) > 0.0 ? normalize(n) : flat_;
  vec3 color = c;
  if (checker > 0.0) {
    vec2 cell = floor(vec2(dot(p, east), dot(p, north)) / checker);
    if (mod(cell.x + cell.y, 2.0) > 0.5) color *= 0.45;
  }
  pixel = vec4(lit(color, m, p), alpha);
}`;
const BALL_VERTEX = `#version 300 es
layout(location=0) in vec2 corner; layout(location=1) in vec3 place;
layout(location=2) in float radius; layout(location=3) in vec3 color;
uniform mat4 view, lens; uniform vec3 low, step_, base;
out vec3 q, c; flat out vec4 ball;
void main() {
  vec4 w = view * vec4(low + step_ * place, 1.0);
  ball = vec4(w.xyz, radius); c = base * color;
  // Perspective widens the outline beyond the radius.
  q = w.xyz + vec3(corner * radius * 1.5, 0.0);
  gl_Position = lens * vec4(q, 1.0);
}`;
const BALL_PIXEL = `#version 300 es
precision highp float;
in vec3 q, c; flat in vec4 ball; out vec4 pixel; uniform mat4 view, lens;
${LIGHT}
void main() {
  vec3 d = normalize(q);
  float b = dot(d, ball.xyz);
  float s = b * b - dot(ball.xyz, ball.xyz) + ball.w * ball.w;
  if (s < 0.0) discard;
  vec3 x = d * (b - sqrt(s));
  mat3 turn = transpose(mat3(view));
  vec3 n = turn * ((x - ball.xyz) / ball.w);
  vec4 clip = lens * vec4(x, 1.0);
  gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
  pixel = vec4(lit(c, n, eye + turn * x), alpha);
}`;

const canvas = byId("view");
const gl = canvas.getContext("webgl2", {antialias: true, preserveDrawingBuffer: true});
if (!gl) {
  byId("problem").hidden = false;
  byId("problem").textContent = "This page needs WebGL 2, which the browser does not offer.";
  throw new Error("no WebGL 2");
}
function program(vertex, pixel) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, pixel]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS))
      throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  const places = {};
  return {made, at: name => places[name] ??= gl.getUniformLocation(made, name)};
}
function buffer(values, kind = gl.ARRAY_BUFFER) {
  const made = gl.createBuffer();
  gl.bindBuffer(kind, made);
  gl.bufferData(kind, values, gl.STATIC_DRAW);
  return made;
}
function feed(place, made, size, type, scaled, every, stride = 0, offset = 0) {
  gl.bindBuffer(gl.ARRAY_BUFFER, made);
  gl.enableVertexAttribArray(place);
  gl.vertexAttribPointer(place, size, type, scaled, stride, offset);
  gl.vertexAttribDivisor(place, every);
}

const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0]];
const unit = a => { const s = Math.hypot(...a) || 1; return a.map(v => v / s); };

function normalsOf(part, points) {
  const out = new Float32Array(points.length), {step} = part.points, index = part.faces;
  for (let f = 0; f < index.length; f += 3) {
    const [i, j, k] = [3 * index[f], 3 * index[f + 1], 3 * index[f + 2]];
    const e = [], g = [];
    for (let d = 0; d < 3; ++d) {
      e.push((points[j + d] - points[i + d]) * step[d]);
      g.push((points[k + d] - points[i + d]) * step[d]);
    }
    const n = cross(e, g);
    for (let d = 0; d < 3; ++d) {
      out[i + d] += n[d]; out[j + d] += n[d]; out[k + d] += n[d];
    }
  }
  for (let i = 0; i < out.length; i += 3) {
    const s = Math.hypot(out[i], out[i + 1], out[i + 2]) || 1;
    out[i] /= s; out[i + 1] /= s; out[i + 2] /= s;
  }
  return out;
}
const meshes = program(MESH_VERTEX, MESH_PIXEL), balls = program(BALL_VERTEX, BALL_PIXEL);
const square = buffer(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]));
let triangles = 0, ballCount = 0;
for (const part of data.meshes) {
  part.faces = read(part.indices);
  part.elements = buffer(part.faces, gl.ELEMENT_ARRAY_BUFFER);
  part.hues = part.colors && buffer(read(part.colors));
  part.shown = null;
  for (const copy of part.copies) {
    copy.count = copy.transforms[0][1] / 16;
    copy.hues = buffer(read(copy.tints));
    triangles += part.faces.length / 3 * copy.count;
  }
}
for (const part of data.spheres) {
  part.hues = buffer(read(part.colors));
  ballCount += part.radii[0][1];
}
function place(part, lists) {
  // Buffers are filled again only where a frame differs from the one shown.
  for (const [name, list, make] of lists) {
    const entry = list[Math.min(frame, list.length - 1)], key = entry[0] + ":" + entry[1];
    if (part[name + "Key"] === key) continue;
    part[name + "Key"] = key;
    if (part[name]) gl.deleteBuffer(part[name]);
    const values = read(entry);
    part[name] = buffer(values);
    if (make) make(values);
  }
}

const turn = {yaw: 0, pitch: 0, far: 1, target: data.view.target.slice()};
const up = data.up, east = unit(cross(Math.abs(up[2]) < 0.9 ? [0, 0, 1] : [0, 1, 0], up));
const north = cross(up, east);
{
  const away = add(data.view.eye, data.view.target, -1);
  turn.far = Math.hypot(...away);
  turn.pitch = Math.asin(Math.max(-1, Math.min(1, dot(unit(away), up))));
  turn.yaw = Math.atan2(dot(away, north), dot(away, east));
}
function eyeOf() {
  const c = Math.cos(turn.pitch) * turn.far;
  let eye = add(turn.target, east, c * Math.cos(turn.yaw));
  eye = add(eye, north, c * Math.sin(turn.yaw));
  return add(eye, up, Math.sin(turn.pitch) * turn.far);
}
let frame = 0, playing = false, dirty = true;
let back = [0, 0, 0];
const begun = turn.far;
function common(shader, view, lens, eye, material) {
  gl.uniformMatrix4fv(shader.at("view"), false, view);
  gl.uniformMatrix4fv(shader.at("lens"), false, lens);
  gl.uniform3fv(shader.at("sun"), unit(data.sun));
  gl.uniform3fv(shader.at("zenith"), up);
  gl.uniform3fv(shader.at("eye"), eye);
  gl.uniform3fv(shader.at("back"), back);
  gl.uniform1f(shader.at("reach"), Math.max(begun, turn.far));
  gl.uniform3fv(shader.at("base"), material.color);
  for (const name of ["shine", "metal", "glow", "alpha"])
    gl.uniform1f(shader.at(name), material[name]);
}
function draw() {
  const scale = Math.min(devicePixelRatio || 1, 2);
  const w = Math.round(canvas.clientWidth * scale), h = Math.round(canvas.clientHeight * scale);
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  gl.viewport(0, 0, w, h);
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  back = dark ? [0.086, 0.094, 0.114] : [0.933, 0.945, 0.961];
  gl.clearColor(...back, 1);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  gl.enable(gl.DEPTH_TEST);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  const eye = eyeOf(), z = unit(add(eye, turn.target, -1)), x = unit(cross(up, z));
  // A window narrower than the picture shows its whole width.
  const shape = Math.min(1, w / h / data.view.aspect);
  const y = cross(z, x), t = shape / Math.tan(data.view.fov * Math.PI / 360);
  const near = turn.far * 0.005, far = turn.far * 400;
  const view = [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0,
    -dot(x, eye), -dot(y, eye), -dot(z, eye), 1];
  const lens = [t * h / w, 0, 0, 0, 0, t, 0, 0, 0, 0, (far + near) / (near - far), -1,
    0, 0, 2 * far * near / (near - far), 0];
  // Transparent parts are drawn last and write no depth.
  for (const clear of [false, true]) {
    gl.depthMask(!clear);
    drawParts(clear, view, lens, eye);
  }
  gl.depthMask(true);
}
function drawParts(clear, view, lens, eye) {
  gl.useProgram(meshes.made);
  gl.uniform3fv(meshes.at("east"), east);
  gl.uniform3fv(meshes.at("north"), north);
  for (const part of data.meshes) {
    place(part, [["points_", part.points.frames, values => {
      if (!part.smooth) return;
      if (part.normals) gl.deleteBuffer(part.normals);
      part.normals = buffer(normalsOf(part, values));
    }]]);
    gl.uniform3fv(meshes.at("low"), part.points.low);
    gl.uniform3fv(meshes.at("step_"), part.points.step);
    gl.uniform1f(meshes.at("smooth_"), part.smooth ? 1 : 0);
    feed(0, part.points_, 3, gl.UNSIGNED_SHORT, false, 0);
    if (part.smooth) feed(1, part.normals, 3, gl.FLOAT, false, 0);
    else gl.disableVertexAttribArray(1);
    if (part.hues) feed(2, part.hues, 3, gl.UNSIGNED_BYTE, true, 0);
    else { gl.disableVertexAttribArray(2); gl.vertexAttrib3f(2, 1, 1, 1); }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, part.elements);
    for (const copy of part.copies) {
      if ((copy.material.alpha < 1) !== clear) continue;
      place(copy, [["models", copy.transforms]]);
      common(meshes, view, lens, eye, copy.material);
      gl.uniform1f(meshes.at("checker"), copy.material.checker);
      feed(3, copy.hues, 3, gl.UNSIGNED_BYTE, true, 1);
      for (let k = 0; k < 4; ++k) feed(4 + k, copy.models, 4, gl.FLOAT, false, 1, 64, 16 * k);
      gl.drawElementsInstanced(gl.TRIANGLES, part.faces.length, gl.UNSIGNED_INT, 0, copy.count);
    }
  }
  for (let k = 4; k < 8; ++k) gl.disableVertexAttribArray(k);
  gl.useProgram(balls.made);
  for (const part of data.spheres) {
    if ((part.material.alpha < 1) !== clear) continue;
    place(part, [["places", part.centers.frames], ["sizes", part.radii]]);
    common(balls, view, lens, eye, part.material);
    gl.uniform3fv(balls.at("low"), part.centers.low);
    gl.uniform3fv(balls.at("step_"), part.centers.step);
    feed(0, square, 2, gl.FLOAT, false, 0);
    feed(1, part.places, 3, gl.UNSIGNED_SHORT, false, 1);
    feed(2, part.sizes, 1, gl.FLOAT, false, 1);
    feed(3, part.hues, 3, gl.UNSIGNED_BYTE, true, 1);
    const count = part.radii[Math.min(frame, part.radii.length - 1)][1];
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
  }
}

function show(number) {
  frame = (number % data.count + data.count) % data.count;
  byId("scrub").value = frame;
  byId("number").textContent = `${frame + 1} / ${data.count}`;
  dirty = true;
}
function run(on) {
  playing = on && data.count > 1;
  byId("play").textContent = playing ? "Pause" : "Play";
}
byId("bar").hidden = data.count < 2;
byId("scrub").max = data.count - 1;
byId("scrub").oninput = event => { run(false); show(Number(event.target.value)); };
byId("play").onclick = () => run(!playing);
addEventListener("keydown", event => {
  if (event.key === " ") { run(!playing); event.preventDefault(); }
  if (event.key === "ArrowRight") { run(false); show(frame + 1); }
  if (event.key === "ArrowLeft") { run(false); show(frame - 1); }
});
const fingers = new Map();
canvas.onpointerdown = event => {
  canvas.setPointerCapture(event.pointerId);
  fingers.set(event.pointerId, [event.clientX, event.clientY]);
};
canvas.onpointerup = canvas.onpointercancel = event => fingers.delete(event.pointerId);
canvas.onpointermove = event => {
  const last = fingers.get(event.pointerId);
  if (!last) return;
  const here = [event.clientX, event.clientY], move = [here[0] - last[0], here[1] - last[1]];
  if (fingers.size === 2) {
    const [other] = [...fingers].filter(([id]) => id !== event.pointerId).map(([, at]) => at);
    const span = at => Math.max(1, Math.hypot(at[0] - other[0], at[1] - other[1]));
    turn.far *= span(last) / span(here);
  } else if (event.buttons & 2 || event.shiftKey) {
    const z = unit(add(eyeOf(), turn.target, -1)), x = unit(cross(up, z)), y = cross(z, x);
    const wide = canvas.clientWidth / canvas.clientHeight / data.view.aspect;
    const size = 2 * turn.far * Math.tan(data.view.fov * Math.PI / 360) /
      canvas.clientHeight / Math.min(1, wide);
    turn.target = add(add(turn.target, x, -move[0] * size), y, move[1] * size);
  } else {
    turn.yaw -= move[0] * 0.006;
    turn.pitch = Math.max(-1.55, Math.min(1.55, turn.pitch + move[1] * 0.006));
  }
  fingers.set(event.pointerId, here);
  dirty = true;
};
canvas.oncontextmenu = event => event.preventDefault();
canvas.addEventListener("wheel", event => {
  turn.far *= Math.exp(event.deltaY * 0.001);
  dirty = true;
  event.preventDefault();
}, {passive: false});
addEventListener("resize", () => { dirty = true; });
matchMedia("(prefers-color-scheme: dark)").onchange = () => { dirty = true; };
let before = 0;
function tick(now) {
  if (playing && now - before >= 1000 / data.fps) { before = now; show(frame + 1); }
  if (dirty) { dirty = false; draw(); }
  requestAnimationFrame(tick);
}
show(0);
draw();
run(data.count > 1);
requestAnimationFrame(tick);
window.warpScene = {
  get frame() { return frame; }, get playing() { return playing; }, count: data.count,
  triangles, spheres: ballCount, error: () => gl.getError(),
};
</script>
</body>
</html>
"""
