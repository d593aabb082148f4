// Are straight lines straight? A photo as taken, and undistorted.
import {el} from '../core/dom';
import type {Figure} from '../core/figure';
import {imageOf, imageNames, whenImagesAreHere} from '../core/images';
import {calibrateScene} from './calibrate_scene';

const prefix = 'undistorted:';

export const undistorted: Figure = {
  id: 'undistorted', title: 'Are straight lines straight?', note: 'as taken, and undistorted', span: 12,
  draw(host, doc, selection) {
    const {photos} = calibrateScene(doc, selection);
    if (!photos.some((photo) => photo.isUsed) || !doc.isAnswer) return null;
    const pair = el('div', {class: 'pair'});
    host.append(pair);
    whenImagesAreHere(() => {
      const name = imageNames().find((one) => one.startsWith(prefix));
      // Images stand behind the document: only now is known whether there is one.
      if (!name) {
        host.closest('section')?.remove();
        document.getElementById('fig-halves')?.style.setProperty('--span', '24');
        return;
      }
      for (const [shownName, words] of [[name.slice(prefix.length), 'as taken'], [name, 'undistorted']] as const) {
        const figure = el('figure', {}, el('figcaption', {class: 'caption'}, `${name.slice(prefix.length)}, ${words}`));
        const show = () => {
          const image = imageOf(shownName, show);
          if (image) figure.prepend(el('img', {src: image.src, alt: `${words}`}));
        };
        show();
        pair.append(figure);
      }
    });
    return {marks: 2, rows: 2, tables: [], words: '', good: 'Good: edges that are straight in the world are straight on the right, out to the corners.'};
  },
};
