// Which estimates trade against each other? Their correlations.
import type {Figure} from '../core/figure';
import {correlationsOf} from './correlations';
import {drawCorrelations} from './estimate';

export const correlationMatrix: Figure = {
  id: 'correlations', isOptional: true, title: 'What trades against what?', note: 'correlation of the estimates', span: 12,
  draw(host, doc) {
    const matrix = correlationsOf(doc);
    if (!matrix || matrix.names.length < 2 || !doc.isAnswer) return null;
    drawCorrelations(host, matrix);
    return {marks: matrix.names.length, rows: matrix.names.length, tables: [], words: matrix.words, good: 'A number stands where two are known together, not each by itself (above 0.6).'};
  },
};
