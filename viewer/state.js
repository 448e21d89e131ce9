// What the user has chosen. Whoever shows or changes it listens here.

export class State {
  constructor(values) {
    Object.assign(this, values);
    Object.defineProperty(this, 'listeners', {value: []});
  }

  /// Changes some values and tells the listeners which.
  set(changes) {
    const changed = Object.keys(changes).filter((name) => this[name] !== changes[name]);
    if (changed.length === 0) return;
    Object.assign(this, changes);
    for (const listener of this.listeners) listener(changed);
  }

  onChange(listener) { this.listeners.push(listener); }
}
