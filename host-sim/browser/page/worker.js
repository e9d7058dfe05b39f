// The worker thread: unpacks the module, passes the files to it, and returns its results.
"use strict";

const PARTS = { name: 0, content: 1, columns: 2, rows: 3 };
const OUTPUTS = { answer: 0, document: 1, parameters: 2, report: 3 };

async function compile(packed) {
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return WebAssembly.compile(await new Response(stream).arrayBuffer());
}

async function instantiate(module) {
  let memory = null;
  let failure = null;
  const text = (address, length) => new TextDecoder().decode(new Uint8Array(memory.buffer, address, length));
  const imports = {
    host: {
      now_ms: () => Date.now(),
      report_stage: (address, length) => postMessage({ stage: text(address, length) }),
      report_failure: (address, length) => { failure = text(address, length); },
    },
  };
  // Libraries import functions of other interfaces to browsers, which a diagnosis never calls.
  for (const { module: from, name } of WebAssembly.Module.imports(module)) {
    imports[from] ??= {};
    imports[from][name] ??= () => { throw new Error(`${from}.${name} is not available`); };
  }
  const { exports } = await WebAssembly.instantiate(module, imports);
  memory = exports.memory;
  const write = (part, bytes) => {
    const address = exports.reserve(PARTS[part], bytes.length);
    new Uint8Array(memory.buffer, address, bytes.length).set(bytes);
  };
  const read = (output) => text(exports.result(OUTPUTS[output]) >>> 0, exports.result_length(OUTPUTS[output]));
  return { exports, write, read, failure: () => failure };
}

async function diagnose({ packed, files, columns, rows }) {
  const { exports, write, read, failure } = await instantiate(await compile(packed));
  const encoder = new TextEncoder();
  for (const file of files) {
    postMessage({ stage: `reading ${file.name}` });
    write("name", encoder.encode(file.name));
    write("content", new Uint8Array(await file.arrayBuffer()));
    exports.add_file();
  }
  write("columns", encoder.encode(columns));
  write("rows", encoder.encode(rows));
  let code;
  try {
    code = exports.diagnose();
  } catch (error) {
    throw new Error(`defect of the program: ${failure() ?? error.message}`);
  }
  if (code !== 0) {
    return { error: read("answer") };
  }
  const [document, parameters, report] = ["document", "parameters", "report"].map(read);
  return { answer: JSON.parse(read("answer")), document, parameters, report };
}

onmessage = ({ data }) => {
  diagnose(data).then(postMessage, (error) => postMessage({ error: error.message }));
};
