// The button "Run it here" of a chapter, its editors and its outputs. Nothing is read before the press; then Pyodide
// comes from the folder `_static/pyodide` of the book or, without one, from its usual host. A file of the host is checked
// by SHA-256; one of the folder was checked when it was filled, and is again where the browser offers `crypto.subtle`.
"use strict";
window.endotsrLive = {kept: {}, keep(name, base64) { this.kept[name] = base64; }};
(() => {
  const live = window.endotsrLive, script = document.currentScript;
  const folder = script.src.replace(/[^/]*$/, ""), parts = script.dataset.parts.split(" ");
  const megabytes = Number(script.dataset.bytes) / 1e6, cells = [];
  const HINT = "python docs/make.py live.fetch";
  const NOTE = "Here the chapter runs on the definition, in NumPy compiled to WebAssembly. Numbers can differ from the " +
    "recorded ones in the last digits. Where a cell compares the compiled function with the definition, it compares " +
    "the definition with itself. A simulated clip is the small scene of the definition. Edit a cell or a formula and press Run or Shift+Enter; a formula runs the gradient " +
    "checks again.";
  let worker = null, answer = null, fail = null, chain = Promise.resolve(), status, start, data = null;

  const make = (tag, attributes = {}, text = "", parent = null) => {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
    element.textContent = text;
    if (parent) parent.append(element);
    return element;
  };
  const say = (text) => { status.textContent = text; };
  const decoded = (base64) => {
    const text = atob(base64), bytes = new Uint8Array(text.length);
    for (let k = 0; k < bytes.length; k++) bytes[k] = text.charCodeAt(k);
    return bytes;
  };
  const hexadecimal = (buffer) => [...new Uint8Array(buffer)].map((b) => b.toString(16).padStart(2, "0")).join("");

  // ---- files ----
  const load = (name) => new Promise((done, refuse) => {
    const element = make("script", {src: folder + name});
    element.onload = () => { element.remove(); done(); };
    element.onerror = () => { element.remove(); refuse(new Error(name + " is not there")); };
    document.head.append(element);
  });
  const fromFolder = async (name, {sha256}) => {
    await load(`pyodide/${name}.js`);
    const bytes = decoded(live.kept[name]);
    delete live.kept[name];
    const found = window.crypto?.subtle ? hexadecimal(await crypto.subtle.digest("SHA-256", bytes)) : sha256;
    if (found !== sha256) throw new Error(`${name} of the folder _static/pyodide is not the file of Pyodide`);
    return bytes;
  };
  const fromHost = async (name, {sha256}) => {
    const integrity = "sha256-" + btoa(String.fromCharCode(...sha256.match(/../g).map((pair) => parseInt(pair, 16))));
    const how = {integrity, credentials: "omit", referrerPolicy: "no-referrer"};
    const reply = await fetch(live.supply.host + name, how).catch(() => ({ok: false}));
    if (!reply.ok) throw new Error(`${name} cannot be read or has another SHA-256`);
    return new Uint8Array(await reply.arrayBuffer());
  };
  const read = async () => {
    for (const name of ["live_worker", ...parts.map((part) => "live/" + part)]) await load(name + ".js");
    const {files, packages, host} = live.supply, names = Object.keys(files), found = {};
    const local = await load("pyodide/filled.js").then(() => true, () => false);
    const place = local ? "the folder of this book" : new URL(host).host;
    let count = 0, failed = false;
    const one = async (name) => {
      found[name] = await (local ? fromFolder : fromHost)(name, files[name]);
      if (!failed) say(`Reading Python from ${place}: file ${++count} of ${names.length} …`);
    };
    await Promise.all(names.map(one)).catch((error) => {
      failed = true;
      const absent = local ? "" : `the folder _static/pyodide of this book is not filled (${HINT}), and ${place}: `;
      throw new Error(absent + error.message);
    });
    const chapter = Object.fromEntries(Object.entries(live.kept).map(([path, base64]) => [path, decoded(base64)]));
    return {files: found, chapter, packages};
  };

  // ---- the worker ----
  const ask = (message) => new Promise((done, refuse) => { answer = done; fail = refuse; worker.postMessage(message); });
  const begin = async () => {
    worker = new Worker(URL.createObjectURL(new Blob([`const endotsrLive = {}; (${live.worker})()`])));
    worker.onerror = (event) => fail(new Error(event.message));
    worker.onmessage = ({data: {kind, ...rest}}) => {
      if (kind === "status") say(rest.text);
      else if (kind === "failed") fail(new Error(rest.text));
      else answer(rest);
    };
    await ask({kind: "start", ...data}).catch((error) => { worker.terminate(); worker = null; throw error; });
  };
  const stop = () => {
    worker?.terminate();
    worker = null;
    for (const cell of cells) cell.done = false;
    fail(new Error("stopped; the next run starts Python again"));
  };

  // ---- cells ----
  const collect = () => {
    const walker = document.createTreeWalker(document.querySelector("article"), 1 | 128);
    for (let node; (node = walker.nextNode());) {
      const formula = node.nodeType === 8 ? (node.data.match(/^ definition: (\S+) $/) || [])[1] : "";
      const box = formula ? node.nextElementSibling : node.matches?.("div.cell") ? node : null;
      const block = formula ? box : box?.querySelector(".cell_input > div");
      if (!block?.querySelector("pre")) continue;
      const source = block.querySelector("pre").textContent.replace(/\n+$/, "");
      const number = cells.filter((cell) => !cell.formula).length + 1;
      const title = formula ? formula.split(".").pop() : `cell ${number}`;
      cells.push({box, block, source, formula: formula || "", title, check: /\bcheck_(pair|function)\(/.test(source)});
    }
  };
  const edit = (cell) => {
    const {block, box, source, title, formula} = cell;
    const pane = make("div", {class: "live-pane"});
    cell.editor = make("textarea", {
      spellcheck: "false", autocapitalize: "off", autocomplete: "off", "aria-label": formula ? `formula ${title}` : title,
    }, "", pane);
    cell.editor.value = source;
    const row = make("div", {class: "live-row"}, "", pane);
    cell.run = make("button", {type: "button"}, "Run", row);
    cell.undo = make("button", {type: "button", disabled: ""}, "Undo", row);
    cell.word = make("span", {}, "", row);
    cell.output = make("div", {class: "live-output", "aria-live": "polite", role: "region", "aria-label": `output of ${title}`});
    block.hidden = true;
    block.after(pane);
    if (formula || box.matches(".tag_hide-cell")) pane.append(cell.output);  // an answer stays folded
    else box.append(cell.output);
    box.id = box.id || "live-" + title.replace(/\W/g, "-");
    const grow = () => {
      cell.editor.style.height = "auto";
      cell.editor.style.height = cell.editor.scrollHeight + 2 + "px";
      cell.undo.disabled = cell.editor.value === source;
    };
    cell.editor.addEventListener("input", () => { cell.done = false; grow(); });
    cell.editor.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || !event.shiftKey) return;
      event.preventDefault();
      press(cell);
    });
    cell.run.addEventListener("click", () => (cell.run.textContent === "Stop" ? stop() : press(cell)));
    cell.undo.addEventListener("click", () => { cell.editor.value = source; grow(); press(cell); cell.editor.focus(); });
    box.closest("details")?.addEventListener("toggle", grow);
    block.closest("details")?.addEventListener("toggle", grow);
    new ResizeObserver(grow).observe(pane);
    grow();
  };
  // A table of aligned text becomes a table of the page, as in the recorded outputs.
  const put = (text, parent) => {
    const lines = text.split("\n"), rule = lines.findIndex((line) => /^-+(?: {2,}-+)+$/.test(line));
    if (rule < 1) return text.trim() && make("pre", {}, text.replace(/^\n+|\n+$/g, ""), parent);
    const starts = [...lines[rule].matchAll(/-+/g)].map((dashes) => dashes.index);
    const blank = lines.findIndex((line, k) => k > rule && !line.trim()), end = blank < 0 ? lines.length : blank;
    put(lines.slice(0, rule - 1).join("\n"), parent);
    const box = make("div", {class: "pst-scrollable-table-container"}, "", parent);
    const table = make("table", {class: "table aligned"}, "", box);
    for (let k = rule - 1; k < end; k++) {
      if (k === rule) continue;
      const row = make("tr", {}, "", table), kind = k < rule ? "th" : "td";
      starts.forEach((begin, column) => make(kind, {}, lines[k].slice(begin, starts[column + 1]).trim(), row));
    }
    put(lines.slice(end).join("\n"), parent);
  };
  const show = (cell, {text, figures, error}) => {
    cell.output.replaceChildren();
    put(text, cell.output);
    for (const [k, figure] of figures.entries())
      make("img", {src: "data:image/png;base64," + figure, alt: `figure ${k + 1} of ${cell.title}`}, "", cell.output);
    if (error) make("pre", {class: "live-error"}, error, cell.output);
    const recorded = cell.box.querySelector(":scope > .cell_output");
    if (recorded) recorded.hidden = true;
    cell.word.textContent = error ? "failed" : cell.formula ? "" : "passed";
    cell.failed = Boolean(error);
    cell.box.classList.toggle("live-failed", cell.failed);
  };

  const changed = (cell) => !cell.formula || cell.editor.value !== cell.source || cell.sent;
  // A cell runs after those above it that have not run; after a formula the gradient checks run.
  const wanted = (cell) => {
    const place = cells.indexOf(cell), checks = cells.filter((other, k) => k > place && other.check);
    const last = cell.formula && checks.length ? cells.indexOf(checks[checks.length - 1]) : place;
    const due = (other) => other === cell || (!other.done && changed(other)) || (cell.formula && checks.includes(other));
    return cells.slice(0, last + 1).filter(due);
  };
  const runAll = async (list, pressed) => {
    if (!worker) await begin();
    for (const [k, cell] of list.entries()) {
      const text = `${cell.title}, ${k + 1} of ${list.length} …`;
      say("Running " + text);
      if (pressed) pressed.word.textContent = text;
      const source = cell.editor.value;
      show(cell, await ask({kind: "run", source, title: cell.title, formula: cell.formula}));
      cell.done = source === cell.editor.value;
      cell.sent = cell.formula && source !== cell.source;
    }
    tell(status, `${list.length} cells ran: `, list);
    if (pressed?.formula) tell(pressed.word, "gradient check: ", list.filter((cell) => cell.check || cell.failed));
  };
  const tell = (place, text, list) => {
    const failed = list.filter((cell) => cell.failed);
    place.textContent = text + (failed.length ? "failed: " : "passed");
    for (const cell of failed) make("a", {href: "#" + cell.box.id}, cell.title + " ", place);
  };
  const queue = (list, pressed) => {
    chain = chain.then(async () => {
      const button = pressed?.run || start, name = button.textContent;
      if (pressed) button.textContent = "Stop";
      else button.disabled = true;
      try {
        await runAll(await list(), pressed);
      } catch (error) {
        say(`This does not run: ${error.message}.`);
        if (pressed) pressed.word.textContent = "stopped";
      }
      button.textContent = data && button === start ? "Run all" : name;
      start.disabled = false;
    });
  };
  const press = (cell) => queue(() => wanted(cell), cell);

  const bar = make("div", {class: "live-bar"});
  start = make("button", {type: "button"}, "Run it here", bar);
  status = make("span", {role: "status", "aria-live": "polite"}, "", bar);
  const note = make("p", {}, `Pressing this button reads ${megabytes.toFixed(0)} MB from the folder of this book or from ` +
    "cdn.jsdelivr.net; then the chapter runs in this page.", bar);
  start.addEventListener("click", () => queue(async () => {
    if (!data) {
      data = await read();
      note.textContent = NOTE;
      collect();
      cells.forEach(edit);
    }
    return cells.filter(changed);
  }));
  document.querySelector("article h1").after(bar);
})();
