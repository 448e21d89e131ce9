// The page's elements.

export const element = (id) => document.getElementById(id);

/// Fills a <dl> with rows of [term, text]; those without a text are left out.
export function fillFigures(list, rows) {
  list.replaceChildren(...rows.filter((row) => row[1] !== undefined && row[1] !== '–').flatMap(([term, text]) => {
    const dt = document.createElement('dt'), dd = document.createElement('dd');
    dt.textContent = term;
    dd.textContent = text;
    return [dt, dd];
  }));
}
