// What does this lens do? Straight lines of the world as it shows them, beside where a lens without distortion would.
import {Chart, type Pen} from '../core/chart';
import {legend, type Figure} from '../core/figure';
import {num} from '../core/format';
import {panelIn} from '../core/panel';
import {lensOf, type Lens} from '../core/rigid';

const lines = 13, steps = 80;

/** Lines of constant x and of constant y on a plane before the camera, out to the image's edge and beyond. */
function drawLines(pen: Pen, lens: Lens): void {
  const panel = panelIn(lens, 0, 0, pen.w, pen.h), half = [1.35 * lens.width / 2 / lens.fx, 1.35 * lens.height / 2 / lens.fy] as const;
  const straight = (x: number, y: number): [number, number] => [lens.fx * x + lens.cx, lens.fy * y + lens.cy];
  const seen = (x: number, y: number): [number, number] => lens.project([x, y, 1]) ?? [NaN, NaN];
  pen.rect(panel.x, panel.y, panel.w, panel.h, pen.c.panel, pen.c.soft);
  pen.clipped(panel.x, panel.y, panel.w, panel.h, () => {
    for (const [look, colour, width, dash] of [[straight, pen.c.soft, 1, [3, 3]], [seen, pen.c.blue, 1.7, []]] as [typeof seen, string, number, number[]][])
      for (let i = 0; i < lines; ++i) {
        const at = (2 * i) / (lines - 1) - 1, along = (k: number) => (2 * k) / steps - 1;
        const run = (f: (s: number) => [number, number]) => pen.path(Array.from({length: steps + 1}, (_, k) => panel.at(...look(...f(along(k))))).flat(), colour, width, dash);
        run((s) => [half[0] * at, half[1] * s]);
        run((s) => [half[0] * s, half[1] * at]);
      }
    const [x, y] = panel.at(lens.cx, lens.cy);
    pen.line(x - 8, y, x + 8, y, pen.c.orange, 2.2), pen.line(x, y - 8, x, y + 8, pen.c.orange, 2.2);
    pen.hit({x, y, tip: () => ['principal point', `${num(lens.cx, 5)}, ${num(lens.cy, 5)} px`]});
  });
}

export const lensGrid: Figure = {
  id: 'grid', isOptional: true, title: 'What does this lens do?', note: 'straight lines of the world, in the image', span: 16,
  draw(host, doc) {
    const lens = lensOf(doc), model = doc.estimateText('camera.model');
    if (!lens || !doc.imageSize || !/^(pinhole|brown|kannala_brandt)$/.test(model)) return null; // a port has no rays through one point
    legend(host, [{words: 'as the lens shows them', colour: 'var(--blue)'}, {words: 'without distortion', colour: 'var(--soft)', look: 'dash'}, {words: 'principal point', colour: 'var(--orange)'}]);
    new Chart(host, {height: 160, aspect: lens.height / lens.width, most: 440, label: `Straight lines through a ${model} lens`}, (pen) => drawLines(pen, lens));
    return {marks: 2 * lines, rows: 2 * lines, tables: [], words: `a ${model} lens`, good: 'Where a blue line ends inside the image, the lens model folds back: nothing of the world is shown beyond.'};
  },
};
