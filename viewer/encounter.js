// Two bodies: what the runtime says of them, in words, figures, and marks in the picture.
import {element, fillFigures} from './dom.js';
import {grouped, plural, short} from './format.js';
import {kWitness} from './colours.js';
import {Queries} from './query.js';

const kNoTriangle = 2 ** 32 - 1;

function whatMeets({enclosed, nodeA, nodeB, triangleA, triangleB}) {
  if (enclosed) return 'a part of one lies inside the other';
  const part = (node, triangle) =>
      (triangle === kNoTriangle ? `node ${grouped(node)}` : `triangle ${grouped(triangle)}`);
  return `${part(nodeA, triangleA)} of A meets ${part(nodeB, triangleB)} of B`;
}

export class Encounter {
  static async start(app) {
    const encounter = new Encounter();
    encounter.app = app;
    encounter.queries = await Queries.start(app.scene);
    encounter.rows = app.scene.bodies.map((body) => new Map(Array.from(body.nodes.slot, (slot, row) => [slot, row])));
    element('query').hidden = false;
    element('query-note').textContent = `Answers of prolate ${app.scene.version} itself, compiled to WebAssembly` +
        (app.scene.bodies.some((body) => body.deformation) ? ', for bodies at rest.' : '.');
    element('reset-pose').addEventListener('click', () => app.resetPose());
    return encounter;
  }

  /// Asks anew, and tells the application what to mark.
  update() {
    const {scene, state} = this.app;
    const answer = this.answer = this.queries.ask(scene.bodies, state.level);
    this.words(answer);
    this.table(answer);
    this.app.marked = answer.meeting.map((slots, i) => new Set(Array.from(slots, (slot) => this.rows[i].get(slot))));
    this.app.marks = !answer.hasPoints ? [] : [
      {from: answer.pointA, to: answer.pointB, radius: 1.5, colour: kWitness},
      {from: answer.pointA, to: answer.pointA, radius: 4.5, colour: kWitness},
      {from: answer.pointB, to: answer.pointB, radius: 4.5, colour: kWitness},
    ];
    clearTimeout(this.clock);
    this.clock = setTimeout(() => this.words(answer, this.queries.time(scene.bodies)), 400);
  }

  words(answer, microseconds) {
    const {bodies} = this.app.scene, point = (p) => p.map((x) => short(x, 4)).join(', ');
    element('verdict').dataset.verdict = answer.verdict;
    element('verdict-word').textContent = answer.verdict;
    element('verdict-note').textContent = answer.verdict === 'overlapping' ? whatMeets(answer) : '';
    const apart = answer.verdict === 'separated';
    fillFigures(element('query-figures'), [
      ['distance', apart ? short(answer.upper, 6) : '0'],
      ['certified', apart ? `≥ ${short(answer.lower, 6)}` : undefined],
      [apart ? 'point of A' : 'common point', answer.hasPoints ? point(answer.pointA) : undefined],
      ['point of B', answer.hasPoints && apart ? point(answer.pointB) : undefined],
      ['collide()', `${plural(answer.pairTests, 'pair')}, ${plural(answer.blockTests, 'block')}`],
      ['time of it', microseconds === undefined ? '…' : `${short(microseconds, 3)} µs`],
      ['B at', point(bodies[1].pose.translation)],
    ]);
  }

  table({levels}) {
    const most = Math.max(1, ...levels.map((level) => level.own));
    element('tests').tBodies[0].replaceChildren(...levels.map((level, l) => {
      const row = document.createElement('tr'), bar = document.createElement('meter');
      bar.max = most;
      bar.value = level.own;
      bar.setAttribute('aria-hidden', 'true');
      for (const content of [String(l), grouped(level.own), bar, level.verdict]) row.insertCell().append(content);
      return row;
    }));
  }
}
