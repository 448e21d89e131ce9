// Shortcuts: one table, for what keys do and for the sheet that lists them.
import {clamp} from './vector.js';

const kNudge = 0.02; // of the picture's height

/// [[group, [[keys as people see them, what they do, test(event), action(event)], ...]], ...]; the mouse's have no
/// test.
export function shortcuts(app) {
  const {state, camera, pointers} = app;
  const key = (...names) => (e) => names.includes(e.key) && !e.shiftKey;
  const letter = (...names) => (e) => names.includes(e.key.toLowerCase()) && !e.shiftKey;
  const typed = (signs) => (e) => e.key.length === 1 && signs.includes(e.key); // some keyboards need Shift for them
  const shifted = (...names) => (e) => names.includes(e.key) && e.shiftKey;
  const arrows = ['ArrowLeft', 'ArrowRight', 'ArrowUp', 'ArrowDown'];
  const between = (e, less, more) => (e.key === more) - (e.key === less);
  const arrow = (e) => [between(e, 'ArrowLeft', 'ArrowRight'), between(e, 'ArrowDown', 'ArrowUp')];
  const pages = (e) => between(e, 'PageDown', 'PageUp');

  const seen = (action) => (e) => (action(e), app.viewChanged());
  const toggle = (name) => () => state.set({[name]: !state[name]});
  const toLevel = (level) => state.set({level: clamp(level, 0, app.levelCount - 1)});
  const cut = (changes) => state.set({section: true, ...changes});

  const view = [
    ['drag', 'orbit'],
    ['right or Shift drag', 'pan'],
    ['wheel, pinch', 'zoom'],
    ['double click', 'turn about that node'],
    ['← → ↑ ↓', 'orbit', key(...arrows), seen((e) => camera.orbit(10 * arrow(e)[0], 10 * arrow(e)[1]))],
    ['+ −', 'zoom', typed('+=-'), seen((e) => camera.zoom(e.key === '-' ? 1.15 : 1 / 1.15))],
    ['R', 'reset the view', letter('r'), () => app.resetView()],
  ];
  const tree = [
    ['0 … 9', 'level', typed('0123456789'), (e) => toLevel(Number(e.key))],
    ['[ ]', 'coarser, finer', typed('[]'), (e) => toLevel(state.level + (e.key === ']' ? 1 : -1))],
    ['C', 'next colouring', letter('c'), () => app.nextColouring()],
    ['T', 'ellipsoids translucent', letter('t'), () => state.set({coverOpacity: state.coverOpacity === 1 ? 0.4 : 1})],
    ['M', 'mesh shown or not', letter('m'), () => state.set({meshOpacity: state.meshOpacity > 0 ? 0 : 1})],
    ['W', 'ellipsoids as wires', letter('w'), toggle('coverWire')],
    ['E', 'mesh as wires', letter('e'), toggle('meshWire')],
    ...(app.scene.bodies.some((body) => body.inner) ?
            [['I', 'inner cover in sections and wires', letter('i'), toggle('inner')]] :
            []),
  ];
  const deformation = [
    ['A', 'play, pause', letter('a'), () => app.togglePlay()],
    ['Q', 'at rest', letter('q'), () => app.rest()],
  ];
  const section = [
    ['S', 'section on or off', letter('s'), toggle('section')],
    ['X Y Z', 'across this axis', letter('x', 'y', 'z'), (e) => cut({sectionAxis: 'xyz'.indexOf(e.key.toLowerCase())})],
    ['F', 'the other side', letter('f'), () => cut({sectionFlip: !state.sectionFlip})],
    [
      ', .', 'move it', typed(',.'),
      (e) => cut({sectionAt: clamp(state.sectionAt + (e.key === '.' ? 0.02 : -0.02), 0, 1)})
    ],
  ];
  const bodies = [
    ['drag B', 'move or turn it, as chosen'],
    ['right or Alt drag B', 'turn it'],
    ['wheel in such a drag', 'nearer, farther'],
    ['D', 'drags move or turn', letter('d'), () => state.set({drag: state.drag === 'move' ? 'turn' : 'move'})],
    ['Shift ← → ↑ ↓', 'move B', shifted(...arrows), (e) => pointers.carry(...arrow(e).map((x) => kNudge * x))],
    ['PageUp PageDown', 'farther, nearer', key('PageUp', 'PageDown'), (e) => pointers.push(kNudge * pages(e))],
    ['P', 'put B back', letter('p'), () => app.resetPose()],
  ];
  return [
    ['View', view], ['Tree', tree], ['Section', section], ...(app.deforms ? [['Deformation', deformation]] : []),
    ...(app.scene.bodies.length > 1 ? [['Bodies', bodies]] : []),
    ['This sheet', [['?', 'open and close', typed('?'), () => app.toggleHelp()]]]
  ];
}

export function listenToKeys(groups) {
  document.addEventListener('keydown', (e) => {
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    if (e.target instanceof HTMLInputElement && e.target.type === 'range' && /^(Arrow|Home|End|Page)/.test(e.key))
      return;
    const open = document.querySelector('dialog[open]');
    for (const [, rows] of groups)
      for (const [, , test, action] of rows)
        if (test?.(e) && (!open || e.key === '?')) {
          e.preventDefault();
          return action(e);
        }
  });
}

export function fillSheet(sheet, groups) {
  for (const [title, rows] of groups) {
    const table = sheet.appendChild(document.createElement('table'));
    table.createCaption().textContent = title;
    for (const [keys, words] of rows) {
      const row = table.insertRow(), cell = row.insertCell();
      if (/^[a-z]/.test(keys) || keys.length > 12)
        cell.textContent = keys;
      else
        cell.append(...keys.split(' ').flatMap((one) => {
          const kbd = document.createElement('kbd');
          kbd.textContent = one;
          return one === '…' ? [' … '] : [kbd, ' '];
        }));
      row.insertCell().textContent = words;
    }
  }
}
