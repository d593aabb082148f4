// The scene of a live run in space: frames, cameras, path, ellipsoids, as the server sends them.
import {rotationOf, type M3, type Pose, type V3, column, mul, norm, sub} from '../core/rigid';
import type {Rgb} from '../core/colours';
import {View3} from '../core/view3';
import {World} from '../core/world';
import type {Message} from './connection';

interface Xyz {x: number; y: number; z: number}
interface Xyzw extends Xyz {w: number}
interface Rgba {r: number; g: number; b: number; a: number}
interface ScenePose {position: Xyz; orientation: Xyzw}
interface Entity {
  lines: {points: Xyz[]; color: Rgba; thickness: number}[];
  spheres: {pose: ScenePose; size: Xyz; color: Rgba}[];
  texts: {pose: ScenePose; text: string}[];
  id: string;
}
export interface Calibration {width: number; height: number; K: number[]}

const v3 = (p: Xyz): V3 => [p.x, p.y, p.z];
const rgb = (c: Rgba): Rgb => [Math.round(255 * c.r), Math.round(255 * c.g), Math.round(255 * c.b)];
const rotation = (q: Xyzw): M3 => rotationOf(q.x, q.y, q.z, q.w);

export class Space {
  readonly frames = new Map<string, Pose>();
  readonly cameras = new Map<string, Calibration>();
  private readonly entities = new Map<string, Entity>();
  private readonly view: View3;
  private isTouched = false;

  constructor(host: HTMLElement, private readonly isTurning: boolean) {
    this.view = new View3(host, {height: 430, isFilling: true, up: [0, -1, 0], ahead: [0, 0, 1], yaw: 0.6, pitch: 0.4, label: 'The scene, live', hasNoBar: isTurning}, () => this.world());
    this.view.wake();
    this.view.chart.canvas.addEventListener('pointerdown', () => (this.isTouched = true));
    this.view.chart.canvas.addEventListener('dblclick', () => (this.isTouched = false));
  }
  takeFrames(message: Message): void {
    for (const one of message['transforms'] as {child_frame_id: string; translation: Xyz; rotation: Xyzw}[])
      this.frames.set(one.child_frame_id, {t: v3(one.translation), r: rotation(one.rotation)});
  }
  takeScene(message: Message): void {
    for (const entity of message['entities'] as Entity[]) this.entities.set(entity.id, entity);
  }
  clear(): void {
    this.entities.clear();
  }
  draw(): void {
    if (!this.isTouched) this.view.refit();
    this.view.refresh();
  }

  private world(): World {
    const world = new World();
    const trail = this.entities.get('trail')?.lines[0]?.points.map(v3) ?? [];
    world.hold(...trail, ...[...this.frames].map(([, pose]) => pose.t));
    const middle = trail[trail.length - 1] ?? [0, 0, 1];
    for (const entity of this.entities.values()) {
      for (const line of entity.lines) world.line(line.points.map(v3), {colour: rgb(line.color), width: line.thickness});
      for (const sphere of entity.spheres) {
        const r = rotation(sphere.pose.orientation), half = [sphere.size.x / 2, sphere.size.y / 2, sphere.size.z / 2];
        world.ellipsoid(v3(sphere.pose.position), ([0, 1, 2] as const).map((k) => mul(column(r, k), half[k]!)), rgb(sphere.color), 0.2);
        world.dot(v3(sphere.pose.position), 'red', 8);
      }
      for (const text of entity.texts) world.label(v3(text.pose.position), text.text);
    }
    for (const [name, pose] of this.frames) {
      const camera = this.cameras.get(name);
      if (!camera) continue;
      const depth = this.isTurning ? 1 : Math.max(0.02, 0.22 * norm(sub(middle, pose.t)) || 0.2), [fx, fy] = [camera.K[0]!, camera.K[4]!];
      const corners = world.frustum(pose, [camera.width / 2 / fx, camera.height / 2 / fy], depth, {colour: 'ink', width: 1.8});
      world.hold(...corners);
    }
    world.axes({t: [0, 0, 0], r: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, this.isTurning ? 0.5 : 0.1 * Math.max(norm(middle), 0.5));
    world.hold([0, 0, 0]);
    return world;
  }
}
