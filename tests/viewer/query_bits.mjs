// node query_bits.mjs QUERY.wasm A.etree B.etree EXPECTED: the same poses as query_bits.cpp; every byte must agree.
import {readFileSync} from 'node:fs';

const [wasm, a, b, expected] = process.argv.slice(2).map((path) => readFileSync(path));
const module = await WebAssembly.compile(wasm), imports = {};
for (const {module: space, name} of WebAssembly.Module.imports(module)) (imports[space] ??= {})[name] = () => 0;
const runtime = (await WebAssembly.instantiate(module, imports)).exports;
runtime._initialize?.();
const memory = (at, size) => new Uint8Array(runtime.memory.buffer, at, size);
[a, b].forEach((bytes, body) => {
  memory(runtime.viewer_allocate(body, bytes.length), bytes.length).set(bytes);
  if (!runtime.viewer_open(body)) throw new Error('a tree does not open');
});

const kPoseBytes = 28, kAnswerBytes = 8 * (20 + 2 * 32 + 1);
let at = 0, poses = 0;
for (; at < expected.length; ++poses) {
  for (const body of [0, 1]) memory(runtime.viewer_pose(body), kPoseBytes).set(expected.subarray(at, at += kPoseBytes));
  const answer = runtime.viewer_query(poses % 4),
        pairs = 8 * new Float64Array(runtime.memory.buffer, answer, kAnswerBytes / 8).at(-1);
  for (const [from, size, what] of [[answer, kAnswerBytes, 'answer'], [runtime.viewer_pairs(), pairs, 'pairs']]) {
    const differs = memory(from, size).findIndex((byte, i) => byte !== expected[at + i]);
    if (differs >= 0) throw new Error(`pose ${poses}: ${what} differs at number ${Math.floor(differs / 8)}`);
    at += size;
  }
}
if (at !== expected.length || poses === 0) throw new Error('the answers end too early');
console.log(`${poses} poses, ${at} bytes, all the same`);
