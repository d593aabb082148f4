// One WebGL renderer for all 3-D figures. It draws out of sight; the figure's canvas takes the image, so that paper and
// saved images need nothing of their own.
import {
  BufferAttribute, BufferGeometry, CanvasTexture, Color, DoubleSide, Mesh, MeshBasicMaterial, PerspectiveCamera, Points,
  PointsMaterial, Scene, SRGBColorSpace, WebGLRenderer,
} from 'three';
import {LineMaterial} from 'three/addons/lines/LineMaterial.js';
import {LineSegments2} from 'three/addons/lines/LineSegments2.js';
import {LineSegmentsGeometry} from 'three/addons/lines/LineSegmentsGeometry.js';
import {css, palette, type Rgb} from './colours';
import {sub, cross, unit, type V3} from './rigid';
import type {Colour, Dot, Face, World} from './world';

let renderer: WebGLRenderer | null | undefined;

/** Null where the browser has no WebGL. */
export function glRenderer(): WebGLRenderer | null {
  if (renderer !== undefined) return renderer;
  const canvas = document.createElement('canvas');
  let context: WebGL2RenderingContext | null = null;
  try {
    context = canvas.getContext('webgl2', {antialias: true, alpha: true, preserveDrawingBuffer: true});
    renderer = context ? new WebGLRenderer({canvas, context, antialias: true, alpha: true}) : null;
    renderer?.setClearColor(0, 0);
  } catch {
    renderer = null;
  }
  return renderer;
}

export function cssOf(colour: Colour): string {
  return typeof colour === 'string' ? palette()[colour] : css(colour as Rgb);
}
const colours = new Map<string, Color>();
function colourOf(colour: Colour): Color {
  const words = cssOf(colour);
  let made = colours.get(words);
  if (!made) colours.set(words, (made = new Color().setStyle(words, SRGBColorSpace)));
  return made;
}

function facesMesh(faces: Face[], opacity: number): Mesh {
  const places: number[] = [], shades: number[] = [];
  for (const face of faces) {
    const {r, g, b} = colourOf(face.colour);
    for (let i = 1; i + 1 < face.places.length; ++i)
      for (const [x, y, z] of [face.places[0]!, face.places[i]!, face.places[i + 1]!]) {
        places.push(x, y, z);
        shades.push(r, g, b);
      }
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(places), 3));
  geometry.setAttribute('color', new BufferAttribute(new Float32Array(shades), 3));
  return new Mesh(geometry, new MeshBasicMaterial({vertexColors: true, side: DoubleSide, transparent: opacity < 1, opacity,
    depthWrite: opacity >= 1, polygonOffset: true, polygonOffsetFactor: 1}));
}

function dotsCloud(dots: Dot[], size: number, ratio: number): Points {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(dots.flatMap((dot) => dot.at)), 3));
  const shades = dots.flatMap((dot) => colourOf(dot.colour).toArray());
  geometry.setAttribute('color', new BufferAttribute(new Float32Array(shades), 3));
  return new Points(geometry, new PointsMaterial({size: size * ratio, sizeAttenuation: false, vertexColors: true,
    map: disc(), alphaTest: 0.5, transparent: true}));
}

let discTexture: CanvasTexture | null = null;
function disc(): CanvasTexture {
  if (discTexture) return discTexture;
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = 32;
  const g = canvas.getContext('2d')!;
  g.fillStyle = '#fff';
  g.beginPath();
  g.arc(16, 16, 15, 0, 7);
  g.fill();
  return (discTexture = new CanvasTexture(canvas));
}

function imageMesh(corners: [V3, V3, V3, V3], image: HTMLImageElement): Mesh {
  const geometry = new BufferGeometry();
  const [a, b, c, d] = corners;
  geometry.setAttribute('position', new BufferAttribute(new Float32Array([...a, ...b, ...c, ...a, ...c, ...d]), 3));
  geometry.setAttribute('uv', new BufferAttribute(new Float32Array([0, 1, 1, 1, 1, 0, 0, 1, 1, 0, 0, 0]), 2));
  const canvas = document.createElement('canvas');
  canvas.width = 512;
  canvas.height = Math.max(1, Math.round((512 * image.naturalHeight) / image.naturalWidth));
  canvas.getContext('2d')?.drawImage(image, 0, 0, canvas.width, canvas.height);
  const map = new CanvasTexture(canvas);
  map.colorSpace = SRGBColorSpace;
  return new Mesh(geometry, new MeshBasicMaterial({map, side: DoubleSide}));
}

function grouped<T>(items: T[], key: (item: T) => number): Map<number, T[]> {
  const groups = new Map<number, T[]>();
  for (const item of items) {
    const group = groups.get(key(item));
    if (group) group.push(item);
    else groups.set(key(item), [item]);
  }
  return groups;
}

/** A world as a scene: one object a look, so that 500 boards are two draw calls. */
export function sceneOf(world: World, images: (name: string) => HTMLImageElement | null, ratio: number): Scene {
  const scene = new Scene();
  for (const [opacity, faces] of grouped(world.faces, (face) => face.opacity)) scene.add(facesMesh(faces, opacity));
  for (const {look, places} of world.lines.values()) {
    if (places.length === 0) continue;
    const material = new LineMaterial({color: colourOf(look.colour), linewidth: look.width * ratio,
      transparent: look.opacity < 1, opacity: look.opacity, depthWrite: look.opacity >= 1});
    scene.add(new LineSegments2(new LineSegmentsGeometry().setPositions(places), material));
  }
  for (const [size, dots] of grouped(world.dots, (dot) => dot.size)) scene.add(dotsCloud(dots, size, ratio));
  for (const texture of world.textures) {
    const image = images(texture.name);
    if (image) scene.add(imageMesh(texture.corners, image));
  }
  return scene;
}

export function dispose(scene: Scene): void {
  scene.traverse((object) => {
    const mesh = object as Mesh;
    mesh.geometry?.dispose();
    const material = mesh.material as MeshBasicMaterial | undefined;
    if (material && material.map && material.map !== discTexture) material.map.dispose();
    material?.dispose();
  });
}

export {PerspectiveCamera};

/** A look at a target from a direction given by turns about `up`. */
export class Orbit {
  readonly camera = new PerspectiveCamera(28, 1, 0.01, 1000);
  target: V3 = [0, 0, 0];
  distance = 1;
  private readonly ahead: V3;
  private readonly side: V3;

  constructor(private readonly up: V3, ahead: V3, public yaw: number, public pitch: number) {
    this.side = unit(cross(ahead, up));
    this.ahead = unit(cross(up, this.side));
  }
  private get away(): V3 {
    const c = Math.cos(this.pitch), s = Math.sin(this.pitch), a = Math.cos(this.yaw), b = Math.sin(this.yaw);
    return [0, 1, 2].map((k) => c * (-a * this.ahead[k]! + b * this.side[k]!) + s * this.up[k]!) as V3;
  }
  place(aspect: number): void {
    const away = this.away, camera = this.camera;
    camera.up.set(...this.up);
    camera.position.set(...([0, 1, 2].map((k) => this.target[k]! + this.distance * away[k]!) as V3));
    camera.aspect = aspect;
    camera.near = this.distance / 100;
    camera.far = this.distance * 20;
    camera.lookAt(...this.target);
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld(true);
  }
  rotate(dx: number, dy: number): void {
    this.yaw -= dx * 0.008;
    this.pitch = Math.min(1.5, Math.max(-1.5, this.pitch + dy * 0.008));
  }
  /** By pixels of a view that is `height` high. */
  pan(dx: number, dy: number, height: number): void {
    const perPixel = (2 * this.distance * Math.tan((this.camera.fov * Math.PI) / 360)) / height;
    const m = this.camera.matrixWorld.elements;
    this.target = sub(this.target, [0, 1, 2].map((k) => perPixel * (dx * m[k]! - dy * m[4 + k]!)) as V3);
  }
  zoom(factor: number): void {
    this.distance *= factor;
  }
}
