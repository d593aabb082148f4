// localize: an image with where points were expected, and where they were found.
import {Chart} from '../core/chart';
import {el} from '../core/dom';
import {legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {imageOf, whenImagesAreHere} from '../core/images';
import {ellipsePlaces, panelIn} from '../core/panel';
import type {Selection} from '../core/selection';

/** Of the images kept, the one nearest to the chosen instant. */
function nearest(t: Float64Array, selection: Selection): number {
  if (!Number.isFinite(selection.time)) return Math.floor(t.length / 2);
  let best = 0;
  t.forEach((value, i) => Math.abs(value - selection.time) < Math.abs(t[best]! - selection.time) && (best = i));
  return best;
}

export const localizeFrame: Figure = {
  id: 'frame', title: 'What did it look for, and find?', note: 'px · ellipse: 3σ of where a point is expected · ← → other images', span: 12,
  draw(host, doc, selection) {
    const frames = doc.table('frames'), sights = doc.table('sights');
    if (!frames || !sights) return null;
    const t = frames.numbers('t_s'), of = sights.numbers('frame'), column = (name: string) => sights.numbers(name);
    const eu = column('expected_u_px'), ev = column('expected_v_px'), uu = column('cov_uu_px2'), uv = column('cov_uv_px2'), vv = column('cov_vv_px2'), u = column('u_px'), v = column('v_px'), used = column('used');
    let shown = Math.floor(t.length / 2), item = shown, time = selection.time;
    selection.offer(Array.from(t, (_, i) => i));
    selection.choose(shown);
    legend(host, [{words: 'expected, 3σ', colour: 'var(--sky)', look: 'ring'}, {words: 'found', colour: 'var(--orange)', look: 'dot'}, {words: 'gated', colour: 'var(--red)', look: 'dot'}]);
    const caption = el('p', {class: 'caption'}), size = {width: frames.number('width_px', 0) || 640, height: frames.number('height_px', 0) || 480};
    host.append(caption);
    const inImage = (k: number) => Array.from(of.keys()).filter((i) => of[i] === k);
    const chart = new Chart(host, {height: 220, aspect: size.height / size.width, most: 640}, (pen) => {
      const image = imageOf(frames.text('name', shown), () => chart.redraw()), panel = panelIn(size, 0, 0, pen.w, pen.h);
      if (image) pen.g.drawImage(image, panel.x, panel.y, panel.w, panel.h);
      else pen.rect(panel.x, panel.y, panel.w, panel.h, '#39424c');
      pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
        for (const i of inImage(shown)) {
          const [x, y] = panel.at(eu[i]!, ev[i]!), ring = ellipsePlaces(x, y, uu[i]!, uv[i]!, vv[i]!, 3 * panel.perPixel);
          pen.path(ring, '#000', 3, [], true), pen.path(ring, '#56b4e9', 1.5, [], true);
          if (Number.isFinite(u[i]!)) pen.circle(...panel.at(u[i]!, v[i]!), 3, used[i]! > 0 ? '#e69f00' : '#d55e00', '#000', 1);
        }
      });
      for (const i of inImage(shown)) {
        const [x, y] = panel.at(eu[i]!, ev[i]!);
        pen.hit({x, y, r: 5, tip: () => [`point ${sights.text('id', i)}`, `expected at ${num(eu[i]!, 4)}, ${num(ev[i]!, 4)} px ± ${num(3 * Math.sqrt(Math.max(uu[i]!, vv[i]!)), 2)} (3σ)`,
          Number.isFinite(u[i]!) ? `${used[i]! > 0 ? 'found' : 'found, and gated'} ${num(Math.hypot(u[i]! - eu[i]!, v[i]! - ev[i]!), 2)} px from there` : 'not found']});
      }
    });
    const update = () => {
      if (!Object.is(selection.time, time)) { // chosen in another figure
        time = selection.time;
        item = shown = nearest(t, selection);
        selection.choose(shown);
      } else if (selection.item !== item && selection.item >= 0 && selection.item < t.length) { // by the keys: the others follow
        item = shown = selection.item;
        selection.at(time = t[shown]!);
      }
      const here = inImage(shown), found = here.filter((i) => used[i]! > 0).length;
      caption.replaceChildren(el('b', {}, `${num(t[shown]!, 4)} s`), ` · ${found} of ${here.length} points found and used · image ${shown + 1} of ${t.length} kept`);
      chart.redraw();
    };
    selection.on(update);
    whenImagesAreHere(update);
    update();
    return {marks: sights.rows, rows: sights.rows, tables: [frames, sights], words: caption.textContent ?? '', good: 'Good: most ellipses hold a dot, small ones near their centre. Large: the point is new, or the camera was not seen for a while.'};
  },
};
