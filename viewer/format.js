// Numbers for people.

const grouping = new Intl.NumberFormat('en', {useGrouping: true});

/// 12345 -> "12,345"
export const grouped = (n) => grouping.format(n);

/// Three or four significant digits; very large and very small ones with an exponent.
export function short(x, digits = 4) {
  if (!Number.isFinite(x)) return '–';
  if (x === 0) return '0';
  const size = Math.abs(x);
  if (size >= 1e6 || size < 1e-4) return x.toExponential(digits - 2).replace('e+', 'e').replace('-', '−');
  return String(Number(x.toPrecision(digits))).replace('-', '−');
}

export const percent = (share, digits = 3) => (Number.isFinite(share) ? `${short(100 * share, digits)} %` : '–');

export const plural = (n, word, words = `${word}s`) => `${grouped(n)} ${n === 1 ? word : words}`;
