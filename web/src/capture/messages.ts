// What the run says of the capture, and what it is sent.
import type {GreyImage} from './camera';

export interface Look {
  op: 'look';
  sight: string;
  words: string;
  words_mirrored: string;
  corners: number[]; // u, v in turn
  width: number;
  height: number;
  exact: boolean;
  ms: number;
}
export interface State {
  op: 'state';
  photos: number;
  last: string;
  paused: boolean;
  has_camera: boolean;
  until: number;
  worst: number | null; // 3σ at the worst pixel, px
  worst_px: number[];
  needed: number | null;
  warnings: string[];
  width: number;
  height: number;
  next: {outline: number[]; words: string; words_mirrored: string} | null;
  sigma: {cols: number; rows: number; three_sigma: (number | null)[]} | null;
  sentence?: string; // of shots: the verdict on them
  history?: (number | null)[]; // of shots: 3σ of the origin after each, mm
}
export type Message = Look | State | {op: 'control'; yes: boolean} | {op: 'took'; file: string} | {op: 'note'; words: string} | {op: 'goal'; holds: boolean} | {op: 'ended'; exit_code: number; report: boolean};

const magic = 0x31594441; // 'ADY1'

export function packed(image: GreyImage): ArrayBuffer {
  const message = new Uint8Array(16 + image.grey.length), head = new DataView(message.buffer);
  [magic, image.width, image.height, image.isExact ? 1 : 0].forEach((value, i) => head.setUint32(4 * i, value, true));
  message.set(image.grey, 16);
  return message.buffer;
}

export interface Line {
  ask(op: string, value?: number): void;
  send(image: GreyImage): void;
  close(): void;
}
export function connect(received: (message: Message) => void, shown: (jpeg: Blob) => void, lost: () => void): Line {
  const socket = new WebSocket(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/capture${location.search}`);
  let isOver = false;
  socket.binaryType = 'blob';
  socket.onmessage = (event: MessageEvent<string | Blob>) => {
    if (isOver) return;
    if (typeof event.data === 'string') received(JSON.parse(event.data) as Message);
    else shown(event.data);
  };
  socket.onclose = () => {
    if (!isOver) lost();
    isOver = true;
  };
  return {
    ask: (op, value) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(value === undefined ? {op} : {op, value})),
    send: (image) => socket.readyState === WebSocket.OPEN && socket.send(packed(image)),
    close: () => {
      isOver = true;
      socket.close();
    },
  };
}
