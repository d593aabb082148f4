// Real results to look at: simulated measurements, run through the executable.
import {execFileSync} from 'node:child_process';
import {mkdirSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';
import {folder, readJson} from './page.mjs';

/** A simulated head that follows a disc, its camera and rig as they are; `out` and `more` are the caller's. */
export function followWords(dir, out, more = []) {
  mkdirSync(dir, {recursive: true});
  writeFileSync(join(dir, 'camera.yaml'), 'model: brown\nwidth: 320\nheight: 240\nfx: 350\nfy: 348\ncx: 163.2\ncy: 117.9\nskew: 0\nk1: -0.08\nk2: 0\np1: 0\np2: 0\nk3: 0\n');
  writeFileSync(join(dir, 'rig.yaml'), 'heads:\n- {id: 1, camera: camera.yaml}\n');
  return ['head', `sim://?latency=0.1${more.length ? '' : '&clock=free'}`, '--stream', 'sim://?fps=15&target=6:0:3:18:1.2', '--rig', join(dir, 'rig.yaml'), '--follow', 'bright', '--move', '--most', '8', '--latency', '0.1', '--out', out, ...more];
}

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
  run(followWords(at('follow'), at('follow', 'out')));
  results['head, following'] = {document: readJson(at('follow', 'out', 'result.json')), report: at('follow', 'out', 'report.html')};
  return results;
}
