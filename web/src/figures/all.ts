// Which figures each command's page has, in their order.
import type {Doc} from '../core/document';
import type {Figure} from '../core/figure';
import {allPhotos} from './all_photos';
import {board} from './board';
import {diagonal, difference, parameters} from './diff';
import {estimate} from './estimate';
import {halves} from './halves';
import {lens} from './lens';
import {nextPhoto} from './next_photo';
import {photo} from './photo';
import {poses} from './poses';
import {residuals} from './residuals';
import {trust} from './trust';
import {undistorted} from './undistorted';
import {worstPhotos} from './worst_photos';

const byCommand: Record<string, Figure[]> = {
  calibrate: [estimate, trust, residuals, worstPhotos, poses, photo, allPhotos, halves, lens, board, nextPhoto, undistorted],
  'camera diff': [difference, diagonal, parameters, {...estimate, span: 10}],
};

export function figuresOf(doc: Doc): Figure[] {
  return Object.prototype.hasOwnProperty.call(byCommand, doc.command) ? byCommand[doc.command]! : [estimate];
}
