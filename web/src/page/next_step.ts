// What the person does next: what the run asks for, or else what its answer is there for.
import type {Doc} from '../core/document';
import {num} from '../core/format';

const uses: Record<string, (doc: Doc) => string> = {
  calibrate: () => 'camera.yaml holds the camera with its σ: give it to `alidade rangefinder`, `rig` or `localize`, or undistort photos with `alidade camera undistort camera.yaml PHOTOS`.',
  'camera diff': (doc) => (doc.state === 'good' ? 'Either camera may stand for the other, as far as their σ tell.' : 'Where the difference is above what both σ allow, calibrate the camera that is in doubt again.'),
  observe: () => 'camera.yaml holds the camera at the end, intrinsics.csv all times. `alidade plan observe` names the rotations that would add most.',
  rangefinder: () => 'rangefinder.yaml holds the beam: `alidade project --beam rangefinder.yaml --camera camera.yaml --range METRES` tells where a reading lies in the image.',
  rig: (doc) => `rig.yaml holds the ${doc.table('cameras') ? 'cameras' : 'heads'}: \`alidade track events.csv --rig rig.yaml\` follows a target with ${doc.table('cameras') ? 'them' : 'it'}.`,
  track: () => 'track.csv holds the path with its σ at every instant.',
  servo: (doc) => (doc.estimateText('best') ? `Use the controller ${doc.estimateText('best')}.` : 'servo.csv holds every step of the loop.'),
  identify: () => 'servo.yaml holds the plant: put it under `plant:` in the scenario of `alidade servo`, which compares controllers on it.',
  'plan calibrate': () => 'Hold the board as sketched, then run `alidade calibrate` with these photos and all the earlier ones.',
  'plan observe': () => 'Turn the head so while points are tracked, then run `alidade observe` on the longer log.',
  'plan rangefinder': () => 'Hold the board as drawn, then run `alidade rangefinder` with these shots and all the earlier ones.',
  project: () => 'What the pixels and points are worth stands beside them: 3σ.',
  'simulate board': () => 'Calibrate from these photos: `alidade calibrate PHOTOS --board COLSxROWS --square METRES`, and compare with truth_camera.yaml by `alidade camera diff`.',
  'simulate rotation': () => 'Run `alidade observe log.csv --size WIDTHxHEIGHT` on it; the truth is truth_camera.yaml.',
  'simulate rangefinder': () => 'Run `alidade rangefinder shots.csv --camera camera.yaml --corners corners.csv` with the board given; the truth is truth_rangefinder.yaml.',
  'simulate rig': () => 'Run `alidade rig views.csv` with its cameras and board; the truth is truth_rig.yaml.',
  'simulate track': () => 'Run `alidade track events.csv --rig rig.yaml --truth truth.csv`.',
  'simulate servo': () => 'Run `alidade identify log.csv`, then `alidade servo scenario.yaml`.',
  'simulate underwater': () => 'Run `alidade localize sights.csv --camera camera.yaml --target target.yaml --truth truth.tum`.',
  'camera show': () => '`alidade camera undistort CAMERA PHOTOS` makes photos straight; `alidade camera diff A B` compares two cameras.',
  reproduce: () => 'Each claim is shown in full below: what was run, what was chosen where the paper is silent, and how it differs.',
};

/** Empty of none. */
export function nextStep(doc: Doc): string {
  if (doc.toAdd) return doc.toAdd.replace(/\.?$/, '.').replace(/^[a-z]/, (first) => first.toUpperCase());
  if (!doc.isAnswer) return '';
  const next = doc.command === 'calibrate' ? doc.table('next') : null;
  const gain = next && next.number('worst_3sigma_px', 0) > 0 ? ` One more photo, as sketched below, would bring the worst 3σ to ${num(next.number('worst_3sigma_px', 0), 2)} px.` : '';
  const command = doc.command.startsWith('reproduce') ? 'reproduce' : doc.command;
  const use = Object.prototype.hasOwnProperty.call(uses, command) ? uses[command]!(doc) : doc.files.length > 0 ? `Beside this page ${doc.files.length === 1 ? 'stands' : 'stand'} ${doc.files.slice(0, 6).join(', ')}${doc.files.length > 6 ? ' and more' : ''}.` : 'All numbers stand in result.json, and in the tables below.';
  return use + gain;
}
