// Python of a chapter that runs in its page: a worker that holds Pyodide and answers one cell at a time.
// The page hands over every file as bytes, so the worker reads nothing from a network. Its text travels as a function,
// because a page opened from a folder may not start a worker from a file.
"use strict";
endotsrLive.worker = function () {
  let known = {}, python = null, run = null;
  const named = (address) => String(address.url || address).split("/").pop().split("?")[0];
  const bytes = (address) => {
    const found = known[named(address)];
    if (!found) throw new TypeError(`${address} is not among the files of Pyodide`);
    return found;
  };
  const say = (text) => self.postMessage({kind: "status", text});

  // Pyodide reads its parts by these two functions.
  self.fetch = async (address) => {
    const type = named(address).endsWith(".wasm") ? "application/wasm" : "application/octet-stream";
    return new Response(bytes(address), {headers: {"Content-Type": type}});
  };
  self.importScripts = (...addresses) => {
    for (const address of addresses) (0, eval)(new TextDecoder().decode(bytes(address)));
  };

  const write = (path, content) => {
    const whole = "/home/pyodide/" + path;
    python.FS.mkdirTree(whole.replace(/\/[^/]*$/, ""));
    python.FS.writeFile(whole, content);
  };

  const start = async ({files, chapter, packages}) => {
    known = files;
    say("Python is starting …");
    self.importScripts("pyodide.js");
    python = await self.loadPyodide({indexURL: "https://book.invalid/"});
    say("NumPy and Matplotlib are being unpacked …");
    const refused = [];
    await python.loadPackage(packages, {messageCallback: () => {}, errorCallback: (text) => refused.push(text)});
    if (refused.length) throw new Error(refused.join("; "));
    for (const [path, content] of Object.entries(chapter)) write(path, content);
    known = {};
    say("Matplotlib is starting …");
    python.runPython("import json, sys; sys.path.insert(0, '.'); from pages.live import cells, table");
    python.runPython("table.install(); cells.quiet()");
    run = python.runPython("lambda *words: json.dumps(cells.run(*words))");
  };

  self.onmessage = async ({data}) => {
    try {
      if (data.kind === "start") {
        await start(data);
        self.postMessage({kind: "ready"});
      } else {
        self.postMessage({kind: "done", ...JSON.parse(run(data.source, data.title, data.formula))});
      }
    } catch (error) {
      self.postMessage({kind: "failed", text: error.message || String(error)});
    }
  };
};
