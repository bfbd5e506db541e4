// Five figures that respond to the reader: <div class="widget" data-widget="NAME"></div>. No network, no library.
// Each keeps its numbers in `element.state`, which the tests compare with endotsr.definition.
"use strict";
(() => {
  const make = (parent, tag, attributes = {}, text = "") => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.textContent = text;
    parent.append(element);
    return element;
  };

  // A canvas of fixed units that CSS scales to the page; `drag(x, y, first)` receives units.
  const canvas = (parent, width, height, label, drag) => {
    const element = make(parent, "canvas", {width, height, role: "img", "aria-label": label});
    if (drag) {
      const at = (event, first) => {
        const box = element.getBoundingClientRect();
        drag(((event.clientX - box.left) / box.width) * width, ((event.clientY - box.top) / box.height) * height, first);
      };
      let down = false;
      element.style.touchAction = "none";
      element.addEventListener("pointerdown", (event) => { down = true; at(event, true); });
      window.addEventListener("pointermove", (event) => { if (down) at(event, false); });
      window.addEventListener("pointerup", () => { down = false; });
    }
    return element.getContext("2d");
  };

  const slider = (parent, name, low, high, step, value, shown, change) => {
    const label = make(parent, "label", {}, name + " ");
    const input = make(label, "input", {type: "range", min: low, max: high, step, value, "data-name": name});
    const output = make(label, "output");
    const update = () => { output.textContent = " " + shown(Number(input.value)); change(Number(input.value)); };
    input.addEventListener("input", update);
    output.textContent = " " + shown(value);
    return input;
  };

  // The same words on every system: a generator of 32 bits (Numerical Recipes), uniform in [0, 1).
  const uniform = (seed) => () => (seed = (Math.imul(1664525, seed) + 1013904223) >>> 0) / 2 ** 32;
  const css = ([r, g, b]) => `rgb(${[r, g, b].map((v) => Math.round(255 * Math.min(1, Math.max(0, v)))).join(",")})`;
  const dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);

  // ---- chapter 9: drag the opacities; (9.1), (9.3) ----
  const compositing = (box) => {
    const colours = [[0.85, 0.3, 0.25], [0.3, 0.65, 0.3], [0.25, 0.4, 0.85]], background = [0.1, 0.1, 0.1];
    const target = [0.5, 0.5, 0.5], alpha = [0.3, 0.6, 0.5], width = 560, height = 250, bar = 110, floor = 180;
    const set = (x, y, first) => {
      if (first) held = Math.floor(x / 140);
      if (held < 0 || held > 2) return;
      alpha[held] = Math.min(1, Math.max(0, (floor - y) / 150));
      sliders[held].value = alpha[held];
      sliders[held].dispatchEvent(new Event("input"));
    };
    let held = -1;
    const pen = canvas(box, width, height, "three opacities; the sliders below set them too", set);
    const words = make(box, "p", {"aria-live": "polite"}), row = make(box, "div", {class: "widget-row"});
    const draw = () => {
      const T = [1];
      for (const a of alpha) T.push(T[T.length - 1] * (1 - a));
      const mix = (a, front, behind) => front.map((v, c) => a * v + (1 - a) * behind[c]);
      const behind = [null, null, null, background];
      for (let k = 2; k >= 0; k--) behind[k] = mix(alpha[k], colours[k], behind[k + 1]);
      const upstream = behind[0].map((v, c) => v - target[c]);
      const loss = dot(upstream, upstream) / 2;
      const g = alpha.map((_, k) => T[k] * dot(colours[k].map((v, c) => v - behind[k + 1][c]), upstream));
      box.state = {alpha: [...alpha], T, g, loss, colour: behind[0]};
      pen.clearRect(0, 0, width, height);
      pen.font = "17px sans-serif";  // 11 px on a telephone of 390 px
      for (let k = 0; k < 3; k++) {
        const x = 140 * k + 10;
        pen.fillStyle = "#8883";
        pen.fillRect(x, floor - 150 * T[k], bar, 150 * T[k]);
        pen.strokeStyle = "#888";
        pen.strokeRect(x, floor - 150, bar, 150);
        pen.fillStyle = css(colours[k]);
        pen.fillRect(x, floor - 150 * alpha[k] * T[k], bar, 150 * alpha[k] * T[k]);
        pen.fillStyle = "#d08000";
        pen.fillRect(x - 4, floor - 150 * alpha[k] - 3, bar + 8, 6);
        pen.fillStyle = "#777";
        pen.fillText(`α = ${alpha[k].toFixed(2)}`, x, floor + 20);
        pen.fillText(`T = ${T[k].toFixed(2)}`, x, floor + 41);
        pen.fillText(`∂L/∂α = ${g[k].toFixed(3)}`, x, floor + 62);
      }
      pen.fillStyle = css(behind[0]);
      pen.fillRect(440, floor - 150, 100, 70);
      pen.fillStyle = css(target);
      pen.fillRect(440, floor - 70, 100, 70);
      pen.fillStyle = "#777";
      pen.fillText("pixel above,", 440, floor + 20);
      pen.fillText("target below", 440, floor + 41);
      words.textContent = `Loss ${loss.toFixed(4)}. Light that reaches the background: T₃ = ${T[3].toFixed(3)}. ` +
        (alpha.some((a) => a === 1) ? "Behind an opacity of 1 all gradients are 0." : "");
    };
    const sliders = alpha.map((value, k) =>
      slider(row, `opacity ${k + 1}`, 0, 1, "any", value, (v) => v.toFixed(2), (v) => { alpha[k] = v; draw(); }));
    draw();
  };

  // ---- chapter 5: correlation length and penalty against a trajectory; equation (4) ----
  const solve = (A, b) => {
    const n = b.length, M = A.map((row, k) => [...row, b[k]]);
    for (let k = 0; k < n; k++) {
      let p = k;
      for (let r = k; r < n; r++) if (Math.abs(M[r][k]) > Math.abs(M[p][k])) p = r;
      [M[k], M[p]] = [M[p], M[k]];
      for (let r = 0; r < n; r++) {
        if (r === k) continue;
        const f = M[r][k] / M[k][k];
        for (let c = k; c <= n; c++) M[r][c] -= f * M[k][c];
      }
    }
    return M.map((row, k) => row[n] / row[k]);
  };
  const matern = (box) => {
    const F = 8, omega = Array.from({length: F}, (_, f) => 16 ** (f / (F - 1)));
    const atoms = (t) => [...omega.map((w) => Math.sin(2 * Math.PI * w * t)), ...omega.map((w) => Math.cos(2 * Math.PI * w * t))];
    const truth = (t) => Math.sin(2 * Math.PI * 1.5 * t) + 0.3 * Math.sin(2 * Math.PI * 4 * t);
    const random = uniform(4), times = Array.from({length: 24}, (_, i) => i / 24).filter((_, i) => i % 8 !== 1);
    const seen = times.map((t) => truth(t) + 0.25 * (random() + random() + random() - 1.5));
    let length = 0.2, power = 1.7;
    const width = 560, height = 220, pen = canvas(box, width, height, "trajectory over time");
    const words = make(box, "p"), row = make(box, "div", {class: "widget-row"});
    const draw = () => {
      const raw = omega.map((w) => (5 / length ** 2 + (2 * Math.PI * w) ** 2) ** 3);
      const mean = raw.reduce((a, b) => a + b) / F, rho = raw.map((v) => v / mean), weights = [...rho, ...rho];
      const rows = times.map(atoms), lambda = 10 ** power;
      const A = weights.map((_, j) => weights.map((_, k) =>
        dot(rows.map((r) => r[j]), rows.map((r) => r[k])) / times.length + (j === k ? lambda / (6 * F) * weights[j] + 1e-9 : 0)));
      const C = solve(A, weights.map((_, j) => dot(rows.map((r) => r[j]), seen) / times.length));
      const fine = Array.from({length: 400}, (_, i) => i / 400), path = fine.map((t) => dot(C, atoms(t)));
      const rms = Math.sqrt(path.reduce((s, v, i) => s + (v - truth(fine[i])) ** 2, 0) / 400);
      const penalty = C.reduce((s, c, k) => s + weights[k] * c * c, 0) / (6 * F);
      box.state = {rho, rms, penalty, lambda, length, C, seen, times};
      pen.clearRect(0, 0, width, height);
      const x = (t) => 10 + 540 * t, y = (v) => 110 - 60 * v;
      const line = (values, colour, thick) => {
        pen.beginPath();
        values.forEach((v, i) => pen.lineTo(x(fine[i]), y(v)));
        pen.strokeStyle = colour;
        pen.lineWidth = thick;
        pen.stroke();
      };
      line(fine.map(truth), "#9998", 5);
      line(path, "#d08000", 2);
      pen.fillStyle = "#38c";
      times.forEach((t, i) => pen.fillRect(x(t) - 3, y(seen[i]) - 3, 6, 6));
      words.textContent = `Grey: truth; blue: noisy frames; orange: fit. Error ${rms.toFixed(3)}, L_msp ` +
        `${penalty.toExponential(1)}, weight of the highest frequency over the lowest ${(rho[7] / rho[0]).toExponential(1)}.`;
    };
    slider(row, "correlation length", 0.02, 0.3, 0.005, length, (v) => v.toFixed(3), (v) => { length = v; draw(); });
    slider(row, "log10 of its weight λ_msp", -5, 5, 0.1, power, (v) => v.toFixed(1), (v) => { power = v; draw(); });
    draw();
  };

  // ---- chapter 10: paint an instrument and watch the valid values of three bands; equation (5) ----
  const reflect = (k, n) => {
    if (n === 1) return 0;
    const r = ((k % (2 * (n - 1))) + 2 * (n - 1)) % (2 * (n - 1));
    return r < n ? r : 2 * (n - 1) - r;
  };
  const supports = (valid) => {  // rows of booleans -> the valid values of bands 1, 2, 3
    const bands = [];
    for (let level = 0; level < 3; level++) {
      const h = valid.length, w = valid[0].length, taps = [-2, -1, 0, 1, 2], fine = valid;
      const coarse = Array.from({length: Math.ceil(h / 2)}, (_, y) => Array.from({length: Math.ceil(w / 2)}, (_, x) =>
        taps.every((r) => taps.every((s) => fine[reflect(2 * y + r, h)][reflect(2 * x + s, w)]))));
      const near = (k, n) => (k % 2 ? [(k - 1) / 2, Math.min((k + 1) / 2, n - 1)] : [k / 2]);
      bands.push(fine.map((row, y) => row.map((v, x) =>
        v && near(y, coarse.length).every((a) => near(x, coarse[0].length).every((b) => coarse[a][b])))));
      valid = coarse;
    }
    return bands;
  };
  const masks = (box) => {
    const W = 40, H = 32, mask = Array.from({length: H}, () => Array(W).fill(true));
    let paints = false, cursor = null;  // the cell of the keyboard, [column, row]
    const paint = (x, y, first) => {
      const column = Math.floor(x / 7), row = Math.floor(y / 7);
      if (column < 0 || row < 0 || column >= W || row >= H) return;
      if (first) paints = !mask[row][column];
      mask[row][column] = paints;
      draw();
    };
    const row = make(box, "div", {class: "widget-row"});
    const pens = ["mask: paint here", "band 1", "band 2", "band 3"].map((name, k) => {
      const cell = make(row, "figure");
      const pen = canvas(cell, W * 7, H * 7, name, k === 0 ? paint : null);
      make(cell, "figcaption", {}, name);
      return pen;
    });
    const words = make(box, "p", {"aria-live": "polite"}), clear = make(box, "button", {type: "button"}, "Clear");
    clear.addEventListener("click", () => { mask.forEach((line) => line.fill(true)); draw(); });
    const show = (pen, grid) => {
      const size = (W * 7) / grid[0].length;
      pen.clearRect(0, 0, W * 7, H * 7);
      grid.forEach((line, y) => line.forEach((v, x) => {
        pen.fillStyle = v ? "#bfe3bf" : "#444";
        pen.fillRect(x * size, y * size, size - 0.6, size - 0.6);
      }));
    };
    const field = pens[0].canvas, steps = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};
    field.tabIndex = 0;
    field.setAttribute("role", "application");
    field.setAttribute("aria-label", "mask: arrow keys move, space excludes a pixel or includes it again");
    field.addEventListener("focus", () => { cursor = cursor || [W / 2, H / 2]; draw(); });
    field.addEventListener("blur", () => { cursor = null; draw(); });
    field.addEventListener("keydown", (event) => {
      const move = steps[event.key], at = cursor || [W / 2, H / 2];
      if (!move && event.key !== " ") return;
      event.preventDefault();  // the page would scroll
      if (move) cursor = [(at[0] + move[0] + W) % W, (at[1] + move[1] + H) % H];
      else mask[at[1]][at[0]] = !mask[at[1]][at[0]];
      draw();
    });
    const count = (grid) => grid.flat().filter(Boolean).length;
    const draw = () => {
      const bands = supports(mask);
      box.state = {mask: mask.map((line) => line.map(Number)), bands: bands.map(count)};
      show(pens[0], mask);
      if (cursor) {
        pens[0].strokeStyle = "#d08000";
        pens[0].lineWidth = 3;
        pens[0].strokeRect(7 * cursor[0], 7 * cursor[1], 7, 7);
      }
      bands.forEach((band, k) => show(pens[k + 1], band));
      const part = (grid) => `${((100 * count(grid)) / (grid.length * grid[0].length)).toFixed(1)} %`;
      words.textContent = `Valid: ${part(mask)} of the pixels; ${bands.map((b, k) => `${part(b)} of band ${k + 1}`).join(", ")}.`;
    };
    for (let y = 24; y < H; y++) for (let x = 33; x < W; x++) mask[y][x] = false;
    draw();
  };

  // ---- chapter 16: cutoff and stop against picture, error and visits; equation (B5) ----
  const cutoff = (box) => {
    const W = 80, H = 60, N = 160, random = uniform(16);
    const splats = Array.from({length: N}, () => ({
      u: W * random(), v: H * random(), s: 2 + 7 * random(), o: 0.15 + 0.8 * random(),
      rgb: [0.4 + 0.5 * random(), 0.15 + 0.4 * random(), 0.1 + 0.4 * random()],
    }));
    const render = (least, stop) => {
      const image = new Float64Array(3 * W * H);
      let visits = 0;
      for (let y = 0; y < H; y++) for (let x = 0; x < W; x++) {
        let T = 1;
        for (const {u, v, s, o, rgb} of splats) {
          const alpha = o * Math.exp(-((x + 0.5 - u) ** 2 + (y + 0.5 - v) ** 2) / (2 * s * s));
          if (alpha < least) continue;
          visits += 1;
          if (T * (1 - alpha) < stop) break;
          for (let c = 0; c < 3; c++) image[c * W * H + y * W + x] += alpha * T * rgb[c];
          T *= 1 - alpha;
        }
      }
      return {image, visits};
    };
    const row = make(box, "div", {class: "widget-row"});
    const pens = ["picture", "error × 50"].map((name) => {
      const cell = make(row, "figure"), pen = canvas(cell, W, H, name);
      make(cell, "figcaption", {}, name);
      return pen;
    });
    const words = make(box, "p"), sliders = make(box, "div", {class: "widget-row"});
    const exact = render(0, 0);
    let cut = Math.log10(1 / 255), stop = -4;
    const put = (pen, value) => {
      const data = pen.createImageData(W, H);
      for (let p = 0; p < W * H; p++) {
        for (let c = 0; c < 3; c++) data.data[4 * p + c] = 255 * Math.min(1, value(c, p));
        data.data[4 * p + 3] = 255;
      }
      pen.putImageData(data, 0, 0);
    };
    const draw = () => {
      const {image, visits} = render(10 ** cut, 10 ** stop);
      let largest = 0;
      image.forEach((v, k) => { largest = Math.max(largest, Math.abs(v - exact.image[k])); });
      box.state = {largest, visits: visits / exact.visits, cut, stop};
      put(pens[0], (c, p) => image[c * W * H + p]);
      put(pens[1], (c, p) => 50 * Math.abs(image[c * W * H + p] - exact.image[c * W * H + p]));
      words.textContent = `Largest error ${(255 * largest).toFixed(3)}/255, visits ${(100 * visits / exact.visits).toFixed(1)} % ` +
        "of the exact picture.";
    };
    slider(sliders, "log10 of the cutoff", -9, -0.5, 0.05, cut, (v) => v.toFixed(2), (v) => { cut = v; draw(); });
    slider(sliders, "log10 of the stop", -9, -0.5, 0.05, stop, (v) => v.toFixed(2), (v) => { stop = v; draw(); });
    draw();
  };

  // ---- chapter 21: the overlap of two windows against step, error and cost; equation (B18b), (21.2), (21.3) ----
  const seam = (box) => {
    const N = 60, G = 2000, FRAMES = 80, MIDDLE = 40, DELTA = 6, width = 560, height = 230;
    let overlap = 8, correlation = 0;
    const pen = canvas(box, width, height, "brightness and error over the frames of a seam");
    const words = make(box, "p"), row = make(box, "div", {class: "widget-row"});
    const draw = () => {
      const begin = MIDDLE - overlap / 2, frames = Array.from({length: FRAMES + 1}, (_, g) => g);
      const weight = frames.map((g) => overlap ? Math.min(1, Math.max(0, (g - begin) / overlap)) : Number(g >= MIDDLE));
      const first = frames.map((g) => 8 * Math.sin(g / 9)), second = first.map((v) => v + DELTA);
      const shown = weight.map((w, g) => (1 - w) * first[g] + w * second[g]);
      const error = weight.map((w) => Math.sqrt((1 - w) ** 2 + w ** 2 + 2 * w * (1 - w) * correlation));
      const step = DELTA * Math.max(...weight.slice(1).map((w, g) => w - weight[g]));
      const windows = Math.ceil((G - overlap) / (N - overlap));
      box.state = {overlap, correlation, weight, error, step, windows};
      pen.clearRect(0, 0, width, height);
      const x = (g) => 10 + 540 * g / FRAMES;
      pen.fillStyle = "#8883";
      pen.fillRect(x(begin), 0, x(begin + overlap) - x(begin), height);
      const line = (values, at, colour, thick) => {
        pen.beginPath();
        values.forEach((v, g) => { if (v !== null) pen.lineTo(x(g), at(v)); });
        pen.strokeStyle = colour;
        pen.lineWidth = thick;
        pen.stroke();
      };
      const brightness = (v) => 80 - 4 * v, below = (v) => 220 - 60 * v;
      line(first.map((v, g) => g <= begin + overlap ? v : null), brightness, "#38c", 2);
      line(second.map((v, g) => g >= begin ? v : null), brightness, "#c44", 2);
      line(shown, brightness, "#d08000", 4);
      line(error, below, "#d08000", 2);
      words.textContent = `Above, brightness of a pixel: window k (blue), window k + 1 (red), scene (orange). Below, size of ` +
        `its error. Largest step in addition to the motion ${step.toFixed(2)} of ${DELTA} levels; error in the middle ` +
        `${(20 * Math.log10(error[MIDDLE])).toFixed(2)} dB; ${windows} windows of ${N} frames cover ${G} frames.`;
    };
    slider(row, "overlap, frames", 0, 40, 2, overlap, (v) => v.toFixed(0), (v) => { overlap = v; draw(); });
    slider(row, "correlation of the errors", 0, 1, 0.05, correlation, (v) => v.toFixed(2), (v) => { correlation = v; draw(); });
    draw();
  };

  const widgets = {compositing, matern, masks, cutoff, seam};
  const start = () => document.querySelectorAll("div.widget").forEach((box) => {
    box.textContent = "";
    widgets[box.dataset.widget](box);
  });
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
