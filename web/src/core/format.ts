// Numbers as a person reads them.

/** To so many significant digits without needless exponents; "–" where missing. */
export function num(value: number, digits = 4): string {
  if (!Number.isFinite(value)) return '–';
  if (value === 0) return '0';
  const size = Math.abs(value);
  if (size >= 10 ** Math.max(6, digits) || size < 1e-5) return shortExponent(value.toExponential(Math.max(0, digits - 1)));
  const decimals = Math.max(0, digits - 1 - Math.floor(Math.log10(size)));
  const text = value.toFixed(Math.min(12, decimals));
  return minus(text.includes('.') ? text.replace(/\.?0+$/, '') : text);
}

/** The same with its closing zeros, for columns of numbers: "0.200". */
export function rounded(value: number, digits: number): string {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size >= 1e6 || (size > 0 && size < 1e-5)) return num(value, digits);
  return minus(value.toFixed(Math.min(12, Math.max(0, digits - 1 - (size > 0 ? Math.floor(Math.log10(size)) : 0)))));
}

function shortExponent(text: string): string {
  return minus(text.replace(/\.?0+e/, 'e').replace('e+', 'e'));
}
function minus(text: string): string {
  return text.replace('-', '−');
}

export function fixed(value: number, decimals: number): string {
  return Number.isFinite(value) ? minus(value.toFixed(decimals)) : '–';
}

export interface ValueText {
  value: string;
  plusMinus: string; // 3σ; empty where there is none
}

/** "532.8" and "1.3": value and 3σ, both to two digits of 3σ. */
export function valueText(value: number, sigma: number): ValueText {
  const three = 3 * sigma;
  if (!(three > 0) || !Number.isFinite(three) || !Number.isFinite(value)) return {value: num(value, 4), plusMinus: ''};
  let exponent = Math.floor(Math.log10(three));
  if (Math.round(three / 10 ** (exponent - 1)) >= 100) ++exponent; // 0.0996 shows as 0.10
  const decimals = 1 - exponent;
  const both = Math.max(Math.abs(value), three);
  if (both >= 1e7 || decimals > 10) {
    const digits = Math.max(1, Math.min(12, Math.floor(Math.log10(both)) + decimals + 1));
    return {value: num(value, digits), plusMinus: num(three, 2)};
  }
  if (decimals <= 0) {
    const step = 10 ** -decimals;
    return {value: fixed(Math.round(value / step) * step, 0), plusMinus: fixed(Math.round(three / step) * step, 0)};
  }
  return {value: fixed(value, decimals), plusMinus: fixed(three, decimals)};
}

export function withSigma(value: number, sigma: number, unit = ''): string {
  const text = valueText(value, sigma);
  return text.value + (text.plusMinus ? ` ± ${text.plusMinus}` : '') + (unit ? ` ${unit}` : '');
}

export function percent(part: number, whole: number, decimals = 0): string {
  return whole > 0 ? `${((100 * part) / whole).toFixed(decimals)} %` : '–';
}

/** "×2.4": how many times; empty where it is not known. */
export function times(ratio: number): string {
  return ratio > 0 && Number.isFinite(ratio) ? `×${ratio.toFixed(ratio < 9.95 ? 1 : 0)}` : '';
}

/** Shortened in the middle to at most `most` characters. */
export function shortened(text: string, most: number): string {
  const letters = [...text];
  if (letters.length <= most) return text;
  const tail = Math.floor((most - 1) / 2);
  return letters.slice(0, most - 1 - tail).join('') + '…' + letters.slice(letters.length - tail).join('');
}

/** "1 photo", "2 photos". */
export function counted(count: number, word: string): string {
  return `${count.toLocaleString('en-GB').replace(/,/g, ' ')} ${word}${count === 1 ? '' : 's'}`;
}

export const degrees = 180 / Math.PI;

/** Units as names end in them, as pages show them, and the factor between; the longer endings first. */
export const units: [string, string, number][] = [['_rad_per_s', '°/s', degrees], ['_m_per_s', 'm/s', 1], ['_per_s', '1/s', 1], ['_rad_s2', '°/s²', degrees], ['_rad_s', '°/s', degrees], ['_m_s2', 'm/s²', 1], ['_m_s', 'm/s', 1], ['_px', 'px', 1], ['_rad', '°', degrees], ['_deg', '°', 1], ['_s', 's', 1], ['_m', 'm', 1]];
