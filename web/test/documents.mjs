// Documents made up for tests: of commands, sizes and troubles. Seeded, so that a failure comes again.

export function random(seed) {
  let state = seed >>> 0;
  const next = () => ((state = (Math.imul(state, 1664525) + 1013904223) >>> 0) / 2 ** 32);
  const normal = () => Math.sqrt(-2 * Math.log(1 - next())) * Math.cos(2 * Math.PI * next());
  return {next, normal};
}
const round = (value, digits = 5) => (Number.isFinite(value) ? Number(value.toPrecision(digits + 1)) : null);
const range = (count, f) => Array.from({length: count}, (_, i) => f(i));

export function base(command, more = {}) {
  return {schema: 'alidade-result/1', command, version: '0.1.0', argv: ['alidade', ...command.split(' '), 'input'], created_utc: '2026-01-31T12:00:00Z', seed: 1, seconds: {total: 0.4},
    inputs: [{role: 'input', name: 'input.csv', bytes: 1234, sha256: 'feed'.repeat(16)}],
    verdict: {state: 'good', exit_code: 0, sentence: `a ${command} that stands`, to_add: null, checks: []},
    counts: {given: 100, used: 98, dropped: 2, skipped: []}, estimate: {}, stddev: {}, covariance: {names: [], upper: []}, files: [], data: {}, grids: {}, ...more};
}

export function servoDocument() {
  const {normal} = random(3), rows = 600, control = {t_s: [], head: [], event: []};
  const names = ['asked_pan_rad', 'asked_tilt_rad', 'measured_pan_rad', 'measured_tilt_rad', 'predicted_pan_rad', 'predicted_tilt_rad', 'rate_pan_rad_s', 'rate_tilt_rad_s', 'error_u_px', 'error_v_px', 'sigma_error_u_px', 'sigma_error_v_px', 'in_picture', 'fx_px', 'sigma_fx_px', 'true_fx_px'];
  for (const name of names) control[name] = [];
  for (let i = 0; i < rows; ++i) {
    const t = i / 60, head = 1 + (i % 2), pan = 0.4 * Math.sin(t), tilt = 0.2 * Math.cos(0.7 * t), sigma = 0.9 + 3 * Math.exp(-2 * t), fx = 340 * Math.exp(0.14 * t);
    const values = [pan, tilt, pan - 0.01, tilt - 0.005, pan + 0.02, tilt + 0.01, 0.4 * Math.cos(t), -0.14 * Math.sin(0.7 * t), sigma * normal(), sigma * normal(), sigma, sigma, 1, fx + 2 * normal(), 2, fx];
    control.t_s.push(round(t)), control.head.push(head), control.event.push(i === 240 ? 'lost' : '');
    names.forEach((name, k) => control[name].push(round(values[k])));
  }
  const trials = {controller: [], seed: [], rms_px: [], p95_px: []};
  for (const [name, rms] of [['predictive', 1.4], ['pid', 3.2], ['pid with feed-forward', 2.1]])
    for (let seed = 1; seed <= 20; ++seed) {
      const value = rms * Math.exp(0.1 * normal());
      trials.controller.push(name), trials.seed.push(seed), trials.rms_px.push(round(value)), trials.p95_px.push(round(2 * value));
    }
  const lenses = {intrinsics: [], seed: [], rms_px: [], p95_px: []};
  for (const [name, rms] of [['given', 40], ['observed', 1.5], ['true', 1.4]])
    for (let seed = 1; seed <= 8; ++seed) lenses.intrinsics.push(name), lenses.seed.push(seed), lenses.rms_px.push(round(rms * Math.exp(0.1 * normal()))), lenses.p95_px.push(round(2 * rms));
  const factors = [0.5, 0.7, 1, 1.4, 2], gain = [], tau = [], rms_px = [];
  for (const g of factors) for (const t of factors) gain.push(g), tau.push(t), rms_px.push(round(1.4 * (1 + 2 * Math.log(g) ** 2 + Math.log(t) ** 2)));
  return base('servo', {estimate: {controllers: {}, best: 'predictive', specification_px: 2},
    data: {control, trials, lenses, loops: {controller: ['predictive', 'pid'], loop_gain: [1, 2], bandwidth_rad_s: [8, 5], phase_margin_deg: [61, 24], delay_samples: [3, 3], sampled_radius: [0.91, 0.97]}},
    grids: {robustness: {cols: 5, rows: 5, u0_px: 0, v0_px: 0, du_px: 0, dv_px: 0, gain, tau, rms_px}}});
}

export function localizeDocument() {
  const {next, normal} = random(5), rows = 300, path = {t_s: range(rows, (i) => round(i / 30))};
  const pose = (i) => { const a = (i / rows) * 5; return [0.5 * Math.cos(a), 0.1 * Math.sin(2 * a), -1 + 0.5 * Math.sin(a), 0, Math.sin(0.1 * Math.sin(a)), 0, Math.cos(0.1 * Math.sin(a))]; };
  const names = ['x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw'], sigma = (i) => 0.002 + 0.004 * Math.abs(Math.sin(i / 40));
  names.forEach((name, k) => {
    path[`truth_${name}`] = range(rows, (i) => round(pose(i)[k]));
    path[`world_from_cam_${name}`] = range(rows, (i) => round(pose(i)[k] + (k < 3 ? sigma(i) * normal() : 0)));
  });
  for (const name of ['x_m', 'y_m', 'z_m', 'rx_rad', 'ry_rad', 'rz_rad']) path[`sigma_world_from_cam_${name}`] = range(rows, (i) => round(sigma(i)));
  Object.assign(path, {num_seen: range(rows, () => 14 + Math.floor(4 * next())), num_tracked: range(rows, () => 12 + Math.floor(3 * next())), num_gated: range(rows, () => Math.floor(1.2 * next())),
    nis: range(rows, () => round(1 + 0.2 * normal())), seconds: range(rows, () => round(0.004 + 0.002 * next())), event: range(rows, (i) => (i === 0 ? 'started' : ''))});
  const points = range(40, () => [2 * next() - 1, 1.2 * next() - 0.6, 1 + next()]), features = {id: range(40, (i) => i)};
  ['x', 'y', 'z'].forEach((axis, k) => (features[`point_in_world_${axis}_m`] = points.map((p) => round(p[k]))));
  for (const name of ['xx', 'yy', 'zz']) features[`cov_${name}_m2`] = points.map(() => (name === 'zz' ? 4e-4 : 1e-4));
  for (const name of ['xy', 'xz', 'yz']) features[`cov_${name}_m2`] = points.map(() => 0);
  Object.assign(features, {num_seen: range(40, () => 200), known: range(40, (i) => i < 4)});
  const kept = range(12, (i) => i * 25), frames = {t_s: kept.map((i) => round(i / 30)), name: kept.map((i) => `frame ${i}`), width_px: kept.map(() => 640), height_px: kept.map(() => 480)};
  const sights = {frame: [], id: [], expected_u_px: [], expected_v_px: [], cov_uu_px2: [], cov_uv_px2: [], cov_vv_px2: [], u_px: [], v_px: [], used: []};
  for (let f = 0; f < 12; ++f)
    for (let i = 0; i < 20; ++i) {
      const u = 640 * next(), v = 480 * next(), isFound = i % 7 !== 6, values = [f, i, round(u), round(v), 4, 1, 2, isFound ? round(u + 2 * normal()) : null, isFound ? round(v + 1.4 * normal()) : null, isFound && i % 5 !== 4];
      Object.keys(sights).forEach((column, k) => sights[column].push(values[k]));
    }
  return base('localize', {estimate: {frames: rows, lost: 0, ate_m: 0.0062, rpe_m: 0.0041, alignment: 'SE(3)', nis_per_dof: 1.0, scale_known: true}, data: {path, features, frames, sights}});
}

export function reproduceDocument() {
  const t = range(80, (i) => i / 10);
  return base('reproduce', {verdict: {state: 'care', exit_code: 0, sentence: '2 of 3 claims come out as printed', to_add: null, checks: []},
    data: {experiments: {id: ['table1-rms', 'fig4-fx', 'fig5-time'], quantity: ['RMS of the position', 'error of fx after 20 s', 'time a step'], unit: ['mm', 'px', 'ms'], printed: [41.2, 0.8, null], ours: [40.7, 0.71, 3.1], best: [38.9, 0.28, 0.02], bound: [38.6, 0.26, null], ratio: [0.99, 0.89, null], state: ['good', 'good', 'care'],
      words: ['', '', 'another machine']},
      methods: {experiment: ['table1', 'fig4'], title: ['Table 1', 'Figure 4'], method: ['Six boards, as printed.', 'Seeded draws.'], chosen: ['Readings of 1 mm.', '']}, figures: {id: ['4', '6', '8', 'table_2'], title: ['Angles', 'Spots', 'Errors', 'Table 2: three ways'], caption: ['Drawn: an angle and a focal length.', 'Left the image, right the offsets.', 'Shares of spots.', 'Three rows.'], across: ['', '', 'error of the spot', ''], up: ['', '', 'share', '']},
      fig_6: {range_m: [1, 2, 3], actual_u_px: [600, 640, 680], actual_v_px: [400, 380, 360], method_1_u_px: [600.3, 640.1, 679.6], method_1_v_px: [400.2, 379.9, 360.1], method_2_u_px: [602, 641, 677], method_2_v_px: [404, 379, 361], best_u_px: [600.1, 640, 680.1], best_v_px: [400, 380.1, 360]},
      fig_8: {error_px: [0.5, 1.5, 2.5], method_1_percent: [60, 30, 10], method_1_optimised_percent: [70, 25, 5]},
      fig_table_2: {label: ['method 1', 'method 2', 'ours'], printed_time_ms: [63, 106, null], ours_time_ms: [4, 5, 6]}, fig_4: {t_s: t, ours_pan_deg: t.map((x) => round(Math.sin(x))), ours_fx_px: t.map((x) => round(700 + 10 * Math.exp(-x))), printed_fx_px: t.map((x, i) => (i % 8 === 0 ? round(700.4 + 10 * Math.exp(-x)) : null))}}});
}

/** A calibration of so many photos of a 9 × 6 board; numbers are plausible, not solved. */
export function calibrateDocument(numPhotos, name = (k) => `photo_${String(k).padStart(4, '0')}.jpg`) {
  const {next, normal} = random(7), cols = 9, rows = 6, [width, height] = [1280, 960], f = 1100;
  const photos = {name: [], used: [], reason: [], num_corners: [], rms_px: [], cluster_z2: []}, corners = {};
  for (const part of ['x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw']) photos[`cam_from_board_${part}`] = [];
  for (const column of ['photo', 'col', 'row', 'u_px', 'v_px', 'sigma_u_px', 'sigma_v_px', 'corr_uv', 'residual_u_px', 'residual_v_px', 'weight']) corners[column] = [];
  for (let k = 0; k < numPhotos; ++k) {
    const isUsed = k % 50 !== 49, tilt = 0.8 * next() - 0.4, z = 0.5 + 0.6 * next(), x = (next() - 0.5) * 0.5 * z - 0.1, y = (next() - 0.5) * 0.35 * z - 0.06, scatter = 0.08 + 0.1 * next();
    let squares = 0;
    for (let r = 0; isUsed && r < rows; ++r)
      for (let c = 0; c < cols; ++c) {
        const px = x + 0.025 * c * Math.cos(tilt), pz = z - 0.025 * c * Math.sin(tilt), py = y + 0.025 * r, du = round(scatter * normal(), 4), dv = round(scatter * normal(), 4);
        squares += du * du + dv * dv;
        const values = [k, c, r, round((f * px) / pz + width / 2), round((f * py) / pz + height / 2), 0.1, 0.11, 0.05, du, dv, 1];
        Object.keys(corners).forEach((column, i) => corners[column].push(values[i]));
      }
    photos.name.push(name(k)), photos.used.push(isUsed), photos.reason.push(isUsed ? '' : 'no board found'), photos.num_corners.push(isUsed ? cols * rows : 0);
    photos.cluster_z2.push(isUsed ? round(0.4 + ((k * 7) % 5)) : null);
    photos.rms_px.push(isUsed ? round(Math.sqrt(squares / (cols * rows))) : null);
    const q = [x, y, z, 0, Math.sin(tilt / 2), 0, Math.cos(tilt / 2)];
    ['x_m', 'y_m', 'z_m', 'qx', 'qy', 'qz', 'qw'].forEach((part, i) => photos[`cam_from_board_${part}`].push(isUsed ? round(q[i]) : null));
    ['xx', 'xy', 'xz', 'yy', 'yz', 'zz'].forEach((part, i) => (photos[`cov_middle_${part}_m2`] ??= []).push(isUsed ? [1e-8, 0, 0, 1e-8, 0, 4e-7 * z][i] : null));
  }
  const gridOf = (nx, ny, f_) => ({cols: nx, rows: ny, u0_px: 0, v0_px: 0, du_px: (width - 1) / (nx - 1), dv_px: (height - 1) / (ny - 1), ...f_(range(nx * ny, (i) => Math.hypot((i % nx) / (nx - 1) - 0.5, Math.floor(i / nx) / (ny - 1) - 0.5)))});
  const sigma = (far) => ({sigma_px: far.map((r) => round(0.03 * Math.exp(6 * r * r)))});
  const cells = {u_px: [], v_px: [], count: [], mean_u_px: [], mean_v_px: [], z: []};
  for (let i = 0; i < 48; ++i) [[(i % 8 + 0.5) * 160], [(Math.floor(i / 8) + 0.5) * 160], [i % 11 === 0 ? 0 : 30], [i % 11 === 0 ? null : round(0.01 * normal())], [i % 11 === 0 ? null : round(0.01 * normal())], [i % 11 === 0 ? null : 1 + next()]].forEach(([v], c) => Object.values(cells)[c].push(v));
  return base('calibrate', {counts: {given: numPhotos, used: photos.used.filter(Boolean).length, dropped: 0, skipped: []},
    estimate: {camera: {model: 'brown', width, height, fx: f, fy: f, cx: 639.5, cy: 479.5, skew: 0, k1: -0.1, k2: 0.05, p1: 0, p2: 0, k3: 0}, rms_px: 0.17, noise_px: 0.13, board: {kind: 'chessboard', cols, rows, square_m: 0.025},
      sigma: {design_effect: 4.1, shrinkage: 0.7, inflation: {fx: 2, fy: 2.2}, degrees_of_freedom: {fx: 11, fy: 13}}},
    assumed: [{name: 'square_m', value: 0.025, sigma: null, ordinary: 5e-5, moves: 0.3, moved: 'fx', moved_by: 0.1}, {name: 'camera.fx', value: 1100, sigma: 0, ordinary: null, moves: 0, moved: null, moved_by: 0}],
    stddev_model: {camera: {fx: 0.15, fy: 0.14}},
    stddev: {camera: {fx: 0.3, fy: 0.3, cx: 0.4, cy: 0.4, skew: 0, k1: 0.001, k2: 0.004, p1: 1e-5, p2: 1e-5, k3: 0}}, data: {photos, corners, cells},
    grids: {sigma_infinity: gridOf(60, 40, sigma), sigma_working: gridOf(60, 40, sigma), halves: gridOf(30, 20, (far) => ({delta_u_px: far.map((r) => round(0.05 * r)), delta_v_px: far.map((r) => round(0.02 * r)), predicted_sigma_px: far.map((r) => round(0.03 + 0.05 * r))}))}});
}

/** Four cameras about a path, as `rig --moving-target` leaves them. */
export function movingDocument() {
  const cameras = {id: [1, 2, 3, 4]}, path = {t_s: range(200, (i) => i / 10)}, places = [[0, 0, 0], [20, 1, 3], [22, 0, 25], [-3, 1, 22]];
  const headings = [0.7, -0.7, -2.4, 2.4];
  ['x_m', 'y_m', 'z_m'].forEach((part, k) => (cameras[`world_from_cam_${part}`] = places.map((p) => p[k])));
  ['qx', 'qy', 'qz', 'qw'].forEach((part, k) => (cameras[`world_from_cam_${part}`] = headings.map((a) => round([0, Math.sin(a / 2), 0, Math.cos(a / 2)][k]))));
  for (const part of ['xx', 'xy', 'xz', 'yy', 'yz', 'zz']) cameras[`cov_${part}_m2`] = [0, 1, 2, 3].map((i) => (i > 0 && part[0] === part[1] ? 4e-4 * i : 0));
  Object.assign(cameras, {half_view_x: [0.6, 0.5, 0.6, 0.4], half_view_y: [0.4, 0.3, 0.4, 0.3], num_used: [300, 310, 280, 290], rms_px: [0.7, 0.6, 0.8, 0.7]});
  ['x', 'y', 'z'].forEach((axis, k) => (path[`target_in_world_${axis}_m`] = path.t_s.map((t) => round([10 + 6 * Math.cos(t), -3 + Math.sin(2 * t), 12 + 6 * Math.sin(t)][k]))));
  const names = ['x_m', 'y_m', 'z_m', 'rx_rad', 'ry_rad', 'rz_rad'].flatMap((part) => [2, 3, 4].map((id) => `head${id}.base_${part}`)), n = names.length;
  const upper = range(n, (i) => range(n - i, (j) => (j === 0 ? (names[i].endsWith('rad') ? 1e-6 : 4e-4) : 0))).flat();
  return base('rig', {covariance: {names, upper}, data: {cameras, path},
    estimate: {cameras: places.map((_, i) => ({id: i + 1, placed: true, reason: '', sights: 400, used: 290, clock_offset_s: i, clock_rate: 1, sigma_clock_s: 0.001 * i, sigma_px: 0.5, rms_px: 0.7}))}});
}
