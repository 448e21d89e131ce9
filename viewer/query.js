// The runtime in the page: prolate's own C++, compiled to WebAssembly (query_module.hpp says what it offers).
import {bytesOf} from './scene.js';

const kVerdicts = ['separated', 'overlapping', 'undecided'];
const kLevels = 32; // kAnswerLevels

export class Queries {
  static async start(scene) {
    const queries = new Queries();
    // What a stand-alone module may import is never called here; memory may grow.
    const unused = () => 0;
    const module = await WebAssembly.compile(bytesOf(scene.queries));
    const imports = {};
    for (const {module: space, name} of WebAssembly.Module.imports(module)) (imports[space] ??= {})[name] = unused;
    queries.runtime = (await WebAssembly.instantiate(module, imports)).exports;
    queries.runtime._initialize?.();
    scene.bodies.slice(0, 2).forEach((body, i) => {
      const at = queries.runtime.viewer_allocate(i, body.file.length);
      new Uint8Array(queries.runtime.memory.buffer, at, body.file.length).set(body.file);
      if (!queries.runtime.viewer_open(i)) throw new Error(`The runtime does not read ${body.tree}.`);
    });
    return queries;
  }

  place(bodies) {
    bodies.slice(0, 2).forEach(({pose}, i) => {
      const numbers = new Float32Array(this.runtime.memory.buffer, this.runtime.viewer_pose(i), 7);
      numbers.set([...pose.translation, ...pose.rotation]);
    });
  }

  /// Everything about the bodies where they are; `level` is that whose meeting nodes are listed, by slots.
  ask(bodies, level) {
    this.place(bodies);
    const place = this.runtime.viewer_query(level), numbers = new Float64Array(this.runtime.memory.buffer, place);
    let at = 0;
    const next = () => numbers[at++], vector = () => [next(), next(), next()],
          some = (n) => Array.from({length: n}, next);
    const answer = {
      verdict: kVerdicts[next()],
      enclosed: next() !== 0,
      nodeA: next(),
      nodeB: next(),
      triangleA: next(),
      triangleB: next(),
      pairTests: next(),
      blockTests: next(),
      triangleTests: next(),
      lower: next(),
      upper: next(),
      pointA: vector(),
      pointB: vector(),
      hasPoints: next() !== 0,
      distancePairTests: next(),
    };
    const levels = next(), tests = some(kLevels), verdicts = some(kLevels), pairs = next();
    answer.levels = tests.slice(0, levels).map(
        (soFar, l) => ({soFar, own: soFar - (l > 0 ? tests[l - 1] : 0), verdict: kVerdicts[verdicts[l]]}));
    const slots = new Uint32Array(this.runtime.memory.buffer, this.runtime.viewer_pairs(), 2 * pairs);
    answer.meeting = [0, 1].map((side) => new Set(slots.filter((_, i) => i % 2 === side)));
    return answer;
  }

  /// Microseconds that one collide() takes here: the best of some rounds of some milliseconds.
  time(bodies) {
    this.place(bodies);
    const round = (times) => {
      const start = performance.now();
      this.runtime.viewer_collide(times);
      return performance.now() - start;
    };
    let times = 1;
    while (round(times) < 2 && times < 1e6) times *= 4;
    return 1000 / times * Math.min(...[0, 1, 2, 3].map(() => round(times)));
  }
}
