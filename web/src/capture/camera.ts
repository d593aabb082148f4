// The browser's camera: its newest image as grey values, exact where the browser hands over what the camera gave.

export interface GreyImage {
  width: number;
  height: number;
  isExact: boolean;
  grey: Uint8Array<ArrayBuffer>;
}
interface FrameReader {
  readable: ReadableStream<VideoFrame>;
}
declare const MediaStreamTrackProcessor: (new (of: {track: MediaStreamTrack}) => FrameReader) | undefined;

const largest = {width: {ideal: 1920}, height: {ideal: 1080}};

export class Camera {
  private newest: VideoFrame | null = null;
  private waiting: (() => void) | null = null;
  private reader: ReadableStreamDefaultReader<VideoFrame> | null = null;
  private readonly canvas = document.createElement('canvas');
  private isStopped = false;
  isExact = false;

  private constructor(readonly stream: MediaStream, private readonly video: HTMLVideoElement, private readonly track: MediaStreamTrack) {}

  /** Asks for permission. Rejects where it is refused, or there is no camera. */
  static async open(video: HTMLVideoElement, gone: () => void): Promise<Camera> {
    if (!navigator.mediaDevices) throw new Error('this browser has no cameras, or gives none to this address');
    const known = navigator.mediaDevices.getSupportedConstraints() as Record<string, boolean>;
    // As the camera has it: an image that is scaled is another camera's.
    const asked: MediaTrackConstraints & {resizeMode?: unknown} = {...largest};
    if (known['resizeMode']) asked.resizeMode = {exact: 'none'};
    const stream = await navigator.mediaDevices.getUserMedia({video: asked, audio: false}), [track] = stream.getVideoTracks();
    if (!track) throw new Error('there is no camera');
    const camera = new Camera(stream, video, track);
    track.addEventListener('ended', () => !camera.isStopped && gone());
    video.srcObject = stream;
    await video.play().catch(() => undefined);
    void camera.hold();
    if (typeof MediaStreamTrackProcessor !== 'undefined') {
      camera.isExact = true;
      camera.reader = new MediaStreamTrackProcessor({track}).readable.getReader();
      void camera.read();
    }
    return camera;
  }

  /** Focus and exposure as they are now, where the device allows. */
  private async hold(): Promise<void> {
    await new Promise((settled) => setTimeout(settled, 1500));
    const can = (this.track.getCapabilities?.() ?? {}) as Record<string, unknown>, now = this.track.getSettings() as Record<string, unknown>;
    for (const [mode, value] of [['focusMode', 'focusDistance'], ['exposureMode', 'exposureTime']] as const) {
      if (!Array.isArray(can[mode]) || !(can[mode] as string[]).includes('manual')) continue;
      const held: Record<string, unknown> = {[mode]: 'manual'};
      if (typeof now[value] === 'number') held[value] = now[value];
      await this.track.applyConstraints({advanced: [held as MediaTrackConstraintSet]}).catch(() => undefined);
    }
  }

  private async read(): Promise<void> {
    while (this.reader) {
      const {value, done} = await this.reader.read().catch(() => ({value: undefined, done: true}));
      if (done || !value) return; // as its track has ended
      if (this.isStopped) { // on its way: the browser complains of those that nobody closes
        value.close();
        continue;
      }
      this.newest?.close(); // nothing is queued
      this.newest = value;
      this.waiting?.();
      this.waiting = null;
    }
  }

  /** The next image; null where there is none any more. */
  async next(): Promise<GreyImage | null> {
    if (!this.reader) return this.drawn(this.video, this.video.videoWidth, this.video.videoHeight);
    if (!this.newest) await new Promise<void>((came) => {
      this.waiting = came;
      setTimeout(came, 1000);
    });
    const frame = this.newest;
    this.newest = null;
    if (!frame) return null;
    try {
      return (await this.luma(frame)) ?? this.drawn(frame, frame.displayWidth, frame.displayHeight);
    } finally {
      frame.close();
    }
  }

  /** The Y plane, bit for bit; null where the frame has none. */
  private async luma(frame: VideoFrame): Promise<GreyImage | null> {
    const rect = frame.visibleRect;
    if (!rect || !/^(I420|I422|I444|NV12|NV21)/.test(frame.format ?? '') || /P1[02]$/.test(frame.format ?? '')) return null;
    const bytes = new Uint8Array(frame.allocationSize()), [plane] = await frame.copyTo(bytes);
    if (!plane) return null;
    const grey = new Uint8Array(rect.width * rect.height);
    for (let row = 0; row < rect.height; ++row) {
      const at = plane.offset + row * plane.stride;
      grey.set(bytes.subarray(at, at + rect.width), row * rect.width);
    }
    this.isExact = true;
    return {width: rect.width, height: rect.height, isExact: true, grey};
  }

  /** As a canvas draws it: its colours have been converted, and are off by some grey values. */
  private drawn(source: CanvasImageSource, width: number, height: number): GreyImage | null {
    this.isExact = false;
    if (!(width > 0 && height > 0)) return null;
    this.canvas.width = width;
    this.canvas.height = height;
    const context = this.canvas.getContext('2d', {willReadFrequently: true})!;
    context.drawImage(source, 0, 0);
    const rgba = context.getImageData(0, 0, width, height).data, grey = new Uint8Array(width * height);
    for (let i = 0; i < grey.length; ++i) grey[i] = Math.round(0.299 * rgba[4 * i]! + 0.587 * rgba[4 * i + 1]! + 0.114 * rgba[4 * i + 2]!);
    return {width, height, isExact: false, grey};
  }

  stop(): void {
    this.isStopped = true;
    this.newest?.close();
    this.newest = null;
    for (const track of this.stream.getTracks()) track.stop();
  }
}
