// Correlations of the estimates, from the upper triangle of their covariance.
import type {Doc} from '../core/document';

export interface Correlations {
  names: string[];
  rho: number[]; // row-major
  words: string;
}

const shortNames: Record<string, string> = {origin_x_m: 'x', origin_y_m: 'y', origin_z_m: 'z', direction_x: 'dx', direction_y: 'dy', direction_z: 'dz'};

/** Null where there is no covariance; fixed parameters are omitted. */
export function correlationsOf(doc: Doc): Correlations | null {
  const all = doc.covarianceNames, n = all.length, upper = doc.covarianceUpper;
  if (n < 2 || n > 400 || upper.length !== (n * (n + 1)) / 2) return null;
  const cov = new Float64Array(n * n);
  for (let i = 0, at = 0; i < n; ++i)
    for (let j = i; j < n; ++j) cov[i * n + j] = cov[j * n + i] = upper[at++]!;
  const kept = all.map((_, i) => i).filter((i) => cov[i * n + i]! > 0 && Number.isFinite(cov[i * n + i]!));
  const rho = kept.flatMap((i) => kept.map((j) => cov[i * n + j]! / Math.sqrt(cov[i * n + i]! * cov[j * n + j]!)));
  const names = kept.map((i) => shortNames[all[i]!] ?? all[i]!.replace(/^camera\./, '').replace(/_(m_s|m|rad|px|s)$/, ''));
  return {names, rho, words: wordsOf(names, rho)};
}

function wordsOf(names: string[], rho: number[]): string {
  let best = 0, words = 'none above 0.6';
  for (let i = 0; i < names.length; ++i)
    for (let j = 0; j < i; ++j) {
      const value = rho[i * names.length + j]!;
      if (Math.abs(value) <= Math.max(0.6, best)) continue;
      best = Math.abs(value);
      words = `strongest ${value.toFixed(2).replace('-', '−')}, between ${names[j]} and ${names[i]}`;
    }
  return words;
}
