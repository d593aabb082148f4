// Where was the board? The camera with the chosen photo on its image plane, and all boards.
import {cividis, pixelShare} from '../core/colours';
import type {Table} from '../core/document';
import type {Figure} from '../core/figure';
import {num} from '../core/format';
import {hasImage, whenImagesAreHere} from '../core/images';
import {halfAxes, lensOf, identity, isFinite3, move, mul, norm, type M3, type Pose, type V3} from '../core/rigid';
import {roundDown125} from '../core/stats';
import {View3} from '../core/view3';
import {World} from '../core/world';
import {calibrateScene, type Photo} from './calibrate_scene';

interface Board {
  cols: number;
  rows: number;
  square_m: number;
}
const at = (board: Board, pose: Pose, col: number, row: number): V3 => move(pose, [col * board.square_m, row * board.square_m, 0]);

function outline(board: Board, pose: Pose): V3[] {
  return [at(board, pose, -1, -1), at(board, pose, board.cols, -1), at(board, pose, board.cols, board.rows), at(board, pose, -1, board.rows)];
}
function squares(world: World, board: Board, pose: Pose): void {
  if (board.cols * board.rows > 2500) return;
  for (let row = -1; row < board.rows; ++row)
    for (let col = -1; col < board.cols; ++col)
      if ((row + col) % 2 === 0) world.face([[0, 0], [1, 0], [1, 1], [0, 1]].map(([c, r]) => at(board, pose, col + c!, row + r!)), 'orange', 0.75);
}

/** Three σ of where a board's centre is, in the camera's frame. Null where the document does not tell. */
function threeSigma(table: Table, row: number): V3[] | null {
  const c = (name: string) => table.number(`cov_middle_${name}_m2`, row);
  const cov: M3 = [[c('xx'), c('xy'), c('xz')], [c('xy'), c('yy'), c('yz')], [c('xz'), c('yz'), c('zz')]];
  return cov.every(isFinite3) ? halfAxes(cov).map((axis) => mul(axis, 3)) : null;
}

export const poses: Figure = {
  id: 'poses', title: 'Where was the board?', note: 'camera frame, m · drag to turn, click a board', span: 12,
  draw(host, doc, selection) {
    const scene = calibrateScene(doc, selection), board = scene.board, lens = lensOf(doc);
    const posed = scene.photos.map((photo, i) => [photo, i] as const).filter(([photo]) => photo.pose);
    if (!board || posed.length === 0) return null;
    const nearest = Math.min(...posed.map(([photo]) => norm(photo.pose!.t)));
    const touch = (photo: Photo, index: number) => ({pick: () => selection.choose(index), tip: () => [photo.name, `RMS ${num(photo.rms_px, 3)} px`, `${num(norm(photo.pose!.t), 3)} m away`]});
    // One magnification for all, so that far boards look as unsure as they are.
    const table = doc.table('photos')!, largest = Math.max(0, ...posed.map(([, index]) => Math.max(0, ...(threeSigma(table, index) ?? []).map(norm))));
    const factor = largest > 0 ? roundDown125(Math.max(1, (0.25 * nearest) / largest)) : 0;
    const make = () => {
      const world = new World();
      for (const [photo, index] of posed) {
        const corners = outline(board, photo.pose!), isChosen = index === selection.item, colour = cividis(pixelShare(photo.rms_px));
        world.face(corners, colour, isChosen ? 0.35 : posed.length > 60 ? 0.08 : 0.22, touch(photo, index));
        world.line(corners, {colour: isChosen ? 'orange' : 'soft', width: isChosen ? 3 : 1, opacity: isChosen ? 1 : 0.7}, true);
        world.hold(...corners);
        if (!isChosen) continue;
        squares(world, board, photo.pose!);
        const three = factor > 0 ? threeSigma(table, index) : null;
        if (three) world.ellipsoid(at(board, photo.pose!, (board.cols - 1) / 2, (board.rows - 1) / 2), three.map((axis) => mul(axis, factor)), 'red');
        for (const [c, r] of [[0, 0], [board.cols - 1, 0], [board.cols - 1, board.rows - 1], [0, board.rows - 1]] as const)
          world.line([[0, 0, 0], at(board, photo.pose!, c, r)], {colour: 'orange', width: 1.2, opacity: 0.8});
      }
      if (lens) {
        const corners = world.frustum(identity, [lens.width / 2 / lens.fx, lens.height / 2 / lens.fy], 0.55 * nearest, {colour: 'ink', width: 2});
        world.hold([0, 0, 0], ...corners);
        const chosen = scene.photos[selection.item];
        if (chosen && hasImage(chosen.name)) world.textures.push({corners, name: chosen.name});
      }
      world.axes(identity, 0.28 * nearest);
      world.hold([0.3 * nearest, 0, 0], [0, 0.36 * nearest, 0]);
      return world;
    };
    const view = new View3(host, {height: 420, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.75, pitch: 0.35,
      note: `colour: RMS, as on the map of 3σ${factor > 0 ? `; red: 3σ of the chosen board’s place, ${num(factor, 2)} ×` : ''}`, label: `${posed.length} poses of the board in front of the camera`}, make);
    selection.on(() => view.refresh());
    whenImagesAreHere(() => view.refresh());
    return {marks: posed.length, rows: scene.photos.filter((photo) => photo.pose).length, tables: [table],
      words: `${posed.length} boards, from ${num(nearest, 2)} m`, good: 'Good: boards tilted all ways, near and far, out to the image’s corners.'};
  },
};
