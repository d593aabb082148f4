// Which figures each command's page has, in their order.
import type {Doc} from '../core/document';
import type {Figure} from '../core/figure';
import {allPhotos} from './all_photos';
import {board} from './board';
import {diagonal, difference, parameters} from './diff';
import {estimate} from './estimate';
import {halves} from './halves';
import {lens} from './lens';
import {localizeFrame} from './localize_frame';
import {localizeError, localizeNis, localizeSpace, localizeSpeed, localizeTracks} from './localize';
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
import {reproduceFigure, reproduceMethods, reproduceTable} from './reproduce';
import {residuals} from './residuals';
import {rigCoverage, rigEstimate, rigResiduals, rigSpace, rigUnknown, rigView} from './rig';
import {servoAngles, servoCompare, servoError, servoLoops, servoPicture, servoRobust} from './servo';
import {trackAbove, trackAge, trackError, trackInnovations, trackPosition, trackSpace} from './track';
import {trust} from './trust';
import {undistorted} from './undistorted';
import {worstPhotos} from './worst_photos';

const byCommand: Record<string, Figure[]> = {
  calibrate: [estimate, trust, residuals, worstPhotos, poses, photo, allPhotos, halves, undistorted, lens, board, nextPhoto],
  observe: [estimate, observeIntrinsics, observeMotion, observeNis, observeTracks, observeDirections, observePoints],
  rangefinder: [{...estimate, span: 7, note: 'camera frame, value ± 3σ'}, {...rangefinderBeam, span: 17}, rangefinderResiduals, rangefinderPhoto, rangefinderPrecision, rangefinderNext, rangefinderCounts, rangefinderShots],
  rig: [rigEstimate, rigSpace, rigCoverage, rigResiduals, rigView, {...rigUnknown, span: 14}],
  track: [trackSpace, trackPosition, trackError, trackInnovations, {...estimate, span: 8}, {...trackAbove, span: 8}, {...trackAge, span: 8}],
  servo: [servoError, servoPicture, servoAngles, servoCompare, {...servoRobust, span: 12}, {...servoLoops, span: 12}, trackSpace, trackPosition],
  localize: [localizeSpace, localizeError, localizeFrame, {...localizeTracks, span: 12}, localizeNis, localizeSpeed, {...estimate, span: 12}],
  'camera diff': [difference, diagonal, parameters, {...estimate, span: 10}],
};

export function figuresOf(doc: Doc): Figure[] {
  if (doc.command.startsWith('reproduce')) {
    const figures = [...doc.tables.values()].filter((table) => table.name.startsWith('fig_') && table.rows > 0);
    return [reproduceTable, ...figures.map(reproduceFigure), reproduceMethods, {...estimate, span: 12}];
  }
  const own = Object.prototype.hasOwnProperty.call(byCommand, doc.command) ? byCommand[doc.command]! : [{...estimate, span: 12}];
  return doc.isAnswer || !doc.isReadable ? own : [refusal, ...own];
}
