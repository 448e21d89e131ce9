// Mouse, pen and fingers. Drag: orbit; right button, Shift, or two fingers: pan; wheel or pinch: zoom; double click:
// look at that node. With two bodies, a drag that begins on the second moves it, or turns it with Alt or the right
// button; the wheel then moves it nearer or farther.
import {aboutAxis, add, multiplied, normalisedRotation, rotated, scaled, subtract, toWorld} from './vector.js';

const kDegreesPerPixel = 0.35, kTurnPerPixel = 0.008;

export class Pointers {
  /// `on`: {view(), pose(), hover(x, y), leave(), busy(boolean)} are told what has happened.
  constructor(canvas, scene, camera, renderer, state, on) {
    Object.assign(this, {canvas, scene, camera, renderer, state, on, down: new Map(), gesture: null});
    const listen = (type, handler, options) => canvas.addEventListener(type, handler, options);
    listen('pointerdown', (e) => this.press(e));
    listen('pointermove', (e) => this.move(e));
    for (const type of ['pointerup', 'pointercancel']) listen(type, (e) => this.release(e));
    listen('pointerleave', () => this.down.size === 0 && on.leave());
    listen('contextmenu', (e) => e.preventDefault());
    listen('dblclick', (e) => this.lookAt(e.offsetX, e.offsetY));
    listen('wheel', (e) => {
      e.preventDefault();
      const lines = e.deltaMode === 1 ? 30 : 1;
      if (this.gesture?.kind === 'carry') return this.push(e.deltaY * lines * -0.0004);
      camera.zoom(Math.exp(e.deltaY * lines * (e.ctrlKey ? 0.01 : 0.0012)));
      on.view();
    }, {passive: false});
  }

  press(e) {
    this.canvas.setPointerCapture(e.pointerId);
    this.canvas.focus({preventScroll: true});
    this.down.set(e.pointerId, {x: e.offsetX, y: e.offsetY});
    if (e.pointerType === 'touch')
      this.on.hover(e.offsetX, e.offsetY);
    else
      this.on.leave();
    if (this.down.size === 2) {
      this.gesture = {kind: 'pinch'};
    } else if (this.down.size === 1) {
      const other = e.button !== 0,
            node = this.scene.bodies.length > 1 && !e.shiftKey ? this.renderer.pick(e.offsetX, e.offsetY) : null;
      if (node?.body === 1) {
        const turn = other || e.altKey || this.state.drag === 'turn', body = this.scene.bodies[1];
        this.gesture = {kind: turn ? 'turn' : 'carry', grip: toWorld(body.pose, body.center(node.row))};
      } else {
        this.gesture = {kind: other || e.shiftKey ? 'pan' : 'orbit'};
      }
    }
    this.canvas.classList.add('dragging');
  }

  move(e) {
    const last = this.down.get(e.pointerId);
    if (!last) return this.down.size === 0 ? this.on.hover(e.offsetX, e.offsetY) : undefined;
    const before = [...this.down.values()].map((p) => ({...p}));
    const dx = e.offsetX - last.x, dy = e.offsetY - last.y, height = this.canvas.clientHeight;
    Object.assign(last, {x: e.offsetX, y: e.offsetY});
    if (dx === 0 && dy === 0) return;
    if (e.pointerType === 'touch') this.on.leave();
    switch (this.gesture?.kind) {
      case 'orbit': this.camera.orbit(-kDegreesPerPixel * dx, kDegreesPerPixel * dy); return this.on.view();
      case 'pan': this.camera.pan(dx / height, -dy / height); return this.on.view();
      case 'pinch': return this.pinch(before, [...this.down.values()], height);
      case 'carry': return this.carry(dx / height, -dy / height);
      case 'turn': return this.turn(dx, dy);
    }
  }

  release(e) {
    this.down.delete(e.pointerId);
    this.gesture = this.down.size === 1 ? {kind: 'orbit'} : null;
    if (this.down.size === 0) this.canvas.classList.remove('dragging');
  }

  pinch([a, b], [c, d], height) {
    const spread = (p, q) => Math.max(20, Math.hypot(p.x - q.x, p.y - q.y));
    this.camera.zoom(spread(a, b) / spread(c, d));
    this.camera.pan((c.x + d.x - a.x - b.x) / 2 / height, -(c.y + d.y - a.y - b.y) / 2 / height);
    this.on.view();
  }

  /// Moves the second body by parts of the picture's height: in the plane of the picture, ...
  carry(right, up) {
    const axes = this.camera.axes();
    this.shift(add(scaled(axes.right, right), scaled(axes.up, up)));
  }
  /// ... and away from the viewer.
  push(away) { this.shift(scaled(this.camera.axes().forward, away)); }
  shift(direction) {
    const body = this.scene.bodies[1], grip = this.gesture?.grip ?? toWorld(body.pose, body.middle);
    const step = scaled(direction, this.camera.heightAt(grip));
    if (this.gesture?.grip) this.gesture.grip = add(grip, step);
    body.pose = {...body.pose, translation: add(body.pose.translation, step)};
    this.on.pose();
  }

  /// Turns the second body about its own middle, as if a ball around it were dragged by so many pixels.
  turn(right, down) {
    const body = this.scene.bodies[1], axes = this.camera.axes(), middle = toWorld(body.pose, body.middle);
    const turn = multiplied(aboutAxis(axes.up, kTurnPerPixel * right), aboutAxis(axes.right, kTurnPerPixel * down));
    const rotation = normalisedRotation(multiplied(turn, body.pose.rotation));
    body.pose = {rotation, translation: subtract(middle, rotated(rotation, body.middle))};
    this.on.pose();
  }

  lookAt(x, y) {
    const node = this.renderer.pick(x, y);
    if (!node) return;
    const body = this.scene.bodies[node.body];
    this.camera.target = toWorld(body.pose, body.center(node.row));
    this.on.view();
  }
}
