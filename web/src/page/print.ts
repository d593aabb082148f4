// Paper: every canvas drawn again at the paper's width, 3-D as it stands, light.
import {charts} from '../core/chart';
import {forgetPalette} from '../core/colours';
import {seriesPlots} from '../core/series';
import {views3} from '../core/view3';

export function listenToPrinting(): void {
  let theme: string | undefined;
  addEventListener('beforeprint', () => {
    theme = document.documentElement.dataset['theme'];
    document.documentElement.dataset['theme'] = 'light';
    document.documentElement.classList.add('printing');
    forgetPalette();
    for (const view of views3) view.forget(), view.wake();
    for (const chart of charts) chart.redrawFor(2.5);
    for (const plot of seriesPlots) plot.fit(), plot.redraw();
  });
  addEventListener('afterprint', () => {
    if (theme === undefined) delete document.documentElement.dataset['theme'];
    else document.documentElement.dataset['theme'] = theme;
    document.documentElement.classList.remove('printing');
    forgetPalette();
    for (const view of views3) view.forget();
    for (const chart of charts) chart.redrawFor(0);
    for (const plot of seriesPlots) plot.fit(), plot.redraw();
  });
}
