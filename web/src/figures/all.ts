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
import {observeDirections} from './observe_directions';
import {observeIntrinsics} from './observe_intrinsics';
import {observeMotion} from './observe_motion';
import {observeNis} from './observe_nis';
import {observePoints, observeTracks} from './observe_points';
import {photo} from './photo';
import {poses} from './poses';
import {rangefinderBeam} from './rangefinder_beam';
import {rangefinderPhoto, rangefinderShots} from './rangefinder_photo';
import {rangefinderCounts, rangefinderNext, rangefinderPrecision} from './rangefinder_precision';
import {rangefinderResiduals} from './rangefinder_residuals';
import {refusal} from './refusal';
import {residuals} from './residuals';
import {trust} from './trust';
import {undistorted} from './undistorted';
import {worstPhotos} from './worst_photos';

const byCommand: Record<string, Figure[]> = {
  calibrate: [estimate, trust, residuals, worstPhotos, poses, photo, allPhotos, halves, undistorted, lens, board, nextPhoto],
  observe: [estimate, observeIntrinsics, observeMotion, observeNis, observeTracks, observeDirections, observePoints],
  rangefinder: [{...estimate, note: 'camera frame, value ± 3σ'}, rangefinderBeam, rangefinderResiduals, rangefinderPhoto, rangefinderPrecision, rangefinderNext, rangefinderCounts, rangefinderShots],
  'camera diff': [difference, diagonal, parameters, {...estimate, span: 10}],
};

export function figuresOf(doc: Doc): Figure[] {
  const own = Object.prototype.hasOwnProperty.call(byCommand, doc.command) ? byCommand[doc.command]! : [estimate];
  return doc.isAnswer || !doc.isReadable ? own : [refusal, ...own];
}
