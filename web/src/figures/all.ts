// Which figures each command's page has, in their order.
import type {Doc} from '../core/document';
import type {Figure} from '../core/figure';
import {allPhotos} from './all_photos';
import {assumed} from './assumed';
import {board} from './board';
import {causes} from './causes';
import {checks} from './checks';
import {clusters} from './clusters';
import {correlationMatrix} from './correlation_matrix';
import {diagonal, difference, parameters} from './diff';
import {estimate} from './estimate';
import {followAngles, followError} from './follow';
import {halves} from './halves';
import {identifyResponse, identifySpread} from './identify';
import {lens} from './lens';
import {lensGrid} from './lens_grid';
import {localizeFrame} from './localize_frame';
import {localizeError, localizeNis, localizeSpace, localizeSpeed, localizeTracks} from './localize';
import {nextPhoto} from './next_photo';
import {observeDirections} from './observe_directions';
import {observeIntrinsics} from './observe_intrinsics';
import {observeMotion} from './observe_motion';
import {observeNis} from './observe_nis';
import {observePoints, observeTracks} from './observe_points';
import {photo} from './photo';
import {planCalibrate, planEstimate, planObserve, planRangefinder, planSketches} from './plan';
import {poses} from './poses';
import {projectHeads, projectImage} from './project';
import {rangefinderBeam} from './rangefinder_beam';
import {rangefinderPhoto, rangefinderShots} from './rangefinder_photo';
import {rangefinderCounts, rangefinderNext, rangefinderPrecision} from './rangefinder_precision';
import {rangefinderResiduals} from './rangefinder_residuals';
import {refusal} from './refusal';
import {reproduceFigure, reproduceMethods, reproduceShort, reproduceTable} from './reproduce';
import {residuals} from './residuals';
import {rigCoverage, rigEstimate, rigResiduals, rigSpace, rigUnknown, rigView} from './rig';
import {movingAbove, movingClocks, movingEstimate, movingSpace} from './rig_moving';
import {servoAngles, servoCompare, servoError, servoFocal, servoLenses, servoLoops, servoImage, servoRobust} from './servo';
import {batchSpread} from './batch';
import {studyCurve} from './study';
import {batchLot, batchOutliers, batchRows, studyQuantities, studyWorst} from './tables';
import {trackAbove, trackAge, trackError, trackInnovations, trackPosition, trackSpace} from './track';
import {trust} from './trust';
import {undistorted} from './undistorted';
import {worstPhotos} from './worst_photos';

/** What a person sees first, beside the verdict: the values, and one figure. */
type First = [values: Figure, figure: Figure];
interface Page {
  first: First;
  rest: Figure[];
}

const values: Figure = {...estimate, span: 8};
const wide = (figure: Figure): Figure => ({...figure, span: 16});
/** Half the width on a narrow first screen: a table with the bound beside each value needs it. */
const even = (figure: Figure): Figure => ({...figure, narrow: 12});
const half = (figure: Figure): Figure => ({...figure, span: 12});
/** Of every page: what the answer rests on. */
const grounds: Figure[] = [assumed, checks, causes, correlationMatrix];

const byCommand: Record<string, Page> = {
  calibrate: {first: [values, wide(trust)], rest: [clusters, worstPhotos, poses, photo, half(residuals), half(lens), half(halves), half(undistorted), half(board), half(nextPhoto), allPhotos, ...grounds]},
  observe: {first: [{...values, narrow: 24}, {...wide(observeIntrinsics), narrow: 24}], rest: [clusters, observeMotion, observeNis, observeTracks, observeDirections, observePoints, ...grounds]},
  rangefinder: {first: [even({...values, note: 'camera frame, value ± 3σ'}), even(wide(rangefinderBeam))], rest: [clusters, rangefinderResiduals, rangefinderPhoto, rangefinderPrecision, rangefinderNext, rangefinderCounts, rangefinderShots, ...grounds]},
  rig: {first: [{...rigEstimate, span: 11, narrow: 24}, {...rigSpace, span: 13, narrow: 24}], rest: [clusters, rigCoverage, rigResiduals, rigView, {...rigUnknown, span: 14}, assumed, checks, causes]},
  track: {first: [values, wide(trackSpace)], rest: [trackPosition, trackError, trackInnovations, {...trackAbove, span: 12}, {...trackAge, span: 12}, ...grounds]},
  servo: {first: [{...servoCompare, span: 10}, servoError], rest: [servoLenses, servoFocal, servoAngles, servoImage, half(servoRobust), half(servoLoops), trackSpace, trackPosition, assumed, checks]},
  localize: {first: [values, wide(localizeSpace)], rest: [half(localizeError), localizeFrame, half(localizeTracks), half(localizeNis), half(localizeSpeed), ...grounds]},
  identify: {first: [values, identifyResponse], rest: [identifySpread, clusters, ...grounds]},
  'plan calibrate': {first: [planEstimate, planCalibrate], rest: [planSketches, assumed, checks]},
  'plan observe': {first: [planEstimate, planObserve], rest: [assumed, checks]},
  'plan rangefinder': {first: [planEstimate, planRangefinder], rest: [planSketches, assumed, checks]},
  project: {first: [{...values, isOptional: true}, projectImage], rest: [projectHeads, assumed, checks]},
  'camera diff': {first: [{...parameters, span: 10, narrow: 24}, {...difference, span: 14, narrow: 24}], rest: [half(diagonal), half(estimate), assumed, checks]},
};
const following: Page = {first: [values, wide(followError)], rest: [followAngles, assumed, checks]};
const movingTarget: Page = {first: [movingEstimate, movingSpace], rest: [clusters, movingAbove, movingClocks, {...rigUnknown, span: 12}, assumed, checks]};

function pageOf(doc: Doc): Page {
  if (doc.command.startsWith('reproduce')) {
    const tables = [...doc.tables.values()].filter((table) => table.name.startsWith('fig_') && table.rows > 0);
    // First the figure that tells most: one with ours beside the paper's.
    const best = tables.find((table) => !table.has('label') && !table.has('actual_u_px') && table.names.some((name) => name.startsWith('best_'))) ?? tables[0];
    const main = best ? reproduceFigure(best, doc) : null, others = tables.filter((table) => table !== best).map((table) => reproduceFigure(table, doc));
    return {first: [{...reproduceShort, narrow: 24}, {...(main ?? reproduceMethods), span: 14, narrow: 24}], rest: [reproduceTable, ...others, ...(main ? [reproduceMethods] : []), half(estimate)]};
  }
  if (doc.command.startsWith('study ')) return {first: [studyCurve, studyQuantities], rest: [studyWorst, checks]};
  if (doc.command === 'batch') return {first: [batchSpread, batchOutliers], rest: [batchLot, batchRows, checks]};
  if (doc.command === 'rig' && (doc.table('cameras') || (doc.estimates.some((one) => one.path === 'cameras[0].id')))) return movingTarget;
  if (doc.command === 'head' && doc.table('follow')) return following;
  const own = Object.prototype.hasOwnProperty.call(byCommand, doc.command) ? byCommand[doc.command]! : null;
  return own ?? {first: [{...values, isOptional: true}, lensGrid], rest: [assumed, checks, correlationMatrix]};
}

/** In their order; the first `first` of them stand on the first screen. */
export function figuresOf(doc: Doc): {figures: Figure[]; first: Set<Figure>} {
  const {first, rest} = pageOf(doc);
  if (doc.isAnswer || !doc.isReadable) return {figures: [...first, ...rest], first: new Set(first)};
  return {figures: [refusal, ...first, ...rest], first: new Set([refusal])};
}
