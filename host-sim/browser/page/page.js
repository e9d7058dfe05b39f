// The page: takes files, starts the worker thread, and shows its results.
"use strict";

const element = (id) => document.getElementById(id);
const BYTES_PER_MB = 1e6;
let files = [];
let worker = null;
let addresses = [];

function unpackedBase64(id) {
  return Uint8Array.from(atob(element(id).textContent.trim()), (letter) => letter.charCodeAt(0));
}

function addressOf(text, type) {
  const address = URL.createObjectURL(new Blob([text], { type }));
  addresses.push(address);
  return address;
}

function setStatus(text, isError = false) {
  element("status").textContent = text;
  element("status").classList.toggle("error", isError);
}

function stop(text) {
  worker?.terminate();
  worker = null;
  element("stop").hidden = true;
  setStatus(text);
}

function clear() {
  element("result").hidden = true;
  element("report").srcdoc = "";
  addresses.forEach((address) => URL.revokeObjectURL(address));
  addresses = [];
}

function addItems(list, texts) {
  list.replaceChildren(...texts.map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
}

function show({ answer, document: json, parameters, report }, seconds) {
  element("cause").textContent = answer.cause;
  addItems(element("summary"), answer.summary);
  addItems(element("log"), answer.log);
  element("document").href = addressOf(json, "application/json");
  element("parameters").href = addressOf(parameters, "text/plain");
  element("page").href = addressOf(report, "text/html");
  element("result").hidden = false;
  element("report").srcdoc = report;
  setStatus(`Done in ${seconds.toFixed(0)} s.`);
}

function start() {
  if (files.length === 0) {
    setStatus("Choose a file first.", true);
    return;
  }
  stop("");
  clear();
  const begin = performance.now();
  const seconds = () => (performance.now() - begin) / 1000;
  const source = new Blob([element("worker").textContent], { type: "text/javascript" });
  const address = URL.createObjectURL(source);
  worker = new Worker(address);
  URL.revokeObjectURL(address);
  worker.onmessage = ({ data }) => {
    if (data.stage !== undefined) {
      setStatus(`${data.stage} (${seconds().toFixed(0)} s)`);
      return;
    }
    stop("");
    if (data.error !== undefined) {
      setStatus(data.error, true);
    } else {
      show(data, seconds());
    }
  };
  worker.onerror = (event) => {
    stop("");
    setStatus(`defect of the program: ${event.message}`, true);
  };
  element("stop").hidden = false;
  setStatus("starting");
  worker.postMessage({
    packed: unpackedBase64("module"),
    files,
    columns: element("columns").value,
    rows: element("rows").value,
  });
}

function take(list) {
  if (list.length === 0) {
    return;
  }
  files = [...list];
  const sizes = files.map((file) => `${file.name} (${(file.size / BYTES_PER_MB).toFixed(1)} MB)`);
  element("files").textContent = sizes.join(", ");
  start();
}

element("chooser").addEventListener("change", ({ target }) => {
  take(target.files);
  // A file that has changed since can be chosen again.
  target.value = "";
});
element("start").addEventListener("click", start);
element("stop").addEventListener("click", () => stop("Stopped."));
// A file dropped beside the zone must not replace the page.
for (const name of ["dragover", "drop"]) {
  document.addEventListener(name, (event) => {
    event.preventDefault();
    element("zone").classList.toggle("over", name === "dragover");
  });
}
document.addEventListener("dragleave", () => element("zone").classList.remove("over"));
document.addEventListener("drop", ({ dataTransfer }) => take(dataTransfer.files));
