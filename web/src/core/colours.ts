// Colours that mean the same in every report, and the page's own in light and dark.

export type Rgb = [number, number, number];

export interface Palette {
  ink: string; soft: string; grid: string; panel: string; card: string;
  blue: string; orange: string; green: string; red: string; purple: string; sky: string;
  isDark: boolean;
}
export type ColourName = Exclude<keyof Palette, 'isDark'>;

const names: ColourName[] = ['ink', 'soft', 'grid', 'panel', 'card', 'blue', 'orange', 'green', 'red', 'purple', 'sky'];
let cached: Palette | null = null;

/** The page's colours as the style sheet gives them now. */
export function palette(): Palette {
  if (cached) return cached;
  const style = getComputedStyle(document.documentElement);
  const made = {isDark: style.getPropertyValue('--is-dark').trim() === '1'} as Palette;
  for (const name of names) made[name] = style.getPropertyValue(`--${name}`).trim();
  return (cached = made);
}
export function forgetPalette(): void {
  cached = null;
}

function along(anchors: Rgb[], share: number): Rgb {
  const place = Math.min(1, Math.max(0, Number.isFinite(share) ? share : 0)) * (anchors.length - 1);
  const below = Math.min(Math.floor(place), anchors.length - 2), rest = place - below;
  const a = anchors[below]!, b = anchors[below + 1]!;
  return [0, 1, 2].map((i) => Math.round(a[i]! + rest * (b[i]! - a[i]!))) as Rgb;
}

/** Cividis, share 0…1: dark blue for small, yellow for large. Nuñez, Anderton & Renslow, PLoS ONE 13(7), 2018. */
export function cividis(share: number): Rgb {
  return along([[0, 34, 78], [18, 53, 112], [59, 73, 108], [87, 93, 109], [112, 113, 115], [138, 134, 120],
    [165, 156, 116], [195, 179, 105], [225, 204, 85], [254, 232, 56]], share);
}

/** Blue over grey to orange, share −1…1, for values with a sign. */
export function diverging(share: number): Rgb {
  return along([[0, 74, 128], [58, 146, 200], [225, 226, 228], [230, 159, 0], [150, 62, 0]], 0.5 + 0.5 * share);
}

/** Of lines on a bare ground, light or dark, share 0…1: blue for small, orange for large, each at least 3:1 against both. */
export function blueToOrange(share: number): Rgb {
  return along([[38, 132, 200], [122, 124, 138], [206, 108, 10]], share);
}

/** Direction in the image: right vermilion, down purple, left blue, up green. */
export function directionColour(u: number, v: number): Rgb {
  const turn = Math.atan2(v, u) / (2 * Math.PI);
  return along([[213, 94, 0], [154, 91, 196], [0, 114, 178], [0, 158, 115], [213, 94, 0]], turn < 0 ? turn + 1 : turn);
}

/** The same colour for the same size in every report: px on a logarithmic scale. */
export const pixelLow = 0.05, pixelHigh = 10;
export function pixelShare(size_px: number): number {
  return size_px > 0 ? Math.log(size_px / pixelLow) / Math.log(pixelHigh / pixelLow) : 0;
}
export const pixelLevels = [0.05, 0.1, 0.2, 0.3, 0.5, 1, 2, 5, 10];

export function css(colour: Rgb, alpha = 1): string {
  return alpha >= 1 ? `rgb(${colour.join(',')})` : `rgba(${colour.join(',')},${alpha})`;
}
/** Black or white, whichever reads better on the colour. */
export function onto(colour: Rgb): string {
  return 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 140 ? '#14181d' : '#ffffff';
}
export function rgbOf(hex: string): Rgb {
  const value = parseInt(hex.replace('#', ''), 16);
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255];
}
export function faded(hex: string, alpha: number): string {
  return css(rgbOf(hex), Math.min(alpha, 0.999));
}
