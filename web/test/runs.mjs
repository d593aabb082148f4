// Real results to look at: simulated measurements, run through the executable.
import {execFileSync} from 'node:child_process';
import {join} from 'node:path';
import {folder, readJson} from './page.mjs';

/** {name: result document}; a refusal ends with exit code 4, what is not to be trusted with 6; both leave a document as well. */
export function realResults(alidade) {
  const at = (...parts) => join(folder, ...parts), results = {};
  const run = (args) => {
    try {
      execFileSync(alidade, [...args, '--quiet'], {cwd: folder, stdio: 'pipe'});
    } catch (error) {
      if (error.status !== 4 && error.status !== 6) throw new Error(`${args.join(' ')}: ${error.stderr}`);
    }
  };
  const both = (name, simulate, command) => {
    run(['simulate', ...simulate, '--out', at(name, 'in')]);
    run([...command(at(name, 'in')), '--out', at(name, 'out')]);
    results[name] = {document: readJson(at(name, 'out', 'result.json')), report: at(name, 'out', 'report.html')};
  };
  const board = ['--board', '9x6', '--square', '0.025'];
  const boards = (more) => ['board', ...board, '--photos', '8', '--size', '640x480', ...more];
  both('calibrate', boards([]), (dir) => ['calibrate', ...Array.from({length: 8}, (_, i) => join(dir, `board_${String(i + 1).padStart(3, '0')}.png`)), ...board]);
  run(['camera', 'diff', at('calibrate', 'out', 'camera.yaml'), at('calibrate', 'in', 'truth_camera.yaml'), '--out', at('diff')]);
  results['camera diff'] = {document: readJson(at('diff', 'result.json')), report: at('diff', 'report.html')};
  const observe = (dir) => ['observe', join(dir, 'log.csv'), '--size', '780x582'];
  both('observe', ['rotation', '--source', 'head', '--zoom', 'ramp', '--points', '12'], observe);
  both('observe, refused', ['rotation', '--motion', 'pan', '--duration', '8'], observe);
  const shots = (dir) => ['rangefinder', join(dir, 'shots.csv'), '--camera', join(dir, 'camera.yaml'), '--corners', join(dir, 'corners.csv'), '--board', '9x6', '--square', '0.04'];
  both('rangefinder', ['rangefinder'], shots);
  both('rangefinder, refused', ['rangefinder', '--scenario', 'parallel'], (dir) => [...shots(dir), '--method', 'plane']);
  const views = (dir) => ['rig', join(dir, 'views.csv'), '--camera', join(dir, 'camera_1.yaml'), '--camera', join(dir, 'camera_2.yaml'), ...board];
  both('rig', ['rig'], views);
  both('rig, refused', ['rig', '--scenario', 'pan_only'], views);
  both('identify', ['servo', '--chirp'], (dir) => ['identify', join(dir, 'log.csv')]);
  for (const command of ['calibrate', 'observe', 'rangefinder']) {
    run(['plan', command, at(command, 'out'), '--out', at('plan', command)]);
    results[`plan ${command}`] = {document: readJson(at('plan', command, 'result.json')), report: at('plan', command, 'report.html')};
  }
  both('track', ['track', '--scenario', 'C'], (dir) => ['track', join(dir, 'events.csv'), '--rig', join(dir, 'rig.yaml'), '--truth', join(dir, 'truth.csv')]);
  return results;
}
