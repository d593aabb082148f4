// The tables of a calibrate document, joined: what more than one figure looks up.
import type {Doc, Table} from '../core/document';
import type {Selection} from '../core/selection';
import {poseOf, type Pose} from '../core/rigid';

export interface Photo {
  name: string;
  reason: string;
  isUsed: boolean;
  rms_px: number;
  pose: Pose | null;
  first: number; // corners from … to
  corners: number[];
}
export interface Corners {
  count: number;
  photo: Float64Array;
  u: Float64Array; v: Float64Array;
  du: Float64Array; dv: Float64Array; // predicted − found
  su: Float64Array; sv: Float64Array; corr: Float64Array;
  isUsed: Uint8Array; // and has a residual
  table: Table;
}
export interface Scene {
  size: {width: number; height: number} | null;
  photos: Photo[];
  corners: Corners | null;
  worstFirst: number[];
  unused: number[];
  board: {cols: number; rows: number; square_m: number} | null;
}

const scenes = new WeakMap<Doc, Scene>();

export function calibrateScene(doc: Doc, selection: Selection): Scene {
  let scene = scenes.get(doc);
  if (!scene) {
    scenes.set(doc, (scene = read(doc)));
    selection.offer([...scene.worstFirst, ...scene.unused]);
  }
  return scene;
}

function read(doc: Doc): Scene {
  const photos = photosOf(doc), corners = cornersOf(doc);
  for (let i = 0; corners && i < corners.count; ++i) photos[corners.photo[i]!]?.corners.push(i);
  const all = photos.map((_, i) => i), rms = (i: number) => photos[i]!.rms_px;
  const cols = doc.estimate('board.cols'), rows = doc.estimate('board.rows'), square_m = doc.estimate('board.square_m');
  return {size: doc.imageSize, photos, corners,
    worstFirst: all.filter((i) => photos[i]!.isUsed && rms(i) >= 0).sort((a, b) => rms(b) - rms(a)),
    unused: all.filter((i) => !(photos[i]!.isUsed && rms(i) >= 0)),
    board: cols > 1 && rows > 1 && square_m > 0 && cols < 500 && rows < 500 ? {cols, rows, square_m} : null};
}

function photosOf(doc: Doc): Photo[] {
  const table = doc.table('photos');
  if (!table) return [];
  return Array.from({length: table.rows}, (_, i) => ({
    name: table.text('name', i), reason: table.text('reason', i), isUsed: table.number('used', i) > 0,
    rms_px: table.number('rms_px', i), pose: poseOf(table, 'cam_from_board', i), first: 0, corners: []}));
}

function cornersOf(doc: Doc): Corners | null {
  const table = doc.table('corners');
  if (!table) return null;
  const c = (name: string) => table.numbers(name), du = c('residual_u_px'), dv = c('residual_v_px');
  const weight = table.has('weight') ? c('weight') : new Float64Array(table.rows).fill(1);
  return {count: table.rows, photo: c('photo'), u: c('u_px'), v: c('v_px'), du, dv, su: c('sigma_u_px'), sv: c('sigma_v_px'),
    corr: c('corr_uv'), table, isUsed: Uint8Array.from({length: table.rows}, (_, i) => Number(weight[i]! > 0 && Number.isFinite(du[i]! + dv[i]!)))};
}
