"use strict";
// Masks of key frames drawn by hand. A frame holds shapes in the order in which they were drawn: polygons filled by the
// even-odd rule, and strokes of a round brush; each adds pixels or erases them. Coordinates are pixels of the picture,
// and the centre of the first pixel is at (0.5, 0.5).
(function () {
const element = (id) => document.getElementById(id);
const about = JSON.parse(element("about").textContent);
const {width, height, frames} = about;
const TINT = {instrument: "#00c98d", never: "#e8a317"};
// px of the screen: to hit a corner, to begin a drag, between its points, to the border of the picture
const CLOSE = 9, FREEHAND = 4, SPACING = 2, SNAP = 5;
const AROUND = 310; // px of the window for the title above the picture, and for the text and the frames below it
const MOST_ZOOM = 16, MOST_UNDO = 300, LEAST_NODES = 12;
const MOST_POINTS = 5000, MOST_OF_FILE = 100000;  // points of a shape, and of a file, that the package reads
const ORIGINS = {colour: "Draft by colour", carried: "Draft carried from the drawn frames"};
const canvas = element("picture"), context = canvas.getContext("2d");

// ---------------------------------------------------------------- what is drawn
// A state is never changed in place: undo keeps the old ones.
let state = {frames: frames.map((f) => ({shapes: f.shapes, key: f.key})), never: about.never};
let undone = [], done = [], saved = state;
let at = Math.max(0, frames.findIndex((f) => !f.key)), kind = "instrument", tool = "polygon", radius = 10;
let open = null;     // corners of the polygon that is being drawn
let stroke = null;   // brush stroke that is being drawn
let held = null;     // {index, corner, from, points}: what Adjust moves
let cross = [width / 2, height / 2], crossShown = false;
let view = {scale: 0, x: 0, y: 0};  // screen = picture * scale + (x, y), in pixels of the canvas

const shapesOf = (s, k) => (k === "never" ? s.never : s.frames[at].shapes);
function changed(shapes) {  // the shapes of the current kind
  if (kind === "never") return {...state, never: shapes};
  return {...state, frames: state.frames.map((f, i) => (i === at ? {shapes, key: shapes.length > 0} : f))};
}
function commit(next) {
  done.push(state);
  if (done.length > MOST_UNDO) done.shift();
  undone = [];
  state = next;
  refresh();
}
function add(...shapes) { commit(changed([...shapesOf(state, kind), ...shapes])); }
const rounded = (points) => points.map(([x, y]) => [Math.round(x * 100) / 100, Math.round(y * 100) / 100]);

// ---------------------------------------------------------------- pictures and masks
const pictures = frames.map((f) => {
  const image = new Image();
  image.onload = paint;
  image.src = f.picture;
  return image;
});
const layers = {};
for (const name of ["instrument", "never", "draft"]) {
  layers[name] = document.createElement("canvas");
  layers[name].width = width;
  layers[name].height = height;
}

function outline(target, points) {
  target.beginPath();
  points.forEach(([x, y], i) => (i ? target.lineTo(x, y) : target.moveTo(x, y)));
}
function fill(layer, shapes, colour) {
  layer.width = width;  // empties the layer and resets its state
  const target = layer.getContext("2d");
  target.fillStyle = target.strokeStyle = colour;
  target.lineCap = target.lineJoin = "round";
  for (const shape of shapes) {
    target.globalCompositeOperation = shape.erase ? "destination-out" : "source-over";
    outline(target, shape.points);
    if (shape.tool === "polygon") target.fill("evenodd");
    else {
      target.lineWidth = 2 * shape.radius;
      if (shape.points.length === 1) target.lineTo(...shape.points[0]);
      target.stroke();
    }
  }
}
function drawn(k) {  // the shapes with the stroke in progress
  const shapes = shapesOf(state, k);
  if (k !== kind) return shapes;
  if (held) return shapes.map((s, i) => (i === held.index ? {...s, points: held.points} : s));
  return stroke ? [...shapes, stroke] : shapes;
}
const draftOf = () => (state.frames[at].key || !frames[at].draft ? null : frames[at].draft);

function paint() {
  const factor = window.devicePixelRatio || 1, {clientWidth} = canvas;
  const room = Math.max(0.5 * window.innerHeight, window.innerHeight - AROUND); // the frames below stay in the window
  const tall = Math.min(clientWidth * height / width, room);
  canvas.style.height = tall + "px";
  if (canvas.width !== Math.round(clientWidth * factor) || canvas.height !== Math.round(tall * factor)) {
    sized(Math.round(clientWidth * factor), Math.round(tall * factor));
  }
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, canvas.width, canvas.height);
  context.setTransform(view.scale, 0, 0, view.scale, view.x, view.y);
  context.imageSmoothingEnabled = view.scale < 3;
  if (pictures[at].complete && pictures[at].naturalWidth) context.drawImage(pictures[at], 0, 0, width, height);
  for (const name of ["never", "instrument"]) {
    const shapes = drawn(name);
    if (!shapes.length) continue;
    fill(layers[name], shapes, TINT[name]);
    context.globalAlpha = 0.45;
    context.drawImage(layers[name], 0, 0);
    context.globalAlpha = 1;
  }
  marks(1 / view.scale * factor);
}
function marks(pixel) {  // outlines, corners and the cross; `pixel` is one pixel of the screen
  const draft = draftOf();
  context.lineWidth = 1.5 * pixel;
  if (draft) {
    context.setLineDash([6 * pixel, 5 * pixel]);
    context.strokeStyle = "#fff";
    for (const shape of draft.shapes) { outline(context, shape.points); context.closePath(); context.stroke(); }
    context.setLineDash([]);
  }
  for (const shape of drawn(kind)) {
    if (shape.tool !== "polygon") continue;
    context.strokeStyle = TINT[kind];
    outline(context, shape.points);
    context.closePath();
    context.stroke();
    if (tool === "adjust") for (const p of shape.points) corner(p, pixel, "#fff");
  }
  if (open) {
    context.strokeStyle = "#fff";
    outline(context, open);
    context.lineTo(...cross);
    context.stroke();
    open.forEach((p, i) => corner(p, pixel, i ? "#fff" : TINT[kind]));
  }
  const round = tool === "brush" || tool === "eraser";
  if (crossShown || round) {
    context.strokeStyle = "#fff";
    context.beginPath();
    if (round) context.arc(...cross, radius, 0, 2 * Math.PI);
    const r = 9 * pixel;
    if (crossShown) for (const [dx, dy] of [[r, 0], [0, r]]) {
      context.moveTo(cross[0] - dx, cross[1] - dy);
      context.lineTo(cross[0] + dx, cross[1] + dy);
    }
    context.stroke();
  }
}
function corner([x, y], pixel, colour) {
  context.fillStyle = colour;
  context.fillRect(x - 3 * pixel, y - 3 * pixel, 6 * pixel, 6 * pixel);
}

// ---------------------------------------------------------------- the view
const least = () => Math.min(canvas.width / width, canvas.height / height);
function sized(across, down) {  // a zoom stays, with the same point in the middle
  const {scale, x, y} = view, zoomed = scale / least();
  const middle = [(canvas.width / 2 - x) / scale, (canvas.height / 2 - y) / scale];
  canvas.width = across;
  canvas.height = down;
  fit();
  const now = zoomed * least();
  if (zoomed > 1) view = {scale: now, x: across / 2 - middle[0] * now, y: down / 2 - middle[1] * now};
}
function fit() {
  const scale = least();
  view = {scale, x: (canvas.width - scale * width) / 2, y: (canvas.height - scale * height) / 2};
}
function zoom(factor, [x, y]) {  // about a point of the picture
  const scale = Math.min(Math.max(view.scale * factor, least()), MOST_ZOOM * least());
  view = {scale, x: view.x + x * (view.scale - scale), y: view.y + y * (view.scale - scale)};
  if (scale === least()) fit();
  paint();
}
function pan(dx, dy) { view = {...view, x: view.x + dx, y: view.y + dy}; paint(); }
function follow() {  // the cross stays in view
  const [x, y] = [cross[0] * view.scale + view.x, cross[1] * view.scale + view.y];
  const into = (value, size) => Math.min(Math.max(value, 0.05 * size), 0.95 * size) - value;
  if (x < 0 || y < 0 || x > canvas.width || y > canvas.height) pan(into(x, canvas.width), into(y, canvas.height));
}
function place(event) {
  const box = canvas.getBoundingClientRect(), factor = canvas.width / box.width;
  const x = (event.clientX - box.left) * factor, y = (event.clientY - box.top) * factor;
  return [(x - view.x) / view.scale, (y - view.y) / view.scale];
}
const inside = ([x, y]) => [Math.min(Math.max(x, 0), width), Math.min(Math.max(y, 0), height)];
const reach = (pixels) => (pixels * (window.devicePixelRatio || 1)) / view.scale;  // screen to picture
function snapped([x, y]) {  // to the border of the picture, where instruments enter
  const to = (value, size) => (value < reach(SNAP) ? 0 : value > size - reach(SNAP) ? size : value);
  return [to(x, width), to(y, height)];
}
const apart = (a, b) => Math.hypot(a[0] - b[0], a[1] - b[1]);

// ---------------------------------------------------------------- tools: press, move, release
let pressed = null;  // where, and whether it has become a drag
function press(point) {
  pressed = {point, drag: false, begins: open === null, open: open && [...open]};
  if (tool === "adjust") take(point);
  else if (tool !== "polygon") {
    stroke = {tool: "brush", erase: tool === "eraser", radius, points: [point], origin: "drawn"};
  } else if (open && open.length > 2 && apart(point, open[0]) <= reach(CLOSE)) {
    pressed = null;
    close();
  } else if (!open || apart(point, open.at(-1)) > reach(1)) open = [...(open || []), point];
  paint();
}
function move(point) {
  if (pressed && apart(point, pressed.point) > reach(FREEHAND)) pressed.drag = true;
  if (stroke && apart(point, stroke.points.at(-1)) > reach(SPACING)) stroke.points = [...stroke.points, point];
  if (held) {
    const by = [point[0] - held.from[0], point[1] - held.from[1]];
    const follows = (i) => held.corner < 0 || held.corner === i;
    held.points = held.start.map((p, i) => (follows(i) ? inside([p[0] + by[0], p[1] + by[1]]) : p));
  }
  const freehand = pressed && pressed.drag && tool === "polygon" && open;
  if (freehand && apart(point, open.at(-1)) > reach(SPACING)) open.push(point);
  paint();
}
function release() {
  if (stroke) {
    const finished = pieces({...stroke, points: rounded(stroke.points)});
    stroke = null;
    if (!finished[0].erase || shapesOf(state, kind).length) add(...finished);  // on an empty frame nothing is erased
  } else if (held) {
    const {index, points} = held;
    held = null;
    commit(changed(shapesOf(state, kind).map((s, i) => (i === index ? {...s, points: rounded(points)} : s))));
  } else if (pressed && pressed.drag && pressed.begins && tool === "polygon") close();
  pressed = null;
  paint();
}
function pieces(drawn) {  // a stroke in parts of at most MOST_POINTS, each of which begins where the last one ends
  const found = [];
  for (let i = 0; i === 0 || i < drawn.points.length - 1; i += MOST_POINTS - 1)
    found.push({...drawn, points: drawn.points.slice(i, i + MOST_POINTS)});
  return found;
}
function thinned(points) {  // at most MOST_POINTS corners: every second one, until they are few enough
  return points.length > MOST_POINTS ? thinned(points.filter((_, i) => i % 2 === 0)) : points;
}
function settle() {  // what is being drawn belongs to the frame, the kind and the tool with which it began
  release();
  if (open) close();
}
function close() {
  const points = open && thinned(rounded(open));
  open = null;
  if (points && points.length > 2) add({tool: "polygon", erase: false, points, origin: "drawn"});
  paint();
}
function take(point) {  // a corner within reach, or the last polygon around the point
  const shapes = shapesOf(state, kind);
  let best = reach(CLOSE);
  for (const [index, shape] of shapes.entries()) {
    if (shape.tool !== "polygon") continue;
    shape.points.forEach((p, i) => {
      if (apart(p, point) <= best) { best = apart(p, point); held = {index, corner: i}; }
    });
  }
  for (let index = shapes.length - 1; index >= 0 && !held; index--) {
    if (shapes[index].tool === "polygon" && encloses(shapes[index].points, point)) held = {index, corner: -1};
  }
  if (held) held = {...held, from: point, start: shapes[held.index].points, points: shapes[held.index].points};
}
function encloses(points, [x, y]) {
  let odd = false;
  points.forEach(([x1, y1], i) => {
    const [x0, y0] = points.at(i - 1);
    if (y0 > y !== y1 > y && x < x0 + ((y - y0) / (y1 - y0)) * (x1 - x0)) odd = !odd;
  });
  return odd;
}

// ---------------------------------------------------------------- copies, moved by the flow
// frames[k].ahead holds the displacement from frame k of the page to frame k + 1 at the nodes of a grid, and
// frames[k].back that to frame k - 1. An instrument moves as one body: the displacement of a shape is the affine map
// that fits its nodes, or their median where they are few.
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
function node(field, i) {
  const {step, columns} = about.grid;
  return [(i % columns) * step + step / 2, Math.floor(i / columns) * step + step / 2, field.x[i], field.y[i]];
}
function moved(points, field) {
  const every = field.x.map((_, i) => node(field, i));
  const [cx, cy] = [0, 1].map((k) => points.reduce((sum, p) => sum + p[k], 0) / points.length);
  let own = every.filter(([x, y]) => encloses(points, [x, y]));
  if (own.length < 3) own = every.sort((a, b) => apart(a, [cx, cy]) - apart(b, [cx, cy])).slice(0, 3);
  const shift = [median(own.map((n) => n[2])), median(own.map((n) => n[3]))];
  const near = own.filter((n) => apart([n[2], n[3]], shift) < Math.max(4, 0.3 * Math.hypot(...shift)));
  const map = near.length >= LEAST_NODES ? affine(near) : null;
  const by = ([x, y]) => (map ? [map[0](x, y), map[1](x, y)] : shift);
  const onBorder = (value, size) => value <= 1 || value >= size - 1;  // an instrument that enters there still does
  const kept = (value, size, shift) => (onBorder(value, size) ? value : value + shift);
  return rounded(points.map((p) => inside([kept(p[0], width, by(p)[0]), kept(p[1], height, by(p)[1])])));
}
function affine(nodes) {  // least squares of both displacements; null if one changes by more than 1/3 px per px
  const mean = (f) => nodes.reduce((sum, n) => sum + f(n), 0) / nodes.length;
  const mx = mean((n) => n[0]), my = mean((n) => n[1]);
  const xx = mean((n) => (n[0] - mx) ** 2), yy = mean((n) => (n[1] - my) ** 2);
  const xy = mean((n) => (n[0] - mx) * (n[1] - my));
  const det = xx * yy - xy * xy;
  if (det < 1e-3 * xx * yy) return null;
  const slopes = [2, 3].map((k) => {
    const m = mean((n) => n[k]);
    const px = mean((n) => (n[0] - mx) * (n[k] - m)), py = mean((n) => (n[1] - my) * (n[k] - m));
    return [m, (px * yy - py * xy) / det, (py * xx - px * xy) / det];
  });
  if (slopes.some(([, a, b]) => Math.hypot(a, b) > 1 / 3)) return null;
  return slopes.map(([m, a, b]) => (x, y) => m + a * (x - mx) + b * (y - my));
}
function copySource(direction) {  // the nearest drawn frame on a side
  for (let i = at + direction; i >= 0 && i < frames.length; i += direction) if (state.frames[i].key) return i;
  return null;
}
function copy(direction) {
  const from = copySource(direction);
  if (from === null) return;
  let shapes = state.frames[from].shapes;
  for (let i = from; i !== at; i -= direction) {
    const field = direction < 0 ? frames[i].ahead : frames[i].back;
    if (field) shapes = shapes.map((s) => ({...s, points: moved(s.points, field), origin: "copied"}));
  }
  kind = "instrument";
  if (shapes.length) commit(changed([...state.frames[at].shapes, ...shapes]));
  else if (!state.frames[at].shapes.length) noInstrument();
}
function useDraft() {
  const draft = draftOf();
  if (!draft) return;
  kind = "instrument";
  commit(changed(draft.shapes));
}
function noInstrument() {
  commit({...state, frames: state.frames.map((f, i) => (i === at ? {shapes: [], key: true} : f))});
}

// ---------------------------------------------------------------- the file
function text() {
  const every = state.frames.map(({shapes}, i) => ({frame: frames[i].frame, name: frames[i].name, shapes}));
  const keys = every.filter((_, i) => state.frames[i].key);
  return JSON.stringify({format: about.format, frames: about.count, width, height, keys, never: state.never}) + "\n";
}
function save() {
  settle();
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text()], {type: "application/json"}));
  link.download = "keys.json";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  saved = state;
  refresh();
}
window.addEventListener("beforeunload", (event) => { if (state !== saved || open || stroke) event.preventDefault(); });

// ---------------------------------------------------------------- buttons and text
const strip = frames.map((f, i) => {
  const button = document.createElement("button"), image = document.createElement("img");
  const name = document.createElement("span"), said = document.createElement("span");
  image.src = f.picture;
  image.alt = "";
  name.textContent = button.title = f.name;
  said.className = "state";
  button.append(image, name, said);
  onClick(button, () => show(i));
  element("strip").append(button);
  return {button, said};
});
function show(i) {
  if (i < 0 || i >= frames.length) return;
  settle();
  at = i;
  const {button} = strip[i], row = element("strip"), left = button.offsetLeft - row.offsetLeft;
  const least = left + button.offsetWidth - row.clientWidth;
  row.scrollLeft = Math.min(Math.max(row.scrollLeft, least), left);  // in view, without scrolling the page
  refresh();
}
function stateText(i) {
  const f = state.frames[i];
  if (f.key) return f.shapes.length ? "drawn" : "no instrument";
  return frames[i].draft ? "draft, not used" : "not drawn";
}
function choose(name, value) {
  settle();
  if (name === "kind") kind = value;
  else tool = value;
  refresh();
}
function refresh() {
  for (const b of document.querySelectorAll("[data-kind]")) b.setAttribute("aria-pressed", b.dataset.kind === kind);
  for (const b of document.querySelectorAll("[data-tool]")) b.setAttribute("aria-pressed", b.dataset.tool === tool);
  strip.forEach(({button, said}, i) => {
    button.setAttribute("aria-pressed", i === at);
    said.textContent = stateText(i);
    said.classList.toggle("key", state.frames[i].key);
  });
  element("undo").disabled = !done.length && !open;
  element("redo").disabled = !undone.length;
  element("draft").disabled = !draftOf();
  element("copy_before").disabled = copySource(-1) === null;
  element("copy_after").disabled = copySource(1) === null;
  element("clear").disabled = !clearable();
  element("radius").value = radius;
  element("radius_text").textContent = radius + " px";
  const draft = draftOf(), keys = state.frames.filter((f) => f.key).length;
  const parts = [`Frame ${frames[at].frame} (${frames[at].name}), ${stateText(at)}`];
  parts.push(`${keys} of ${frames.length} frames are keys`);
  if (draft) parts.unshift(ORIGINS[draft.origin] + ": dashed outline, inspect it before you use it");
  if (state !== saved) parts.push("not saved");
  const points = [state.never, ...state.frames.map((f) => f.shapes)].flat().reduce((sum, s) => sum + s.points.length, 0);
  if (points > MOST_OF_FILE) parts.push(`${points} points: the command reads a file of at most ${MOST_OF_FILE}`);
  element("shown").textContent = parts.join("; ");
  paint();
}
function undo() {
  if (stroke || held) { stroke = held = pressed = null; return refresh(); }
  if (open) { open = open.length > 1 ? open.slice(0, -1) : null; return refresh(); }
  if (!done.length) return;
  undone.push(state);
  state = done.pop();
  refresh();
}
function redo() {
  if (!undone.length || stroke || held) return;
  done.push(state);
  state = undone.pop();
  refresh();
}
const clearable = () => shapesOf(state, kind).length > 0 || (kind === "instrument" && state.frames[at].key);
function clear() {  // a frame without an instrument becomes one that is not drawn
  settle();
  if (clearable()) commit(changed([]));
}
function resize(value) { radius = Math.min(Math.max(value, 1), 80); refresh(); }

// ---------------------------------------------------------------- mouse, pen, fingers, keys
const fingers = new Map();
let panning = null, pinch = null;
function spread() {  // of two fingers
  const [a, b] = [...fingers.values()];
  return {size: apart(a, b), middle: [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]};
}
canvas.addEventListener("pointerdown", (event) => {
  canvas.focus({preventScroll: true});
  canvas.setPointerCapture(event.pointerId);
  event.preventDefault();
  if (event.pointerType === "touch") fingers.set(event.pointerId, [event.clientX, event.clientY]);
  if (fingers.size === 2) {  // the first finger was the beginning of a zoom: what it began is dropped
    if (pressed) open = pressed.open;
    stroke = held = pressed = null;
    pinch = spread();
    return paint();
  }
  if (event.button) { panning = [event.clientX, event.clientY]; return; }
  crossShown = false;
  cross = inside(place(event));
  press(tool === "polygon" ? snapped(cross) : cross);
  refresh();
});
canvas.addEventListener("pointermove", (event) => {
  if (fingers.has(event.pointerId)) fingers.set(event.pointerId, [event.clientX, event.clientY]);
  const factor = window.devicePixelRatio || 1;
  if (pinch && fingers.size === 2) {
    const now = spread();
    pan((now.middle[0] - pinch.middle[0]) * factor, (now.middle[1] - pinch.middle[1]) * factor);
    zoom(now.size / pinch.size, place({clientX: now.middle[0], clientY: now.middle[1]}));
    pinch = now;
  } else if (panning) {
    pan((event.clientX - panning[0]) * factor, (event.clientY - panning[1]) * factor);
    panning = [event.clientX, event.clientY];
  } else {
    cross = inside(place(event));
    crossShown = false;
    move(tool === "polygon" ? snapped(cross) : cross);
  }
});
function lift(event) {
  fingers.delete(event.pointerId);
  if (fingers.size < 2) pinch = null;
  if (panning) panning = null;
  else { release(); refresh(); }
}
canvas.addEventListener("pointerup", lift);
canvas.addEventListener("pointercancel", lift);
canvas.addEventListener("dblclick", () => { if (open) close(); });
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoom(Math.exp(-event.deltaY / 400), place(event));
}, {passive: false});

const ARROWS = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
function arrow([dx, dy], far) {
  crossShown = true;
  cross = inside([cross[0] + dx * far, cross[1] + dy * far]);
  follow();
  move(cross);
}
function space() {
  crossShown = true;
  if (tool === "polygon") { press(cross); pressed = null; }
  else if (stroke || held) release();
  else press(cross);
  refresh();
}
const KEYS = {
  i: () => choose("kind", "instrument"), n: () => choose("kind", "never"), p: () => choose("tool", "polygon"),
  b: () => choose("tool", "brush"), e: () => choose("tool", "eraser"), m: () => choose("tool", "adjust"),
  a: useDraft, x: noInstrument, c: () => copy(-1), v: () => copy(1), z: undo, y: redo, s: save,
  "[": () => resize(radius - 1), "]": () => resize(radius + 1),
  "+": () => zoom(1.25, cross), "=": () => zoom(1.25, cross),
  "-": () => zoom(0.8, cross), "0": () => { fit(); paint(); }, ",": () => show(at - 1), ".": () => show(at + 1),
  PageUp: () => show(at - 1), PageDown: () => show(at + 1), Delete: clear, Backspace: undo,
  Enter: close, Escape: () => { open = stroke = held = null; refresh(); },
};
const ONCE = "axcvs ";  // keys that act once when they are held
window.addEventListener("keydown", (event) => {
  const typed = event.target.tagName, key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (event.altKey || ((event.ctrlKey || event.metaKey) && !["z", "y", "s"].includes(key))) return;
  if (typed === "INPUT" && key.startsWith("Arrow")) return;
  if ((typed === "BUTTON" || typed === "SUMMARY") && (key === "Enter" || key === " ")) return;
  if (event.repeat && ONCE.includes(key)) event.preventDefault();
  else if (ARROWS[key]) arrow(ARROWS[key], event.shiftKey ? 10 : 1);
  else if (key === " ") space();
  else if (key === "z" && event.shiftKey) redo();
  else if (KEYS[key]) KEYS[key]();
  else return;
  event.preventDefault();
});

const buttons = {
  draft: useDraft, none: noInstrument, copy_before: () => copy(-1), copy_after: () => copy(1), clear, undo, redo, save,
  closer: () => zoom(1.25, cross), farther: () => zoom(0.8, cross), fit: () => { fit(); paint(); },
};
function onClick(button, action) {  // after a click, keys go to the picture; after Enter or Space, to the button
  button.onclick = (event) => {
    action();
    if (event.detail) canvas.focus({preventScroll: true});
  };
}
for (const [id, action] of Object.entries(buttons)) onClick(element(id), action);
for (const b of document.querySelectorAll("[data-kind]")) onClick(b, () => choose("kind", b.dataset.kind));
for (const b of document.querySelectorAll("[data-tool]")) onClick(b, () => choose("tool", b.dataset.tool));
element("radius").oninput = (event) => resize(Number(event.target.value));
element("command").textContent = about.command;
new ResizeObserver(paint).observe(canvas);
window.addEventListener("resize", paint);
refresh();
})();
